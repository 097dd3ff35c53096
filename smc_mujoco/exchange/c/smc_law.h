/* smc_law.h: the interface of a control law in C, for laws that smc_mujoco calls and for laws that it exports.
 *
 * The law is one function, called once per channel and control sample. A law of many joints is called once per control
 * sample; its file defines SMC_JOINTS, their number, before this header. The state of a law belongs in memory[], which
 * is 0 at the start of a run and separate for each channel. It must not be in static variables, because all simulations
 * and channels share them, on several threads. The law returns 0, or any other value to end the run. u is the command
 * before saturation.
 */
#ifndef SMC_LAW_H
#define SMC_LAW_H

#ifndef SMC_REAL
#define SMC_REAL double /* or float */
#endif
typedef SMC_REAL smc_real;

#ifndef SMC_JOINTS

/* Inputs of a law of one channel: its channel at a sample, in SI units. */
typedef struct {
    smc_real t;           /* time of the sample */
    smc_real dt;          /* control period */
    smc_real x;           /* measured position */
    smc_real v;           /* measured or estimated velocity */
    smc_real e;           /* x - r */
    smc_real de;          /* v - r' */
    smc_real r;           /* reference */
    smc_real dr;          /* r' */
    smc_real ddr;         /* r'' */
    smc_real f;           /* nominal f and g of x'' = f + g u, at the measured x and v */
    smc_real g;
    smc_real a;           /* estimated acceleration; r'' if the estimator gives none */
    smc_real limit;       /* bound on |u|, may be infinite */
    smc_real model;       /* 1 if the law may use f and g, else 0 */
    smc_real has_surface; /* 1 if the scenario has a surface, else 0 */
    smc_real s;           /* sliding variable of the scenario's surface */
    smc_real v_eq;        /* acceleration of the error that keeps s constant */
    smc_real q;           /* position of the joint without actuator that this one moves; 0 without such a joint */
    smc_real dq;          /* its velocity */
    smc_real fq;          /* its nominal q'' = fq + gq u */
    smc_real gq;
} smc_measurement;

#elif SMC_JOINTS < 2
#error "define SMC_JOINTS as a number from 2 on: a law of one channel has none"
#else

/* Inputs of a law of many joints: all joints at a sample, in SI units. The nominal model is M(x) x'' + h(x, v) = u.
 * Vectors have one number for each joint, matrices are stored by rows.
 *
 * A body that flies has six: x, y, z in the axes of the world, and its attitude as a rotation vector. Of the attitude, v
 * is the angular velocity in the axes of the body, dr and ddr are derivatives of the rotation vector r, e is the rotation
 * vector from r to x, and de the angular velocity relative to the reference's, in the axes of the body. u is a force in
 * the axes of the world, and a torque in those of the body. */
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
} smc_measurement;

#endif

/* Sets out[0] = u and out[1] = s, the sliding variable. gains[] has the order of their names. Of many joints, out has
 * SMC_JOINTS numbers u and then as many s, gains[i * SMC_JOINTS + j] is gain i of joint j, and memory[j * m + i] is
 * number i of the m numbers that joint j has. */
int smc_law(const smc_measurement *y, const smc_real *gains, smc_real *memory, smc_real *out);

#ifdef SMC_JOINTS
/* Of a body that flies, in files that smc_mujoco writes from a scenario. */
void smc_pose(const smc_real *q, smc_real *x); /* sets x by the position and the unit quaternion w, x, y, z */
void smc_errors(const smc_real *x, const smc_real *v, const smc_real *r, const smc_real *dr, smc_real *e, smc_real *de);
void smc_actuators(const smc_measurement *y, const smc_real *u, smc_real *controls); /* of the plant: u within its limit */
#endif

/* What a scenario's Feedforward adds to u, a number for each joint, in files that smc_mujoco writes from such a scenario:
 * smc_law has added it already. Before the call compensation[] is the law's own u, which friction that grows with the
 * load reads. */
void smc_compensation(const smc_measurement *y, smc_real *compensation);

/* Optional definitions: */
extern const char smc_law_gains[]; /* names and defaults of its gains: "lam=6,k1=3", or "k1=3 5" of two joints */
extern const smc_real smc_law_defaults[]; /* those defaults, ready to be passed as gains[] */
extern const char smc_law_shared[]; /* names of gains that are one number for all joints, such as "rho,eps" */
extern const int smc_law_memory;   /* numbers of memory[] for each channel or joint */
extern const int smc_law_real;     /* sizeof(smc_real); without it a library is assumed to use doubles */
extern const int smc_law_degree;   /* relative degree of the sliding variable it needs: 1, 2 or 3 */
extern const int smc_law_modelled; /* 1 if it needs the nominal model */
int smc_setup(void);               /* called once, before everything else; returns 0 on success */

#endif
