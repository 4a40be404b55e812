/* The benchmarks' measure: what upright computes, written in plain C.
 *
 * Each function does the arithmetic of its twin in the package, in the same order, so that both end
 * in the same state; speed.py holds them to that before it times anything. Compiled without
 * contraction (-ffp-contract=off) they agree bit for bit. SI units and radians throughout.
 */

#include <string.h>

#include "../matlab/mex/cartpole.h"

/* ---- The plant alone ------------------------------------------------------------------------- */

static inline bool pushes_right(const double w[4], State s)
{
    return w[0] * s.x + w[1] * s.x_dot + (w[2] * s.theta + w[3] * s.theta_dot) > 0.0;
}

/* Push one cart-pole by a linear rule; nothing else. */
void plant(const Parameters *p, const double w[4], State *state, int64_t steps)
{
    State s = *state;
    for (int64_t i = 0; i < steps; i++)
        s = step(p, s, push(p, pushes_right(w, s)));
    *state = s;
}

/* Advance n independent cart-poles by one step; the states as four rows of n numbers. */
void many(const Parameters *p, double *restrict states, const double *restrict forces, int64_t n)
{
    double *x = states, *x_dot = states + n, *theta = states + 2 * n, *theta_dot = states + 3 * n;
    enum { PART = 512 };
    for (int64_t first = 0; first < n; first += PART) {
        int64_t end = first + PART < n ? first + PART : n, others = 0;
        for (int64_t i = first; i < end; i++)
            others += fabs(theta[i]) > SMALL;
        if (others == 0) {
#pragma GCC ivdep /* the four rows do not overlap */
            for (int64_t i = first; i < end; i++) {
                State s = {x[i], x_dot[i], theta[i], theta_dot[i]};
                double sine, one_less_cosine;
                small_sine_cosine(s.theta, &sine, &one_less_cosine);
                s = euler(p, s, forces[i], sine, 1.0 - one_less_cosine);
                x[i] = s.x, x_dot[i] = s.x_dot, theta[i] = s.theta, theta_dot[i] = s.theta_dot;
            }
        } else {
#pragma GCC ivdep
            for (int64_t i = first; i < end; i++) {
                State s = step(p, (State){x[i], x_dot[i], theta[i], theta_dot[i]}, forces[i]);
                x[i] = s.x, x_dot[i] = s.x_dot, theta[i] = s.theta, theta_dot[i] = s.theta_dot;
            }
        }
    }
}

/* The same with the C library's sine and cosine, as one would write it first. */
void many_libm(const Parameters *p, double *restrict states, const double *restrict forces,
               int64_t n)
{
    double *x = states, *x_dot = states + n, *theta = states + 2 * n, *theta_dot = states + 3 * n;
#pragma GCC ivdep
    for (int64_t i = 0; i < n; i++) {
        State s = {x[i], x_dot[i], theta[i], theta_dot[i]};
        s = euler(p, s, forces[i], sin(s.theta), cos(s.theta));
        x[i] = s.x, x_dot[i] = s.x_dot, theta[i] = s.theta, theta_dot[i] = s.theta_dot;
    }
}

/* ---- A trial of each agent: upright/core/trials.py ------------------------------------------- */

/* The policy of upright/agents/random_search.py: returns how many steps it lasted. */
int64_t trial_linear(const Parameters *p, const double w[4], State *state, int64_t steps)
{
    State s = *state;
    bool fallen = false;
    int64_t count = 0;
    while (count < steps && !fallen) {
        s = step(p, s, push(p, pushes_right(w, s)));
        fallen = has_fallen(p, s);
        count++;
    }
    *state = s;
    return count;
}

/* The agent of upright/agents/q_learning.py, that learns when it has fallen. */
int64_t trial_q(const Parameters *p, QMemory *memory, State *state, int64_t steps)
{
    QMemory m = *memory;
    State s = *state;
    bool fallen = false;
    int64_t count = 0;
    int64_t box = find_box(&m, s);
    while (count < steps && !fallen) {
        bool action = right_is_better(&m, box);
        s = step(p, s, push(p, action));
        fallen = has_fallen(p, s);
        int64_t next_box = fallen ? FALL : find_box(&m, s);
        if (next_box != box)
            keep_move(&m, box, action, next_box);
        box = next_box;
        count++;
    }
    *memory = m;
    *state = s;
    return count;
}

/* NumPy's default generator: PCG64 (M. O'Neill, 2014), 128 bits of state, XSL-RR output. */
typedef struct {
    unsigned __int128 state, increment;
} Random;

static inline double uniform(Random *random)
{
    const unsigned __int128 multiplier =
        ((unsigned __int128)2549297995355413924ULL << 64) + 4865540595714422341ULL;
    random->state = random->state * multiplier + random->increment;
    uint64_t folded = (uint64_t)(random->state >> 64) ^ (uint64_t)random->state;
    unsigned turn = (unsigned)(random->state >> 122);
    uint64_t bits = (folded >> turn) | (folded << (-turn & 63));
    return (double)(bits >> 11) * (1.0 / 9007199254740992.0);
}

/* The memory of upright/agents/reinforce.py, as far as a trial needs it. */
enum { HIDDEN_1 = 8, HIDDEN_2 = 16 };

typedef struct {
    const double *weights; /* of the three layers, one after the other */
    const double *scales;
    double logit_scale;
    double *inputs; /* of each kept step, four; a ring, as the next two */
    bool *actions;
    double *probabilities; /* of the push that was made */
    int64_t kept_steps, length;
} ReinforceMemory;

#ifdef __FAST_MATH__
#define exponential exp /* as it would take away the rounding below */
#else
/* e^x, as in upright/core/portable_math.py. */
static inline double exponential(double x)
{
    static const double log_2_high = 0.6931471803691238, log_2_low = 1.9082149292705877e-10;
    static const double round = 1.5 * 4503599627370496.0;
    static const double e[14] = {1.0,
                                 1.0,
                                 1.0 / 2.0,
                                 1.0 / 6.0,
                                 1.0 / 24.0,
                                 1.0 / 120.0,
                                 1.0 / 720.0,
                                 1.0 / 5040.0,
                                 1.0 / 40320.0,
                                 1.0 / 362880.0,
                                 1.0 / 3628800.0,
                                 1.0 / 39916800.0,
                                 1.0 / 479001600.0,
                                 1.0 / 6227020800.0};
    x = x > 700.0 ? 700.0 : x;
    x = x < -700.0 ? -700.0 : x;
    double shifted = x * (1.0 / 0.6931471805599453) + round, n = shifted - round;
    double r = (x - n * log_2_high) - n * log_2_low, z = r * r, z2 = z * z;
    double series = (e[2] + r * e[3]) + z * (e[4] + r * e[5]) +
                    z2 * ((e[6] + r * e[7]) + z * (e[8] + r * e[9]));
    series += z2 * z2 * ((e[10] + r * e[11]) + z * (e[12] + r * e[13]));
    double mantissa = 1.0 + (r + z * series);
    uint64_t doublings, bits;
    memcpy(&doublings, &shifted, sizeof doublings);
    memcpy(&bits, &mantissa, sizeof bits);
    bits += doublings << 52;
    memcpy(&mantissa, &bits, sizeof mantissa);
    return mantissa;
}
#endif

static inline double activation(double z)
{
    return z > 0.0 ? z : z / sqrt(1.0 + z * z);
}

static inline void evaluate_layer(const double *restrict inputs, const double *restrict weights,
                                  double *restrict outputs, int fan_in, int width)
{
    for (int k = 0; k < width; k++) {
        double total = 0.0;
        for (int j = 0; j < fan_in; j++)
            total += inputs[j] * weights[j * width + k];
        outputs[k] = total;
    }
    for (int k = 0; k < width; k++)
        outputs[k] = activation(outputs[k]);
}

static inline double evaluate(const double *weights, const double *inputs)
{
    double hidden_1[HIDDEN_1], hidden_2[HIDDEN_2], total = 0.0;
    const double *layer_2 = weights + 4 * HIDDEN_1, *layer_3 = layer_2 + HIDDEN_1 * HIDDEN_2;
    evaluate_layer(inputs, weights, hidden_1, 4, HIDDEN_1);
    evaluate_layer(hidden_1, layer_2, hidden_2, HIDDEN_1, HIDDEN_2);
    for (int k = 0; k < HIDDEN_2; k++)
        total += hidden_2[k] * layer_3[k];
    return total;
}

int64_t trial_reinforce(const Parameters *p, ReinforceMemory *memory, Random *random, State *state,
                        int64_t steps)
{
    ReinforceMemory m = *memory;
    Random r = *random;
    State s = *state;
    bool fallen = false;
    int64_t count = 0;
    while (count < steps && !fallen) {
        double inputs[4] = {s.x / m.scales[0], s.x_dot / m.scales[1], s.theta / m.scales[2],
                            s.theta_dot / m.scales[3]};
        double right = 1.0 / (1.0 + exponential(-(m.logit_scale * evaluate(m.weights, inputs))));
        bool action = uniform(&r) < right;
        s = step(p, s, push(p, action));
        fallen = has_fallen(p, s);
        int64_t row = m.length % m.kept_steps;
        m.length++;
        for (int i = 0; i < 4; i++)
            m.inputs[4 * row + i] = inputs[i];
        m.actions[row] = action;
        m.probabilities[row] = action ? right : 1.0 - right;
        count++;
    }
    *memory = m;
    *random = r;
    *state = s;
    return count;
}

/* ---- The vector environment: upright/environments/batch.py, without noise -------------------- */

/* NumPy's SFC64, of lane i of n: four rows of words. */
static inline double draw(uint64_t *words, int64_t n, int64_t i)
{
    uint64_t *a = words + i, *b = a + n, *c = b + n, *counter = c + n;
    uint64_t word = *a + *b + (*counter)++;
    *a = *b ^ (*b >> 11);
    *b = *c + (*c << 3);
    *c = ((*c << 24) | (*c >> 40)) + word;
    return (double)(word >> 11) * (1.0 / 9007199254740992.0);
}

typedef struct {
    double *states; /* four rows of n, as the observations */
    uint64_t *words;
    int64_t *steps;
    bool *ended;
    int64_t n, limit;
} Lanes;

/* One step of every lane; where an episode has ended, the next one begins instead. */
void vector_step(const Parameters *p, const Lanes *lanes, const int64_t *restrict actions,
                 float *restrict observations, double *restrict rewards,
                 bool *restrict terminations, bool *restrict truncations)
{
    int64_t n = lanes->n, limit = lanes->limit;
    double *x = lanes->states, *x_dot = x + n, *theta = x_dot + n, *theta_dot = theta + n;
    int64_t *steps = lanes->steps;
    bool *ended = lanes->ended;
#pragma GCC ivdep
    for (int64_t i = 0; i < n; i++) {
        State s = {x[i], x_dot[i], theta[i], theta_dot[i]};
        double sine, one_less_cosine; /* all angles are small: a fallen pole soon stands again */
        small_sine_cosine(s.theta, &sine, &one_less_cosine);
        s = euler(p, s, push(p, actions[i] == 1), sine, 1.0 - one_less_cosine);
        x[i] = s.x, x_dot[i] = s.x_dot, theta[i] = s.theta, theta_dot[i] = s.theta_dot;
    }
#pragma GCC ivdep
    for (int64_t i = 0; i < n; i++) {
        bool fallen = !(fabs(x[i]) <= p->position_limit && fabs(theta[i]) <= p->angle_limit);
        steps[i]++;
        rewards[i] = ended[i] ? 0.0 : 1.0;
        terminations[i] = fallen & !ended[i];
        truncations[i] = (steps[i] >= limit) & !ended[i];
    }
#pragma GCC ivdep
    for (int64_t i = 0; i < 4 * n; i++)
        observations[i] = (float)lanes->states[i];
    for (int64_t i = 0; i < n; i++) {
        if (ended[i]) {
            for (int row = 0; row < 4; row++) {
                double value = 0.05 * (2.0 * draw(lanes->words, n, i) - 1.0);
                lanes->states[row * n + i] = value;
                observations[row * n + i] = (float)value;
            }
            steps[i] = 0;
        }
        ended[i] = terminations[i] | truncations[i];
    }
}
