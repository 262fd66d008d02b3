/* x' = -V*V'*x, where V holds small integers: stiff, dense, and its factorisation has to pivot. */
#include "model.h"

#define COLUMN(n) n, n + 1, n + 2, n + 3, n + 4, n + 5, n + 6, n + 7

const double model_start[] = {1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0};
const double model_nominal[] = {1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0};
const unsigned char model_tunable[] = {0};
const char *const model_assertion_text[] = {""};
const int model_jacobian_xu_column[] = {0, 8, 16, 24, 32, 40, 48, 56, 64};
const int model_jacobian_xu_row[] = {COLUMN(0), COLUMN(0), COLUMN(0), COLUMN(0),
                                     COLUMN(0), COLUMN(0), COLUMN(0), COLUMN(0)};
const int model_jacobian_p_column[] = {0};
const int model_jacobian_p_row[] = {0};

static int factor(int row, int k) {
    return (row + 1) * ((row * row + 3 * row * k + 5 * k) % 13 - 6);
}

static double entry(int row, int column) {
    double sum = 0.0;
    for (int k = 0; k < NX; k++) {
        sum -= factor(row, k) * factor(column, k);
    }
    return sum;
}

int model_derivatives(double t, const double *x, const double *u, const double *p, double *xdot) {
    (void)t, (void)u, (void)p;
    for (int row = 0; row < NX; row++) {
        xdot[row] = 0.0;
        for (int column = 0; column < NX; column++) {
            xdot[row] += entry(row, column) * x[column];
        }
    }
    return 0;
}

int model_jacobian_xu(double t, const double *x, const double *u, const double *p,
                      double *nonzeros) {
    (void)t, (void)x, (void)u, (void)p;
    for (int n = 0; n < NNZ_XU; n++) {
        nonzeros[n] = entry(n % NX, n / NX);
    }
    return 0;
}
