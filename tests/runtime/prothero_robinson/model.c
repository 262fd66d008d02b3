/* x' = -lambda*(x - cos(omega*t)) - omega*sin(omega*t), solved by cos(omega*t).
 * Source: A. Prothero and A. Robinson, Math. Comp. 28 (1974), 145-162. */
#include "model.h"

#include <math.h>

const double model_start[] = {1.0, 1.0, 1.0};
const double model_nominal[] = {1.0};
const unsigned char model_tunable[] = {0, 0};
const char *const model_assertion_text[] = {""};
const int model_jacobian_xu_column[] = {0, 1};
const int model_jacobian_xu_row[] = {0};
const int model_jacobian_p_column[] = {0, 1, 2};
const int model_jacobian_p_row[] = {0, 0};

int model_derivatives(double t, const double *x, const double *u, const double *p, double *xdot) {
    (void)u;
    xdot[0] = -p[0] * (x[0] - cos(p[1] * t)) - p[1] * sin(p[1] * t);
    return 0;
}

int model_jacobian_xu(double t, const double *x, const double *u, const double *p,
                      double *nonzeros) {
    (void)t, (void)x, (void)u;
    nonzeros[0] = -p[0];
    return 0;
}

int model_jacobian_p(double t, const double *x, const double *u, const double *p,
                     double *nonzeros) {
    (void)u;
    nonzeros[0] = cos(p[1] * t) - x[0];
    nonzeros[1] = -p[0] * t * sin(p[1] * t) - sin(p[1] * t) - p[1] * t * cos(p[1] * t);
    return 0;
}
