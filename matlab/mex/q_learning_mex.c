/* A whole run of tabular Q-learning, compiled: what upright.q_learning does, some thousand times as
 * fast, to the last bit.
 *
 *   [lengths, balanced, table] =
 *       q_learning_mex(parameters, noise, start, settings, number, steps, trials)
 *
 *     parameters   from upright.parameters
 *     noise        from upright.noise_case
 *     start        1-by-4, half-widths of the uniform start [m, m/s, rad, rad/s]
 *     settings     from upright.settings('q-learning')
 *     number       of the stream of random numbers, 0 to 2^32 - 1; see twister.h
 *     steps        N: a trial that lasts this many steps without a fall succeeds
 *     trials       a run is at most this many trials
 *
 *     lengths      1-by-k, how many steps each trial lasted
 *     balanced     whether the last one succeeded
 *     table        1-by-2*boxes, what was learned: push left and push right of each box in turn
 *
 * The rule is explained in upright/agents/q_learning.py, and in q_learning.m. Built by
 * upright.build_mex; without contraction (-ffp-contract=off), or the last bits differ. Only those
 * functions are called that Octave and MATLAB share, whether complex numbers are kept interleaved
 * or apart. A run cannot be interrupted.
 */

#include <float.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#include "mex.h"

#include "cartpole.h"
#include "noise.h"

/* ---- The run: upright/core/trials.py and agents/q_learning.py -------------------------------- */

typedef struct {
    Parameters parameters;
    Noise noise;
    State start;
    int64_t steps, trials;
} Task;

typedef struct {
    QMemory memory;
    double learning_rate, discount, trace_decay, jitter;
    int64_t replay_passes; /* over the kept moves after a fall; 0 learns at every step instead */
} Learner;

static inline double best_value(const QMemory *m, int64_t box)
{
    double left = m->table[entry(m, box, false)], right = m->table[entry(m, box, true)];
    return left > right ? left : right;
}

/* What a move was worth: the reward and the discounted value of where it led. */
static inline double target(const Learner *l, int64_t next_box)
{
    return next_box == FALL ? -1.0 : l->discount * best_value(&l->memory, next_box);
}

/* Move a value of the table towards a new one. */
static inline void change(Learner *l, int64_t place, double value)
{
    double *old = &l->memory.table[place];
    *old += l->learning_rate * (value - *old);
}

/* Learn from a move, or keep it until the pole has fallen. */
static inline void learn(Learner *l, int64_t box, bool action, int64_t next_box)
{
    if (l->replay_passes == 0)
        change(l, entry(&l->memory, box, action), target(l, next_box));
    else if (next_box != box)
        keep_move(&l->memory, box, action, next_box);
}

/* Learn from the kept moves, the newest first. */
static void replay(Learner *l)
{
    const QMemory *m = &l->memory;
    int64_t kept = m->moves < m->replay_size ? m->moves : m->replay_size;
    int64_t row = m->moves % m->replay_size;
    double value = 0.0;
    for (int64_t i = 0; i < kept; i++) {
        row = (row > 0 ? row : m->replay_size) - 1;
        int64_t next_box = m->move_boxes[row];
        double one_step = target(l, next_box);
        if (next_box == FALL)
            value = one_step;
        else
            value = (1.0 - l->trace_decay) * one_step + l->trace_decay * l->discount * value;
        change(l, m->move_entries[row], value);
    }
}

/* A trial, from a start to a fall or a success: returns how many steps it lasted.
 *
 * The learner is copied, so that the compiler may keep it in registers. */
static int64_t trial(Learner *learner, const Task *task, Twister *twister, bool *balanced)
{
    Learner l = *learner;
    const Parameters p = task->parameters;
    const Noise noise = task->noise;
    State state = draw_start(task->start, twister);
    int64_t box = find_box(&l.memory, measure(&noise, state, twister));
    bool fallen = false;
    int64_t count = 0;
    while (count < task->steps && !fallen) {
        bool action = right_is_better(&l.memory, box);
        state = step(&p, state, disturb(&noise, push(&p, action), twister));
        fallen = has_fallen(&p, state);
        State observation = measure(&noise, state, twister); /* after a fall too: it may draw */
        int64_t next_box = fallen ? FALL : find_box(&l.memory, observation);
        learn(&l, box, action, next_box);
        box = next_box;
        count++;
    }
    for (int64_t i = 0; fallen && i < l.replay_passes; i++)
        replay(&l);
    *learner = l;
    *balanced = !fallen;
    return count;
}

/* Trial after trial, until one succeeds: returns how many there were. */
static int64_t run(Learner *learner, const Task *task, Twister *twister, double *lengths,
                   bool *balanced)
{
    for (int64_t i = 0; i < learner->memory.table_length; i++)
        learner->memory.table[i] = learner->jitter * (draw(twister) - 0.5);
    int64_t count = 0;
    *balanced = false;
    while (count < task->trials && !*balanced)
        lengths[count++] = (double)trial(learner, task, twister, balanced);
    return count;
}

/* ---- What MATLAB hands over ------------------------------------------------------------------ */

enum { MOST_EDGES = 100, MOST_BOXES = 1000000, MOST_KEPT_MOVES = 10000000 };

typedef enum { ANY, ABOVE, WHOLE } Kind; /* ABOVE: the least is itself refused */

/* Full, real numbers: whose memory holds as many as their size says. */
static bool is_plain(const mxArray *value)
{
    return (mxIsNumeric(value) || mxIsLogical(value)) && !mxIsComplex(value)
        && !mxIsSparse(value);
}

static bool is_row(const mxArray *value, size_t columns)
{
    return is_plain(value) && mxIsDouble(value) && mxGetNumberOfDimensions(value) == 2
        && mxGetM(value) == 1 && mxGetN(value) == columns;
}

/* Stop: a value is none of what it must be. */
static void refuse(const char *name, const mxArray *value, const char *allowed)
{
    if (is_plain(value) && mxGetNumberOfElements(value) == 1)
        mexErrMsgIdAndTxt("upright:badValue", "%s is %g; it must be %s", name,
                          mxGetScalar(value), allowed);
    mexErrMsgIdAndTxt("upright:badValue", "%s is %s%s of %d by %d; it must be %s", name,
                      mxIsComplex(value) ? "complex " : mxIsSparse(value) ? "sparse " : "",
                      mxGetClassName(value), (int)mxGetM(value), (int)mxGetN(value), allowed);
}

static double read_number(const mxArray *value, const char *name, double least, double most,
                          Kind kind)
{
    if (is_plain(value) && mxGetNumberOfElements(value) == 1) {
        double number = mxGetScalar(value);
        bool inside = kind == ABOVE ? number > least : number >= least;
        if (inside && number <= most && (kind != WHOLE || number == floor(number)))
            return number;
    }
    char allowed[100], limit[40] = "";
    if (most < DBL_MAX)
        snprintf(limit, sizeof limit, " and at most %.10g", most);
    snprintf(allowed, sizeof allowed, "%s, %s %g%s", kind == WHOLE ? "a whole number" : "a number",
             kind == ABOVE ? "above" : "at least", least, limit);
    refuse(name, value, allowed);
    return 0.0;
}

/* A field of the one struct that an argument must be. */
static const mxArray *get_field(const mxArray *argument, const char *argument_name,
                                const char *name)
{
    if (!mxIsStruct(argument) || mxGetNumberOfElements(argument) != 1)
        refuse(argument_name, argument, "one struct");
    const mxArray *field = mxGetField(argument, 0, name);
    if (field == NULL)
        mexErrMsgIdAndTxt("upright:badValue", "%s has no field %s", argument_name, name);
    return field;
}

static Parameters read_parameters(const mxArray *argument)
{
    Parameters p;
    const struct {
        const char *name;
        double *place;
        Kind kind;
    } fields[] = {
        {"gravity", &p.gravity, ANY},
        {"cart_mass", &p.cart_mass, ABOVE},
        {"pole_mass", &p.pole_mass, ABOVE},
        {"half_length", &p.half_length, ABOVE},
        {"cart_friction", &p.cart_friction, ANY},
        {"pole_friction", &p.pole_friction, ANY},
        {"force", &p.force, ABOVE},
        {"time_step", &p.time_step, ABOVE},
        {"position_limit", &p.position_limit, ABOVE},
        {"angle_limit", &p.angle_limit, ABOVE},
    };
    for (size_t i = 0; i < sizeof fields / sizeof *fields; i++) {
        const mxArray *value = get_field(argument, "parameters", fields[i].name);
        *fields[i].place = read_number(value, fields[i].name, 0.0, DBL_MAX, fields[i].kind);
    }
    return p;
}

static double read_noise(const mxArray *argument, const char *name)
{
    return read_number(get_field(argument, "noise", name), name, 0.0, DBL_MAX, ANY);
}

static State read_start(const mxArray *argument)
{
    const char *allowed = "a row of 4 finite half-widths, at least 0";
    if (!is_row(argument, 4))
        refuse("start", argument, allowed);
    const double *w = mxGetPr(argument);
    for (int i = 0; i < 4; i++)
        if (!(w[i] >= 0.0 && w[i] <= DBL_MAX))
            mexErrMsgIdAndTxt("upright:badValue", "start holds %g; it must be %s", w[i], allowed);
    return (State){w[0], w[1], w[2], w[3]};
}

static double read_setting(const mxArray *settings, const char *name, double least, double most,
                           Kind kind)
{
    return read_number(get_field(settings, "settings", name), name, least, most, kind);
}

/* Point to the edges along one of the measurements; returns how many there are. */
static int64_t read_edges(const mxArray *settings, const char *name, bool mirrored,
                          const double **edges)
{
    const mxArray *value = get_field(settings, "settings", name);
    size_t count = mxGetNumberOfElements(value);
    bool empty = is_plain(value) && mxIsDouble(value) && count == 0;
    if (!empty && (!is_row(value, count) || count > MOST_EDGES))
        refuse(name, value, "a row of at most 100 numbers, or empty");
    const double *e = mxGetPr(value);
    for (size_t i = 0; i < count; i++) {
        if (!(fabs(e[i]) <= 1e6) || (i > 0 && !(e[i] > e[i - 1])))
            mexErrMsgIdAndTxt("upright:badValue",
                              "%s holds %g; its numbers must ascend, within +-1e6", name, e[i]);
        double image = -e[count - 1 - i];
        if (mirrored && fabs(e[i] - image) > 1e-8 + 1e-5 * fabs(image))
            mexErrMsgIdAndTxt("upright:badValue",
                              "%s holds %g; mirrored boxes need edges alike in +-", name, e[i]);
    }
    *edges = e;
    return (int64_t)count;
}

static Learner read_settings(const mxArray *settings)
{
    const char *names[4] = {"x_edges", "x_dot_edges", "theta_edges", "theta_dot_edges"};
    Learner l;
    QMemory *m = &l.memory;
    l.learning_rate = read_setting(settings, "learning_rate", 0.0, 1.0, ANY);
    l.discount = read_setting(settings, "discount", 0.0, 1.0, ANY);
    l.replay_passes = (int64_t)read_setting(settings, "replay_passes", 0.0, 1000.0, WHOLE);
    l.trace_decay = read_setting(settings, "trace_decay", 0.0, 1.0, ANY);
    l.jitter = read_setting(settings, "jitter", 0.0, DBL_MAX, ANY);
    m->replay_size = (int64_t)read_setting(settings, "replay_size", 1.0, MOST_KEPT_MOVES, WHOLE);
    m->mirrored = read_setting(settings, "mirrored", 0.0, 1.0, WHOLE) > 0.0;
    int64_t boxes = 1;
    for (int i = 0; i < 4; i++) {
        m->edge_counts[i] = read_edges(settings, names[i], m->mirrored, &m->edges[i]);
        boxes *= m->edge_counts[i] + 1;
    }
    if (boxes > MOST_BOXES)
        mexErrMsgIdAndTxt("upright:badValue",
                          "the edges make %.0f boxes; there must be at most 1000000",
                          (double)boxes);
    m->table_length = 2 * boxes;
    m->moves = 0;
    return l;
}

static mxArray *make_row(const double *numbers, int64_t count)
{
    mxArray *row = mxCreateDoubleMatrix(1, (mwSize)count, mxREAL);
    double *place = mxGetPr(row);
    for (int64_t i = 0; i < count; i++)
        place[i] = numbers[i];
    return row;
}

/* Memory from mxMalloc is freed by MATLAB and Octave, after an error too. */
void mexFunction(int output_count, mxArray *outputs[], int input_count, const mxArray *inputs[])
{
    if (input_count != 7 || output_count > 3)
        mexErrMsgIdAndTxt("upright:badValue",
                          "%d values were given and %d asked for; it must be [lengths, balanced, "
                          "table] = q_learning_mex(parameters, noise, start, settings, number, "
                          "steps, trials)",
                          input_count, output_count);
    Task task = {
        read_parameters(inputs[0]),
        {read_noise(inputs[1], "actuator"), read_noise(inputs[1], "angle"),
         read_noise(inputs[1], "others"), read_noise(inputs[1], "angle_offset")},
        read_start(inputs[2]),
        (int64_t)read_number(inputs[5], "steps", 1.0, 1e9, WHOLE),
        (int64_t)read_number(inputs[6], "trials", 1.0, 1e6, WHOLE),
    };
    Learner learner = read_settings(inputs[3]);
    Twister twister;
    seed_twister(&twister, (uint32_t)read_number(inputs[4], "number", 0.0, 4294967295.0, WHOLE));

    QMemory *m = &learner.memory;
    m->table = mxMalloc((size_t)m->table_length * sizeof *m->table);
    m->move_entries = mxMalloc((size_t)m->replay_size * sizeof *m->move_entries);
    m->move_boxes = mxMalloc((size_t)m->replay_size * sizeof *m->move_boxes);
    double *lengths = mxMalloc((size_t)task.trials * sizeof *lengths);
    bool balanced;
    int64_t count = run(&learner, &task, &twister, lengths, &balanced);

    outputs[0] = make_row(lengths, count);
    if (output_count > 1)
        outputs[1] = mxCreateLogicalScalar(balanced);
    if (output_count > 2)
        outputs[2] = make_row(m->table, m->table_length);
    mxFree(m->table);
    mxFree(m->move_entries);
    mxFree(m->move_boxes);
    mxFree(lengths);
}
