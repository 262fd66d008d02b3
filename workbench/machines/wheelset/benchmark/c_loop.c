/* The disturbance observer in C over the plain equations of a model, without FMI.
 *
 * Linked with `model.c` of the minimal model. Same method and order of operations as
 * `workbench/observers/disturbance.py`, so that the results are the same bits.
 */
#include <math.h>
#include <string.h>

#include "model.h"

enum { WIDTH = 8 }; /* of an estimate: omegaW, omegaR, dmuWR, dmuDC, muWR, muDC, Fx, slip */

typedef struct {
    double L[4][4], decay[2], effect[2], low[2], high[2], nominal[2], radius, ratio, fading_speed;
} Settings;

/* Value references of pB, tauR, dmuWR, dmuDC and of Fx, slip. */
typedef struct {
    int u[4], w[2];
} References;

static double clip(double value, double low, double high) {
    const double least = low > value ? low : value;
    return high < least ? high : least;
}

/* Place of an entry among the nonzeros of the Jacobian; the one behind the last, a zero, if none. */
static int nonzero(int row, int column) {
    for (int k = model_jacobian_xu_column[column]; k < model_jacobian_xu_column[column + 1]; k++) {
        if (model_jacobian_xu_row[k] == row) {
            return k;
        }
    }
    return NNZ_XU;
}

/* Gaussian elimination with partial pivoting, b becomes the solution; 0 on success. */
static int solve(double a[4][4], double b[4]) {
    for (int k = 0; k < 4; k++) {
        int pivot = k;
        for (int i = k + 1; i < 4; i++) {
            pivot = fabs(a[i][k]) > fabs(a[pivot][k]) ? i : pivot;
        }
        if (!(fabs(a[pivot][k]) > 0.0)) {
            return 1;
        }
        if (pivot != k) {
            double row[4];
            memcpy(row, a[k], sizeof row);
            memcpy(a[k], a[pivot], sizeof row);
            memcpy(a[pivot], row, sizeof row);
            const double value = b[k];
            b[k] = b[pivot];
            b[pivot] = value;
        }
        const double inverse = 1.0 / a[k][k];
        for (int i = k + 1; i < 4; i++) {
            const double factor = a[i][k] * inverse;
            if (factor != 0.0) {
                for (int j = k + 1; j < 4; j++) {
                    a[i][j] -= factor * a[k][j];
                }
                b[i] -= factor * b[k];
            }
        }
    }
    for (int k = 3; k >= 0; k--) {
        double total = b[k];
        for (int i = k + 1; i < 4; i++) {
            total -= a[k][i] * b[i];
        }
        b[k] = total / a[k][k];
    }
    return 0;
}

/* Runs over n samples, u = [pB, tauR], y = [omegaW, omegaR]; 0 on success. */
int c_loop(int n, const double *steps, const double (*u_measured)[2], const double (*y)[2],
           const Settings *s, const References *references, double (*rows)[WIDTH]) {
    const double *const p = model_start + NX + NU;
    double u[NU], w[NW], xdot[NX], nonzeros[NNZ_XU + 1], integral[2] = {0.0, 0.0};
    int input[4], output[2], place[2][4];
    double z[4] = {y[0][0], y[0][1], 0.0, 0.0};
    nonzeros[NNZ_XU] = 0.0;
    memcpy(u, model_start + NX, sizeof u);
    for (int j = 0; j < 4; j++) {
        input[j] = references->u[j] - REFERENCE_U;
        for (int i = 0; i < 2; i++) {
            output[i] = references->w[i] - REFERENCE_W;
            place[i][j] = nonzero(i, j < 2 ? j : NX + input[j]);
        }
    }
    for (int k = 0; k < n; k++) {
        const double h = steps[k];
        u[input[0]] = u_measured[k][0];
        u[input[1]] = u_measured[k][1];
        if (h > 0.0) {
            const double speed = s->radius * y[k][1];
            const double fade = speed * speed / (speed * speed + s->fading_speed * s->fading_speed);
            const double innovation[2] = {y[k][0] - z[0], y[k][1] - z[1]};
            double system[4][4], change[4];
            model_derivatives(0.0, z, u, p, xdot);
            model_jacobian_xu(0.0, z, u, p, nonzeros);
            for (int i = 0; i < 4; i++) {
                double share = fade;
                if (i >= 2) {
                    share *= clip(nonzeros[place[0][i]] / s->effect[i - 2], -1.0, 1.0);
                }
                change[i] = i < 2 ? h * xdot[i] : h * (s->decay[i - 2] * z[i]);
                for (int j = 0; j < 2; j++) {
                    system[i][j] = i < 2 ? -h * nonzeros[place[i][j]] : 0.0;
                    system[i][2 + j] = i < 2 ? -h * nonzeros[place[i][2 + j]] : 0.0;
                }
                if (i < 2) {
                    system[i][i] += 1.0;
                } else {
                    system[i][i] = 1.0 - h * s->decay[i - 2];
                }
                for (int j = 0; j < 2; j++) {
                    const double integrated = share * s->L[i][2 + j];
                    const double gain = h * (share * s->L[i][j] + h * integrated);
                    change[i] += gain * innovation[j] + h * integrated * integral[j];
                    system[i][j] += gain;
                }
            }
            if (solve(system, change)) {
                return 1;
            }
            const double before = s->ratio * z[1] - z[0];
            for (int i = 0; i < 2; i++) {
                z[i] += change[i];
                integral[i] += h * (innovation[i] - change[i]);
                z[2 + i] = clip(z[2 + i] + change[2 + i], s->low[i], s->high[i]);
            }
            if (fabs(s->radius * z[1]) < s->fading_speed &&
                before * (s->ratio * z[1] - z[0]) < 0.0) {
                z[0] = s->ratio * z[1];
            }
            u[input[2]] = z[2];
            u[input[3]] = z[3];
        }
        model_algebraics(0.0, z, u, p, w);
        const double row[WIDTH] = {z[0], z[1], z[2], z[3], s->nominal[0] + z[2],
                                   s->nominal[1] + z[3], w[output[0]], w[output[1]]};
        memcpy(rows[k], row, sizeof row);
    }
    return 0;
}
