/* smc_loop.h: a controller as functions on one array of numbers, which its caller keeps. Nothing is allocated. */
#ifndef SMC_LOOP_H
#define SMC_LOOP_H
#ifdef __cplusplus
extern "C" {
#endif

int smc_loop_numbers(void);  /* length of the array */
int smc_loop_joints(void);   /* 1, or the number of joints of a law of many */
double smc_loop_period(void); /* s: call smc_loop_step this often */

void smc_loop_start(double *value); /* gains, bound and estimator of the export, memory at 0 */

/* The place of a variable, such as "x" or "law.k1", or -1: x, v, r, dr, u; of many joints "x[1]" and so on. */
int smc_loop_index(const char *name);

const char *smc_loop_parameter(int i); /* the name of parameter i = 0, 1, ...; NULL after the last */
int smc_loop_set(double *value, int index, double number); /* returns 1, and sets nothing, if it is out of range */

/* Runs the law on x, v, r and dr as they are in the array, and sets u, within its bound. Returns 0, or why it fails. */
int smc_loop_step(double *value);

#ifdef __cplusplus
}
#endif
#endif
