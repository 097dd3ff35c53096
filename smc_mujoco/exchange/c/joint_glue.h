/* What glue.c needs for a law of many joints: its measurement, from the numbers of joint_law.py in double precision. */
enum { SMC_EACH = SMC_JOINTS, SMC_NUMBERS = (SMC_VECTORS + 2 + SMC_JOINTS) * SMC_JOINTS }; /* of vectors, M, h and g */
typedef smc_joint_measurement smc_seen;
/* a struct of other fields than smc_joint_law.h's is an error here */
typedef char smc_joint_measurement_as_in_smc_joint_law_h[
    __builtin_offsetof(smc_joint_measurement, g) == (3 + SMC_NUMBERS - SMC_JOINTS) * sizeof(smc_real) ? 1 : -1];

typedef long long smc_mujoco_function(const double *, const double *, double *, double *);

typedef struct { /* REQUESTS of joint_law.py: addresses of two functions and of their parameters, force per unit of u */
    double smc_coriolis, smc_jacobian, smc_parameters, smc_unit;
} smc_mujoco_requests;

typedef struct { /* HEAD of joint_law.py, with the address of smc_mujoco_requests, or 0, and then the arrays */
    double smc_t, smc_dt, smc_model, smc_dynamics, smc_joints, smc_arrays[SMC_NUMBERS];
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

static void smc_mujoco_see(const double *smc_in, smc_mujoco_plant *smc_plant, smc_seen *smc_y)
{
    const smc_mujoco_measurement *const smc_given = (const void *)smc_in;
    smc_real *const smc_to = (smc_real *)(void *)((char *)smc_y + __builtin_offsetof(smc_joint_measurement, x));
    int smc_i;
    smc_plant->smc_requests = (const smc_mujoco_requests *)(__INTPTR_TYPE__)smc_given->smc_dynamics;
    smc_plant->without_tip = 0;
    smc_y->t = (smc_real)smc_given->smc_t, smc_y->dt = (smc_real)smc_given->smc_dt;
    smc_y->model = (smc_real)smc_given->smc_model;
    for (smc_i = 0; smc_i < SMC_NUMBERS; smc_i++) smc_to[smc_i] = (smc_real)smc_given->smc_arrays[smc_i];
    smc_y->coriolis = smc_mujoco_coriolis, smc_y->jacobian = smc_mujoco_jacobian, smc_y->plant = smc_plant;
}
