/* The interface between the runtime and the generated model code.
 *
 * `model_data.h` and `model.c` are generated for every model; all other files are the same for all
 * models. The model is the explicit ordinary differential equation
 *
 *     der(x) = f(t, x, u, p),    w = g(t, x, u, p)
 *
 * with continuous states x, inputs u, parameters p, outputs and local variables w, in SI units.
 *
 * Value references:  x 0..NX-1 | der(x) NX..2*NX-1 | u (NU) | p (NP) | w (NW) | time (one)
 *
 * Every function returns 0 on success and keeps no data between calls, so instances and threads do
 * not meet. Arrays of length zero are generated with one dummy element.
 */
#ifndef MODEL_H
#define MODEL_H

/* MODEL_IDENTIFIER, MODEL_TOKEN (strings); NX, NU, NP, NW, NA, NNZ_XU, NNZ_P (integers);
 * STARTS_FOLLOW, 1 if start values of states follow parameters, inputs or the start time. */
#include "model_data.h"
#ifndef STARTS_FOLLOW
#define STARTS_FOLLOW 0
#endif

/* First value reference of every group of variables. */
enum {
    REFERENCE_X = 0,
    REFERENCE_XDOT = NX,
    REFERENCE_U = 2 * NX,
    REFERENCE_P = REFERENCE_U + NU,
    REFERENCE_W = REFERENCE_P + NP,
    REFERENCE_TIME = REFERENCE_W + NW
};

extern const double model_start[];           /* NX+NU+NP: start values of x, u, p */
extern const double model_nominal[];         /* NX: nominal values of x, positive */
extern const unsigned char model_tunable[];  /* NP: 1 tunable, 0 fixed */
extern const char *const model_assertion_text[]; /* NA */

/* start: NX values. Only if STARTS_FOLLOW; x is not read. */
int model_starts(double t, const double *x, const double *u, const double *p, double *start);

/* xdot: NX values. */
int model_derivatives(double t, const double *x, const double *u, const double *p, double *xdot);

/* w: NW values. */
int model_algebraics(double t, const double *x, const double *u, const double *p, double *w);

/* holds: NA values, 0 where the assertion is violated. */
int model_assertions(double t, const double *x, const double *u, const double *p, double *holds);

/* Jacobian of [xdot; w] (rows 0..NX+NW-1) with respect to [x, u], in compressed columns. */
extern const int model_jacobian_xu_column[]; /* NX+NU+1 */
extern const int model_jacobian_xu_row[];    /* NNZ_XU */
int model_jacobian_xu(double t, const double *x, const double *u, const double *p,
                      double *nonzeros);

/* values: NX+NW values of xdot and w, then the nonzeros of that Jacobian; bit for bit as above. */
int model_linearisation(double t, const double *x, const double *u, const double *p,
                        double *values);

/* Jacobian of [xdot; w] with respect to p, in compressed columns. */
extern const int model_jacobian_p_column[]; /* NP+1 */
extern const int model_jacobian_p_row[];    /* NNZ_P */
int model_jacobian_p(double t, const double *x, const double *u, const double *p,
                     double *nonzeros);

#endif
