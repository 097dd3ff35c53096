/* smc_joint_law.h: the interface of a law of many joints in C, for laws that smc_mujoco calls and that it exports.
 *
 * SMC_JOINTS, the number of joints, is defined before this header. The law is one function, called once per control
 * sample. Its state belongs in memory[], which is 0 at the start of a run. It must not be in static variables, because
 * all simulations share them, on several threads. The law returns 0, or any other value to end the run. u is the command
 * before saturation. Vectors have one number for each joint, matrices are stored by rows.
 */
#ifndef SMC_JOINT_LAW_H
#define SMC_JOINT_LAW_H

#ifndef SMC_JOINTS
#error "define SMC_JOINTS, the number of joints, before smc_joint_law.h"
#elif SMC_JOINTS < 2
#error "define SMC_JOINTS as a number from 2 on: a law of one channel has smc_law.h"
#endif

#ifndef SMC_REAL
#define SMC_REAL double /* or float */
#endif
typedef SMC_REAL smc_real;

/* Inputs of a law: all joints at a sample, in SI units. The nominal model is M(x) x'' + h(x, v) = u. */
typedef struct {
    smc_real t;                          /* time of the sample */
    smc_real dt;                         /* control period */
    smc_real model;                      /* 1 if the law may use M, h and g, else 0 */
    smc_real x[SMC_JOINTS];              /* measured positions */
    smc_real v[SMC_JOINTS];              /* measured or estimated velocities */
    smc_real e[SMC_JOINTS];              /* x - r */
    smc_real de[SMC_JOINTS];             /* v - r' */
    smc_real r[SMC_JOINTS];              /* references */
    smc_real dr[SMC_JOINTS];             /* r' */
    smc_real ddr[SMC_JOINTS];            /* r'' */
    smc_real a[SMC_JOINTS];              /* estimated accelerations; r'' if the estimator gives none */
    smc_real limit[SMC_JOINTS];          /* bounds on |u|, may be infinite */
    smc_real M[SMC_JOINTS * SMC_JOINTS]; /* nominal mass matrix at the measured x; the identity without the model */
    smc_real h[SMC_JOINTS];              /* all forces but inertia and u; 0 without the model */
    smc_real g[SMC_JOINTS];              /* those of them that hold at rest: gravity and springs */
    /* Functions that only some laws call; NULL for the others. The first argument is `plant`. */
    void (*coriolis)(void *plant, const smc_real *w, smc_real *out); /* out = C(x, v) w, with M' - 2 C skew-symmetric */
    void (*jacobian)(void *plant, smc_real *out); /* out = 3 x SMC_JOINTS, the velocity of the tip is J v */
    void *plant;
} smc_joint_measurement;

/* Sets u, out[0] to out[SMC_JOINTS - 1], and s, the sliding variables, in the next SMC_JOINTS numbers of out.
 * gains[i * SMC_JOINTS + j] is gain i of joint j, in the order of their names. memory[j * m + i] is number i of the m
 * numbers that joint j has. */
int smc_law(const smc_joint_measurement *y, const smc_real *gains, smc_real *memory, smc_real *out);

/* Optional definitions: */
extern const char smc_law_gains[];  /* names and defaults of its gains, such as "lam=6,k1=3 5" for two joints */
extern const smc_real smc_law_defaults[]; /* those defaults, ready to be passed as gains[] */
extern const char smc_law_shared[]; /* names of gains that are one number for all joints, such as "rho,eps" */
extern const int smc_law_memory;    /* numbers of memory for each joint */
extern const int smc_law_real;      /* sizeof(smc_real) */
extern const int smc_law_modelled;  /* 1 if it needs the nominal model */
int smc_setup(void);                /* called once, before everything else; returns 0 on success */

#endif
