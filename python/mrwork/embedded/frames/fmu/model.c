/* What both standards ask of the model; a sentence that is returned says why not, and one of them is no error. */
static const char beyond[] = "displacement or velocity is beyond what this damper is believed for; take a smaller step";

static double *place_of(model *m, unsigned long reference)
{
#define PLACE(number, field, value) case number: return &m->field;
    switch (reference) {
        SETTABLE(PLACE)
        CALCULATED(PLACE)
    default:
        return NULL;
    }
#undef PLACE
}

static void reset(model *m)
{
    memset(m, 0, sizeof *m);
#define START(number, field, value) m->field = value;
    SETTABLE(START)
#undef START
    m->is_stale = 1;
}

static void finish_initialisation(model *m)
{
    begin(m);
    m->is_running = 1;
    m->is_stale = 1;
}

static const char *set_variable(model *m, unsigned long reference, double value)
{
    if (reference < 1 || reference > N_SETTABLE) {
        return "only inputs and parameters can be set";
    }
    if (!isfinite(value) && (CHECKS_INPUTS || reference > N_INPUTS)) {
        return "a value that is set must be a finite number";
    }
    {
        double *place = place_of(m, reference);
        const double before = *place;
        *place = value;
        if (m->is_running && reference > N_INPUTS && !retune(m)) {
            *place = before;
            return "with this value the model is not finite, or too stiff for the sub-steps of the fitted parameters";
        }
    }
    m->is_stale = 1;
    return NULL;
}

static const char *get_variable(model *m, unsigned long reference, double *value)
{
    const double *place = place_of(m, reference);
    if (place == NULL) {
        return "the model has no variable with this value reference";
    }
    if (m->is_stale && reference > N_SETTABLE && is_beyond(m)) {
        return beyond;
    }
    if (m->is_stale) {
        evaluate(m);
        m->is_stale = 0;
    }
    *value = *place;
    return NULL;
}

/* Beside a millionth of the grid, a step may be off by the rounding of the time from which it was computed. */
static const char *advance(model *m, double time, double step)
{
    const double count = floor(step / GRID + 0.5);
    if (!m->is_running) {
        return "a step was asked for before the initialisation was finished";
    }
    if (!(count >= 1.0 && count < 1e9 && fabs(step - count * GRID) <= 1e-6 * GRID + 1e-15 * fabs(time))) {
        return "the communication step must be a whole number of " GRID_WORDS " of " TEXT_OF(GRID) " s";
    }
    if (is_beyond(m)) {
        return beyond;
    }
    run(m, (long)count);
    m->time = time + step;
    m->is_stale = 0;
    return NULL;
}

/* A state of the FMU is a copy of the model: inputs, parameters, memory and time. */
static const char *keep(void **state, const void *bytes)
{
    if (*state == NULL) {
        *state = malloc(sizeof(model));
    }
    if (*state == NULL) {
        return "there is no memory left for a state";
    }
    memcpy(*state, bytes, sizeof(model));
    return NULL;
}

static const char *serialise(const void *state, void *bytes, size_t size)
{
    if (size < sizeof(model)) {
        return "the array for the state is too small";
    }
    memcpy(bytes, state, sizeof(model));
    return NULL;
}

static const char *deserialise(const void *bytes, size_t size, void **state)
{
    return size == sizeof(model) ? keep(state, bytes) : "the bytes are no state of this FMU";
}
