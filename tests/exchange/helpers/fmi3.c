/* A controller of FMI 3.0 as another tool may write it: u = -Kp x - 4 v - integral of x, every 5 ms, and 0 unless its
 * Boolean input is true and its mode is 2. */
#include <math.h>
#include <stdlib.h>

#include "fmi3Functions.h"

typedef struct {
    double numbers[7], integral; /* by value reference */
    int enable, mode;
} servo;

fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean events,
    fmi3Boolean early, const fmi3ValueReference intermediate[], size_t n, fmi3InstanceEnvironment environment,
    fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update)
{
    servo *s = calloc(1, sizeof *s);
    s->numbers[5] = 20.0;
    return s;
}

void fmi3FreeInstance(fmi3Instance one) { free(one); }
fmi3Status fmi3ExitInitializationMode(fmi3Instance one) { return fmi3OK; }
fmi3Status fmi3Terminate(fmi3Instance one) { return fmi3OK; }
fmi3Status fmi3EnterInitializationMode(
    fmi3Instance one, fmi3Boolean toleranced, fmi3Float64 tolerance, fmi3Float64 start, fmi3Boolean stops, fmi3Float64 stop)
{
    return fmi3OK;
}

fmi3Status fmi3SetFloat64(
    fmi3Instance one, const fmi3ValueReference at[], size_t n, const fmi3Float64 values[], size_t count)
{
    for (size_t i = 0; i < n; i++) ((servo *)one)->numbers[at[i]] = values[i];
    return fmi3OK;
}

fmi3Status fmi3GetFloat64(fmi3Instance one, const fmi3ValueReference at[], size_t n, fmi3Float64 values[], size_t count)
{
    for (size_t i = 0; i < n; i++) values[i] = ((servo *)one)->numbers[at[i]];
    return fmi3OK;
}

fmi3Status fmi3SetBoolean(
    fmi3Instance one, const fmi3ValueReference at[], size_t n, const fmi3Boolean values[], size_t count)
{
    ((servo *)one)->enable = values[0];
    return fmi3OK;
}

fmi3Status fmi3SetInt32(fmi3Instance one, const fmi3ValueReference at[], size_t n, const fmi3Int32 values[], size_t count)
{
    ((servo *)one)->mode = values[0];
    return fmi3OK;
}

fmi3Status fmi3DoStep(
    fmi3Instance one, fmi3Float64 t, fmi3Float64 h, fmi3Boolean no_rollback, fmi3Boolean *event, fmi3Boolean *terminate,
    fmi3Boolean *early, fmi3Float64 *last)
{
    servo *s = one;
    if (fabs(h - 0.005) > 1e-9) return fmi3Error;
    s->integral += h * s->numbers[1];
    s->numbers[6] =
        s->enable && s->mode == 2 ? -s->numbers[5] * s->numbers[1] - 4.0 * s->numbers[2] - s->integral : 0.0;
    *event = *terminate = *early = fmi3False;
    *last = t + h;
    return fmi3OK;
}
