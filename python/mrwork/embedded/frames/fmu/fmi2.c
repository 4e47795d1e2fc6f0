/* FMI 2.0. Types and constants of the standard stand here for sources that are compiled alone. */
#ifndef fmi2TypesPlatform_h
#define fmi2TypesPlatform "default"
typedef void *fmi2Component;
typedef void *fmi2ComponentEnvironment;
typedef void *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer;
typedef int fmi2Boolean;
typedef char fmi2Char;
typedef const fmi2Char *fmi2String;
typedef char fmi2Byte;
#define fmi2True 1
#define fmi2False 0
#endif

#ifndef fmi2FunctionTypes_h
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum { fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated } fmi2StatusKind;
typedef struct {
    void (*logger)(fmi2ComponentEnvironment, fmi2String name, fmi2Status, fmi2String category, fmi2String message, ...);
    void *(*allocateMemory)(size_t, size_t);
    void (*freeMemory)(void *);
    void (*stepFinished)(fmi2ComponentEnvironment, fmi2Status);
    fmi2ComponentEnvironment componentEnvironment;
} fmi2CallbackFunctions;
typedef struct {
    fmi2Boolean newDiscreteStatesNeeded;
    fmi2Boolean terminateSimulation;
    fmi2Boolean nominalsOfContinuousStatesChanged;
    fmi2Boolean valuesOfContinuousStatesChanged;
    fmi2Boolean nextEventTimeDefined;
    fmi2Real nextEventTime;
} fmi2EventInfo;
#endif

/* Names have a prefix for who links statically, by the standard that of the model; a shared library overrides it. */
#ifndef FMI2_FUNCTION_PREFIX
#define FMI2_FUNCTION_PREFIX MODEL_PREFIX
#endif
#ifdef fmi2Functions_h
#define FMI(name) fmi2##name
#else
#if defined(FMI2_FUNCTION_PREFIX) && !defined(FMI2_OVERRIDE_FUNCTION_PREFIX)
#define FMI2_ACTUAL_FUNCTION_PREFIX FMI2_FUNCTION_PREFIX
#endif
#ifdef FMI2_ACTUAL_FUNCTION_PREFIX
#define FMI(name) JOINED(FMI2_ACTUAL_FUNCTION_PREFIX, fmi2##name)
#else
#define FMI(name) fmi2##name
#endif
#endif

typedef struct {
    model model;
    fmi2CallbackFunctions calls;
    char name[128];
} component;

static fmi2Status refuse(const component *c, const char *sentence)
{
    if (c->calls.logger != NULL) {
        c->calls.logger(c->calls.componentEnvironment, c->name, fmi2Error, "logStatusError", sentence);
    }
    return fmi2Error;
}

static fmi2Status answer(const component *c, const char *sentence)
{
    if (sentence == NULL) {
        return fmi2OK;
    }
    refuse(c, sentence);
    return sentence == beyond ? fmi2Discard : fmi2Error;
}

EXPORTED const char *FMI(GetTypesPlatform)(void) { return fmi2TypesPlatform; }
EXPORTED const char *FMI(GetVersion)(void) { return "2.0"; }
EXPORTED fmi2Status FMI(SetDebugLogging)(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) { return fmi2OK; }

EXPORTED fmi2Component FMI(Instantiate)(
    fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources, const fmi2CallbackFunctions *calls,
    fmi2Boolean visible, fmi2Boolean logging)
{
    component *c = calloc(1, sizeof *c);
    const char *sentence = NULL;
    if (c == NULL) {
        return NULL;
    }
    if (calls != NULL) {
        c->calls = *calls;
    }
    if (name != NULL) {
        strncpy(c->name, name, sizeof c->name - 1);
    }
    if (guid == NULL || strcmp(guid, TOKEN) != 0) {
        sentence = "the guid is not that of this FMU: its description and its binary differ";
    } else if (type == fmi2ModelExchange && !HAS_MODEL_EXCHANGE) {
        sentence = "a controller is for co-simulation alone";
    }
    if (sentence != NULL) {
        refuse(c, sentence);
        free(c);
        return NULL;
    }
    reset(&c->model);
    return c;
}

EXPORTED void FMI(FreeInstance)(fmi2Component c) { free(c); }

EXPORTED fmi2Status FMI(SetupExperiment)(
    fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start, fmi2Boolean has_stop, fmi2Real stop)
{
    ((component *)c)->model.time = start;
    return fmi2OK;
}

EXPORTED fmi2Status FMI(EnterInitializationMode)(fmi2Component c) { return fmi2OK; }

EXPORTED fmi2Status FMI(ExitInitializationMode)(fmi2Component c)
{
    finish_initialisation(&((component *)c)->model);
    return fmi2OK;
}

EXPORTED fmi2Status FMI(Terminate)(fmi2Component c) { return fmi2OK; }

EXPORTED fmi2Status FMI(Reset)(fmi2Component c)
{
    reset(&((component *)c)->model);
    return fmi2OK;
}

EXPORTED fmi2Status FMI(GetReal)(fmi2Component c, const fmi2ValueReference references[], size_t n, fmi2Real values[])
{
    const char *sentence = NULL;
    for (size_t i = 0; i < n && sentence == NULL; ++i) {
        sentence = get_variable(&((component *)c)->model, references[i], &values[i]);
    }
    return answer(c, sentence);
}

EXPORTED fmi2Status FMI(SetReal)(fmi2Component c, const fmi2ValueReference references[], size_t n, const fmi2Real values[])
{
    const char *sentence = NULL;
    for (size_t i = 0; i < n && sentence == NULL; ++i) {
        sentence = set_variable(&((component *)c)->model, references[i], values[i]);
    }
    return answer(c, sentence);
}

#define NO_VARIABLES(Kind) \
    EXPORTED fmi2Status FMI(Get##Kind)(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2##Kind values[]) \
    { \
        return answer(c, n == 0 ? NULL : "all variables are of type Real"); \
    } \
    EXPORTED fmi2Status FMI(Set##Kind)(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2##Kind values[]) \
    { \
        return answer(c, n == 0 ? NULL : "all variables are of type Real"); \
    }
NO_VARIABLES(Integer)
NO_VARIABLES(Boolean)
NO_VARIABLES(String)

EXPORTED fmi2Status FMI(GetFMUstate)(fmi2Component c, fmi2FMUstate *state)
{
    return answer(c, keep(state, &((component *)c)->model));
}

EXPORTED fmi2Status FMI(SetFMUstate)(fmi2Component c, fmi2FMUstate state)
{
    memcpy(&((component *)c)->model, state, sizeof(model));
    return fmi2OK;
}

EXPORTED fmi2Status FMI(FreeFMUstate)(fmi2Component c, fmi2FMUstate *state)
{
    free(*state);
    *state = NULL;
    return fmi2OK;
}

EXPORTED fmi2Status FMI(SerializedFMUstateSize)(fmi2Component c, fmi2FMUstate state, size_t *size)
{
    *size = sizeof(model);
    return fmi2OK;
}

EXPORTED fmi2Status FMI(SerializeFMUstate)(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    return answer(c, serialise(state, bytes, size));
}

EXPORTED fmi2Status FMI(DeSerializeFMUstate)(
    fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    return answer(c, deserialise(bytes, size, state));
}

/* Model exchange. */
EXPORTED fmi2Status FMI(EnterEventMode)(fmi2Component c) { return fmi2OK; }
EXPORTED fmi2Status FMI(EnterContinuousTimeMode)(fmi2Component c) { return fmi2OK; }

EXPORTED fmi2Status FMI(NewDiscreteStates)(fmi2Component c, fmi2EventInfo *event)
{
    memset(event, 0, sizeof *event);
    return fmi2OK;
}

EXPORTED fmi2Status FMI(CompletedIntegratorStep)(
    fmi2Component c, fmi2Boolean is_final, fmi2Boolean *enters_event_mode, fmi2Boolean *terminates)
{
    *enters_event_mode = fmi2False;
    *terminates = fmi2False;
    return fmi2OK;
}

EXPORTED fmi2Status FMI(SetTime)(fmi2Component c, fmi2Real time)
{
    ((component *)c)->model.time = time;
    return fmi2OK;
}

static fmi2Status get_range(component *c, unsigned long first, fmi2Real values[], size_t n)
{
    const char *sentence = n == N_RATES ? NULL : "the number of continuous states is another";
    for (size_t i = 0; i < n && sentence == NULL; ++i) {
        sentence = get_variable(&c->model, first + i, &values[i]);
    }
    return answer(c, sentence);
}

EXPORTED fmi2Status FMI(GetContinuousStates)(fmi2Component c, fmi2Real x[], size_t n) { return get_range(c, FIRST_STATE, x, n); }
EXPORTED fmi2Status FMI(GetDerivatives)(fmi2Component c, fmi2Real rates[], size_t n) { return get_range(c, FIRST_RATE, rates, n); }

EXPORTED fmi2Status FMI(SetContinuousStates)(fmi2Component c, const fmi2Real x[], size_t n)
{
    model *m = &((component *)c)->model;
    if (n != N_RATES) {
        return refuse(c, "the number of continuous states is another");
    }
    for (size_t i = 0; i < n; ++i) {
        *place_of(m, FIRST_STATE + i) = x[i];
    }
    m->is_stale = 1;
    return fmi2OK;
}

EXPORTED fmi2Status FMI(GetNominalsOfContinuousStates)(fmi2Component c, fmi2Real nominals[], size_t n)
{
    for (size_t i = 0; i < n; ++i) {
        nominals[i] = 1.0;
    }
#if HAS_MODEL_EXCHANGE
    if (n != N_RATES) {
        return refuse(c, "the number of continuous states is another");
    }
    nominal_sizes(&((component *)c)->model, nominals);
#endif
    return fmi2OK;
}

EXPORTED fmi2Status FMI(GetEventIndicators)(fmi2Component c, fmi2Real indicators[], size_t n)
{
    return answer(c, n == 0 ? NULL : "the model has no event indicators");
}

/* Co-simulation. */
EXPORTED fmi2Status FMI(DoStep)(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean is_final)
{
    return answer(c, advance(&((component *)c)->model, time, step));
}

static fmi2Status has_no(const component *c)
{
    return refuse(c, "the FMU does not offer this function, as its description says");
}

EXPORTED fmi2Status FMI(GetDirectionalDerivative)(
    fmi2Component c, const fmi2ValueReference unknowns[], size_t n_unknowns, const fmi2ValueReference knowns[],
    size_t n_knowns, const fmi2Real seed[], fmi2Real values[])
{
    return has_no(c);
}
EXPORTED fmi2Status FMI(SetRealInputDerivatives)(
    fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer orders[], const fmi2Real values[])
{
    return has_no(c);
}
EXPORTED fmi2Status FMI(GetRealOutputDerivatives)(
    fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer orders[], fmi2Real values[])
{
    return has_no(c);
}
EXPORTED fmi2Status FMI(CancelStep)(fmi2Component c) { return has_no(c); }
EXPORTED fmi2Status FMI(GetStatus)(fmi2Component c, const fmi2StatusKind s, fmi2Status *value) { return has_no(c); }
EXPORTED fmi2Status FMI(GetRealStatus)(fmi2Component c, const fmi2StatusKind s, fmi2Real *value) { return has_no(c); }
EXPORTED fmi2Status FMI(GetIntegerStatus)(fmi2Component c, const fmi2StatusKind s, fmi2Integer *value) { return has_no(c); }
EXPORTED fmi2Status FMI(GetBooleanStatus)(fmi2Component c, const fmi2StatusKind s, fmi2Boolean *value) { return has_no(c); }
EXPORTED fmi2Status FMI(GetStringStatus)(fmi2Component c, const fmi2StatusKind s, fmi2String *value) { return has_no(c); }
