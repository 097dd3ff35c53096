/* Calls the law, whatever its smc_real, as the callback calls laws: inputs, gains, memory and outputs are doubles.
 * Compiled in one unit with the law itself, so that a law of another type is a compiler error. All other names, also
 * of macros, are the law's: this file includes no header of the C library, and its names begin with smc_.
 */
#include SMC_SOURCE
#include "smc_law.h"
/* a struct of other fields than smc_law.h's is an error here */
#ifdef SMC_JOINTS
enum { SMC_EACH = SMC_JOINTS, SMC_NUMBERS = (SMC_VECTORS + 2 + SMC_JOINTS) * SMC_JOINTS }; /* of vectors, M, h and g */
typedef char smc_measurement_as_in_smc_law_h[
    __builtin_offsetof(smc_measurement, g) == (3 + SMC_NUMBERS - SMC_JOINTS) * sizeof(smc_real) ? 1 : -1];
#else
enum { SMC_EACH = 1 }; /* numbers of each gain, of each slot of memory, of u and of s */
typedef char smc_measurement_as_in_smc_law_h[sizeof(smc_measurement) == SMC_INPUTS * sizeof(smc_real) ? 1 : -1];
#endif

#define SMC_BEYOND (1LL << 40) /* codes of FAULTS in shared_library.py: wrote beyond its memory; one more: beyond out */

extern int smc_mujoco_gains, smc_mujoco_memory; /* set when the library is loaded */
extern const int smc_mujoco_joints;
long long smc_mujoco_entry(const double *smc_in, const double *smc_gains, double *smc_memory, double *smc_out);

int smc_mujoco_gains = 0, smc_mujoco_memory = 0;

/* Calls the law with numbers of its type, between guards that show whether it writes beyond them. */
static long long smc_mujoco_convert(
    const smc_measurement *smc_y, const double *smc_gains, double *smc_memory, double *smc_out)
{
    int (*const smc_called)(const smc_measurement *, const smc_real *, smc_real *, smc_real *) = SMC_SYMBOL;
    enum { SMC_PLAY = 16, SMC_OUT = 2 * SMC_EACH }; /* numbers around the law's own */
    const int smc_many = smc_mujoco_gains * SMC_EACH, smc_slots = smc_mujoco_memory * SMC_EACH;
    const smc_real smc_guard = (smc_real)-7.25;
    smc_real smc_g[smc_many + SMC_PLAY], smc_fenced[smc_slots + 2 * SMC_PLAY], smc_found[SMC_OUT + 2 * SMC_PLAY];
    smc_real *const smc_m = smc_fenced + SMC_PLAY, *const smc_o = smc_found + SMC_PLAY;
    long long smc_code;
    int smc_i;
    for (smc_i = 0; smc_i < smc_many; smc_i++) smc_g[smc_i] = (smc_real)smc_gains[smc_i];
    for (smc_i = 0; smc_i < smc_slots; smc_i++) smc_m[smc_i] = (smc_real)smc_memory[smc_i];
    for (smc_i = 0; smc_i < SMC_PLAY; smc_i++) {
        smc_g[smc_many + smc_i] = (smc_real)smc_out[0];
        smc_fenced[smc_i] = smc_m[smc_slots + smc_i] = smc_found[smc_i] = smc_o[SMC_OUT + smc_i] = smc_guard;
    }
    for (smc_i = 0; smc_i < SMC_OUT; smc_i++) smc_o[smc_i] = (smc_real)smc_out[smc_i];
    smc_code = smc_called(smc_y, smc_g, smc_m, smc_o);
    for (smc_i = 0; smc_i < smc_slots; smc_i++) smc_memory[smc_i] = (double)smc_m[smc_i];
    for (smc_i = 0; smc_i < SMC_OUT; smc_i++) smc_out[smc_i] = (double)smc_o[smc_i];
    for (smc_i = 0; smc_i < SMC_PLAY; smc_i++) {
        if (smc_found[smc_i] != smc_guard || smc_o[SMC_OUT + smc_i] != smc_guard) smc_code = SMC_BEYOND + 1;
        if (smc_fenced[smc_i] != smc_guard || smc_m[smc_slots + smc_i] != smc_guard) return SMC_BEYOND;
    }
    return smc_code;
}

static long long smc_mujoco_with(
    const smc_measurement *smc_y, const double *smc_gains, double *smc_memory, double *smc_out)
{
    int (*const smc_called)(const smc_measurement *, const smc_real *, smc_real *, smc_real *) = SMC_SYMBOL;
    if (sizeof(smc_real) != sizeof(double)) return smc_mujoco_convert(smc_y, smc_gains, smc_memory, smc_out);
    return smc_called(smc_y, (const void *)smc_gains, (void *)smc_memory, (void *)smc_out);
}

#ifdef SMC_JOINTS
const int smc_mujoco_joints = SMC_JOINTS;

/* The measurement of a law of many joints, from the numbers of joint_law.py in double precision. */
typedef long long smc_mujoco_function(const double *, const double *, double *, double *);

typedef struct { /* HANDLE of joint_law.py: addresses of two functions and of their parameters, force per unit of u */
    double smc_coriolis, smc_jacobian, smc_parameters, smc_unit;
} smc_mujoco_requests;

typedef struct { /* HEAD of joint_law.py, with the address of smc_mujoco_requests, or 0, and then the arrays */
    double smc_t, smc_dt, smc_model, smc_dynamics, smc_joints, smc_driven, smc_arrays[SMC_NUMBERS];
} smc_mujoco_measurement;

typedef struct {
    const smc_mujoco_requests *smc_requests; /* NULL without model */
    int without_tip;                         /* the law asked for the Jacobian of a tip, and there is none */
} smc_mujoco_plant;

static long long smc_mujoco_ask(
    const smc_mujoco_requests *smc_requests, double smc_function, const double *smc_in, double *smc_found)
{
    smc_mujoco_function *const smc_called = (smc_mujoco_function *)(__INTPTR_TYPE__)smc_function;
    return smc_called(smc_in, (const double *)(__INTPTR_TYPE__)smc_requests->smc_parameters, 0, smc_found);
}

static void smc_mujoco_coriolis(void *smc_plant, const smc_real *smc_w, smc_real *smc_out)
{
    const smc_mujoco_requests *const smc_asked = ((const smc_mujoco_plant *)smc_plant)->smc_requests;
    double smc_in[SMC_JOINTS], smc_found[SMC_JOINTS];
    int smc_i;
    for (smc_i = 0; smc_i < SMC_JOINTS; smc_i++) smc_in[smc_i] = (double)smc_w[smc_i], smc_found[smc_i] = 0.0;
    if (smc_asked) smc_mujoco_ask(smc_asked, smc_asked->smc_coriolis, smc_in, smc_found);
    for (smc_i = 0; smc_i < SMC_JOINTS; smc_i++)
        smc_out[smc_i] = (smc_real)(smc_asked ? smc_found[smc_i] / smc_asked->smc_unit : smc_found[smc_i]);
}

static void smc_mujoco_jacobian(void *smc_plant, smc_real *smc_out)
{
    smc_mujoco_plant *const smc_of = smc_plant;
    const smc_mujoco_requests *const smc_asked = smc_of->smc_requests;
    double smc_found[3 * SMC_JOINTS];
    int smc_i;
    for (smc_i = 0; smc_i < 3 * SMC_JOINTS; smc_i++) smc_found[smc_i] = 0.0;
    if (!smc_asked || smc_mujoco_ask(smc_asked, smc_asked->smc_jacobian, 0, smc_found)) smc_of->without_tip = 1;
    for (smc_i = 0; smc_i < 3 * SMC_JOINTS; smc_i++) smc_out[smc_i] = (smc_real)smc_found[smc_i];
}

static void smc_mujoco_see(const double *smc_in, smc_mujoco_plant *smc_plant, smc_measurement *smc_y)
{
    const smc_mujoco_measurement *const smc_given = (const void *)smc_in;
    smc_real *const smc_to = (smc_real *)(void *)((char *)smc_y + __builtin_offsetof(smc_measurement, x));
    int smc_i;
    smc_plant->smc_requests = (const smc_mujoco_requests *)(__INTPTR_TYPE__)smc_given->smc_dynamics;
    smc_plant->without_tip = 0;
    smc_y->t = (smc_real)smc_given->smc_t, smc_y->dt = (smc_real)smc_given->smc_dt;
    smc_y->model = (smc_real)smc_given->smc_model;
    for (smc_i = 0; smc_i < SMC_NUMBERS; smc_i++) smc_to[smc_i] = (smc_real)smc_given->smc_arrays[smc_i];
    smc_y->coriolis = smc_mujoco_coriolis, smc_y->jacobian = smc_mujoco_jacobian, smc_y->plant = smc_plant;
}

static long long smc_mujoco_call(const double *smc_in, const double *smc_gains, double *smc_memory, double *smc_out)
{
    union { smc_measurement smc_y; unsigned char smc_byte[sizeof(smc_measurement)]; } smc_given, smc_before;
    smc_mujoco_plant smc_plant;
    long long smc_code;
    unsigned smc_i;
    smc_mujoco_see(smc_in, &smc_plant, &smc_given.smc_y);
    smc_before = smc_given;
    smc_code = smc_mujoco_with(&smc_given.smc_y, smc_gains, smc_memory, smc_out);
    for (smc_i = 0; smc_i < sizeof(smc_measurement); smc_i++)
        if (smc_given.smc_byte[smc_i] != smc_before.smc_byte[smc_i]) return SMC_BEYOND + 4;
    return smc_plant.without_tip ? SMC_BEYOND + 3 : smc_code;
}
#else
const int smc_mujoco_joints = 0;

static long long smc_mujoco_call(const double *smc_in, const double *smc_gains, double *smc_memory, double *smc_out)
{
    smc_real smc_given[SMC_INPUTS];
    int smc_i;
    if (sizeof(smc_real) == sizeof(double))
        return smc_mujoco_with((const void *)smc_in, smc_gains, smc_memory, smc_out);
    for (smc_i = 0; smc_i < SMC_INPUTS; smc_i++) smc_given[smc_i] = (smc_real)smc_in[smc_i];
    return smc_mujoco_with((const void *)smc_given, smc_gains, smc_memory, smc_out);
}
#endif

long long smc_mujoco_entry(const double *smc_in, const double *smc_gains, double *smc_memory, double *smc_out)
{
    int smc_i;
    for (smc_i = 0; smc_i < 2 * SMC_EACH; smc_i++) smc_out[smc_i] = __builtin_nan(""); /* unset, it ends the run */
    return smc_mujoco_call(smc_in, smc_gains, smc_memory, smc_out);
}
