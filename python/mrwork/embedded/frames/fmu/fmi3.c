/* FMI 3.0, co-simulation. Types and constants of the standard stand here for sources that are compiled alone. */
#include <stdbool.h>
#include <stdint.h>

#ifndef fmi3PlatformTypes_h
typedef void *fmi3Instance;
typedef void *fmi3InstanceEnvironment;
typedef void *fmi3FMUState;
typedef uint32_t fmi3ValueReference;
typedef float fmi3Float32;
typedef double fmi3Float64;
typedef int8_t fmi3Int8;
typedef uint8_t fmi3UInt8;
typedef int16_t fmi3Int16;
typedef uint16_t fmi3UInt16;
typedef int32_t fmi3Int32;
typedef uint32_t fmi3UInt32;
typedef int64_t fmi3Int64;
typedef uint64_t fmi3UInt64;
typedef bool fmi3Boolean;
typedef char fmi3Char;
typedef const fmi3Char *fmi3String;
typedef uint8_t fmi3Byte;
typedef const fmi3Byte *fmi3Binary;
typedef bool fmi3Clock;
#endif

#ifndef fmi3FunctionTypes_h
typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef enum {
    fmi3Independent, fmi3Constant, fmi3Fixed, fmi3Tunable, fmi3Discrete, fmi3Dependent
} fmi3DependencyKind;
typedef enum { fmi3IntervalNotYetKnown, fmi3IntervalUnchanged, fmi3IntervalChanged } fmi3IntervalQualifier;
typedef void (*fmi3LogMessageCallback)(fmi3InstanceEnvironment, fmi3Status, fmi3String category, fmi3String message);
typedef void (*fmi3ClockUpdateCallback)(fmi3InstanceEnvironment);
typedef void (*fmi3IntermediateUpdateCallback)(
    fmi3InstanceEnvironment, fmi3Float64, fmi3Boolean, fmi3Boolean, fmi3Boolean, fmi3Boolean, fmi3Boolean *,
    fmi3Float64 *);
typedef void (*fmi3LockPreemptionCallback)(void);
typedef void (*fmi3UnlockPreemptionCallback)(void);
#endif

/* Names have a prefix for who links statically, by the standard that of the model; a shared library overrides it. */
#ifndef FMI3_FUNCTION_PREFIX
#define FMI3_FUNCTION_PREFIX MODEL_PREFIX
#endif
#ifdef fmi3Functions_h
#define FMI(name) fmi3##name
#else
#if defined(FMI3_FUNCTION_PREFIX) && !defined(FMI3_OVERRIDE_FUNCTION_PREFIX)
#define FMI3_ACTUAL_FUNCTION_PREFIX FMI3_FUNCTION_PREFIX
#endif
#ifdef FMI3_ACTUAL_FUNCTION_PREFIX
#define FMI(name) JOINED(FMI3_ACTUAL_FUNCTION_PREFIX, fmi3##name)
#else
#define FMI(name) fmi3##name
#endif
#endif

typedef struct {
    model model;
    fmi3LogMessageCallback log;
    fmi3InstanceEnvironment environment;
} instance;

static fmi3Status refuse(const instance *i, const char *sentence)
{
    if (i->log != NULL) {
        i->log(i->environment, fmi3Error, "logStatusError", sentence);
    }
    return fmi3Error;
}

static fmi3Status answer(const instance *i, const char *sentence)
{
    if (sentence == NULL) {
        return fmi3OK;
    }
    refuse(i, sentence);
    return sentence == beyond ? fmi3Discard : fmi3Error;
}

static fmi3Status has_no(const instance *i)
{
    return refuse(i, "the FMU does not offer this function, as its description says");
}

EXPORTED const char *FMI(GetVersion)(void) { return "3.0"; }
EXPORTED fmi3Status FMI(SetDebugLogging)(fmi3Instance i, fmi3Boolean on, size_t n, const fmi3String categories[]) { return fmi3OK; }

EXPORTED fmi3Instance FMI(InstantiateCoSimulation)(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging,
    fmi3Boolean event_mode, fmi3Boolean early_return, const fmi3ValueReference intermediate[], size_t n_intermediate,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update)
{
    instance *i = calloc(1, sizeof *i);
    if (i == NULL) {
        return NULL;
    }
    i->log = log;
    i->environment = environment;
    if (token == NULL || strcmp(token, TOKEN) != 0) {
        refuse(i, "the instantiation token is not that of this FMU: its description and its binary differ");
        free(i);
        return NULL;
    }
    reset(&i->model);
    return i;
}

static fmi3Instance no_instance(fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    instance i = {.environment = environment, .log = log};
    refuse(&i, "the FMU is for co-simulation");
    return NULL;
}

EXPORTED fmi3Instance FMI(InstantiateModelExchange)(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    return no_instance(environment, log);
}

EXPORTED fmi3Instance FMI(InstantiateScheduledExecution)(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3ClockUpdateCallback update,
    fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock)
{
    return no_instance(environment, log);
}

EXPORTED void FMI(FreeInstance)(fmi3Instance i) { free(i); }

EXPORTED fmi3Status FMI(EnterInitializationMode)(
    fmi3Instance i, fmi3Boolean has_tolerance, fmi3Float64 tolerance, fmi3Float64 start, fmi3Boolean has_stop,
    fmi3Float64 stop)
{
    ((instance *)i)->model.time = start;
    return fmi3OK;
}

EXPORTED fmi3Status FMI(ExitInitializationMode)(fmi3Instance i)
{
    finish_initialisation(&((instance *)i)->model);
    return fmi3OK;
}

EXPORTED fmi3Status FMI(Terminate)(fmi3Instance i) { return fmi3OK; }

EXPORTED fmi3Status FMI(Reset)(fmi3Instance i)
{
    reset(&((instance *)i)->model);
    return fmi3OK;
}

EXPORTED fmi3Status FMI(GetFloat64)(
    fmi3Instance i, const fmi3ValueReference references[], size_t n, fmi3Float64 values[], size_t n_values)
{
    const char *sentence = n == n_values ? NULL : "every variable has one value";
    for (size_t k = 0; k < n && sentence == NULL; ++k) {
        sentence = get_variable(&((instance *)i)->model, references[k], &values[k]);
    }
    return answer(i, sentence);
}

EXPORTED fmi3Status FMI(SetFloat64)(
    fmi3Instance i, const fmi3ValueReference references[], size_t n, const fmi3Float64 values[], size_t n_values)
{
    const char *sentence = n == n_values ? NULL : "every variable has one value";
    for (size_t k = 0; k < n && sentence == NULL; ++k) {
        sentence = set_variable(&((instance *)i)->model, references[k], values[k]);
    }
    return answer(i, sentence);
}

EXPORTED fmi3Status FMI(DoStep)(
    fmi3Instance i, fmi3Float64 time, fmi3Float64 step, fmi3Boolean is_final, fmi3Boolean *needs_event,
    fmi3Boolean *terminates, fmi3Boolean *returned_early, fmi3Float64 *last_time)
{
    const char *sentence = advance(&((instance *)i)->model, time, step);
    *needs_event = *terminates = *returned_early = false;
    *last_time = sentence == NULL ? time + step : time;
    return answer(i, sentence);
}

EXPORTED fmi3Status FMI(GetFMUState)(fmi3Instance i, fmi3FMUState *state)
{
    return answer(i, keep(state, &((instance *)i)->model));
}

EXPORTED fmi3Status FMI(SetFMUState)(fmi3Instance i, fmi3FMUState state)
{
    memcpy(&((instance *)i)->model, state, sizeof(model));
    return fmi3OK;
}

EXPORTED fmi3Status FMI(FreeFMUState)(fmi3Instance i, fmi3FMUState *state)
{
    free(*state);
    *state = NULL;
    return fmi3OK;
}

EXPORTED fmi3Status FMI(SerializedFMUStateSize)(fmi3Instance i, fmi3FMUState state, size_t *size)
{
    *size = sizeof(model);
    return fmi3OK;
}

EXPORTED fmi3Status FMI(SerializeFMUState)(fmi3Instance i, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    return answer(i, serialise(state, bytes, size));
}

EXPORTED fmi3Status FMI(DeserializeFMUState)(
    fmi3Instance i, const fmi3Byte bytes[], size_t size, fmi3FMUState *state)
{
    return answer(i, deserialise(bytes, size, state));
}

/* What the standard asks of every binary, and this one does not have. */
#define REFERENCES fmi3Instance i, const fmi3ValueReference r[], size_t n
#define NO_VARIABLES(Kind) \
    EXPORTED fmi3Status FMI(Get##Kind)(REFERENCES, fmi3##Kind values[], size_t n_values) \
    { \
        return answer(i, n == 0 ? NULL : "all variables are of type Float64"); \
    } \
    EXPORTED fmi3Status FMI(Set##Kind)(REFERENCES, const fmi3##Kind values[], size_t n_values) \
    { \
        return answer(i, n == 0 ? NULL : "all variables are of type Float64"); \
    }
NO_VARIABLES(Float32)
NO_VARIABLES(Int8)
NO_VARIABLES(UInt8)
NO_VARIABLES(Int16)
NO_VARIABLES(UInt16)
NO_VARIABLES(Int32)
NO_VARIABLES(UInt32)
NO_VARIABLES(Int64)
NO_VARIABLES(UInt64)
NO_VARIABLES(Boolean)
NO_VARIABLES(String)

#define ABSENT(name, ...) \
    EXPORTED fmi3Status FMI(name)(__VA_ARGS__) \
    { \
        return has_no(i); \
    }
ABSENT(GetBinary, REFERENCES, size_t sizes[], fmi3Binary values[], size_t n_values)
ABSENT(SetBinary, REFERENCES, const size_t sizes[], const fmi3Binary values[], size_t n_values)
ABSENT(GetClock, REFERENCES, fmi3Clock values[])
ABSENT(SetClock, REFERENCES, const fmi3Clock values[])
ABSENT(GetNumberOfVariableDependencies, fmi3Instance i, fmi3ValueReference r, size_t *n)
ABSENT(GetVariableDependencies, fmi3Instance i, fmi3ValueReference dependent, size_t elements[],
    fmi3ValueReference independents[], size_t independent_elements[], fmi3DependencyKind kinds[], size_t n)
ABSENT(GetDirectionalDerivative, fmi3Instance i, const fmi3ValueReference unknowns[], size_t n_unknowns,
    const fmi3ValueReference knowns[], size_t n_knowns, const fmi3Float64 seed[], size_t n_seed, fmi3Float64 values[],
    size_t n_values)
ABSENT(GetAdjointDerivative, fmi3Instance i, const fmi3ValueReference unknowns[], size_t n_unknowns,
    const fmi3ValueReference knowns[], size_t n_knowns, const fmi3Float64 seed[], size_t n_seed, fmi3Float64 values[],
    size_t n_values)
ABSENT(GetOutputDerivatives, REFERENCES, const fmi3Int32 orders[], fmi3Float64 values[], size_t n_values)
ABSENT(EnterConfigurationMode, fmi3Instance i)
ABSENT(ExitConfigurationMode, fmi3Instance i)
ABSENT(EnterEventMode, fmi3Instance i)
ABSENT(EnterStepMode, fmi3Instance i)
ABSENT(EnterContinuousTimeMode, fmi3Instance i)
ABSENT(EvaluateDiscreteStates, fmi3Instance i)
ABSENT(UpdateDiscreteStates, fmi3Instance i, fmi3Boolean *needs_update, fmi3Boolean *terminates,
    fmi3Boolean *nominals_changed, fmi3Boolean *values_changed, fmi3Boolean *has_next_event, fmi3Float64 *next_event)
ABSENT(CompletedIntegratorStep, fmi3Instance i, fmi3Boolean is_final, fmi3Boolean *enters_event_mode,
    fmi3Boolean *terminates)
ABSENT(SetTime, fmi3Instance i, fmi3Float64 time)
ABSENT(SetContinuousStates, fmi3Instance i, const fmi3Float64 x[], size_t n)
ABSENT(GetContinuousStates, fmi3Instance i, fmi3Float64 x[], size_t n)
ABSENT(GetContinuousStateDerivatives, fmi3Instance i, fmi3Float64 rates[], size_t n)
ABSENT(GetEventIndicators, fmi3Instance i, fmi3Float64 indicators[], size_t n)
ABSENT(GetNominalsOfContinuousStates, fmi3Instance i, fmi3Float64 nominals[], size_t n)
ABSENT(GetNumberOfEventIndicators, fmi3Instance i, size_t *n)
ABSENT(GetNumberOfContinuousStates, fmi3Instance i, size_t *n)
ABSENT(GetIntervalDecimal, REFERENCES, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
ABSENT(GetIntervalFraction, REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[],
    fmi3IntervalQualifier qualifiers[])
ABSENT(GetShiftDecimal, REFERENCES, fmi3Float64 shifts[])
ABSENT(GetShiftFraction, REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[])
ABSENT(SetIntervalDecimal, REFERENCES, const fmi3Float64 intervals[])
ABSENT(SetIntervalFraction, REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
ABSENT(SetShiftDecimal, REFERENCES, const fmi3Float64 shifts[])
ABSENT(SetShiftFraction, REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
ABSENT(ActivateModelPartition, fmi3Instance i, fmi3ValueReference clock, fmi3Float64 time)
