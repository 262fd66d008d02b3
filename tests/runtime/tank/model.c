/* level' = u, valid while level <= 1. */
#include "model.h"

const double model_start[] = {0.0, 1.0};
const double model_nominal[] = {1.0};
const unsigned char model_tunable[] = {0};
const char *const model_assertion_text[] = {"The tank is more than 100% full"};
const int model_jacobian_xu_column[] = {0, 0, 1};
const int model_jacobian_xu_row[] = {0};
const int model_jacobian_p_column[] = {0};
const int model_jacobian_p_row[] = {0};

int model_derivatives(double t, const double *x, const double *u, const double *p, double *xdot) {
    (void)t, (void)x, (void)p;
    xdot[0] = u[0];
    return 0;
}

int model_assertions(double t, const double *x, const double *u, const double *p, double *holds) {
    (void)t, (void)u, (void)p;
    holds[0] = x[0] <= 1.0;
    return 0;
}

int model_jacobian_xu(double t, const double *x, const double *u, const double *p,
                      double *nonzeros) {
    (void)t, (void)x, (void)u, (void)p;
    nonzeros[0] = 1.0;
    return 0;
}
