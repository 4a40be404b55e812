/* The cart-pole and Q-learning's table in C99: the one place with their equations in C.
 *
 * For the benchmarks' reference.c and for the MEX function beside this file. Each function does the
 * arithmetic of its twin in the Python package, in the same order: compiled without contraction
 * (-ffp-contract=off) both give the same bits. SI units and radians throughout.
 */

#ifndef UPRIGHT_CARTPOLE_H
#define UPRIGHT_CARTPOLE_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

/* ---- Elementary functions: upright/core/portable_math.py ------------------------------------- */

/* sin and 1 - cos of an angle up to SMALL. */
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

/* sin and cos of any angle. The whole turns are rounded by rint: adding and subtracting a large
 * number, as there, is lost with -ffast-math. */
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

/* cos of 0 to 1 turns. */
static inline double cosine_of_turns(double turns)
{
    double sine, one_less_cosine;
    small_sine_cosine((2.0 * SMALL) * (turns - 0.5), &sine, &one_less_cosine);
    for (int i = 0; i < 3; i++)
        one_less_cosine *= 2.0 * (2.0 - one_less_cosine);
    return one_less_cosine - 1.0;
}

/* Natural logarithm of a positive normal number x = m 2^exponent, m from sqrt(1/2) to sqrt(2). */
static inline double logarithm(double x)
{
    const double root_half = 0.7071067811865476, log_2 = 0.6931471805599453;
    int exponent;
    double m = frexp(x, &exponent);
    if (m < root_half) {
        m *= 2.0;
        exponent--;
    }
    double s = (m - 1.0) / (m + 1.0);
    double z = s * s;
    double z2 = z * z;
    double z4 = z2 * z2;
    double series = (1.0 / 3 + z * (1.0 / 5)) + z2 * (1.0 / 7 + z * (1.0 / 9));
    series += z4
        * ((1.0 / 11 + z * (1.0 / 13)) + z2 * (1.0 / 15 + z * (1.0 / 17)) + z4 * (1.0 / 19));
    return exponent * log_2 + 2.0 * s * (1.0 + z * series);
}

/* ---- The plant: upright/core/cartpole.py ----------------------------------------------------- */

typedef struct {
    double gravity, cart_mass, pole_mass, half_length, cart_friction, pole_friction;
    double force, time_step, position_limit, angle_limit;
} Parameters;

typedef struct {
    double x, x_dot, theta, theta_dot;
} State;

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

static inline double push(const Parameters *p, bool right)
{
    double force = p->force;
    if (!right)
        force = -force;
    return force;
}

/* ---- Q-learning: upright/agents/q_learning.py, boxes.py -------------------------------------- */

enum { FALL = -1 }; /* stands for the box that a fall leads to */

/* What the agent carries from step to step and from trial to trial, its boxes included. */
typedef struct {
    double *table;
    int64_t table_length;
    const double *edges[4]; /* of the boxes, along x, x_dot, theta, theta_dot */
    int64_t edge_counts[4];
    int64_t *move_entries, *move_boxes; /* a ring of the last moves */
    int64_t replay_size, moves; /* room in the ring; how many there have been */
    bool mirrored; /* whether a box and its mirror image share their values */
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

/* The place of a box and a push in the table, mirrored the same for their mirror image. */
static inline int64_t entry(const QMemory *m, int64_t box, bool action)
{
    int64_t place = 2 * box + action, mirrored = m->table_length - 1 - place;
    return m->mirrored && mirrored < place ? mirrored : place;
}

static inline bool right_is_better(const QMemory *m, int64_t box)
{
    return m->table[entry(m, box, true)] > m->table[entry(m, box, false)];
}

/* Keep a move from one box to another, or to the fall, in place of the oldest. */
static inline void keep_move(QMemory *m, int64_t box, bool action, int64_t next_box)
{
    int64_t row = m->moves % m->replay_size;
    m->move_entries[row] = entry(m, box, action);
    m->move_boxes[row] = next_box;
    m->moves++;
}

#endif
