/* The damper between two calls of the importer. */
#define CHECKS_INPUTS 1
#define GRID_WORDS "sub-steps"

typedef struct {
    NAME_memory memory;
    NAME_parameters parameters;
    NAME_input input;
    double output[N_OUTPUTS];
    double rate[N_RATES + 1];
    double time;
    int is_running;
    int is_stale;
} model;

/* Whether motions as they stand are beyond what is believed: no force is given for them. */
static int is_beyond(const model *m)
{
    return !(fabs(m->input.displacement) <= NAME_believed.displacement && fabs(m->input.velocity) <= NAME_believed.velocity);
}

/* The command as it is believed. */
static double commanded(const model *m)
{
    return fmin(fmax(m->input.command, NAME_believed.lowest_command), NAME_believed.highest_command);
}

/* Parameters of the model at the current, which is the command where no driver lags. */
static void carry(model *m)
{
    NAME_carry(&m->memory, IS_LAGGED ? m->memory.current : commanded(m));
}

static void begin(model *m)
{
    NAME_start(&m->memory, &m->parameters, commanded(m));
}

/* Whether the damper has other parameters from now on. */
static int retune(model *m)
{
    return NAME_retune(&m->memory, &m->parameters) == 0;
}

static void evaluate_at(model *m, double displacement)
{
#if N_RATES > 0
    NAME_rate(&m->memory, commanded(m), displacement, m->input.velocity, m->rate);
#endif
    m->output[0] = NAME_force(&m->memory, displacement, m->input.velocity);
    m->output[1] = m->memory.status;
}

/* Force and rates at the inputs as they stand; before the first step the driver is at rest at its command. */
static void evaluate(model *m)
{
    if (!m->is_running) {
        begin(m);
    }
    carry(m);
    evaluate_at(m, m->input.displacement);
}

/* A straight motion from the displacement at the velocity; the force afterwards is that at its end. */
static void run(model *m, long count)
{
    const double velocity = m->input.velocity, command = commanded(m);
    double displacement = m->input.displacement;
    m->memory.status = (command != m->input.command ? STATUS_COMMAND_LIMITED : 0) |
                       (fabs(velocity) > NAME_tested.velocity ? STATUS_OUTSIDE_TESTED : 0);
    NAME_heal(&m->memory, command);
    carry(m);
    for (long i = 0; i < count; ++i) {
        const double motion[6] = {
            displacement, velocity,
            displacement + 0.5 * GRID * velocity, velocity,
            displacement + GRID * velocity, velocity,
        };
        NAME_substep(&m->memory, command, motion);
        displacement = motion[4];
    }
    NAME_heal(&m->memory, command);
    evaluate_at(m, displacement);
}

#if HAS_MODEL_EXCHANGE
/* Largest states in two cycles of the tested stroke, velocity and command: an integrator measures its errors by them, and a state
   may be a ratio or a deflection of micrometres. */
static void nominal_sizes(const model *m, double sizes[])
{
    const double stroke = NAME_tested.displacement;
    const double turn = NAME_tested.velocity / stroke * GRID;
    const double command = fmax(fabs(NAME_tested.lowest_command), fabs(NAME_tested.highest_command));
    const double count = fmin(12.6 / turn, 1e5);
    NAME_memory probe;
    NAME_start(&probe, &m->parameters, command);
    double largest[N_RATES + 1] = {0.0};
    for (double step = 0.0; step < count; ++step) {
        double motion[6];
        for (int stage = 0; stage < 3; ++stage) {
            const double phase = turn * (step + 0.5 * stage);
            motion[2 * stage] = stroke * sin(phase);
            motion[2 * stage + 1] = stroke * turn / GRID * cos(phase);
        }
        NAME_substep(&probe, command, motion);
        for (int i = 0; i < N_RATES - IS_LAGGED; ++i) {
            largest[i] = fmax(largest[i], fabs(probe.state[i]));
        }
    }
    largest[N_RATES - IS_LAGGED] = command;
    for (int i = 0; i < N_RATES; ++i) {
        sizes[i] = largest[i] > 0.0 && isfinite(largest[i]) ? largest[i] : 1.0;
    }
}
#endif
