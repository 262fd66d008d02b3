/* A life of FMI 3.0 instances, right and wrong, for the sanitizers: create, initialise, step, roll
 * back, serialise, deserialise, wrong calls, free. Exit status 0: every call returned what the
 * standard says. Linked with the sources of an FMU. */
#include <float.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi3Functions.h"
#include "model.h"

#define CHECK(condition)                                                \
    do {                                                                \
        if (!(condition)) {                                             \
            fprintf(stderr, "line %d: %s\n", __LINE__, #condition);     \
            exit(1);                                                    \
        }                                                               \
    } while (0)
#define OK(call) CHECK((call) == fmi3OK)
#define REFUSED(call) CHECK((call) == fmi3Error)

static int messages;

static void note(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category,
                 fmi3String message) {
    (void)environment;
    (void)status;
    CHECK(strlen(category) + strlen(message) > 0);
    messages++;
}

static fmi3Instance co_simulation(const char *name, const char *token) {
    return fmi3InstantiateCoSimulation(name, token, NULL, fmi3False, fmi3True, fmi3False, fmi3False,
                                       NULL, 0, NULL, note, NULL);
}

static void initialise(fmi3Instance c) {
    OK(fmi3EnterInitializationMode(c, fmi3True, 1e-6, 0.0, fmi3False, 0.0));
    OK(fmi3ExitInitializationMode(c));
}

static void get_all(fmi3Instance c, double *value) {
    fmi3ValueReference all[REFERENCE_TIME + 1];
    for (unsigned n = 0; n <= REFERENCE_TIME; n++) {
        all[n] = n;
    }
    OK(fmi3GetFloat64(c, all, REFERENCE_TIME + 1, value, REFERENCE_TIME + 1));
}

static fmi3Status try_step(fmi3Instance c, double start, double size) {
    fmi3Boolean event, stop, early;
    double last;
    return fmi3DoStep(c, start, size, fmi3False, &event, &stop, &early, &last);
}

static void step(fmi3Instance c, double start, int steps) {
    for (int n = 0; n < steps; n++) {
        OK(try_step(c, start + 0.01 * n, 0.01));
    }
}

/* Every column of the Jacobian, all unknowns, and every unknown alone. */
static void differentiate(fmi3Instance c) {
    fmi3ValueReference unknown[NX + NW + 1];
    double sensitivity[NX + NW + 1];
    const double one = 1.0;
    for (unsigned n = 0; n < NX + NW; n++) {
        unknown[n] = n < NX ? REFERENCE_XDOT + n : REFERENCE_W + n - NX;
    }
    for (unsigned known = 0; known < REFERENCE_W; known++) {
        if (known >= REFERENCE_XDOT && known < REFERENCE_U) {
            continue;
        }
        OK(fmi3GetDirectionalDerivative(c, unknown, NX + NW, &known, 1, &one, 1, sensitivity,
                                        NX + NW));
        OK(fmi3GetAdjointDerivative(c, unknown, NX + NW, &known, 1, sensitivity, NX + NW,
                                    &(double){0.0}, 1));
        OK(fmi3GetDirectionalDerivative(c, NULL, 0, &known, 1, &one, 1, NULL, 0));
    }
}

/* What every unknown depends on, in arrays of exactly the size asked for. */
static void ask_dependencies(fmi3Instance c) {
    for (unsigned n = REFERENCE_XDOT; n < REFERENCE_TIME; n++) {
        size_t count = 0;
        if (n >= REFERENCE_U && n < REFERENCE_W) {
            REFUSED(fmi3GetNumberOfVariableDependencies(c, n, &count));
            continue;
        }
        OK(fmi3GetNumberOfVariableDependencies(c, n, &count));
        size_t *const elements = calloc(count + 1, sizeof *elements);
        fmi3ValueReference *const independents = malloc(count * sizeof *independents + 1);
        fmi3DependencyKind *const kinds = malloc(count * sizeof *kinds + 1);
        CHECK(elements != NULL && independents != NULL && kinds != NULL);
        OK(fmi3GetVariableDependencies(c, n, elements, independents, elements, kinds, count));
        REFUSED(fmi3GetVariableDependencies(c, n, elements, independents, elements, kinds,
                                            count + 1));
        free(kinds);
        free(independents);
        free(elements);
    }
}

static void co_simulate(void) {
    double first[REFERENCE_TIME + 1], second[REFERENCE_TIME + 1];
    fmi3FMUState saved = NULL, copy = NULL;
    size_t size = 0;
    const fmi3Instance c = co_simulation("an instance", MODEL_TOKEN);
    CHECK(c != NULL);
    initialise(c);
    step(c, 0.0, 20);
    OK(fmi3GetFMUState(c, &saved));
    step(c, 0.2, 20);
    get_all(c, first);
    OK(fmi3SetFMUState(c, saved));
    step(c, 0.2, 20);
    get_all(c, second);
    CHECK(memcmp(first, second, sizeof first) == 0);

    OK(fmi3SerializedFMUStateSize(c, saved, &size));
    fmi3Byte *const bytes = malloc(size); /* exactly as large as asked for */
    CHECK(bytes != NULL);
    OK(fmi3SerializeFMUState(c, saved, bytes, size));
    REFUSED(fmi3SerializeFMUState(c, saved, bytes, size - 1));
    OK(fmi3DeserializeFMUState(c, bytes, size, &copy));
    OK(fmi3SetFMUState(c, copy));
    OK(fmi3GetFMUState(c, &copy));
    step(c, 0.2, 20);
    get_all(c, second);
    CHECK(memcmp(first, second, sizeof first) == 0);
    /* Cut off or damaged anywhere, in exactly as many bytes: refused. */
    for (size_t n = 0; n < size; n += 7) {
        fmi3FMUState damaged = NULL;
        fmi3Byte *const part = malloc(n + 1);
        CHECK(part != NULL);
        memcpy(part, bytes, n);
        REFUSED(fmi3DeserializeFMUState(c, part, n, &damaged));
        free(part);
        bytes[n] ^= 1;
        REFUSED(fmi3DeserializeFMUState(c, bytes, size, &damaged));
        bytes[n] ^= 1;
        CHECK(damaged == NULL);
    }
    free(bytes);
    differentiate(c);
    ask_dependencies(c);
    OK(fmi3FreeFMUState(c, &saved));
    OK(fmi3FreeFMUState(c, &saved)); /* NULL now */
    OK(fmi3FreeFMUState(c, &copy));
    OK(fmi3Terminate(c));
    OK(fmi3Reset(c));
    initialise(c);
    step(c, 0.0, 1);
    fmi3FreeInstance(c);
}

static void exchange(void) {
    double x[NX + 1], xdot[NX + 1], all[REFERENCE_TIME + 1];
    double next;
    fmi3Boolean event[5], enter = fmi3False, stop = fmi3False;
    const fmi3Instance c = fmi3InstantiateModelExchange("an instance", MODEL_TOKEN, NULL, fmi3False,
                                                         fmi3True, NULL, note);
    CHECK(c != NULL);
    initialise(c);
    OK(fmi3UpdateDiscreteStates(c, event, event + 1, event + 2, event + 3, event + 4, &next));
    OK(fmi3EnterContinuousTimeMode(c));
    for (int n = 0; n < 100; n++) {
        OK(fmi3SetTime(c, 1e-5 * n));
        OK(fmi3GetContinuousStates(c, x, NX));
        OK(fmi3GetContinuousStateDerivatives(c, xdot, NX));
        for (int k = 0; k < NX; k++) {
            x[k] += 1e-5 * xdot[k];
        }
        OK(fmi3SetContinuousStates(c, x, NX));
        OK(fmi3CompletedIntegratorStep(c, fmi3True, &enter, &stop));
    }
    OK(fmi3GetNominalsOfContinuousStates(c, x, NX));
    OK(fmi3GetEventIndicators(c, NULL, 0));
    get_all(c, all);
    differentiate(c);
    fmi3FreeInstance(c);
}

/* Arguments and orders that the standard forbids: refused with a message, without harm. */
static void err(void) {
    double value[2] = {NAN, 1.0};
    fmi3ValueReference reference[2] = {0, REFERENCE_TIME + 1};
    fmi3FMUState none = NULL;
    const fmi3ValueReference last = UINT_MAX;
    fmi3Int32 integer = 1;
    char name[5000];
    CHECK(co_simulation(NULL, MODEL_TOKEN) == NULL);
    CHECK(co_simulation("", MODEL_TOKEN) == NULL);
    CHECK(co_simulation("x", NULL) == NULL);
    memset(name, '%', sizeof name);
    name[sizeof name - 1] = '\0';
    CHECK(co_simulation("x", name) == NULL);
    CHECK(fmi3InstantiateScheduledExecution("x", MODEL_TOKEN, NULL, fmi3False, fmi3True, NULL, note,
                                            NULL, NULL, NULL) == NULL);
    const fmi3Instance c = co_simulation(name, MODEL_TOKEN);
    CHECK(c != NULL);
    REFUSED(fmi3GetFloat64(NULL, reference, 1, value, 1));
    REFUSED(try_step(c, 0.0, 0.01));
    REFUSED(fmi3GetFloat64(c, reference, 1, value, 1));
    REFUSED(fmi3EnterInitializationMode(c, fmi3True, 0.0, 0.0, fmi3False, 0.0));
    REFUSED(fmi3EnterInitializationMode(c, fmi3False, 0.0, 1.0, fmi3True, 0.0));
    initialise(c);
    const int before = messages;
    REFUSED(fmi3GetFloat64(c, reference, 2, value, 2));
    REFUSED(fmi3GetFloat64(c, reference, 1, value, 2));
    REFUSED(fmi3GetFloat64(c, &last, 1, value, 1));
    REFUSED(fmi3GetFloat64(c, NULL, 1, value, 1));
    REFUSED(fmi3SetFloat64(c, &last, 1, value, 1));
    REFUSED(fmi3SetFloat64(c, reference, 1, (const double[]){NAN}, 1));
    REFUSED(fmi3SetFloat64(c, reference, 1, (const double[]){INFINITY}, 1));
    REFUSED(fmi3GetInt32(c, reference, 1, &integer, 1));
    REFUSED(fmi3SetContinuousStates(c, value, NX + 1));
    REFUSED(fmi3GetContinuousStates(c, NULL, NX));
    REFUSED(fmi3GetContinuousStateDerivatives(c, NULL, NX));
    REFUSED(fmi3GetDirectionalDerivative(c, &last, 1, reference, 1, value, 1, value, 1));
    REFUSED(fmi3GetDirectionalDerivative(c, reference, 1, &last, 1, value, 1, value, 1));
    REFUSED(fmi3GetAdjointDerivative(c, reference, 1, &last, 1, value, 1, value, 1));
    REFUSED(fmi3GetDirectionalDerivative(c, reference, 1, reference, 1, NULL, 1, value, 1));
    REFUSED(fmi3GetDirectionalDerivative(c, reference, 1, reference, 1, value, 2, value, 1));
    REFUSED(fmi3GetNumberOfVariableDependencies(c, last, NULL));
    REFUSED(fmi3SetFMUState(c, NULL));
    REFUSED(fmi3GetFMUState(c, NULL));
    REFUSED(fmi3SerializeFMUState(c, NULL, NULL, 0));
    REFUSED(fmi3DeserializeFMUState(c, NULL, 0, &none));
    REFUSED(try_step(c, 0.0, -0.01));
    REFUSED(try_step(c, NAN, 0.01));
    REFUSED(try_step(c, 5.0, 0.01));
    REFUSED(fmi3DoStep(c, 0.0, 0.01, fmi3True, NULL, NULL, NULL, NULL));
    REFUSED(fmi3EnterEventMode(c));
    REFUSED(fmi3EnterConfigurationMode(c));
    CHECK(messages == before + 27); /* one message for each refusal */
    OK(fmi3FreeFMUState(c, NULL));
    step(c, 0.0, 1); /* none of it did harm */
    /* Numbers at the end of the range: a status, whatever the model makes of them. */
    for (unsigned n = 0; n < NX; n++) {
        OK(fmi3SetFloat64(c, &n, 1, (const double[]){n % 2 == 0 ? DBL_MAX : -DBL_MAX}, 1));
    }
    const fmi3Status extreme = try_step(c, 0.01, 0.01);
    CHECK(extreme == fmi3OK || extreme == fmi3Discard || extreme == fmi3Error);
    fmi3FreeInstance(c);
    fmi3FreeInstance(NULL);
}

int main(void) {
    co_simulate();
    exchange();
    err();
    return 0;
}
