/* FMI 2.0 Model Exchange of a heated room, C der(T) = P - G (T - Ta). What switches the heating P is
 * chosen by WHAT: a thermostat with hysteresis (state events), a timetable (time events), a relay
 * that switches a relay (two iterations at the start), a fuse (step events), or nothing at a time
 * event that stays due. MODE and FLAG are an Integer and a Boolean parameter whose value references
 * are those of T and its derivative. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "fmi2FunctionTypes.h"
enum { THERMOSTAT, TIMETABLE, RELAYS, FUSE, STUCK };
enum { T, DT, TA, G, DG, C, P, SIZE };
#define MOST 2000 /* steps that a delay remembers */
typedef struct { double r[SIZE], time, past[MOST][2]; int mode, flag, relay, steps; const fmi2CallbackFunctions *callbacks; } Room;
static void reset(Room *m) {
    const fmi2CallbackFunctions *callbacks = m->callbacks;
    memset(m, 0, sizeof *m);
    m->callbacks = callbacks;
    m->r[T] = 291.0, m->r[TA] = 280.0, m->r[G] = 50.0, m->r[C] = 1e5;
}
static double delayed(const Room *m, double by) { /* T, on a straight line between steps */
    const double t = m->time - by;
    int k = m->steps - 1;
    if (t <= m->past[0][0]) return m->past[0][1];
    while (m->past[k][0] > t) k--;
    const double *a = m->past[k], here[2] = {m->time, m->r[T]}, *b = k + 1 < m->steps ? m->past[k + 1] : here;
    return a[1] + (b[1] - a[1]) * (t - a[0]) / (b[0] - a[0]);
}
static void calculate(Room *m) {
    const double *r = m->r;
#ifdef INTEGRATES /* a room that loses no heat */
    m->r[DT] = r[P] / r[C];
    return;
#endif
#ifdef DELAY /* of the heat loss, whose steps it remembers */
    m->r[DT] = (r[P] - r[G] * (delayed(m, DELAY) - r[TA])) / r[C];
    return;
#endif
#ifdef UNKNOWN /* a power that is no number at the start */
    m->r[DT] = r[G] * (r[TA] - r[T]) / r[C], m->r[P] = m->time > 0.0 ? r[G] * (r[TA] - r[T]) : NAN;
    return;
#endif
#ifdef UNREAD
    m->r[DT] = r[G] * (r[TA] - r[T]) / r[C];
    return;
#endif
#ifdef HIDDEN /* a thermostat in the code, which no event tells */
    m->relay = r[T] < 293.0 ? 1 : r[T] > 295.0 ? 0 : m->relay, m->r[P] = m->relay ? 1500.0 : 0.0;
#endif
#ifdef BENDS /* a heating with half of its power above a temperature, which no indicator tells */
    if (r[T] > BENDS) { m->r[DT] = (r[P] / 2.0 - (r[G] + r[DG]) * (r[T] - r[TA])) / r[C]; return; }
#endif
    m->r[DT] = (r[P] * (1 + m->mode) - (r[G] + r[DG]) * (r[T] - r[TA])) / r[C] + m->flag;
}
const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return "2.0"; }
fmi2Component fmi2Instantiate(fmi2String a, fmi2Type b, fmi2String c, fmi2String d, const fmi2CallbackFunctions *e, fmi2Boolean f, fmi2Boolean g) {
    Room *m = calloc(1, sizeof *m);
#ifdef SINGLE /* instance that it bears */
    static int made;
    if (made++) abort();
#endif
    m->callbacks = e;
    reset(m);
    return m;
}
void fmi2FreeInstance(fmi2Component c) { free(c); }
#ifdef KEEPS /* a heat loss through a reset */
fmi2Status fmi2Reset(fmi2Component c) { const double G_ = ((Room *)c)->r[G]; reset(c), ((Room *)c)->r[G] = G_; return fmi2OK; }
#else
fmi2Status fmi2Reset(fmi2Component c) { reset(c); return fmi2OK; }
#endif
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean a, fmi2Real b, fmi2Real t, fmi2Boolean d, fmi2Real e) {
    ((Room *)c)->time = t;
#ifdef UNTOLD /* warns of a tolerance, since it does not integrate */
    return a ? fmi2Warning : fmi2OK;
#endif
    return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    Room *m = c;
#ifdef RANDOM /* heat capacity, of each start */
    m->r[C] *= 1.0 + 0.1 * rand() / RAND_MAX;
#endif
    m->past[0][0] = m->time, m->past[0][1] = m->r[T], m->steps = 1;
    return fmi2OK;
}
fmi2Status fmi2Terminate(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2EnterEventMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *e) {
    Room *m = c;
    memset(e, 0, sizeof *e);
    if (WHAT == THERMOSTAT) m->r[P] = m->r[T] < 293.0 ? 1500.0 : m->r[T] > 295.0 ? 0.0 : m->r[P];
#ifdef CHATTERS /* a relay without hysteresis */
    m->r[P] = m->r[T] < 295.0 ? 1500.0 : 0.0;
#endif
#ifndef CONTROLS
    if (WHAT == TIMETABLE) {
        const int part = (int)floor(m->time / 600.0 + 1e-9);
        m->r[P] = part % 2 == 0 ? 1500.0 : 0.0;
        e->nextEventTimeDefined = fmi2True, e->nextEventTime = 600.0 * (part + 1);
    }
#else /* the temperature, every 20 s, by a power per deviation */
    const int sample = 1 + (int)floor(m->time / 20.0 + 1e-9);
    if (sample != m->relay) m->r[P] = CONTROLS * (295.0 - m->r[T]), m->relay = sample;
    e->nextEventTimeDefined = fmi2True, e->nextEventTime = 20.0 * sample;
#endif
    if (WHAT == STUCK) e->nextEventTimeDefined = fmi2True, e->nextEventTime = m->time < 30.0 ? 30.0 : 20.0;
    if (WHAT == RELAYS) {
        m->r[P] = m->relay ? 1500.0 : 0.0;
        e->newDiscreteStatesNeeded = !m->relay, m->relay = 1;
    }
    if (WHAT == FUSE) m->r[P] = m->relay || m->r[T] > 295.0 ? 0.0 : 1500.0, m->relay = m->r[P] == 0.0;
    return fmi2OK;
}
fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean n, fmi2Boolean *event, fmi2Boolean *end) {
    Room *m = c;
#ifdef MOVES /* a window that cools it at the end of a step, which is no event; 2: once */
    if (m->r[T] > 295.0 && !(MOVES == 2 && m->relay)) m->r[T] -= 0.2, m->relay = 1;
#endif
#ifdef LATER /* a heat loss that steps change, from 50 s on */
    if (m->time > 50.0) m->r[G] = m->r[T] - 241.0;
#endif
    if (m->steps < MOST) m->past[m->steps][0] = m->time, m->past[m->steps++][1] = m->r[T];
#ifdef LATE /* an output that follows at the end of a step alone */
    m->r[P] = m->r[T] - m->r[TA];
#endif
    *event = WHAT == FUSE && !m->relay && m->r[T] > 295.0, *end = fmi2False;
#ifdef ONCE /* a fuse that is told at the end of one step alone */
    if (*event) m->relay = 1;
#endif
    return fmi2OK;
}
fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x[], size_t n) { x[0] = 300.0; return fmi2OK; }
fmi2Status fmi2SetTime(fmi2Component c, fmi2Real t) { ((Room *)c)->time = t; return fmi2OK; }
fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t n) { ((Room *)c)->r[T] = x[0]; return fmi2OK; }
fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t n) { x[0] = ((Room *)c)->r[T]; return fmi2OK; }
fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real x[], size_t n) {
    Room *m = c;
    calculate(c);
    x[0] = m->r[DT];
#ifdef UNREAD /* an output that follows where derivatives are read */
    m->r[P] = m->r[T] - m->r[TA];
#endif
#ifdef DISCARDS /* below its table */
    if (m->r[T] < DISCARDS) return fmi2Discard;
#endif
#ifdef FULL /* above its start */
    if (m->r[T] > FULL) return fmi2Discard;
#endif
#ifdef LOST /* above its table */
    if (m->r[T] > LOST) x[0] = NAN;
#endif
#ifdef WARNS /* above its table: 1 by a message and a status, 2 by a status alone, 3 by a message alone */
    if (m->r[T] > 292.0) {
        if (WARNS != 2) m->callbacks->logger(m->callbacks->componentEnvironment, "room", fmi2Warning, "logStatusWarning", "%s is above its table", "T");
        return WARNS == 3 ? fmi2OK : fmi2Warning;
    }
#endif
    return fmi2OK;
}
fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real z[], size_t n) {
    const double *r = ((Room *)c)->r;
    z[0] = r[P] > 0.0 ? 295.0 - r[T] : r[T] - 293.0;
#ifdef CHATTERS
    z[0] = 295.0 - r[T];
#endif
    return fmi2OK;
}
fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference k[], size_t n, fmi2Real v[]) {
    calculate(c);
    for (size_t i = 0; i < n; i++) v[i] = ((Room *)c)->r[k[i]];
    return fmi2OK;
}
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference k[], size_t n, const fmi2Real v[]) {
    for (size_t i = 0; i < n; i++) ((Room *)c)->r[k[i]] = v[i];
    return fmi2OK;
}
fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference k[], size_t n, const fmi2Integer v[]) { ((Room *)c)->mode = v[0]; return fmi2OK; }
fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference k[], size_t n, const fmi2Boolean v[]) { ((Room *)c)->flag = v[0]; return fmi2OK; }
fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference k[], size_t n, fmi2Integer v[]) { v[0] = 10 + ((Room *)c)->flag; return fmi2OK; }
fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference k[], size_t n, fmi2Boolean v[]) { v[0] = ((Room *)c)->flag; return fmi2OK; }
fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *s) {
    if (!*s) *s = malloc(sizeof(Room));
    memcpy(*s, c, sizeof(Room));
    return fmi2OK;
}
#ifdef FORGETS /* whether it heated */
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate s) { const double P_ = ((Room *)c)->r[P]; memcpy(c, s, sizeof(Room)), ((Room *)c)->r[P] = P_; return fmi2OK; }
#else
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate s) { memcpy(c, s, sizeof(Room)); return fmi2OK; }
#endif
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *s) { free(*s), *s = NULL; return fmi2OK; }
/* FMPy looks for all functions; these are never called. */
#define NEVER(name) fmi2Status name(void) { return fmi2Error; }
NEVER(fmi2SetDebugLogging) NEVER(fmi2GetString)
NEVER(fmi2SetString)
NEVER(fmi2SerializedFMUstateSize) NEVER(fmi2SerializeFMUstate) NEVER(fmi2DeSerializeFMUstate)
#ifdef STALE /* derivatives that hold at the start values of parameters alone, as those that code has as numbers */
fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference z[], size_t n, const fmi2ValueReference v[], size_t k, const fmi2Real dv[], fmi2Real dz[]) {
    const double *r = ((Room *)c)->r;
    for (size_t i = 0; i < n; i++) {
        dz[i] = 0.0;
        for (size_t j = 0; j < k; j++) {
            const double by = v[j] == T ? -50.0 : v[j] == TA ? 50.0 : v[j] == DG ? r[TA] - r[T] : 0.0;
            dz[i] += dv[j] * (z[i] == DT ? by / 1e5 : z[i] == v[j]);
        }
    }
    return fmi2OK;
}
#else
NEVER(fmi2GetDirectionalDerivative)
#endif
#ifdef ALONE /* Co-Simulation that always heats; each step is exact for inputs that stay */
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean n) {
    double *r = ((Room *)c)->r;
    const double loss = r[G] + r[DG], steady = r[TA] + 1500.0 / loss;
    r[T] = steady + (r[T] - steady) * exp(-h * loss / r[C]);
    return fmi2OK;
}
NEVER(fmi2SetRealInputDerivatives) NEVER(fmi2GetRealOutputDerivatives)
NEVER(fmi2CancelStep) NEVER(fmi2GetStatus) NEVER(fmi2GetRealStatus) NEVER(fmi2GetIntegerStatus)
NEVER(fmi2GetBooleanStatus) NEVER(fmi2GetStringStatus)
#endif
