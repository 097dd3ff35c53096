/* smc_law.h: a control law in C, as smc_mujoco calls it and as it writes laws out.
 *
 * One function, called once a control sample and channel. It keeps what it remembers in memory[], which is 0 at the
 * start of a run and the channel's own, never in static variables: simulations and channels share those, on several
 * threads. It returns 0, or anything else to end the run. u is the command before saturation.
 */
#ifndef SMC_LAW_H
#define SMC_LAW_H

#ifndef SMC_REAL
#define SMC_REAL double /* or float */
#endif
typedef SMC_REAL smc_real;

/* What a law sees of its channel at a sample, SI units. */
typedef struct {
    smc_real t;        /* time of the sample */
    smc_real dt;       /* control period */
    smc_real x;        /* measured position */
    smc_real v;        /* measured or estimated velocity */
    smc_real e;        /* x - r */
    smc_real de;       /* v - r' */
    smc_real r;        /* reference */
    smc_real dr;       /* r' */
    smc_real ddr;      /* r'' */
    smc_real f;        /* nominal f and g of x'' = f + g u, at the measured x and v */
    smc_real g;
    smc_real a;        /* estimated acceleration; r'' where the estimator gives none */
    smc_real limit;    /* bound on |u|, may be infinite */
    smc_real model;    /* 1 where the law may use f and g, else 0 */
    smc_real surfaced; /* 1 where the scenario has a surface, and what it gives: */
    smc_real s;        /* sliding variable */
    smc_real eq;       /* acceleration of the error that keeps s constant */
    smc_real q;        /* of the joint without actuator that moves with this one: position, */
    smc_real dq;       /* velocity, */
    smc_real fq;       /* and nominal q'' = fq + gq u; all 0 without such a joint */
    smc_real gq;
} smc_measurement;

/* out[0] = u, out[1] = s, the sliding variable. gains[] in the order in which they were named. */
int smc_law(const smc_measurement *y, const smc_real *gains, smc_real *memory, smc_real *out);

/* A file may also say: */
extern const char smc_law_gains[]; /* names and defaults of its gains, such as "lam=6,k1=3" */
extern const int smc_law_memory;   /* how many numbers memory[] holds */
extern const int smc_law_real;     /* sizeof(smc_real); a library that does not say is taken to be of doubles */
extern const int smc_law_degree;   /* relative degree of the sliding variable that it needs, 1, 2 or 3 */
extern const int smc_law_modelled; /* 1 where it cannot do without the nominal model */
int smc_setup(void);               /* called once, before everything else; 0, or anything else where it fails */

#endif
