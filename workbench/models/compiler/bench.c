/* Time of FMI calls beside plain calls of the same model, in one program.
 *
 * Linked with the sources of an FMU (FMI 2.0). Reads from standard input the numbers of points,
 * evaluations, repeats and steps, the step size [s], then one line of states and inputs for each
 * point. Writes one line for each repeat, nanoseconds of: the derivatives, plain and through FMI;
 * the nonzeros of the Jacobian, plain; the matrix d[der(x), w]/d[x, u] in columns, plain and
 * through FMI; one Co-Simulation step.
 *
 * Both sides call the same generated functions at the same points and leave the same numbers in the
 * same memory. A plain call takes x and u where they lie; through FMI they are set first, in the
 * time that counts. The matrix has all rows that the Jacobian function computes, so neither side
 * computes what it does not use. Plain is the shortest way: one call for all nonzeros, then one loop
 * that puts each to its place among zeros, known beforehand. FMI gives one column a call.
 */
#define _POSIX_C_SOURCE 199309L
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fmi2Functions.h"
#include "model.h"

static double *points; /* x, u of each */
static int count;
static fmi2ValueReference inputs[NU + 1], knowns[NX + NU + 1], unknowns[NX + NW + 1];

static int place[NNZ_XU + 1]; /* of the nonzeros in the matrix */

/* Results; not static, so that the compiler can leave out none. The matrix is stored by columns. */
enum { ROWS = NX + NW, ENTRIES = ROWS * (NX + NU) };
double xdot[NX + 1], nonzeros[NNZ_XU + 1], matrix[ENTRIES + 1];

static const double *x_of(int n) { return points + (size_t)(n % count) * (NX + NU); }
static const double *u_of(int n) { return x_of(n) + NX; }
static const double *parameters(void) { return model_start + NX + NU; }

static void require(int condition, const char *what) {
    if (!condition) {
        fprintf(stderr, "%s\n", what);
        exit(1);
    }
}

static void ok(fmi2Status status) { require(status == fmi2OK, "an FMI call failed"); }

static void note(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                 fmi2String category, fmi2String message, ...) {
    (void)environment;
    (void)status;
    fprintf(stderr, "%s: %s: %s\n", name, category, message);
}

static const fmi2CallbackFunctions functions = {note, calloc, free, NULL, NULL};

static double nanoseconds(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

static void set_point(fmi2Component c, int n) {
    ok(fmi2SetContinuousStates(c, x_of(n), NX));
    ok(fmi2SetReal(c, inputs, NU, u_of(n)));
}

static void plain_derivatives(fmi2Component c, int n) {
    (void)c;
    model_derivatives(0.0, x_of(n), u_of(n), parameters(), xdot);
}

static void fmi_derivatives(fmi2Component c, int n) {
    set_point(c, n);
    ok(fmi2GetDerivatives(c, xdot, NX));
}

static void plain_nonzeros(fmi2Component c, int n) {
    (void)c;
    model_jacobian_xu(0.0, x_of(n), u_of(n), parameters(), nonzeros);
}

static void plain_jacobian(fmi2Component c, int n) {
    plain_nonzeros(c, n);
    memset(matrix, 0, ENTRIES * sizeof *matrix);
    for (int m = 0; m < NNZ_XU; m++) {
        matrix[place[m]] = nonzeros[m];
    }
}

static void fmi_jacobian(fmi2Component c, int n) {
    static const double one = 1.0;
    set_point(c, n);
    for (int k = 0; k < NX + NU; k++) {
        ok(fmi2GetDirectionalDerivative(c, unknowns, ROWS, &knowns[k], 1, &one,
                                        matrix + k * ROWS));
    }
}

/* Nanoseconds of one call, every call at another point than the one before. */
static double time_of(void (*evaluate)(fmi2Component, int), fmi2Component c, int evaluations) {
    const double begin = nanoseconds();
    for (int n = 0; n < evaluations; n++) {
        evaluate(c, n);
    }
    return (nanoseconds() - begin) / evaluations;
}

static fmi2Component create(fmi2Type type) {
    const fmi2Component c =
        fmi2Instantiate("bench", type, MODEL_TOKEN, "", &functions, fmi2False, fmi2False);
    require(c != NULL, "no instance");
    return c;
}

static void initialise(fmi2Component c) {
    fmi2ValueReference states[NX + 1];
    for (unsigned n = 0; n < NX; n++) {
        states[n] = n;
    }
    ok(fmi2SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2False, 0.0));
    ok(fmi2SetReal(c, states, NX, x_of(0)));
    ok(fmi2SetReal(c, inputs, NU, u_of(0)));
    ok(fmi2EnterInitializationMode(c));
    ok(fmi2ExitInitializationMode(c));
}

/* Nanoseconds of one step from the first point, with the inputs of the points in turn. */
static double time_of_step(fmi2Component c, int steps, double size) {
    ok(fmi2Reset(c));
    initialise(c);
    const double begin = nanoseconds();
    for (int n = 0; n < steps; n++) {
        ok(fmi2SetReal(c, inputs, NU, u_of(n)));
        ok(fmi2DoStep(c, n * size, size, fmi2True));
    }
    return (nanoseconds() - begin) / steps;
}

static int equal(const double *a, const double *b, size_t n) {
    while (n > 0 && a[n - 1] == b[n - 1]) {
        n--;
    }
    return n == 0;
}

/* What is compared must be the same numbers. */
static void check(fmi2Component c) {
    double derivatives[NX + 1], jacobian[ENTRIES + 1];
    for (int n = 0; n < count; n++) {
        plain_derivatives(c, n);
        memcpy(derivatives, xdot, sizeof xdot);
        fmi_derivatives(c, n);
        require(equal(derivatives, xdot, NX), "derivatives differ");
        plain_jacobian(c, n);
        memcpy(jacobian, matrix, sizeof matrix);
        fmi_jacobian(c, n);
        require(equal(jacobian, matrix, ENTRIES), "Jacobians differ");
    }
}

int main(void) {
    int evaluations, repeats, steps;
    double size;
    require(scanf("%d %d %d %d %lf", &count, &evaluations, &repeats, &steps, &size) == 5, "input");
    points = calloc((size_t)count * (NX + NU) + 1, sizeof *points);
    require(points != NULL, "no memory");
    for (int n = 0; n < count * (NX + NU); n++) {
        require(scanf("%lf", &points[n]) == 1, "too few points");
    }
    for (int k = 0; k < NX + NU; k++) {
        for (int m = model_jacobian_xu_column[k]; m < model_jacobian_xu_column[k + 1]; m++) {
            place[m] = k * ROWS + model_jacobian_xu_row[m];
        }
    }
    for (unsigned n = 0; n < NU; n++) {
        inputs[n] = REFERENCE_U + n;
    }
    for (unsigned n = 0; n < NX + NU; n++) {
        knowns[n] = n < NX ? n : REFERENCE_U + n - NX;
    }
    for (unsigned n = 0; n < ROWS; n++) {
        unknowns[n] = n < NX ? REFERENCE_XDOT + n : REFERENCE_W + n - NX;
    }
    const fmi2Component c = create(fmi2ModelExchange);
    const fmi2Component s = create(fmi2CoSimulation);
    fmi2EventInfo events;
    initialise(c);
    ok(fmi2NewDiscreteStates(c, &events));
    ok(fmi2EnterContinuousTimeMode(c));
    check(c);
    for (int n = 0; n < repeats; n++) {
        printf("%.17g ", time_of(plain_derivatives, c, evaluations));
        printf("%.17g ", time_of(fmi_derivatives, c, evaluations));
        printf("%.17g ", time_of(plain_nonzeros, c, evaluations));
        printf("%.17g ", time_of(plain_jacobian, c, evaluations));
        printf("%.17g ", time_of(fmi_jacobian, c, evaluations));
        printf("%.17g\n", time_of_step(s, steps, size));
    }
    fmi2FreeInstance(c);
    fmi2FreeInstance(s);
    free(points);
    return 0;
}
