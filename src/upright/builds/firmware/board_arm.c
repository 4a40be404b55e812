/* A board of Arm's as QEMU emulates it: it starts, prints by semihosting, and ends.
 *
 * A real board has its maker's start-up code and a serial port instead. */
#include <stdint.h>

#include "board.h"

int main(void);
void reset(void);

#define TOP_OF_STACK 0x20380000u
#define COPROCESSORS (*(volatile uint32_t *)0xE000ED88u)

static int ask_host(int what, const void *how) {
  register int r0 __asm__("r0") = what;
  register const void *r1 __asm__("r1") = how;
  __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
  return r0;
}

void board_print(const char *text) { ask_host(0x04, text); }

void reset(void) {
#ifdef __ARM_FP
  COPROCESSORS |= 0xFu << 20; /* turn the floating-point unit on */
  __asm__ volatile("dsb\n\tisb");
#endif
  const uint32_t status[2] = {0x20026, (uint32_t)main()};
  ask_host(0x20, status);
  for (;;) {
  }
}

__attribute__((section(".vectors"), used)) static void (*const vectors[4])(void) = {
    (void (*)(void))TOP_OF_STACK, reset, reset, reset};
