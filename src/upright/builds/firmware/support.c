/* What compiled code calls without saying so: copying and filling memory, and the square root. */
#include <stddef.h>
#include <stdint.h>

void *memcpy(void *to, const void *from, size_t count) {
  unsigned char *out = to;
  const unsigned char *in = from;
  while (count-- > 0) *out++ = *in++;
  return to;
}

void *memset(void *to, int value, size_t count) {
  unsigned char *out = to;
  while (count-- > 0) *out++ = (unsigned char)value;
  return to;
}

#ifdef __ARM_EABI__
/* Arm's own names for these. */
void __aeabi_memcpy(void *to, const void *from, size_t count) { memcpy(to, from, count); }
void __aeabi_memcpy4(void *to, const void *from, size_t count) { memcpy(to, from, count); }
void __aeabi_memcpy8(void *to, const void *from, size_t count) { memcpy(to, from, count); }
void __aeabi_memclr(void *to, size_t count) { memset(to, 0, count); }
void __aeabi_memclr4(void *to, size_t count) { memset(to, 0, count); }
void __aeabi_memclr8(void *to, size_t count) { memset(to, 0, count); }
#endif

#ifdef UPRIGHT_NO_DOUBLE_UNIT
/* The square root, correctly rounded as a unit for doubles does it: digit by digit, in whole
 * numbers. */
double sqrt(double x) {
  union {
    double number;
    uint64_t bits;
  } value = {x};
  const uint64_t one = (uint64_t)1 << 52;
  if (x == 0.0 || value.bits == (uint64_t)0x7FF << 52) return x;
  if (!(x > 0.0)) return (x - x) / (x - x);
  int exponent = (int)(value.bits >> 52);
  uint64_t mantissa = value.bits & (one - 1);
  if (exponent > 0) mantissa |= one;
  if (exponent == 0) exponent = 1;
  while (mantissa < one) {
    mantissa <<= 1;
    --exponent;
  }
  exponent -= 1023;
  if (exponent & 1) mantissa <<= 1;
  exponent = (exponent - (exponent & 1)) / 2;

  /* The root of mantissa * 2^54: 54 digits, the last of which rounds. */
  uint64_t root = 0, rest = 0;
  for (int digit = 53; digit >= 0; --digit) {
    int shift = 2 * digit - 54;
    uint64_t pair = shift >= 0 ? mantissa >> shift & 3 : 0;
    rest = rest << 2 | pair;
    root <<= 1;
    if (rest >= 2 * root + 1) {
      rest -= 2 * root + 1;
      root |= 1;
    }
  }
  root = (root >> 1) + (root & 1);
  value.bits = ((uint64_t)(exponent + 1023) << 52) + (root - one);
  return value.number;
}

float sqrtf(float x) { return (float)sqrt(x); }
#endif
