/* FMI 3.0 for Co-Simulation around one control law, written by smc_mujoco. Use without restriction, without warranty.
 *
 * The law runs at t_k = startTime + k SMC_DT, k = 0, 1, ..., on the inputs as they are set at that time. Between two
 * samples u and s are held. All that changes in an instance is one struct without pointers, so that several instances
 * are independent, and fmi3GetFMUState is a copy.
 *
 * Without Event Mode, fmi3DoStep runs the law at every sample in [t, t + h), on the inputs set before the step. With
 * Event Mode, fmi3DoStep ends where the next sample is due. In Event Mode u follows the inputs at once, and
 * fmi3UpdateDiscreteStates completes the sample, so that u has no delay.
 */
#include "fmi3Functions.h"
#include "controller.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define CLOSE 1e-3 /* of SMC_DT: instants closer than this are the same */

typedef enum { INSTANTIATED, INITIALIZING, EVENT, STEPPING, TERMINATED, FAILED } Mode;

typedef struct {
    Mode mode;
    fmi3UInt64 samples;   /* completed */
    fmi3Float64 start;    /* time of the first sample */
    fmi3Boolean outdated; /* an input or a parameter was set after the outputs were computed */
    fmi3Float64 value[SMC_VARIABLES];
} State;

typedef struct {
    State state;
    fmi3Boolean events;       /* whether the importer uses Event Mode */
    fmi3Boolean early_return; /* whether the importer lets fmi3DoStep return early */
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
} Instance;

static fmi3Status fail(Instance *instance, const char *format, const char *name, double number)
{
    char message[256];
    if (instance->log) {
        snprintf(message, sizeof message, format, name, number);
        instance->log(instance->environment, fmi3Error, "error", message);
    }
    return fmi3Error;
}

/* Returns fmi3OK in the modes of a set, 1 << Mode, else fmi3Error. */
static fmi3Status allowed(Instance *instance, unsigned modes, const char *name)
{
    if (instance && (modes >> instance->state.mode & 1u)) return fmi3OK;
    return instance ? fail(instance, "%s was called in the wrong mode (%g)", name, instance->state.mode) : fmi3Error;
}

static double due(const State *state)
{
    return state->start + (double)state->samples * SMC_DT;
}

/* Says why the law failed, if it did. */
static fmi3Status reported(Instance *instance, int failure)
{
    if (!failure) return fmi3OK;
    if (failure == SMC_NOT_FINITE)
        return fail(instance, "the law gave %s that are not finite, at t = %g s", "u, s", due(&instance->state));
    return fail(instance, "%s failed at t = %g s", "the law", due(&instance->state));
}

/* Runs the law for the sample that is due. Returns 0, or the reason of a failure. */
static int sample(State *state)
{
    state->outdated = fmi3False;
    return smc_controller(state->value, (double)state->samples * SMC_DT);
}

/* Computes the outputs for the present inputs, without completing the sample. */
static int preview(State *state)
{
    State trial = *state;
    const int failure = sample(&trial);
    memcpy(state->value, trial.value, SMC_MEMORY * sizeof trial.value[0]); /* all but the memory */
    state->outdated = fmi3False;
    return failure;
}

static fmi3Status complete(Instance *instance)
{
    const fmi3Status status = reported(instance, sample(&instance->state));
    instance->state.samples++;
    return status;
}

static void restart(State *state)
{
    int i;
    memset(state, 0, sizeof *state);
    state->outdated = fmi3True;
    for (i = 0; i < SMC_VARIABLES; i++) state->value[i] = smc_variables[i].start;
}

/* Inquiry, creation and the modes */

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String categories[])
{
    (void)on, (void)n, (void)categories; /* there are only messages of errors */
    return c ? fmi3OK : fmi3Error;
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early_return, const fmi3ValueReference intermediate[],
    size_t n_intermediate, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
    fmi3IntermediateUpdateCallback update)
{
    Instance *instance;
    (void)name, (void)resources, (void)visible, (void)logging, (void)intermediate, (void)n_intermediate, (void)update;
    if (!token || strcmp(token, SMC_TOKEN) != 0) {
        if (log) log(environment, fmi3Error, "error", "the instantiation token is that of another FMU");
        return NULL;
    }
    instance = calloc(1, sizeof *instance);
    if (!instance) return NULL;
    instance->environment = environment;
    instance->log = log;
    instance->events = events;
    instance->early_return = early_return;
    restart(&instance->state);
    return instance;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)environment, (void)log;
    return NULL;
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
    fmi3Boolean visible, fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
    fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock)
{
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)environment, (void)log;
    (void)update, (void)lock, (void)unlock;
    return NULL;
}

void fmi3FreeInstance(fmi3Instance c) { free(c); }

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean tolerance_defined, fmi3Float64 tolerance,
    fmi3Float64 start, fmi3Boolean stop_defined, fmi3Float64 stop)
{
    Instance *instance = c;
    (void)tolerance_defined, (void)tolerance, (void)stop_defined, (void)stop;
    if (allowed(instance, 1u << INSTANTIATED, "fmi3EnterInitializationMode") != fmi3OK) return fmi3Error;
    instance->state.start = instance->state.value[SMC_TIME] = start;
    instance->state.mode = INITIALIZING;
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c)
{
    Instance *instance = c;
    if (allowed(instance, 1u << INITIALIZING, "fmi3ExitInitializationMode") != fmi3OK) return fmi3Error;
    if (instance->state.outdated) preview(&instance->state); /* outputs of the start, whatever they are */
    instance->state.outdated = fmi3True;
    instance->state.mode = instance->events ? EVENT : STEPPING;
    return fmi3OK;
}

fmi3Status fmi3EnterEventMode(fmi3Instance c)
{
    Instance *instance = c;
    if (allowed(instance, 1u << STEPPING, "fmi3EnterEventMode") != fmi3OK) return fmi3Error;
    if (!instance->events) return fail(instance, "%s needs eventModeUsed", "fmi3EnterEventMode", 0.0);
    instance->state.mode = EVENT;
    return fmi3OK;
}

fmi3Status fmi3EnterStepMode(fmi3Instance c)
{
    Instance *instance = c;
    if (allowed(instance, 1u << EVENT, "fmi3EnterStepMode") != fmi3OK) return fmi3Error;
    instance->state.mode = STEPPING;
    return fmi3OK;
}

fmi3Status fmi3Terminate(fmi3Instance c)
{
    Instance *instance = c;
    if (allowed(instance, 1u << EVENT | 1u << STEPPING, "fmi3Terminate") != fmi3OK) return fmi3Error;
    instance->state.mode = TERMINATED;
    return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance c)
{
    Instance *instance = c;
    if (!instance) return fmi3Error;
    restart(&instance->state);
    return fmi3OK;
}

/* Variables */

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference references[], size_t n, fmi3Float64 values[],
    size_t n_values)
{
    Instance *instance = c;
    const unsigned modes = 1u << INITIALIZING | 1u << EVENT | 1u << STEPPING | 1u << TERMINATED | 1u << INSTANTIATED;
    size_t i;
    if (allowed(instance, modes, "fmi3GetFloat64") != fmi3OK) return fmi3Error;
    if (n != n_values) return fail(instance, "%s got another number of values than of variables", "fmi3GetFloat64", 0.0);
    for (i = 0; i < n; i++) {
        const fmi3ValueReference reference = references[i];
        const Mode mode = instance->state.mode;
        if (reference >= SMC_VARIABLES) return fail(instance, "there is no variable %s%g", "", reference);
        if (smc_variables[reference].kind == SMC_COMPUTED && instance->state.outdated) {
            /* in Event Mode only while a sample is due: otherwise the outputs are held */
            const fmi3Boolean live = mode == INITIALIZING
                || (mode == EVENT && due(&instance->state) <= instance->state.value[SMC_TIME] + CLOSE * SMC_DT);
            if (live && reported(instance, preview(&instance->state)) != fmi3OK) return fmi3Error;
        }
        values[i] = instance->state.value[reference];
    }
    return fmi3OK;
}

fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference references[], size_t n, const fmi3Float64 values[],
    size_t n_values)
{
    Instance *instance = c;
    size_t i;
    if (allowed(instance, 1u << INSTANTIATED | 1u << INITIALIZING | 1u << EVENT | 1u << STEPPING, "fmi3SetFloat64") != fmi3OK)
        return fmi3Error;
    if (n != n_values) return fail(instance, "%s got another number of values than of variables", "fmi3SetFloat64", 0.0);
    for (i = 0; i < n; i++) {
        const smc_variable *variable;
        const double value = values[i];
        if (references[i] >= SMC_VARIABLES) return fail(instance, "there is no variable %s%g", "", references[i]);
        variable = &smc_variables[references[i]];
        if (variable->kind != SMC_INPUT && variable->kind != SMC_PARAMETER
            && !(variable->kind == SMC_STATE && instance->state.mode <= INITIALIZING))
            return fail(instance, "%s cannot be set now", variable->name, 0.0);
        if (isnan(value) || value < variable->least || (variable->positive && !(value > 0.0)))
            return fail(instance, "%s = %g is out of its range", variable->name, value);
        instance->state.value[references[i]] = value;
        instance->state.outdated = fmi3True;
    }
    return fmi3OK;
}

/* Steps and events */

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 t, fmi3Float64 h, fmi3Boolean no_state_before,
    fmi3Boolean *event_needed, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *reached)
{
    Instance *instance = c;
    State *state;
    double end = t + h;
    (void)no_state_before;
    if (allowed(instance, 1u << STEPPING, "fmi3DoStep") != fmi3OK) return fmi3Error;
    state = &instance->state;
    *event_needed = *terminate = *early = fmi3False;
    *reached = t;
    if (!(h > 0.0)) return fail(instance, "fmi3DoStep: the step %s= %g s is not positive", "", h);
    if (fabs(t - state->value[SMC_TIME]) > CLOSE * SMC_DT)
        return fail(instance, "fmi3DoStep: the step begins at another time than the last one ended%s, %g s", "", t);
    while (due(state) < end - CLOSE * SMC_DT) {
        if (instance->events && instance->early_return) { /* the importer handles the sample */
            end = due(state) > t ? due(state) : t;
            *early = fmi3True;
            break;
        }
        if (complete(instance) != fmi3OK) {
            state->mode = FAILED;
            return fmi3Error;
        }
    }
    *event_needed = instance->events && due(state) <= end + CLOSE * SMC_DT;
    *reached = state->value[SMC_TIME] = end;
    return fmi3OK;
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *again, fmi3Boolean *terminate, fmi3Boolean *nominals,
    fmi3Boolean *values, fmi3Boolean *next_defined, fmi3Float64 *next)
{
    Instance *instance = c;
    if (allowed(instance, 1u << EVENT, "fmi3UpdateDiscreteStates") != fmi3OK) return fmi3Error;
    *again = *terminate = *nominals = *values = fmi3False;
    *next_defined = fmi3True;
    if (due(&instance->state) <= instance->state.value[SMC_TIME] + CLOSE * SMC_DT && complete(instance) != fmi3OK) {
        instance->state.mode = FAILED;
        return fmi3Error;
    }
    *next = due(&instance->state);
    return fmi3OK;
}

/* The state of an instance, to come back to it */

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *copy)
{
    Instance *instance = c;
    if (!instance || !copy) return fmi3Error;
    if (!*copy) *copy = malloc(sizeof(State));
    if (!*copy) return fail(instance, "%s: there is no memory", "fmi3GetFMUState", 0.0);
    memcpy(*copy, &instance->state, sizeof(State));
    return fmi3OK;
}

fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState copy)
{
    Instance *instance = c;
    if (!instance || !copy) return fmi3Error;
    memcpy(&instance->state, copy, sizeof(State));
    return fmi3OK;
}

fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *copy)
{
    if (!c) return fmi3Error;
    if (copy) {
        free(*copy);
        *copy = NULL;
    }
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState copy, size_t *size)
{
    (void)copy;
    *size = sizeof(State);
    return c ? fmi3OK : fmi3Error;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState copy, fmi3Byte bytes[], size_t size)
{
    if (!c || !copy || size < sizeof(State)) return fmi3Error;
    memcpy(bytes, copy, sizeof(State));
    return fmi3OK;
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *copy)
{
    Instance *instance = c;
    if (!instance || !copy) return fmi3Error;
    if (size != sizeof(State)) return fail(instance, "%s: the bytes are of another FMU", "fmi3DeserializeFMUState", 0.0);
    if (!*copy) *copy = malloc(sizeof(State));
    if (!*copy) return fmi3Error;
    memcpy(*copy, bytes, sizeof(State));
    return fmi3OK;
}

/* What an FMU of real numbers without clocks, arrays and continuous states does not have */

static fmi3Status none(fmi3Instance c, const char *name)
{
    Instance *instance = c;
    return instance ? fail(instance, "this FMU has no %s", name, 0.0) : fmi3Error;
}

#define NONE_OF(TYPE)                                                                                                 \
    fmi3Status fmi3Get##TYPE(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3##TYPE v[], size_t m)        \
    {                                                                                                                 \
        (void)r, (void)v, (void)m;                                                                                    \
        return n ? none(c, #TYPE) : fmi3OK;                                                                           \
    }                                                                                                                 \
    fmi3Status fmi3Set##TYPE(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3##TYPE v[], size_t m)  \
    {                                                                                                                 \
        (void)r, (void)v, (void)m;                                                                                    \
        return n ? none(c, #TYPE) : fmi3OK;                                                                           \
    }

NONE_OF(Float32)
NONE_OF(Int8)
NONE_OF(UInt8)
NONE_OF(Int16)
NONE_OF(UInt16)
NONE_OF(Int32)
NONE_OF(UInt32)
NONE_OF(Int64)
NONE_OF(UInt64)
NONE_OF(Boolean)
NONE_OF(String)

fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference r[], size_t n, size_t sizes[], fmi3Binary v[], size_t m)
{
    (void)r, (void)sizes, (void)v, (void)m;
    return n ? none(c, "Binary") : fmi3OK;
}

fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference r[], size_t n, const size_t sizes[],
    const fmi3Binary v[], size_t m)
{
    (void)r, (void)sizes, (void)v, (void)m;
    return n ? none(c, "Binary") : fmi3OK;
}

fmi3Status fmi3GetClock(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3Clock v[])
{
    (void)r, (void)v;
    return n ? none(c, "Clock") : fmi3OK;
}

fmi3Status fmi3SetClock(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3Clock v[])
{
    (void)r, (void)v;
    return n ? none(c, "Clock") : fmi3OK;
}

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance c, fmi3ValueReference r, size_t *n)
{
    (void)r, (void)n;
    return none(c, "dependencies per element");
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance c, fmi3ValueReference r, size_t i[], fmi3ValueReference on[],
    size_t j[], fmi3DependencyKind kinds[], size_t n)
{
    (void)r, (void)i, (void)on, (void)j, (void)kinds, (void)n;
    return none(c, "dependencies per element");
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance c, const fmi3ValueReference unknowns[], size_t n,
    const fmi3ValueReference knowns[], size_t m, const fmi3Float64 seed[], size_t n_seed, fmi3Float64 v[], size_t n_v)
{
    (void)unknowns, (void)n, (void)knowns, (void)m, (void)seed, (void)n_seed, (void)v, (void)n_v;
    return none(c, "derivatives");
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance c, const fmi3ValueReference unknowns[], size_t n,
    const fmi3ValueReference knowns[], size_t m, const fmi3Float64 seed[], size_t n_seed, fmi3Float64 v[], size_t n_v)
{
    (void)unknowns, (void)n, (void)knowns, (void)m, (void)seed, (void)n_seed, (void)v, (void)n_v;
    return none(c, "derivatives");
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3Int32 orders[],
    fmi3Float64 v[], size_t m)
{
    (void)r, (void)n, (void)orders, (void)v, (void)m;
    return none(c, "derivatives");
}

fmi3Status fmi3EnterConfigurationMode(fmi3Instance c) { return none(c, "structural parameters"); }
fmi3Status fmi3ExitConfigurationMode(fmi3Instance c) { return none(c, "structural parameters"); }
fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance c) { return none(c, "fmi3EvaluateDiscreteStates"); }

fmi3Status fmi3GetIntervalDecimal(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3Float64 v[],
    fmi3IntervalQualifier q[])
{
    (void)r, (void)n, (void)v, (void)q;
    return none(c, "Clock");
}

fmi3Status fmi3GetIntervalFraction(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3UInt64 counters[],
    fmi3UInt64 resolutions[], fmi3IntervalQualifier q[])
{
    (void)r, (void)n, (void)counters, (void)resolutions, (void)q;
    return none(c, "Clock");
}

fmi3Status fmi3GetShiftDecimal(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3Float64 v[])
{
    (void)r, (void)n, (void)v;
    return none(c, "Clock");
}

fmi3Status fmi3GetShiftFraction(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3UInt64 counters[],
    fmi3UInt64 resolutions[])
{
    (void)r, (void)n, (void)counters, (void)resolutions;
    return none(c, "Clock");
}

fmi3Status fmi3SetIntervalDecimal(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3Float64 v[])
{
    (void)r, (void)n, (void)v;
    return none(c, "Clock");
}

fmi3Status fmi3SetIntervalFraction(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3UInt64 counters[],
    const fmi3UInt64 resolutions[])
{
    (void)r, (void)n, (void)counters, (void)resolutions;
    return none(c, "Clock");
}

fmi3Status fmi3SetShiftDecimal(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3Float64 v[])
{
    (void)r, (void)n, (void)v;
    return none(c, "Clock");
}

fmi3Status fmi3SetShiftFraction(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3UInt64 counters[],
    const fmi3UInt64 resolutions[])
{
    (void)r, (void)n, (void)counters, (void)resolutions;
    return none(c, "Clock");
}

fmi3Status fmi3ActivateModelPartition(fmi3Instance c, fmi3ValueReference r, fmi3Float64 t)
{
    (void)r, (void)t;
    return none(c, "model partitions");
}

/* Model Exchange */

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance c) { return none(c, "Model Exchange"); }

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance c, fmi3Boolean no_state_before, fmi3Boolean *event,
    fmi3Boolean *terminate)
{
    (void)no_state_before, (void)event, (void)terminate;
    return none(c, "Model Exchange");
}

fmi3Status fmi3SetTime(fmi3Instance c, fmi3Float64 t)
{
    (void)t;
    return none(c, "Model Exchange");
}

fmi3Status fmi3SetContinuousStates(fmi3Instance c, const fmi3Float64 v[], size_t n)
{
    (void)v;
    return n ? none(c, "Model Exchange") : fmi3OK;
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance c, fmi3Float64 v[], size_t n)
{
    (void)v;
    return n ? none(c, "Model Exchange") : fmi3OK;
}

fmi3Status fmi3GetEventIndicators(fmi3Instance c, fmi3Float64 v[], size_t n)
{
    (void)v;
    return n ? none(c, "Model Exchange") : fmi3OK;
}

fmi3Status fmi3GetContinuousStates(fmi3Instance c, fmi3Float64 v[], size_t n)
{
    (void)v;
    return n ? none(c, "Model Exchange") : fmi3OK;
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance c, fmi3Float64 v[], size_t n)
{
    (void)v;
    return n ? none(c, "Model Exchange") : fmi3OK;
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance c, size_t *n)
{
    if (!c || !n) return fmi3Error;
    *n = 0;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance c, size_t *n)
{
    if (!c || !n) return fmi3Error;
    *n = 0;
    return fmi3OK;
}
