/* x' = exp(x), solved by -log(1 - t): infinite at t = 1. Output: log(x + 1). */
#include "model.h"

#include <math.h>

const double model_start[] = {0.0};
const double model_nominal[] = {1.0};
const unsigned char model_tunable[] = {0};
const char *const model_assertion_text[] = {""};
const int model_jacobian_xu_column[] = {0, 2};
const int model_jacobian_xu_row[] = {0, 1};
const int model_jacobian_p_column[] = {0};
const int model_jacobian_p_row[] = {0};

int model_derivatives(double t, const double *x, const double *u, const double *p, double *xdot) {
    (void)t, (void)u, (void)p;
    xdot[0] = exp(x[0]);
    return 0;
}

int model_algebraics(double t, const double *x, const double *u, const double *p, double *w) {
    (void)t, (void)u, (void)p;
    w[0] = log(x[0] + 1.0);
    return 0;
}

int model_jacobian_xu(double t, const double *x, const double *u, const double *p,
                      double *nonzeros) {
    (void)t, (void)u, (void)p;
    nonzeros[0] = exp(x[0]);
    nonzeros[1] = 1.0 / (x[0] + 1.0);
    return 0;
}
