/* Runs of a learner on its plant under several noises: what it learns, as a sum over each array.
 * RUNS, ARRAYS and NUMBERS come from the test. */
#include <stdint.h>

#include "board.h"
#include "proof.h"

void begin(void *memory);
void seed(void *memory, uint32_t seed, uint32_t run);
uint32_t advance(void *memory, uint32_t count);

static uint64_t memory[SIZE / 8];

static void print_hex(uint64_t number) {
  char digits[18] = "0000000000000000\n";
  for (int i = 15; i >= 0; --i, number >>= 4) digits[i] = "0123456789abcdef"[number & 15];
  board_print(digits);
}

/* Fowler, Noll and Vo's sum of bytes (FNV-1a, 64 bits). */
static uint64_t sum_of(const unsigned char *bytes, uint32_t count) {
  uint64_t sum = 14695981039346656037u;
  while (count-- > 0) sum = (sum ^ *bytes++) * 1099511628211u;
  return sum;
}

int main(void) {
  unsigned char *bytes = (unsigned char *)memory;
  for (uint32_t run = 0; run < RUNS; ++run) {
    begin(memory);
    for (uint32_t i = 0; i < NUMBERS; ++i) {
      const unsigned char *value = (const unsigned char *)&values[run][i];
      for (uint32_t k = 0; k < sizes[i]; ++k) bytes[offsets[i] + k] = value[k];
    }
    seed(memory, SEED, RUN);
    while (advance(memory, 100000) > 0) {
    }
    for (uint32_t i = 0; i < ARRAYS; ++i) print_hex(sum_of(bytes + arrays[i][0], arrays[i][1]));
  }
  return 0;
}
