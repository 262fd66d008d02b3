/* The observer's law, one sample at a time; stands in the place of the integrator of other FMUs.
 *
 * A communication step takes one sample: the inputs that stand at its start. The first sample sets
 * what it measures of the observer's states; measured outputs that are all zero are none, but inputs
 * that a tool has not connected yet, and leave the observer as it is. Every further sample is a linearly implicit Euler step,
 *
 *     (M - h*df/dx) dx = h*f(x, u, p),
 *
 * over the time h since the sample before, which is the size of the communication step before.
 * States of kind TAKEN get their value before the step and keep it, also in df/dx; states of kind
 * APPLIED have no inertia, M = 0. States stay within their limits. Where sampled_sticks, a step may
 * not reverse the sign of an output close to standstill. Source of the method:
 * P. Deuflhard, E. Hairer, J. Zugck (1987), Numerische Mathematik 51, 501-516.
 */
#include "integrator.h"

#include <math.h>
#include <string.h>

enum { DYNAMIC, TAKEN, APPLIED };

/* sampled_kind, sampled_first (number of the input that the first sample is in, or -1),
 * sampled_low, sampled_high: NX values each. sampled_sticks; if so, sampled_follower and
 * sampled_leader (states), sampled_zero (output that is zero while the follower rolls along),
 * sampled_lead (of the leader in the signal that says how fast it goes), sampled_half (parameter:
 * level of that signal). */
#include "sampled_data.h"

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

/* f and df/dx at r->x, the latter row by row in r->matrix; 0 with `bad` set if not finite. */
static int linearise(Rosenbrock *r, double t, const double *u, const double *p) {
    const int failed = model_derivatives(t, r->x, u, p, r->f) != 0 ||
                       model_jacobian_xu(t, r->x, u, p, r->jacobian) != 0;
    r->t_bad = t;
    memset(r->matrix, 0, sizeof r->matrix);
    for (int column = 0; column < NX; column++) {
        r->bad = REFERENCE_XDOT + column;
        if (failed || !isfinite(r->f[column])) {
            return 0;
        }
        for (int n = model_jacobian_xu_column[column]; n < model_jacobian_xu_column[column + 1];
             n++) {
            const int row = model_jacobian_xu_row[n];
            if (row < NX) {
                r->bad = REFERENCE_XDOT + row;
                if (!isfinite(r->jacobian[n])) {
                    return 0;
                }
                r->matrix[row * NX + column] = r->jacobian[n];
            }
        }
    }
    return 1;
}

/* Gives the states of a kind the value at which their derivative, linear in them, vanishes. */
static int settle(Rosenbrock *r, int kind, double t, const double *u, const double *p) {
    if (!linearise(r, t, u, p)) {
        return 0;
    }
    for (int n = 0; n < NX; n++) {
        if (sampled_kind[n] == kind) {
            r->x[n] -= r->f[n] / r->matrix[n * NX + n];
        }
    }
    return 1;
}

static void limit(Rosenbrock *r) {
    for (int n = 0; n < NX; n++) {
        r->x[n] = fmin(fmax(r->x[n], sampled_low[n]), sampled_high[n]);
    }
}

/* The output that is zero while the follower rolls along, at these speeds of both; it is linear. */
static double reading(const Rosenbrock *r, double t, double follower, double leader,
                      const double *u, const double *p) {
    double x[NX], w[NW];
    memcpy(x, r->x, sizeof x);
    x[sampled_follower] = follower;
    x[sampled_leader] = leader;
    return model_algebraics(t, x, u, p, w) != 0 ? NAN : w[sampled_zero];
}

/* Lets the follower roll where a step has taken it past its leader close to standstill: what drives
 * it is saturated there at the least lag, and a tangent to that leads to the other side, and back in
 * the next step. `follower` and `leader` are their speeds before the step. */
static void stick(Rosenbrock *r, double t, double follower, double leader, const double *u,
                  const double *p) {
    double *x = r->x;
    if (fabs(sampled_lead * x[sampled_leader]) < p[sampled_half]) {
        const double ratio = -reading(r, t, 0.0, 1.0, u, p) / reading(r, t, 1.0, 0.0, u, p);
        const double rolling = ratio * x[sampled_leader];
        if ((ratio * leader - follower) * (rolling - x[sampled_follower]) < 0.0) {
            x[sampled_follower] = rolling;
        }
    }
}

/* Solves matrix * f = f in place, by Gaussian elimination with partial pivoting; 0 if singular. */
static int solve(double *matrix, double *f) {
    for (int column = 0; column < NX; column++) {
        int pivot = column;
        for (int row = column + 1; row < NX; row++) {
            if (fabs(matrix[row * NX + column]) > fabs(matrix[pivot * NX + column])) {
                pivot = row;
            }
        }
        if (!(fabs(matrix[pivot * NX + column]) > 0.0)) {
            return 0;
        }
        for (int n = column; pivot != column && n < NX; n++) {
            const double swapped = matrix[pivot * NX + n];
            matrix[pivot * NX + n] = matrix[column * NX + n];
            matrix[column * NX + n] = swapped;
        }
        const double value = f[pivot];
        f[pivot] = f[column];
        f[column] = value;
        for (int row = column + 1; row < NX; row++) {
            const double factor = matrix[row * NX + column] / matrix[column * NX + column];
            for (int n = column + 1; n < NX; n++) {
                matrix[row * NX + n] -= factor * matrix[column * NX + n];
            }
            f[row] -= factor * value;
        }
    }
    for (int row = NX - 1; row >= 0; row--) {
        for (int n = row + 1; n < NX; n++) {
            f[row] -= matrix[row * NX + n] * f[n];
        }
        f[row] /= matrix[row * NX + row];
    }
    return 1;
}

/* One step of the law on r->x. */
static Outcome take_sample(Rosenbrock *r, double t, double h, const double *u, const double *p) {
    if (!settle(r, TAKEN, t, u, p) || !linearise(r, t, u, p)) {
        return OUTCOME_NOT_FINITE;
    }
    for (int row = 0; row < NX; row++) {
        const int kind = sampled_kind[row];
        for (int column = 0; column < NX; column++) {
            r->matrix[row * NX + column] *= kind == TAKEN ? 0.0 : -h;
        }
        r->matrix[row * NX + row] += kind == APPLIED ? 0.0 : 1.0;
        r->f[row] *= kind == TAKEN ? 0.0 : h;
    }
    if (!solve(r->matrix, r->f)) {
        return OUTCOME_STEP_TOO_SMALL;
    }
    const double follower = r->x[sampled_follower], leader = r->x[sampled_leader];
    for (int n = 0; n < NX; n++) {
        r->x[n] += r->f[n];
        if (!isfinite(r->x[n])) {
            r->bad = REFERENCE_X + n;
            return OUTCOME_NOT_FINITE;
        }
    }
    if (sampled_sticks) {
        stick(r, t, follower, leader, u, p);
    }
    limit(r);
    if (!settle(r, APPLIED, t, u, p)) {
        return OUTCOME_NOT_FINITE;
    }
    limit(r);
    return OUTCOME_REACHED;
}

/* Gives the states that are measured the values of the first sample; 0 if there is none yet. */
static int start(Rosenbrock *r, const double *u) {
    int measured = 0, connected = 0;
    for (int n = 0; n < NX; n++) {
        if (sampled_first[n] >= 0) {
            r->x[n] = u[sampled_first[n]];
            measured = 1;
            connected |= r->x[n] != 0.0;
        }
    }
    return connected || !measured;
}

Outcome rosenbrock_integrate(Rosenbrock *r, const double *u, const double *p, double tolerance,
                             double end, double *t, double *x, Memory *memory) {
    (void)tolerance;
    memcpy(r->x, x, NX * sizeof *x);
    int started = 1;
    if (memory->step == 0.0) {
        started = start(r, u);
    } else {
        const Outcome outcome = take_sample(r, *t, memory->step, u, p);
        if (outcome != OUTCOME_REACHED) {
            return outcome;
        }
    }
    const int violated = first_violated(end, r->x, u, p, r->holds);
    if (violated >= 0) {
        r->bad = violated;
        r->t_bad = end;
        return OUTCOME_ASSERTION;
    }
    memcpy(x, r->x, NX * sizeof *x);
    memory->step = started ? end - *t : 0.0;
    *t = end;
    return OUTCOME_REACHED;
}
