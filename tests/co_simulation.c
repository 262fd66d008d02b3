/* FMI 2.0 Co-Simulation without Model Exchange: der(x) = u, each step exact. */
#include <math.h>
#include <stdlib.h>
#include <time.h>
#include "fmi2FunctionTypes.h"
enum { X, U, SLOPE, TIME, BEFORE, LOOSE, FED, SIZE };
const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return "2.0"; }
#if STAYS == 2
static double left = 1.0;
#endif
fmi2Component fmi2Instantiate(fmi2String a, fmi2Type b, fmi2String c, fmi2String d, const fmi2CallbackFunctions *e, fmi2Boolean f, fmi2Boolean g) {
    double *r = calloc(SIZE, sizeof *r);
    r[X] = r[BEFORE] = 1.0, r[LOOSE] = 0.01;
#if STAYS == 2
    r[X] = left;
#endif
#ifdef ONCE /* no reset, and no second instance until the library is loaded anew */
    static int instances;
    if (instances++) return NULL;
#endif
    return r;
}
#if STAYS == 2
void fmi2FreeInstance(fmi2Component c) { left = ((double *)c)[X], free(c); }
#else
void fmi2FreeInstance(fmi2Component c) { free(c); }
#endif
#ifdef ONCE
fmi2Status fmi2Reset(fmi2Component c) { return fmi2Error; }
#elif defined STAYS /* where it is; 2: and so begins the next instance */
fmi2Status fmi2Reset(fmi2Component c) { return fmi2OK; }
#else
fmi2Status fmi2Reset(fmi2Component c) { ((double *)c)[X] = ((double *)c)[BEFORE] = 1.0, ((double *)c)[U] = ((double *)c)[TIME] = ((double *)c)[FED] = 0.0; return fmi2OK; }
#endif
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean a, fmi2Real b, fmi2Real t, fmi2Boolean d, fmi2Real e) { if (a) ((double *)c)[LOOSE] = b; return fmi2OK; }
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2Terminate(fmi2Component c) { return fmi2OK; }
#ifndef ONLY /* size of a step, 0 for any */
#define ONLY 0.0
#endif
#ifdef LAGS /* der(x) = u - x, u a straight line */
fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference k[], size_t n, const fmi2Integer o[], const fmi2Real v[]) { ((double *)c)[SLOPE] = v[0]; return o[0] == 1 ? fmi2OK : fmi2Error; }
#else
fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference k[], size_t n, const fmi2Integer o[], const fmi2Real v[]) { return fmi2Error; }
#endif
#ifdef ENDS /* time by which it asks to end */
fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind s, fmi2Boolean *v) { *v = s == fmi2Terminated; return fmi2OK; }
#else
fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind s, fmi2Boolean *v) { return fmi2Error; }
#endif
#ifdef LONGEST /* step that its solver makes whole */
static double last;
fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *v) { *v = last; return fmi2OK; }
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean n) {
    const double made = h > LONGEST ? LONGEST : h;
    ((double *)c)[X] += made * ((double *)c)[U], last = t + made;
    return made < h ? fmi2Discard : fmi2OK;
}
#else
fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *v) { return fmi2Error; }
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean n) {
#ifdef LAGS
    double *r = c;
    r[X] = (r[X] - r[U] + r[SLOPE]) * exp(-h) + r[U] + r[SLOPE] * (h - 1.0);
    return fmi2OK;
#endif
#ifdef SOLVES /* in steps of one size, as far as they reach */
    double *s = c;
    for (; s[TIME] + SOLVES <= t + h + 1e-9; s[TIME] += SOLVES) s[X] += SOLVES * s[U];
    return fmi2OK;
#endif
#ifdef ROUGH /* its error is its tolerance, and a step that may be undone is one again */
    double *q = c;
    if (!n) q[X] = q[BEFORE];
    q[BEFORE] = q[X], q[X] += h * q[U] * (1.0 + q[LOOSE]);
    return fmi2OK;
#endif
#ifdef ENDS
    if (t + h > ENDS) return fmi2Discard;
#endif
    if (ONLY && (h < 0.99 * ONLY || h > 1.01 * ONLY)) return fmi2Error;
    ((double *)c)[X] += h * ((double *)c)[U];
#ifdef FEEDS /* x is u twice at once, too, of the step that was made */
    double *f = c;
    f[X] += 2.0 * (f[U] - f[FED]), f[FED] = f[U];
#endif
#ifdef RANDOM /* variable that is moved by what is drawn */
    static unsigned drawn;
    struct timespec now;
    if (!drawn) timespec_get(&now, TIME_UTC), drawn = (unsigned)now.tv_nsec;
    ((double *)c)[RANDOM] += 1e-3 * (drawn = drawn * 1103515245u + 12345u) / 4294967296.0;
#endif
    return fmi2OK;
}
#endif
fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference k[], size_t n, fmi2Real v[]) {
    for (size_t i = 0; i < n; i++) v[i] = ((double *)c)[k[i]];
    return fmi2OK;
}
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference k[], size_t n, const fmi2Real v[]) {
    for (size_t i = 0; i < n; i++) ((double *)c)[k[i]] = v[i];
    return fmi2OK;
}
/* FMPy looks for all functions; these are never called. */
#define NEVER(name) fmi2Status name(void) { return fmi2Error; }
NEVER(fmi2SetDebugLogging) NEVER(fmi2GetInteger) NEVER(fmi2GetBoolean) NEVER(fmi2GetString) NEVER(fmi2SetInteger)
NEVER(fmi2SetBoolean) NEVER(fmi2SetString) NEVER(fmi2GetFMUstate) NEVER(fmi2SetFMUstate) NEVER(fmi2FreeFMUstate)
NEVER(fmi2SerializedFMUstateSize) NEVER(fmi2SerializeFMUstate) NEVER(fmi2DeSerializeFMUstate)
NEVER(fmi2GetDirectionalDerivative) NEVER(fmi2GetRealOutputDerivatives)
NEVER(fmi2CancelStep) NEVER(fmi2GetStatus) NEVER(fmi2GetIntegerStatus)
NEVER(fmi2GetStringStatus)
