/* The Mersenne Twister MT19937: uniform random numbers, as NumPy, MATLAB and Octave draw them.
 *
 * M. Matsumoto, T. Nishimura, Mersenne Twister: a 623-dimensionally equidistributed uniform
 * pseudo-random number generator, ACM Trans. Model. Comput. Simul. 8(1), 1998; seeded as the
 * authors' init_genrand of 2002. draw() gives what numpy.random.RandomState(number).random() and,
 * for numbers from 1, MATLAB's rand after rng(number) give, to the last bit.
 */

#ifndef UPRIGHT_TWISTER_H
#define UPRIGHT_TWISTER_H

#include <stdint.h>

enum { TWISTER_WORDS = 624, TWISTER_SHIFT = 397 };

typedef struct {
    uint32_t words[TWISTER_WORDS];
    int used; /* how many of the words have been drawn */
} Twister;

static void seed_twister(Twister *t, uint32_t number)
{
    t->words[0] = number;
    for (uint32_t i = 1; i < TWISTER_WORDS; i++) {
        uint32_t previous = t->words[i - 1];
        t->words[i] = 1812433253u * (previous ^ (previous >> 30)) + i;
    }
    t->used = TWISTER_WORDS;
}

/* A word from the one `far` ahead of it, and from its own first bit with the rest of the next. */
static inline uint32_t twisted(uint32_t own, uint32_t next, uint32_t far)
{
    uint32_t joined = (own & 0x80000000u) | (next & 0x7fffffffu);
    return far ^ (joined >> 1) ^ (-(joined & 1u) & 0x9908b0dfu);
}

/* Replace all words by the next ones. In three parts, as it goes round at the end. */
static void twist(Twister *t)
{
    uint32_t *w = t->words;
    int i = 0;
    for (; i < TWISTER_WORDS - TWISTER_SHIFT; i++)
        w[i] = twisted(w[i], w[i + 1], w[i + TWISTER_SHIFT]);
    for (; i < TWISTER_WORDS - 1; i++)
        w[i] = twisted(w[i], w[i + 1], w[i + TWISTER_SHIFT - TWISTER_WORDS]);
    w[i] = twisted(w[i], w[0], w[TWISTER_SHIFT - 1]);
    t->used = 0;
}

static inline uint32_t draw_word(Twister *t)
{
    if (t->used == TWISTER_WORDS)
        twist(t);
    uint32_t y = t->words[t->used++];
    y ^= y >> 11;
    y ^= (y << 7) & 0x9d2c5680u;
    y ^= (y << 15) & 0xefc60000u;
    return y ^ (y >> 18);
}

/* A number from 0 to 1, of 53 random bits: 27 of one word above 26 of the next. */
static inline double draw(Twister *t)
{
    uint32_t high = draw_word(t) >> 5;
    uint32_t low = draw_word(t) >> 6;
    return (high * 67108864.0 + low) * (1.0 / 9007199254740992.0);
}

#endif
