/* smc_fmu.h: what fmu.c knows of the controller in controller.c. */
#ifndef SMC_FMU_H
#define SMC_FMU_H

#include "smc_law.h"

/* Sets out[0] = s and out[1] = v_eq, as in smc_measurement. */
int smc_surface(const smc_measurement *y, const smc_real *gains, smc_real *memory, smc_real *out);

/* Inputs of a velocity estimator, in SI units. */
typedef struct {
    smc_real dt; /* control period */
    smc_real x;  /* measured position */
    smc_real v;  /* measured velocity */
} smc_reading;

/* Sets out[0] = v and out[1] = a, NaN if it does not estimate the acceleration. */
int smc_estimator(const smc_reading *y, const smc_real *gains, smc_real *memory, smc_real *out);

typedef enum { SMC_CLOCK, SMC_INPUT, SMC_COMPUTED, SMC_PARAMETER, SMC_CONSTANT, SMC_STATE } smc_kind;

typedef struct {
    const char *name;
    smc_kind kind;
    double start, least; /* at the start; the smallest value that it takes */
    int positive;        /* whether it must be greater than 0 */
} smc_variable;

extern const smc_variable smc_variables[];

enum { SMC_NOT_FINITE = -1 };

/* Runs estimator, surface and law on the variables, t s after the first sample. Returns 0, or the reason of a failure. */
int smc_controller(double *value, double t);

#endif
