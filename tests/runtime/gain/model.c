/* w = 2*u: a model without states and parameters. */
#include "model.h"

const double model_start[] = {1.0};
const double model_nominal[] = {1.0};
const unsigned char model_tunable[] = {0};
const char *const model_assertion_text[] = {""};
const int model_jacobian_xu_column[] = {0, 1};
const int model_jacobian_xu_row[] = {0};
const int model_jacobian_p_column[] = {0};
const int model_jacobian_p_row[] = {0};

int model_derivatives(double t, const double *x, const double *u, const double *p, double *xdot) {
    (void)t, (void)x, (void)u, (void)p, (void)xdot;
    return 0;
}

int model_algebraics(double t, const double *x, const double *u, const double *p, double *w) {
    (void)t, (void)x, (void)p;
    w[0] = 2.0 * u[0];
    return 0;
}

int model_jacobian_xu(double t, const double *x, const double *u, const double *p,
                      double *nonzeros) {
    (void)t, (void)x, (void)u, (void)p;
    nonzeros[0] = 2.0;
    return 0;
}
