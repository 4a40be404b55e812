/* A learner that learns from its own falls, on a simulated cart-pole.
 *
 * For a real one, replace what begins with cart_: bring the cart to a start, push it, wait for the
 * end of the control period, measure, and tell whether it has fallen. The rest stays. */
#include "board.h"
#include "cart.h"
#include "learner.h"

enum { ENOUGH = 3000, MOST_TRIALS = 100 };

static upright_learner learner;
static cart_pole cart;

static void print_number(uint32_t number) {
  char digits[11], *first = digits + sizeof digits - 1;
  *first = '\0';
  do {
    *--first = (char)('0' + number % 10);
    number /= 10;
  } while (number > 0);
  board_print(first);
}

/* Balance once, from a start to a fall or to a success; return how many steps it lasted. */
static uint32_t trial(int *fallen) {
  const double *seen = cart_observation(&cart); /* m, m/s, rad, rad/s */
  uint32_t steps = 0;
  *fallen = 0;
  cart_reset(&cart);
  upright_begin_trial(&learner);
  while (steps < ENOUGH && !*fallen) {
    int right = upright_act(&learner, seen[0], seen[1], seen[2], seen[3]);
    *fallen = cart_push(&cart, right);
    upright_learn(&learner, seen[0], seen[1], seen[2], seen[3], *fallen);
    ++steps;
  }
  upright_end_trial(&learner, *fallen);
  return steps;
}

int main(void) {
  int fallen = 1;
  upright_begin(&learner);
  upright_seed(&learner, 0, 0);
  cart_begin(&cart);
  cart_seed(&cart, 0, 1);
  for (uint32_t number = 1; number <= MOST_TRIALS && fallen; ++number) {
    uint32_t steps = trial(&fallen);
    board_print("trial ");
    print_number(number);
    board_print(": ");
    print_number(steps);
    board_print(fallen ? " steps\n" : " steps, balanced\n");
  }
  return fallen;
}
