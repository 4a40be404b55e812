/* The noise cases in C99, as upright/noise.py: the same random numbers, drawn in the same order.
 *
 * C leaves open in which order the parts of an expression are computed, so no expression draws
 * twice.
 */

#ifndef UPRIGHT_NOISE_H
#define UPRIGHT_NOISE_H

#include "cartpole.h"
#include "twister.h"

/* Sizes of the disturbances; zero means none, and draws no random number. */
typedef struct {
    double actuator, angle, others, angle_offset;
} Noise;

static inline double draw_within(double half_width, Twister *twister)
{
    return half_width * (2.0 * draw(twister) - 1.0);
}

/* A standard normal number (Box & Muller, Ann. Math. Statist. 29, 1958). */
static inline double draw_normal(Twister *twister)
{
    double radius = sqrt(-2.0 * logarithm(1.0 - draw(twister)));
    return radius * cosine_of_turns(draw(twister));
}

/* The force that acts when `force` was asked for. */
static inline double disturb(const Noise *noise, double force, Twister *twister)
{
    if (noise->actuator > 0.0)
        force *= 1.0 + draw_within(noise->actuator, twister);
    return force;
}

/* What the agent sees of the true state. */
static inline State measure(const Noise *noise, State state, Twister *twister)
{
    if (noise->angle > 0.0)
        state.theta *= 1.0 + draw_within(noise->angle, twister);
    if (noise->others > 0.0) {
        state.x *= 1.0 + draw_within(noise->others, twister);
        state.x_dot *= 1.0 + draw_within(noise->others, twister);
        state.theta_dot *= 1.0 + draw_within(noise->others, twister);
    }
    if (noise->angle_offset > 0.0)
        state.theta += noise->angle_offset * draw_normal(twister);
    return state;
}

/* A start state, each component uniform in +- its half-width. */
static inline State draw_start(State half_widths, Twister *twister)
{
    State state;
    state.x = draw_within(half_widths.x, twister);
    state.x_dot = draw_within(half_widths.x_dot, twister);
    state.theta = draw_within(half_widths.theta, twister);
    state.theta_dot = draw_within(half_widths.theta_dot, twister);
    return state;
}

#endif
