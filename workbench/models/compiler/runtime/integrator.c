#include "integrator.h"

#include <float.h>
#include <math.h>
#include <string.h>

/* Coefficients of RODAS in the form that needs no product with the Jacobian:
 * (I/(h*gamma) - df/dx) k_i = f(t + alpha_i*h, x + sum_j a_ij*k_j) + sum_j c_ij/h*k_j
 *                             + h*gamma_i*df/dt. */
static const double gamma_diagonal = 0.25;
static const double alpha[6] = {0.0, 0.386, 0.21, 0.63, 1.0, 1.0};
static const double gamma_sum[6] = {0.25, -0.1043, 0.1035, -0.0362, 0.0, 0.0};
static const double a[6][5] = {
    {0.0},
    {1.544},
    {0.9466785280815826, 0.2557011698983284},
    {3.314825187068521, 2.896124015972201, 0.9986419139977817},
    {1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950},
    {1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950, 1.0}};
static const double c[6][5] = {
    {0.0},
    {-5.6688},
    {-2.430093356833875, -0.2063599157091915},
    {-0.1073529058151375, -9.594562251023355, -20.47028614809616},
    {7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160},
    {8.083246795921522, -7.981132988064893, -31.52159432874371, 16.31930543123136,
     -6.058818238834054}};

int first_violated(double t, const double *x, const double *u, const double *p, double *holds) {
    if (NA > 0 && model_assertions(t, x, u, p, holds) != 0) {
        return 0;
    }
    for (int n = 0; n < NA; n++) {
        if (holds[n] == 0.0) {
            return n;
        }
    }
    return -1;
}

/* Derivatives into `xdot`; 0 with `bad` set if one of them is not finite. */
static int derivatives(Rosenbrock *r, double t, const double *x, const double *u, const double *p,
                       double *xdot) {
    const int failed = model_derivatives(t, x, u, p, xdot);
    for (int n = 0; n < NX; n++) {
        if (failed || !isfinite(xdot[n])) {
            r->bad = REFERENCE_XDOT + n;
            r->t_bad = t;
            return 0;
        }
    }
    return 1;
}

/* Partial derivative with respect to time, for a step of about size h: second order difference of
 * values after t. Inputs are constant, so it is zero unless the model names time itself. */
static int differentiate_time(Rosenbrock *r, double t, double h, const double *x, const double *u,
                              const double *p) {
    /* Small against h for the order of the method, large against the rounding of t. */
    const double delta = fmax(1e-4 * h, 1e-10 * fabs(t));
    double *const f_1 = r->k[0];
    double *const f_2 = r->k[1];
    if (!derivatives(r, t + delta, x, u, p, f_1)) {
        return 0;
    }
    memset(r->dfdt, 0, sizeof r->dfdt);
    if (memcmp(f_1, r->f, NX * sizeof *f_1) == 0) {
        return 1;
    }
    if (!derivatives(r, t + 2.0 * delta, x, u, p, f_2)) {
        return 0;
    }
    for (int n = 0; n < NX; n++) {
        r->dfdt[n] = (4.0 * f_1[n] - 3.0 * r->f[n] - f_2[n]) / (2.0 * delta);
    }
    return 1;
}

/* Derivatives, their derivative with respect to time and the Jacobian at the start of a step. */
static int linearise(Rosenbrock *r, double t, double h, const double *x, const double *u,
                     const double *p) {
    if (!derivatives(r, t, x, u, p, r->f) || !differentiate_time(r, t, h, x, u, p)) {
        return 0;
    }
    const int failed = model_jacobian_xu(t, x, u, p, r->jacobian);
    for (int column = 0; column < NX; column++) {
        for (int n = model_jacobian_xu_column[column]; n < model_jacobian_xu_column[column + 1];
             n++) {
            const int row = model_jacobian_xu_row[n];
            if (row < NX && (failed || !isfinite(r->jacobian[n]))) {
                r->bad = REFERENCE_XDOT + row;
                r->t_bad = t;
                return 0;
            }
        }
    }
    return 1;
}

/* LU factorisation of I/(h*gamma) - df/dx with partial pivoting; 0 if the matrix is singular. */
static int factorise(Rosenbrock *r, double h) {
    double *const m = r->matrix;
    memset(m, 0, sizeof r->matrix);
    for (int column = 0; column < NX; column++) {
        m[column * NX + column] = 1.0 / (h * gamma_diagonal);
        for (int n = model_jacobian_xu_column[column]; n < model_jacobian_xu_column[column + 1];
             n++) {
            if (model_jacobian_xu_row[n] < NX) {
                m[model_jacobian_xu_row[n] * NX + column] -= r->jacobian[n];
            }
        }
    }
    for (int column = 0; column < NX; column++) {
        int pivot = column;
        for (int row = column + 1; row < NX; row++) {
            if (fabs(m[row * NX + column]) > fabs(m[pivot * NX + column])) {
                pivot = row;
            }
        }
        r->pivot[column] = pivot;
        if (m[pivot * NX + column] == 0.0) {
            return 0;
        }
        if (pivot != column) {
            for (int n = 0; n < NX; n++) {
                const double entry = m[column * NX + n];
                m[column * NX + n] = m[pivot * NX + n];
                m[pivot * NX + n] = entry;
            }
        }
        for (int row = column + 1; row < NX; row++) {
            if (m[row * NX + column] == 0.0) {
                continue; /* multibody Jacobians are sparse */
            }
            const double factor = m[row * NX + column] /= m[column * NX + column];
            for (int n = column + 1; n < NX; n++) {
                m[row * NX + n] -= factor * m[column * NX + n];
            }
        }
    }
    return 1;
}

static void solve(const Rosenbrock *r, double *b) {
    const double *const m = r->matrix;
    for (int row = 0; row < NX; row++) {
        const double entry = b[r->pivot[row]];
        b[r->pivot[row]] = b[row];
        b[row] = entry;
    }
    for (int row = 1; row < NX; row++) {
        for (int n = 0; n < row; n++) {
            b[row] -= m[row * NX + n] * b[n];
        }
    }
    for (int row = NX - 1; row >= 0; row--) {
        for (int n = row + 1; n < NX; n++) {
            b[row] -= m[row * NX + n] * b[n];
        }
        b[row] /= m[row * NX + row];
    }
}

static double scale(int n, double tolerance, double x) {
    return tolerance * (model_nominal[n] + fabs(x));
}

/* One step of size h into r->x. Returns its largest error in units of the tolerance, or infinity
 * if the model has no finite value on the way (sets `bad`) or the matrix is singular. */
static double attempt(Rosenbrock *r, double t, double h, const double *x, const double *u,
                      const double *p, double tolerance) {
    if (!factorise(r, h)) {
        return INFINITY;
    }
    for (int stage = 0; stage < 6; stage++) {
        double *const k = r->k[stage];
        for (int n = 0; n < NX; n++) {
            r->x[n] = x[n];
            for (int j = 0; j < stage; j++) {
                r->x[n] += a[stage][j] * r->k[j][n];
            }
        }
        if (stage == 0) {
            memcpy(k, r->f, sizeof r->f);
        } else if (!derivatives(r, t + alpha[stage] * h, r->x, u, p, k)) {
            return INFINITY;
        }
        for (int n = 0; n < NX; n++) {
            double sum = h * gamma_sum[stage] * r->dfdt[n];
            for (int j = 0; j < stage; j++) {
                sum += c[stage][j] / h * r->k[j][n];
            }
            k[n] += sum;
        }
        solve(r, k);
    }
    /* Stiffly accurate: the last stage is both the last increment and the error estimate. */
    double error = 0.0;
    for (int n = 0; n < NX; n++) {
        r->x[n] += r->k[5][n];
        const double larger = fmax(fabs(x[n]), fabs(r->x[n]));
        const double relative = fabs(r->k[5][n]) / scale(n, tolerance, larger);
        if (!isfinite(r->x[n])) {
            r->bad = REFERENCE_X + n;
            r->t_bad = t + h;
            return INFINITY;
        }
        error = fmax(error, relative);
    }
    return error;
}

/* First step size: one per cent of the time in which x changes by itself (Hairer, Norsett and
 * Wanner, Solving Ordinary Differential Equations I, section II.4); 1e-6 s where x or f vanish. */
static double first_step(const Rosenbrock *r, const double *x, double tolerance) {
    double size = 0.0;
    double rate = 0.0;
    for (int n = 0; n < NX; n++) {
        size = fmax(size, fabs(x[n]) / scale(n, tolerance, x[n]));
        rate = fmax(rate, fabs(r->f[n]) / scale(n, tolerance, x[n]));
    }
    return size < 1e-5 || rate < 1e-5 ? 1e-6 : 0.01 * size / rate;
}

Outcome rosenbrock_integrate(Rosenbrock *r, const double *u, const double *p, double tolerance,
                             double end, double *t, double *x, Memory *memory) {
    double h = memory->step;
    int linearised = 0;
    int rejected = 0;
    for (int steps = 0; *t < end; steps++) {
        if (steps == MAXIMAL_STEPS) {
            return OUTCOME_TOO_MANY_STEPS;
        }
        if (!linearised) {
            if (!linearise(r, *t, h > 0.0 ? fmin(h, end - *t) : end - *t, x, u, p)) {
                return OUTCOME_NOT_FINITE;
            }
            linearised = 1;
        }
        if (h <= 0.0) {
            h = first_step(r, x, tolerance);
        }
        const int last = NX == 0 || *t + 1.01 * h >= end;
        const double used = last ? end - *t : h;
        r->bad = -1;
        const double error = attempt(r, *t, used, x, u, p, tolerance);
        /* Order of the error estimate is 4: factor 0.9 * error^(-1/4), within 0.2 .. 6. */
        const double factor = fmin(6.0, fmax(0.2, 0.9 / sqrt(sqrt(error))));
        if (error > 1.0) {
            h = used * factor;
            rejected = 1;
            if (h < 10.0 * DBL_EPSILON * fabs(*t) || h < DBL_MIN) {
                return r->bad < 0 ? OUTCOME_STEP_TOO_SMALL : OUTCOME_NOT_FINITE;
            }
            continue;
        }
        const double t_new = last ? end : *t + used;
        const int violated = first_violated(t_new, r->x, u, p, r->holds);
        if (violated >= 0) {
            r->bad = violated;
            r->t_bad = t_new;
            return OUTCOME_ASSERTION;
        }
        const double next = used * (rejected ? fmin(factor, 1.0) : factor);
        /* A step cut short by the communication point tells nothing against a larger one. */
        h = used < h ? fmax(h, next) : next;
        memory->step = h;
        *t = t_new;
        memcpy(x, r->x, NX * sizeof *x);
        linearised = 0;
        rejected = 0;
    }
    return OUTCOME_REACHED;
}
