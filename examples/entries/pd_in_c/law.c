/* u = -(kp e + kd de): a PD law. */
#include "smc_law.h"

const char smc_law_gains[] = "kp=25,kd=8";

int smc_law(const smc_measurement *y, const smc_real *gains, smc_real *memory, smc_real *out)
{
    (void)memory;
    out[1] = gains[0] * y->e + gains[1] * y->de;
    out[0] = -out[1];
    return 0;
}
