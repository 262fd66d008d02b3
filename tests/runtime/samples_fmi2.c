/* Samples through a Co-Simulation FMU of FMI 2.0, for the sanitizers. Reads the numbers of samples,
 * inputs and outputs, references of both, then for each sample the size of its step and the inputs;
 * prints the outputs after each. At the middle the state is saved, and restored after ten more steps,
 * which are made again. The FMU must not ask for memory between instantiation and the saved state. */
#include <stdio.h>
#include <stdlib.h>

#include "fmi2Functions.h"
#include "model.h"

#define CHECK(condition)                                            \
    do {                                                            \
        if (!(condition)) {                                         \
            fprintf(stderr, "line %d: %s\n", __LINE__, #condition); \
            exit(1);                                                \
        }                                                           \
    } while (0)

enum { MOST = 256, AGAIN = 10 };

static int allocations;

static void *allocate(size_t count, size_t size) {
    allocations++;
    return calloc(count, size);
}

static void note(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                 fmi2String category, fmi2String message, ...) {
    (void)environment, (void)category;
    fprintf(stderr, "%s, status %d: %s\n", name, (int)status, message);
}

int main(void) {
    static const fmi2CallbackFunctions functions = {note, allocate, free, NULL, NULL};
    fmi2ValueReference input[MOST], output[MOST];
    int samples, inputs, outputs;
    CHECK(scanf("%d %d %d", &samples, &inputs, &outputs) == 3 && inputs < MOST && outputs < MOST);
    for (int k = 0; k < inputs + outputs; k++) {
        CHECK(scanf("%u", k < inputs ? &input[k] : &output[k - inputs]) == 1);
    }
    const int width = inputs + 1;
    double *const sample = calloc((size_t)samples * (size_t)width, sizeof *sample);
    CHECK(sample != NULL);
    for (int k = 0; k < samples * width; k++) {
        CHECK(scanf("%lf", &sample[k]) == 1);
    }
    const fmi2Component c = fmi2Instantiate("samples", fmi2CoSimulation, MODEL_TOKEN, "",
                                            &functions, fmi2False, fmi2False);
    CHECK(c != NULL && allocations == 1);
    CHECK(fmi2SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2False, 0.0) == fmi2OK);
    CHECK(fmi2EnterInitializationMode(c) == fmi2OK && fmi2ExitInitializationMode(c) == fmi2OK);
    fmi2FMUstate saved = NULL;
    double time = 0.0, time_saved = 0.0, value[MOST];
    int restored = 0;
    for (int k = 0; k < samples; k++) {
        if (k == samples / 2 && !restored) {
            CHECK(allocations == 1);
            CHECK(fmi2GetFMUstate(c, &saved) == fmi2OK);
            time_saved = time;
        }
        if (k == samples / 2 + AGAIN && !restored) {
            CHECK(fmi2SetFMUstate(c, saved) == fmi2OK);
            k = samples / 2;
            time = time_saved;
            restored = 1;
        }
        CHECK(fmi2SetReal(c, input, (size_t)inputs, sample + k * width + 1) == fmi2OK);
        CHECK(fmi2DoStep(c, time, sample[k * width], fmi2True) == fmi2OK);
        time += sample[k * width];
        CHECK(fmi2GetReal(c, output, (size_t)outputs, value) == fmi2OK);
        for (int n = 0; n < outputs; n++) {
            printf("%.17g ", value[n]);
        }
        printf("\n");
    }
    CHECK(fmi2FreeFMUstate(c, &saved) == fmi2OK);
    fmi2FreeInstance(c);
    free(sample);
    return 0;
}
