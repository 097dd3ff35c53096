/* A controller as another tool would export it, for FMI 2.0: torque = -k (theta - setpoint) - 2 omega - sum, with a sum
 * of its own over the errors of its steps. The input mode makes it fail: 1 crashes, 2 never ends, 3 gives NaN, 4 says why,
 * 5 rounds upwards ever after, 6 starts processes that never end and crashes. A gain above 100 fails too. */
#include <fenv.h>
#include <math.h>
#include <stdlib.h>
#include <unistd.h>
#include "fmi2FunctionTypes.h"

/* What FMPy looks for and never calls. */
#define NEVER(NAME) int NAME(void) { return fmi2Error; }
NEVER(fmi2GetTypesPlatform)
NEVER(fmi2GetVersion)
NEVER(fmi2SetDebugLogging)
NEVER(fmi2Reset)
NEVER(fmi2GetInteger)
NEVER(fmi2GetBoolean)
NEVER(fmi2GetString)
NEVER(fmi2SetInteger)
NEVER(fmi2SetBoolean)
NEVER(fmi2SetString)
NEVER(fmi2GetFMUstate)
NEVER(fmi2SetFMUstate)
NEVER(fmi2FreeFMUstate)
NEVER(fmi2SerializedFMUstateSize)
NEVER(fmi2SerializeFMUstate)
NEVER(fmi2DeSerializeFMUstate)
NEVER(fmi2GetDirectionalDerivative)
NEVER(fmi2SetRealInputDerivatives)
NEVER(fmi2GetRealOutputDerivatives)
NEVER(fmi2CancelStep)
NEVER(fmi2GetStatus)
NEVER(fmi2GetRealStatus)
NEVER(fmi2GetIntegerStatus)
NEVER(fmi2GetBooleanStatus)
NEVER(fmi2GetStringStatus)

enum { THETA, OMEGA, SETPOINT, MODE, TORQUE, K, COUNT };

typedef struct {
    double value[COUNT], sum;
    fmi2CallbackLogger log;
    fmi2ComponentEnvironment environment;
} Controller;

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
    const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging)
{
    Controller *c = calloc(1, sizeof *c);
    (void)name, (void)type, (void)guid, (void)resources, (void)visible, (void)logging;
    c->value[K] = 8.0;
    c->log = functions->logger;
    c->environment = functions->componentEnvironment;
    return c;
}

void fmi2FreeInstance(fmi2Component c) { free(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean a, fmi2Real b, fmi2Real d, fmi2Boolean e, fmi2Real f)
{
    (void)c, (void)a, (void)b, (void)d, (void)e, (void)f;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return c ? fmi2OK : fmi2Error; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return c ? fmi2OK : fmi2Error; }
fmi2Status fmi2Terminate(fmi2Component c) { return c ? fmi2OK : fmi2Error; }

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference at[], size_t n, const fmi2Real value[])
{
    for (size_t i = 0; i < n; i++) ((Controller *)c)->value[at[i]] = value[i];
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference at[], size_t n, fmi2Real value[])
{
    for (size_t i = 0; i < n; i++) value[i] = ((Controller *)c)->value[at[i]];
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component instance, fmi2Real t, fmi2Real h, fmi2Boolean no_state_before)
{
    Controller *c = instance;
    const double e = c->value[THETA] - c->value[SETPOINT], mode = c->value[MODE];
    (void)t, (void)no_state_before;
    if (mode == 1.0) *(volatile int *)0 = 1;
    while (mode == 2.0) sleep(1);
    if (mode == 4.0 || fabs(h - 0.01) > 1e-9) {
        if (c->log) c->log(c->environment, "c", fmi2Error, "error", mode == 4.0 ? "the licence has ended" : "another step");
        return fmi2Error;
    }
    c->value[TORQUE] = -c->value[K] * e - 2.0 * c->value[OMEGA] - c->sum;
    if (mode == 3.0) c->value[TORQUE] = NAN;
    if (mode == 6.0) {
        for (int i = 0; i < 20; i++)
            if (!fork()) pause();
        abort();
    }
    if (c->value[K] > 100.0) return fmi2Error;
    if (mode == 5.0) fesetround(FE_UPWARD);
    c->sum += 0.01 * e;
    return fmi2OK;
}
