/* FMI 2.0 Model Exchange of a ball that falls and is thrown back: h'' = -(g + dg), v -> -e v where h = 0. */
#include <stdlib.h>
#include <string.h>
#include "fmi2FunctionTypes.h"
#ifndef SAYS /* whether it says that states have changed */
#define SAYS fmi2True
#endif
enum { H, DH, V, DV, G, DG, E, SIZE };
typedef struct { double r[SIZE], left; /* in v by derivatives */ } Ball;
static void reset(Ball *m) {
    memset(m, 0, sizeof *m);
    m->r[H] = 1.0, m->r[G] = 9.81, m->r[E] = 0.8;
}
static void calculate(Ball *m) { m->r[DH] = m->r[V], m->r[DV] = -(m->r[G] + m->r[DG]); }
const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return "2.0"; }
fmi2Component fmi2Instantiate(fmi2String a, fmi2Type b, fmi2String c, fmi2String d, const fmi2CallbackFunctions *e, fmi2Boolean f, fmi2Boolean g) {
    Ball *m = malloc(sizeof *m);
    reset(m);
    return m;
}
void fmi2FreeInstance(fmi2Component c) { free(c); }
fmi2Status fmi2Reset(fmi2Component c) { reset(c); return fmi2OK; }
#define OK(name, ...) fmi2Status name(__VA_ARGS__) { return fmi2OK; }
OK(fmi2SetupExperiment, fmi2Component c, fmi2Boolean a, fmi2Real b, fmi2Real t, fmi2Boolean d, fmi2Real e)
OK(fmi2EnterInitializationMode, fmi2Component c) OK(fmi2ExitInitializationMode, fmi2Component c)
OK(fmi2Terminate, fmi2Component c) OK(fmi2EnterEventMode, fmi2Component c)
OK(fmi2EnterContinuousTimeMode, fmi2Component c) OK(fmi2SetTime, fmi2Component c, fmi2Real t)
fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *e) {
    double *r = ((Ball *)c)->r;
    memset(e, 0, sizeof *e);
#ifdef RESTS /* where it is slower than this; until then it is thrown back from where it was found */
    if (r[H] <= 0.0 && r[V] < 0.0) r[V] *= -r[E], e->valuesOfContinuousStatesChanged = SAYS;
    if (r[H] <= 0.0 && r[V] < RESTS) r[V] = 0.0, r[DG] = -r[G];
    return fmi2OK;
#endif
    if (r[H] <= 0.0 && r[V] < 0.0) r[H] = 0.0, r[V] *= -r[E], e->valuesOfContinuousStatesChanged = SAYS;
    return fmi2OK;
}
fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean n, fmi2Boolean *event, fmi2Boolean *end) { *event = *end = fmi2False; return fmi2OK; }
fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x[], size_t n) { x[0] = x[1] = 1.0; return fmi2OK; }
fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t n) { double *r = ((Ball *)c)->r; r[H] = x[0], r[V] = x[1], ((Ball *)c)->left = 0.0; return fmi2OK; }
fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t n) { const double *r = ((Ball *)c)->r; x[0] = r[H], x[1] = r[V]; return fmi2OK; }
fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real x[], size_t n) { calculate(c); x[0] = ((Ball *)c)->r[DH], x[1] = ((Ball *)c)->r[DV]; return fmi2OK; }
fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real z[], size_t n) { z[0] = ((Ball *)c)->r[H]; return fmi2OK; }
fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference k[], size_t n, fmi2Real v[]) {
    calculate(c);
    for (size_t i = 0; i < n; i++) v[i] = ((Ball *)c)->r[k[i]] + (k[i] == V) * ((Ball *)c)->left;
    return fmi2OK;
}
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference k[], size_t n, const fmi2Real v[]) {
    for (size_t i = 0; i < n; i++) ((Ball *)c)->r[k[i]] = v[i];
    return fmi2OK;
}
fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *s) {
    if (!*s) *s = malloc(sizeof(Ball));
    memcpy(*s, c, sizeof(Ball));
    return fmi2OK;
}
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate s) { memcpy(c, s, sizeof(Ball)); return fmi2OK; }
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *s) { free(*s), *s = NULL; return fmi2OK; }
/* As Dymola does, it leaves in v what only a call that sets the states takes out. */
fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference z[], size_t nz, const fmi2ValueReference v[], size_t nv, const fmi2Real dv[], fmi2Real dz[]) {
    for (size_t i = 0; i < nz; i++) {
        dz[i] = 0.0;
        for (size_t j = 0; j < nv; j++)
            dz[i] += dv[j] * ((z[i] == v[j] || (z[i] == DH && v[j] == V)) - (z[i] == DV && (v[j] == G || v[j] == DG)));
    }
    ((Ball *)c)->left = 1.0;
    return fmi2OK;
}
/* FMPy looks for all functions; these are never called. */
#define NEVER(name) fmi2Status name(void) { return fmi2Error; }
NEVER(fmi2SetDebugLogging) NEVER(fmi2GetInteger) NEVER(fmi2GetBoolean) NEVER(fmi2GetString)
NEVER(fmi2SetInteger) NEVER(fmi2SetBoolean) NEVER(fmi2SetString)
NEVER(fmi2SerializedFMUstateSize) NEVER(fmi2SerializeFMUstate) NEVER(fmi2DeSerializeFMUstate)
