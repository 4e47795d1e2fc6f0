/* The damper between two calls of the importer. */
#define CHECKS_INPUTS 1
#define FIXES_PARAMETERS 1 /* the start prepares them */
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

/* Parameters of the model at the current, which is the command where no driver lags. */
static void carry(model *m)
{
    NAME_carry(&m->memory, IS_LAGGED ? m->memory.current : m->input.command);
}

static void begin(model *m)
{
    NAME_start(&m->memory, &m->parameters, m->input.command);
}

static void evaluate_at(model *m, double displacement)
{
#if N_RATES > 0
    NAME_rate(&m->memory, m->input.command, displacement, m->input.velocity, m->rate);
#endif
    m->output[0] = NAME_force(&m->memory, displacement, m->input.velocity);
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
    const double velocity = m->input.velocity;
    double displacement = m->input.displacement;
    carry(m);
    for (long i = 0; i < count; ++i) {
        const double motion[6] = {
            displacement, velocity,
            displacement + 0.5 * GRID * velocity, velocity,
            displacement + GRID * velocity, velocity,
        };
        NAME_substep(&m->memory, m->input.command, motion);
        displacement = motion[4];
    }
    evaluate_at(m, displacement);
}

#if HAS_MODEL_EXCHANGE
/* Largest states in two cycles of the tested stroke, velocity and command, a tenth of what is believed: an integrator measures
   its errors by them, and a state may be a ratio or a deflection of micrometres. */
static void nominal_sizes(const model *m, double sizes[])
{
    const double stroke = 0.1 * NAME_believed.displacement;
    const double turn = 0.1 * NAME_believed.velocity / stroke * GRID;
    const double command = 0.1 * NAME_believed.command;
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
