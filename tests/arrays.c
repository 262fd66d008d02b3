/* FMI 3.0 whose variables are arrays: der(x[i]) = g u[i] - k[i] x[i], y = x, g of Float32. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "fmi3FunctionTypes.h"
enum { X, DX, K, Y, U, G, ARRAYS };
typedef double Model[ARRAYS][2];
static void reset(void *m) {
    const double first[2] = {1.0, 2.0};
    memset(m, 0, sizeof(Model));
    memcpy(((double(*)[2])m)[X], first, sizeof first), memcpy(((double(*)[2])m)[K], first, sizeof first);
    ((double(*)[2])m)[G][0] = 1.0;
}
static void calculate(double (*m)[2]) {
    for (int i = 0; i < 2; i++) m[DX][i] = m[G][0] * m[U][i] - m[K][i] * m[X][i], m[Y][i] = m[X][i];
}
const char *fmi3GetVersion(void) { return "3.0"; }
fmi3Instance fmi3InstantiateModelExchange(fmi3String a, fmi3String b, fmi3String c, fmi3Boolean d, fmi3Boolean e, fmi3InstanceEnvironment f, fmi3LogMessageCallback g) {
    void *m = malloc(sizeof(Model));
    reset(m);
    return m;
}
fmi3Instance fmi3InstantiateCoSimulation(fmi3String a, fmi3String b, fmi3String c, fmi3Boolean d, fmi3Boolean e, fmi3Boolean f, fmi3Boolean g, const fmi3ValueReference h[], size_t n, fmi3InstanceEnvironment i, fmi3LogMessageCallback j, fmi3IntermediateUpdateCallback k) { return fmi3InstantiateModelExchange(a, b, c, d, e, i, j); }
#ifndef SHARE /* of a step that it takes, without a word */
#define SHARE 1.0
#endif
fmi3Status fmi3DoStep(fmi3Instance m, fmi3Float64 t, fmi3Float64 h, fmi3Boolean a, fmi3Boolean *b, fmi3Boolean *c, fmi3Boolean *d, fmi3Float64 *last) {
    double(*r)[2] = m;
    for (int i = 0; i < 2; i++) r[X][i] = r[U][i] / r[K][i] + (r[X][i] - r[U][i] / r[K][i]) * exp(-r[K][i] * SHARE * h);
    *b = *c = *d = fmi3False, *last = t + SHARE * h;
    return fmi3OK;
}
#ifndef INDICATORS /* more than the model structure has */
#define INDICATORS 0
#endif
fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance m, size_t *n) { *n = INDICATORS; return fmi3OK; }
void fmi3FreeInstance(fmi3Instance m) { free(m); }
fmi3Status fmi3Reset(fmi3Instance m) { reset(m); return fmi3OK; }
fmi3Status fmi3EnterInitializationMode(fmi3Instance m, fmi3Boolean a, fmi3Float64 b, fmi3Float64 c, fmi3Boolean d, fmi3Float64 e) { return fmi3OK; }
fmi3Status fmi3ExitInitializationMode(fmi3Instance m) { return fmi3OK; }
fmi3Status fmi3EnterEventMode(fmi3Instance m) { return fmi3OK; }
fmi3Status fmi3UpdateDiscreteStates(fmi3Instance m, fmi3Boolean *a, fmi3Boolean *b, fmi3Boolean *c, fmi3Boolean *d, fmi3Boolean *e, fmi3Float64 *f) {
    *a = *b = *c = *d = *e = fmi3False;
    return fmi3OK;
}
fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance m) { return fmi3OK; }
fmi3Status fmi3Terminate(fmi3Instance m) { return fmi3OK; }
fmi3Status fmi3SetTime(fmi3Instance m, fmi3Float64 t) { return fmi3OK; }
fmi3Status fmi3SetContinuousStates(fmi3Instance m, const fmi3Float64 x[], size_t n) { memcpy(((double(*)[2])m)[X], x, n * sizeof *x); return fmi3OK; }
fmi3Status fmi3GetContinuousStates(fmi3Instance m, fmi3Float64 x[], size_t n) { memcpy(x, ((double(*)[2])m)[X], n * sizeof *x); return fmi3OK; }
fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance m, fmi3Float64 x[], size_t n) {
    calculate(m);
    memcpy(x, ((double(*)[2])m)[DX], n * sizeof *x);
    return fmi3OK;
}
fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance m, fmi3Float64 x[], size_t n) { x[0] = x[1] = 1.0; return fmi3OK; }
/* Values of an array go together: two for each reference. */
fmi3Status fmi3GetFloat64(fmi3Instance m, const fmi3ValueReference k[], size_t n, fmi3Float64 v[], size_t count) {
    if (n == 1 && k[0] > G) { v[0] = 0.0; return fmi3OK; } /* time, which is none */
    if (count != 2 * n) return fmi3Error;
    calculate(m);
    for (size_t i = 0; i < n; i++) memcpy(v + 2 * i, ((double(*)[2])m)[k[i]], 2 * sizeof *v);
    return fmi3OK;
}
fmi3Status fmi3SetFloat64(fmi3Instance m, const fmi3ValueReference k[], size_t n, const fmi3Float64 v[], size_t count) {
    if (count != 2 * n) return fmi3Error;
    for (size_t i = 0; i < n; i++) memcpy(((double(*)[2])m)[k[i]], v + 2 * i, 2 * sizeof *v);
    return fmi3OK;
}
fmi3Status fmi3GetFloat32(fmi3Instance m, const fmi3ValueReference k[], size_t n, fmi3Float32 v[], size_t count) { v[0] = ((double(*)[2])m)[G][0]; return fmi3OK; }
fmi3Status fmi3SetFloat32(fmi3Instance m, const fmi3ValueReference k[], size_t n, const fmi3Float32 v[], size_t count) { ((double(*)[2])m)[G][0] = v[0]; return fmi3OK; }
