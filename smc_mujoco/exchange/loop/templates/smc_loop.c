/* smc_loop.c: see smc_loop.h. The last number of the array counts the samples. */
#include "smc_loop.h"
#include "controller.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

enum { SMC_SAMPLES = SMC_VARIABLES };

int smc_loop_numbers(void)
{
    return SMC_VARIABLES + 1;
}

int smc_loop_joints(void)
{
#ifdef SMC_JOINTS
    return SMC_JOINTS;
#else
    return 1;
#endif
}

double smc_loop_period(void)
{
    return SMC_DT;
}

void smc_loop_start(double *value)
{
    for (int i = 0; i < SMC_VARIABLES; i++) value[i] = smc_variables[i].start;
    value[SMC_SAMPLES] = 0.0;
}

int smc_loop_index(const char *name)
{
    for (int i = 0; i < SMC_VARIABLES; i++)
        if (!strcmp(smc_variables[i].name, name)) return i;
    return -1;
}

const char *smc_loop_parameter(int i)
{
    for (int k = 0; k < SMC_VARIABLES; k++)
        if (smc_variables[k].kind == SMC_PARAMETER && i-- == 0) return smc_variables[k].name;
    return NULL;
}

int smc_loop_set(double *value, int index, double number)
{
    if (index < 0 || index >= SMC_VARIABLES || isnan(number)) return 1;
    const smc_variable *variable = &smc_variables[index];
    if (number < variable->least || (variable->positive && number == 0.0)) return 1;
    value[index] = number;
    return 0;
}

int smc_loop_step(double *value)
{
    const int failure = smc_controller(value, value[SMC_SAMPLES] * SMC_DT);
    value[SMC_SAMPLES] += 1.0;
    return failure;
}
