/* A life of FMI 2.0 instances, right and wrong, for the sanitizers: create, initialise, step, roll
 * back, serialise, deserialise, wrong calls, free. Exit status 0: every call returned what the
 * standard says. Linked with the sources of an FMU. */
#include <float.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"
#include "model.h"

#define CHECK(condition)                                                \
    do {                                                                \
        if (!(condition)) {                                             \
            fprintf(stderr, "line %d: %s\n", __LINE__, #condition);     \
            exit(1);                                                    \
        }                                                               \
    } while (0)
#define OK(call) CHECK((call) == fmi2OK)
#define REFUSED(call) CHECK((call) == fmi2Error)

static int messages;

static void note(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                 fmi2String category, fmi2String message, ...) {
    (void)environment;
    (void)status;
    CHECK(strlen(name) + strlen(category) + strlen(message) > 0);
    messages++;
}

static const fmi2CallbackFunctions own_memory = {note, calloc, free, NULL, NULL};
static const fmi2CallbackFunctions no_memory = {note, NULL, NULL, NULL, NULL};

static fmi2Component create(fmi2Type type, const fmi2CallbackFunctions *functions) {
    const fmi2Component c =
        fmi2Instantiate("an instance", type, MODEL_TOKEN, "", functions, fmi2False, fmi2True);
    CHECK(c != NULL);
    return c;
}

static void initialise(fmi2Component c) {
    OK(fmi2SetupExperiment(c, fmi2True, 1e-6, 0.0, fmi2False, 0.0));
    OK(fmi2EnterInitializationMode(c));
    OK(fmi2ExitInitializationMode(c));
}

static void get_all(fmi2Component c, double *value) {
    fmi2ValueReference all[REFERENCE_TIME + 1];
    for (unsigned n = 0; n <= REFERENCE_TIME; n++) {
        all[n] = n;
    }
    OK(fmi2GetReal(c, all, REFERENCE_TIME + 1, value));
}

static void step(fmi2Component c, double start, int steps) {
    for (int n = 0; n < steps; n++) {
        OK(fmi2DoStep(c, start + 0.01 * n, 0.01, fmi2False));
    }
}

/* Every column of the Jacobian, all unknowns, and every unknown alone. */
static void differentiate(fmi2Component c) {
    fmi2ValueReference unknown[NX + NW + 1];
    double sensitivity[NX + NW + 1];
    const double one = 1.0;
    for (unsigned n = 0; n < NX + NW; n++) {
        unknown[n] = n < NX ? REFERENCE_XDOT + n : REFERENCE_W + n - NX;
    }
    for (unsigned known = 0; known < REFERENCE_W; known++) {
        if (known >= REFERENCE_XDOT && known < REFERENCE_U) {
            continue;
        }
        OK(fmi2GetDirectionalDerivative(c, unknown, NX + NW, &known, 1, &one, sensitivity));
        OK(fmi2GetDirectionalDerivative(c, unknown + NX + NW - 1, 1, &known, 1, &one, sensitivity));
        OK(fmi2GetDirectionalDerivative(c, NULL, 0, &known, 1, &one, NULL));
    }
}

static void co_simulate(void) {
    double first[REFERENCE_TIME + 1], second[REFERENCE_TIME + 1];
    fmi2FMUstate saved = NULL, copy = NULL;
    size_t size = 0;
    const fmi2Component c = create(fmi2CoSimulation, &own_memory);
    initialise(c);
    step(c, 0.0, 20);
    OK(fmi2GetFMUstate(c, &saved));
    step(c, 0.2, 20);
    get_all(c, first);
    OK(fmi2SetFMUstate(c, saved));
    step(c, 0.2, 20);
    get_all(c, second);
    CHECK(memcmp(first, second, sizeof first) == 0);

    OK(fmi2SerializedFMUstateSize(c, saved, &size));
    fmi2Byte *const bytes = malloc(size); /* exactly as large as asked for */
    CHECK(bytes != NULL);
    OK(fmi2SerializeFMUstate(c, saved, bytes, size));
    REFUSED(fmi2SerializeFMUstate(c, saved, bytes, size - 1));
    OK(fmi2DeSerializeFMUstate(c, bytes, size, &copy));
    OK(fmi2SetFMUstate(c, copy));
    OK(fmi2GetFMUstate(c, &copy));
    step(c, 0.2, 20);
    get_all(c, second);
    CHECK(memcmp(first, second, sizeof first) == 0);
    /* Cut off or damaged anywhere, in exactly as many bytes: refused. */
    for (size_t n = 0; n < size; n += 7) {
        fmi2FMUstate damaged = NULL;
        fmi2Byte *const part = malloc(n + 1);
        CHECK(part != NULL);
        memcpy(part, bytes, n);
        REFUSED(fmi2DeSerializeFMUstate(c, part, n, &damaged));
        free(part);
        bytes[n] ^= 1;
        REFUSED(fmi2DeSerializeFMUstate(c, bytes, size, &damaged));
        bytes[n] ^= 1;
        CHECK(damaged == NULL);
    }
    free(bytes);
    differentiate(c);
    OK(fmi2FreeFMUstate(c, &saved));
    OK(fmi2FreeFMUstate(c, &saved)); /* NULL now */
    OK(fmi2FreeFMUstate(c, &copy));
    OK(fmi2Terminate(c));
    OK(fmi2Reset(c));
    initialise(c);
    step(c, 0.0, 1);
    fmi2FreeInstance(c);
}

static void exchange(void) {
    double x[NX + 1], xdot[NX + 1], all[REFERENCE_TIME + 1];
    fmi2EventInfo events;
    fmi2Boolean enter = fmi2False, stop = fmi2False;
    const fmi2Component c = create(fmi2ModelExchange, &no_memory);
    initialise(c);
    OK(fmi2NewDiscreteStates(c, &events));
    OK(fmi2EnterContinuousTimeMode(c));
    for (int n = 0; n < 100; n++) {
        OK(fmi2SetTime(c, 1e-5 * n));
        OK(fmi2GetContinuousStates(c, x, NX));
        OK(fmi2GetDerivatives(c, xdot, NX));
        for (int k = 0; k < NX; k++) {
            x[k] += 1e-5 * xdot[k];
        }
        OK(fmi2SetContinuousStates(c, x, NX));
        OK(fmi2CompletedIntegratorStep(c, fmi2True, &enter, &stop));
    }
    OK(fmi2GetNominalsOfContinuousStates(c, x, NX));
    OK(fmi2GetEventIndicators(c, NULL, 0));
    get_all(c, all);
    differentiate(c);
    fmi2FreeInstance(c);
}

/* Arguments and orders that the standard forbids: refused with a message, without harm. */
static void err(void) {
    double value[2] = {NAN, 1.0};
    fmi2ValueReference reference[2] = {0, REFERENCE_TIME + 1};
    fmi2FMUstate none = NULL;
    const fmi2ValueReference last = UINT_MAX;
    fmi2Integer order = 1;
    fmi2Real status = 0.0;
    char name[5000];
    CHECK(fmi2Instantiate(NULL, fmi2CoSimulation, MODEL_TOKEN, "", &own_memory, 0, 0) == NULL);
    CHECK(fmi2Instantiate("", fmi2CoSimulation, MODEL_TOKEN, "", &own_memory, 0, 0) == NULL);
    CHECK(fmi2Instantiate("x", fmi2CoSimulation, NULL, "", &own_memory, 0, 0) == NULL);
    memset(name, '%', sizeof name);
    name[sizeof name - 1] = '\0';
    CHECK(fmi2Instantiate("x", fmi2CoSimulation, name, NULL, &own_memory, 0, 1) == NULL);
    CHECK(fmi2Instantiate("x", fmi2CoSimulation, MODEL_TOKEN, NULL, NULL, 0, 0) == NULL);
    const fmi2Component c =
        fmi2Instantiate(name, fmi2CoSimulation, MODEL_TOKEN, NULL, &own_memory, 0, 1);
    CHECK(c != NULL);
    REFUSED(fmi2GetReal(NULL, reference, 1, value));
    REFUSED(fmi2DoStep(c, 0.0, 0.01, fmi2True));
    REFUSED(fmi2GetReal(c, reference, 1, value));
    REFUSED(fmi2SetupExperiment(c, fmi2True, 0.0, 0.0, fmi2False, 0.0));
    REFUSED(fmi2SetupExperiment(c, fmi2False, 0.0, 1.0, fmi2True, 0.0));
    initialise(c);
    const int before = messages;
    REFUSED(fmi2GetReal(c, reference, 2, value));
    REFUSED(fmi2GetReal(c, &last, 1, value));
    REFUSED(fmi2GetReal(c, NULL, 1, value));
    REFUSED(fmi2SetReal(c, &last, 1, value));
    REFUSED(fmi2SetReal(c, reference, 1, (const double[]){NAN}));
    REFUSED(fmi2SetReal(c, reference, 1, (const double[]){INFINITY}));
    REFUSED(fmi2GetInteger(c, reference, 1, &order));
    REFUSED(fmi2SetContinuousStates(c, value, NX + 1));
    REFUSED(fmi2GetContinuousStates(c, NULL, NX));
    REFUSED(fmi2GetDerivatives(c, NULL, NX));
    REFUSED(fmi2GetDirectionalDerivative(c, &last, 1, reference, 1, value, value));
    REFUSED(fmi2GetDirectionalDerivative(c, reference, 1, &last, 1, value, value));
    REFUSED(fmi2GetDirectionalDerivative(c, reference, 1, reference, 1, NULL, value));
    REFUSED(fmi2SetFMUstate(c, NULL));
    REFUSED(fmi2GetFMUstate(c, NULL));
    REFUSED(fmi2SerializeFMUstate(c, NULL, NULL, 0));
    REFUSED(fmi2DeSerializeFMUstate(c, NULL, 0, &none));
    REFUSED(fmi2DoStep(c, 0.0, -0.01, fmi2True));
    REFUSED(fmi2DoStep(c, NAN, 0.01, fmi2True));
    REFUSED(fmi2DoStep(c, 5.0, 0.01, fmi2True));
    REFUSED(fmi2EnterEventMode(c));
    REFUSED(fmi2SetRealInputDerivatives(c, reference, 1, &order, value));
    REFUSED(fmi2CancelStep(c));
    CHECK(messages == before + 23); /* one message for each refusal */
    OK(fmi2FreeFMUstate(c, NULL));
    CHECK(fmi2GetRealStatus(c, fmi2LastSuccessfulTime, &status) == fmi2OK && status == 0.0);
    step(c, 0.0, 1); /* none of it did harm */
    /* Numbers at the end of the range: a status, whatever the model makes of them. */
    for (unsigned n = 0; n < NX; n++) {
        OK(fmi2SetReal(c, &n, 1, (const double[]){n % 2 == 0 ? DBL_MAX : -DBL_MAX}));
    }
    const fmi2Status extreme = fmi2DoStep(c, 0.01, 0.01, fmi2False);
    CHECK(extreme == fmi2OK || extreme == fmi2Discard || extreme == fmi2Error);
    fmi2FreeInstance(c);
    fmi2FreeInstance(NULL);
}

int main(void) {
    co_simulate();
    exchange();
    err();
    return 0;
}
