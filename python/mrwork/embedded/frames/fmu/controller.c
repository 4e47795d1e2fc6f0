/* The controller between two calls of the importer. */
#define CHECKS_INPUTS 0 /* the controller itself replaces a reading that is not a number */
#define GRID_WORDS "sample times"

typedef struct {
    NAME_memory memory;
    NAME_parameters parameters;
    NAME_input input;
    double output[N_OUTPUTS];
    double time;
    int is_running;
    int is_stale;
} model;

static void begin(model *m)
{
    NAME_start(&m->memory);
}

static int is_beyond(const model *m) { return 0; }
static int retune(model *m) { return 1; }

/* The commands that readings as they stand would give: the memory stays as it is. */
static void evaluate(model *m)
{
    NAME_memory memory;
    if (!m->is_running) {
        begin(m);
    }
    memory = m->memory;
    NAME_step(&memory, &m->parameters, &m->input, m->output);
    m->output[N_OUTPUTS - 1] = memory.status;
}

/* Samples with the readings at the start; the commands afterwards are those of the last one, held since. */
static void run(model *m, long count)
{
    for (long i = 0; i < count; ++i) {
        NAME_step(&m->memory, &m->parameters, &m->input, m->output);
    }
    m->output[N_OUTPUTS - 1] = m->memory.status;
}
