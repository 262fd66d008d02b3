/* x1' = x2, x2' = -k*x1 - d*x2 + u; outputs: force, energy. k is tunable, d fixed. */
#include "model.h"

const double model_start[] = {1.0, 0.0, 0.0, 4.0, 0.5};
const double model_nominal[] = {1.0, 1.0};
const unsigned char model_tunable[] = {1, 0};
const char *const model_assertion_text[] = {""};
const int model_jacobian_xu_column[] = {0, 3, 7, 9};
const int model_jacobian_xu_row[] = {1, 2, 3, 0, 1, 2, 3, 1, 2};
const int model_jacobian_p_column[] = {0, 3, 5};
const int model_jacobian_p_row[] = {1, 2, 3, 1, 2};

int model_derivatives(double t, const double *x, const double *u, const double *p, double *xdot) {
    (void)t;
    xdot[0] = x[1];
    xdot[1] = -p[0] * x[0] - p[1] * x[1] + u[0];
    return 0;
}

int model_algebraics(double t, const double *x, const double *u, const double *p, double *w) {
    (void)t;
    w[0] = -p[0] * x[0] - p[1] * x[1] + u[0];
    w[1] = 0.5 * (p[0] * x[0] * x[0] + x[1] * x[1]);
    return 0;
}

int model_jacobian_xu(double t, const double *x, const double *u, const double *p,
                      double *nonzeros) {
    (void)t, (void)u;
    nonzeros[0] = nonzeros[1] = -p[0];
    nonzeros[2] = p[0] * x[0];
    nonzeros[3] = 1.0;
    nonzeros[4] = nonzeros[5] = -p[1];
    nonzeros[6] = x[1];
    nonzeros[7] = nonzeros[8] = 1.0;
    return 0;
}

int model_jacobian_p(double t, const double *x, const double *u, const double *p,
                     double *nonzeros) {
    (void)t, (void)u, (void)p;
    nonzeros[0] = nonzeros[1] = -x[0];
    nonzeros[2] = 0.5 * x[0] * x[0];
    nonzeros[3] = nonzeros[4] = -x[1];
    return 0;
}
