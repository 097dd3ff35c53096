/* A loop around the controller: it reads a line for each sample, the positions, then the velocities if the controller
 * takes them, then the references, their rates and, if it takes them, their accelerations; it writes the commands. Put
 * your sensors in place of measured(), your motors in place of commanded(), and call the body of the loop every
 * smc_loop_period() seconds. */
#include "smc_loop.h"

#include <stdio.h>

enum { MAX_NUMBERS = @numbers@, JOINTS = @joints@ };
static double value[MAX_NUMBERS]; /* smc_loop_numbers() of them */

static const char *const inputs[] = {@inputs@};
static const char *const outputs[] = {@outputs@};

static int measured(void)
{
    for (unsigned i = 0; i < sizeof inputs / sizeof *inputs; i++)
        if (scanf("%lf", &value[smc_loop_index(inputs[i])]) != 1) return 0;
    return 1;
}

static void commanded(void)
{
    for (int i = 0; i < JOINTS; i++) printf("%.17g%c", value[smc_loop_index(outputs[i])], i + 1 < JOINTS ? ' ' : '\n');
}

int main(void)
{
    smc_loop_start(value);
    while (measured()) {
        if (smc_loop_step(value)) return 1; /* stop the motors: the law gave no finite number */
        commanded();
    }
    return 0;
}
