/* Rosenbrock integrator for stiff ordinary differential equations, used by Co-Simulation.
 *
 * RODAS: 6 stages, order 4 with an embedded method of order 3, L-stable and stiffly accurate, with
 * the exact Jacobian of the model. Source: E. Hairer and G. Wanner, Solving Ordinary Differential
 * Equations II, 2nd ed., Springer 1996, section IV.7 and the code RODAS.
 */
#ifndef INTEGRATOR_H
#define INTEGRATOR_H

#include "memory.h"
#include "model.h"

typedef enum {
    OUTCOME_REACHED,       /* the end of the interval */
    OUTCOME_NOT_FINITE,    /* the model gives no finite value; see `bad` */
    OUTCOME_STEP_TOO_SMALL,
    OUTCOME_TOO_MANY_STEPS,
    OUTCOME_ASSERTION      /* an assertion is violated; see `bad` */
} Outcome;

/* Work space; nothing in it survives a call, so it is no part of an instance's state. */
typedef struct {
    double jacobian[NNZ_XU + 1];
    double matrix[NX * NX + 1]; /* I/(h*gamma) - df/dx, factorised, row by row */
    int pivot[NX + 1];
    double f[NX + 1];     /* derivatives at the start of the step */
    double dfdt[NX + 1];  /* their partial derivative with respect to time */
    double k[6][NX + 1];  /* stages */
    double x[NX + 1];     /* argument of a stage, then the new states */
    double holds[NA + 1];
    int bad;      /* value reference, or number of the assertion */
    double t_bad; /* time at which it was found */
} Rosenbrock;

enum { MAXIMAL_STEPS = 100000 }; /* internal steps in one call, rejected ones included */

/* Advances `*t` and `x` to `end` with constant inputs. The local error of no state exceeds
 * tolerance * (nominal + |x|). Whatever the outcome, `*t`, `x` and `*memory` are those of the last
 * accepted step. */
Outcome rosenbrock_integrate(Rosenbrock *r, const double *u, const double *p, double tolerance,
                             double end, double *t, double *x, Memory *memory);

/* Number (from 0) of the first assertion that is violated, or -1. `holds` is work space. */
int first_violated(double t, const double *x, const double *u, const double *p, double *holds);

#endif
