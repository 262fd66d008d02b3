/* What a model without it says of algebraic variables, assertions and parameters: nothing. */
#include "model.h"

__attribute__((weak)) int model_algebraics(double t, const double *x, const double *u,
                                           const double *p, double *w) {
    (void)t, (void)x, (void)u, (void)p, (void)w;
    return 0;
}

__attribute__((weak)) int model_assertions(double t, const double *x, const double *u,
                                           const double *p, double *holds) {
    (void)t, (void)x, (void)u, (void)p, (void)holds;
    return 0;
}

__attribute__((weak)) int model_jacobian_p(double t, const double *x, const double *u,
                                           const double *p, double *nonzeros) {
    (void)t, (void)x, (void)u, (void)p, (void)nonzeros;
    return 0;
}

int model_linearisation(double t, const double *x, const double *u, const double *p,
                        double *values) {
    return model_derivatives(t, x, u, p, values) || model_algebraics(t, x, u, p, values + NX) ||
           model_jacobian_xu(t, x, u, p, values + NX + NW);
}
