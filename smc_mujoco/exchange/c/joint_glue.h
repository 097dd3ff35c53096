/* What glue.c needs for a law of many joints: its measurement, from the numbers of joint_law.py in double precision:
 * a header of SMC_HEADER numbers (t, dt, model, the address of what `coriolis` and `jacobian` call, the number of
 * joints), then SMC_VECTORS vectors, M, h, g.
 */
enum { SMC_EACH = SMC_JOINTS, SMC_NUMBERS = (SMC_VECTORS + 2 + SMC_JOINTS) * SMC_JOINTS }; /* of vectors, M, h and g */
typedef smc_joint_measurement smc_seen;
/* a struct of other fields than smc_joint_law.h's is an error here */
typedef char smc_joint_measurement_as_in_smc_joint_law_h[
    __builtin_offsetof(smc_joint_measurement, g) == (3 + SMC_NUMBERS - SMC_JOINTS) * sizeof(smc_real) ? 1 : -1];

typedef long long smc_mujoco_function(const double *, const double *, double *, double *);

typedef struct {
    const double *own; /* addresses of two functions and of their parameters, force per unit of u; NULL without model */
    int without_tip;   /* the law asked for the Jacobian of a tip, and there is none */
} smc_mujoco_plant;

static long long smc_mujoco_ask(const double *smc_own, int smc_i, const double *smc_in, double *smc_found)
{
    smc_mujoco_function *const smc_called = (smc_mujoco_function *)(__INTPTR_TYPE__)smc_own[smc_i];
    return smc_called(smc_in, (const double *)(__INTPTR_TYPE__)smc_own[2], 0, smc_found);
}

static void smc_mujoco_coriolis(void *smc_plant, const smc_real *smc_w, smc_real *smc_out)
{
    const double *const smc_own = ((const smc_mujoco_plant *)smc_plant)->own;
    double smc_in[SMC_JOINTS], smc_found[SMC_JOINTS];
    int smc_i;
    for (smc_i = 0; smc_i < SMC_JOINTS; smc_i++) smc_in[smc_i] = (double)smc_w[smc_i], smc_found[smc_i] = 0.0;
    if (smc_own) smc_mujoco_ask(smc_own, 0, smc_in, smc_found);
    for (smc_i = 0; smc_i < SMC_JOINTS; smc_i++)
        smc_out[smc_i] = (smc_real)(smc_own ? smc_found[smc_i] / smc_own[3] : smc_found[smc_i]);
}

static void smc_mujoco_jacobian(void *smc_plant, smc_real *smc_out)
{
    smc_mujoco_plant *const smc_asked = smc_plant;
    double smc_found[3 * SMC_JOINTS];
    int smc_i;
    for (smc_i = 0; smc_i < 3 * SMC_JOINTS; smc_i++) smc_found[smc_i] = 0.0;
    if (!smc_asked->own || smc_mujoco_ask(smc_asked->own, 1, 0, smc_found)) smc_asked->without_tip = 1;
    for (smc_i = 0; smc_i < 3 * SMC_JOINTS; smc_i++) smc_out[smc_i] = (smc_real)smc_found[smc_i];
}

static void smc_mujoco_see(const double *smc_in, smc_mujoco_plant *smc_plant, smc_seen *smc_y)
{
    smc_real *const smc_to = (smc_real *)(void *)((char *)smc_y + __builtin_offsetof(smc_joint_measurement, x));
    int smc_i;
    smc_plant->own = (const double *)(__INTPTR_TYPE__)smc_in[3];
    smc_plant->without_tip = 0;
    smc_y->t = (smc_real)smc_in[0], smc_y->dt = (smc_real)smc_in[1], smc_y->model = (smc_real)smc_in[2];
    for (smc_i = 0; smc_i < SMC_NUMBERS; smc_i++) smc_to[smc_i] = (smc_real)smc_in[SMC_HEADER + smc_i];
    smc_y->coriolis = smc_mujoco_coriolis, smc_y->jacobian = smc_mujoco_jacobian, smc_y->plant = smc_plant;
}
