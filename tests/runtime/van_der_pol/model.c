/* x1' = x2, epsilon*x2' = (1 - x1^2)*x2 - x1.
 * Source: E. Hairer and G. Wanner, Solving Ordinary Differential Equations II, section IV.10. */
#include "model.h"

const double model_start[] = {2.0, -0.66, 1e-6};
const double model_nominal[] = {1.0, 1.0};
const unsigned char model_tunable[] = {0};
const char *const model_assertion_text[] = {""};
const int model_jacobian_xu_column[] = {0, 1, 3};
const int model_jacobian_xu_row[] = {1, 0, 1};
const int model_jacobian_p_column[] = {0, 1};
const int model_jacobian_p_row[] = {1};

int model_derivatives(double t, const double *x, const double *u, const double *p, double *xdot) {
    (void)t, (void)u;
    xdot[0] = x[1];
    xdot[1] = ((1.0 - x[0] * x[0]) * x[1] - x[0]) / p[0];
    return 0;
}

int model_jacobian_xu(double t, const double *x, const double *u, const double *p,
                      double *nonzeros) {
    (void)t, (void)u;
    nonzeros[0] = (-2.0 * x[0] * x[1] - 1.0) / p[0];
    nonzeros[1] = 1.0;
    nonzeros[2] = (1.0 - x[0] * x[0]) / p[0];
    return 0;
}

int model_jacobian_p(double t, const double *x, const double *u, const double *p,
                     double *nonzeros) {
    (void)t, (void)u;
    nonzeros[0] = -((1.0 - x[0] * x[0]) * x[1] - x[0]) / (p[0] * p[0]);
    return 0;
}
