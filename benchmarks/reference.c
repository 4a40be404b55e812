/* The benchmarks' measure: what upright computes, written in plain C.
 *
 * Each function does the arithmetic of its twin in the package, in the same order, so that both end
 * in the same state; speed.py holds them to that before it times anything. Compiled without
 * contraction (-ffp-contract=off) they agree bit for bit. SI units and radians throughout.
 */

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

/* ---- The plant: upright/cartpole.py ---------------------------------------------------------- */

typedef struct {
    double gravity, cart_mass, pole_mass, half_length, cart_friction, pole_friction;
    double force, time_step, position_limit, angle_limit;
} Parameters;

typedef struct {
    double x, x_dot, theta, theta_dot;
} State;

/* sin and 1 - cos of an angle up to SMALL, as `small_sine_cosine` of upright/elementary.py. */
#define SMALL (3.141592653589793 / 8)

static inline void small_sine_cosine(double angle, double *sine, double *one_less_cosine)
{
    double z = angle * angle;
    double z2 = z * z;
    double z4 = z2 * z2;
    double series = (-1.0 / 6 + z * (1.0 / 120)) + z2 * (-1.0 / 5040 + z * (1.0 / 362880))
        + z4 * (-1.0 / 39916800 + z * (1.0 / 6227020800));
    *sine = angle + angle * z * series;
    *one_less_cosine = z * ((1.0 / 2 + z * (-1.0 / 24)) + z2 * (1.0 / 720 + z * (-1.0 / 40320))
        + z4 * (1.0 / 3628800 + z * (-1.0 / 479001600)));
}

/* sin and cos of any angle, as `sine_cosine` has them. The whole turns are rounded by rint: adding
 * and subtracting a large number, as there, is lost with -ffast-math. */
static inline void sine_cosine(double angle, double *sine, double *cosine)
{
    const double turn = 6.283185307179586, turn_rest = 2.4492935982947064e-16;
    double s = angle, y;
    bool small = fabs(angle) <= SMALL;
    if (!small) {
        double turns = rint(angle * (1 / turn));
        s = 0.125 * ((angle - turns * turn) - turns * turn_rest);
    }
    small_sine_cosine(s, &s, &y);
    if (!small) {
        for (int i = 0; i < 3; i++) {
            double doubled = 2.0 * s * (1.0 - y);
            y = 2.0 * s * s;
            s = doubled;
        }
    }
    *sine = s;
    *cosine = 1.0 - y;
}

/* One step of explicit Euler, the sine and cosine of the angle being known. */
static inline State euler(const Parameters *p, State s, double force, double sine, double cosine)
{
    double mass_inverse = 1.0 / (p->cart_mass + p->pole_mass);
    double moment = p->pole_mass * p->half_length;
    double sign_x_dot = (s.x_dot > 0.0) - (s.x_dot < 0.0);
    double drive = (force + moment * s.theta_dot * s.theta_dot * sine
        - p->cart_friction * sign_x_dot) * mass_inverse;
    double theta_acceleration = (p->gravity * sine - cosine * drive
        - (p->pole_friction / moment) * s.theta_dot)
        / (p->half_length * (4.0 / 3.0 - (p->pole_mass * mass_inverse) * (cosine * cosine)));
    double x_acceleration = drive - (moment * mass_inverse) * (theta_acceleration * cosine);
    double h = p->time_step;
    return (State){
        s.x + h * s.x_dot,
        s.x_dot + h * x_acceleration,
        s.theta + h * s.theta_dot,
        s.theta_dot + h * theta_acceleration,
    };
}

static inline State step(const Parameters *p, State s, double force)
{
    double sine, cosine;
    sine_cosine(s.theta, &sine, &cosine);
    return euler(p, s, force, sine, cosine);
}

static inline bool has_fallen(const Parameters *p, State s)
{
    return !(fabs(s.x) <= p->position_limit && fabs(s.theta) <= p->angle_limit);
}

static inline bool pushes_right(const double w[4], State s)
{
    return w[0] * s.x + w[1] * s.x_dot + (w[2] * s.theta + w[3] * s.theta_dot) > 0.0;
}

static inline double push(const Parameters *p, bool right)
{
    double force = p->force;
    if (!right)
        force = -force;
    return force;
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

/* ---- A trial of each agent: upright/trials.py ------------------------------------------------ */

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

/* The memory of upright/agents/q_learning.py, its boxes included. */
typedef struct {
    const double *table;
    int64_t table_length;
    const double *edges[4]; /* of the boxes, along x, x_dot, theta, theta_dot */
    int64_t edge_counts[4];
    int64_t *move_entries, *move_boxes; /* a ring of the last moves */
    int64_t kept_moves, moves;
} QMemory;

static inline int64_t count_below(const double *edges, int64_t length, double value)
{
    int64_t count = 0;
    for (int64_t i = 0; i < length; i++)
        count += value > edges[i];
    return count;
}

static inline int64_t find_box(const QMemory *m, State s)
{
    int64_t box = count_below(m->edges[0], m->edge_counts[0], s.x);
    box = box * (m->edge_counts[1] + 1) + count_below(m->edges[1], m->edge_counts[1], s.x_dot);
    box = box * (m->edge_counts[2] + 1) + count_below(m->edges[2], m->edge_counts[2], s.theta);
    return box * (m->edge_counts[3] + 1)
        + count_below(m->edges[3], m->edge_counts[3], s.theta_dot);
}

/* The place of a box and a push in the table, the same for their mirror image. */
static inline int64_t entry(const QMemory *m, int64_t box, bool action)
{
    int64_t place = 2 * box + action, mirrored = m->table_length - 1 - place;
    return place < mirrored ? place : mirrored;
}

int64_t trial_q(const Parameters *p, QMemory *memory, State *state, int64_t steps)
{
    QMemory m = *memory;
    State s = *state;
    bool fallen = false;
    int64_t count = 0;
    int64_t box = find_box(&m, s);
    while (count < steps && !fallen) {
        bool action = m.table[entry(&m, box, true)] > m.table[entry(&m, box, false)];
        s = step(p, s, push(p, action));
        fallen = has_fallen(p, s);
        int64_t next_box = fallen ? -1 : find_box(&m, s);
        if (next_box != box) {
            int64_t row = m.moves % m.kept_moves;
            m.move_entries[row] = entry(&m, box, action);
            m.move_boxes[row] = next_box;
            m.moves++;
        }
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
    double gain;
    double *inputs; /* of each kept step, four; a ring, as the next two */
    bool *actions;
    double *probabilities; /* of the push that was made */
    int64_t kept_steps, length;
} ReinforceMemory;

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
        double right = 1.0 / (1.0 + exp(-(m.gain * evaluate(m.weights, inputs))));
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

/* ---- The vector environment: upright/lanes.py, without noise --------------------------------- */

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
