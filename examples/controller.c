/* super_twisting for one C Caller block: call controller_start() once, then controller() every millisecond. */
#include "super_twisting.c"

static const double gains[] = {[GAIN_k1] = 5.0, [GAIN_k2] = 8.0, [GAIN_c] = 2.5, [GAIN_w_max] = INFINITY};
static double memory[8]; /* at least the memory[] that the top of super_twisting.c names */

void controller_start(void)
{
    for (int i = 0; i < 8; i++) memory[i] = 0.0;
}

void controller(double t, double x, double v, double r, double dr, double *u, double *s)
{
    smc_measurement y = {0};
    double out[2];
    y.t = t, y.dt = 0.001, y.limit = 6.0;
    y.x = x, y.v = v, y.r = r, y.dr = dr, y.e = x - r, y.de = v - dr;
    smc_law(&y, gains, memory, out);
    *u = fmin(fmax(out[0], -6.0), 6.0);
    *s = out[1];
}
