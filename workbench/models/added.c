/* A Model Exchange FMU (FMI 2.0) around another one, with terms beside the rates of its states.

   All calls go to the inner FMU, which lies unpacked below the resources. Variables from FIRST on are
   the coefficients of the terms, then their speeds, of which a Stribeck term alone makes use:
   rate[i] = inner rate[i] + sum of coefficient * form(state[i], speed).
   Parameters of the inner FMU that differ from its own are set as it is instantiated. */

#include <dlfcn.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"
#include "added.h" /* generated: GUID, INNER_*, FIRST, TERMS, STATES, terms, states, rates, changed */

/* Called by its type: every function of the inner FMU that is handed on. */
#define INNER(X) \
    X(GetVersion) X(SetDebugLogging) X(Instantiate) X(FreeInstance) X(SetupExperiment) \
    X(EnterInitializationMode) X(ExitInitializationMode) X(Terminate) X(Reset) X(GetReal) \
    X(GetInteger) X(GetBoolean) X(GetString) X(SetReal) X(SetInteger) X(SetBoolean) X(SetString) \
    X(GetFMUstate) X(SetFMUstate) X(FreeFMUstate) X(GetDirectionalDerivative) X(EnterEventMode) \
    X(NewDiscreteStates) X(EnterContinuousTimeMode) X(CompletedIntegratorStep) X(SetTime) \
    X(SetContinuousStates) X(GetDerivatives) X(GetEventIndicators) X(GetContinuousStates) \
    X(GetNominalsOfContinuousStates)

typedef struct {
    void *library;
    fmi2Component inner;
    double own[OWN_VARIABLES];
#define POINTER(name) fmi2##name##TYPE *name;
    INNER(POINTER)
#undef POINTER
} Model;

typedef struct {
    fmi2FMUstate inner;
    double own[OWN_VARIABLES];
} Saved;

/* Value of a form at x, its derivatives by x and by the speed. Friction is smooth within `width` of
   rest. A Stribeck term is -tanh(x / width) exp(-|x| / speed). */
static double form(const Term *term, double x, double speed, double *slope, double *by_speed) {
    *by_speed = 0.0;
    switch (term->form) {
        case COULOMB: {
            double t = tanh(x / term->width);
            *slope = -(1.0 - t * t) / term->width;
            return -t;
        }
        case STRIBECK: {
            double t = tanh(x / term->width), left = exp(-fabs(x) / speed);
            *slope = left * ((x < 0.0 ? -t : t) / speed - (1.0 - t * t) / term->width);
            *by_speed = -t * left * fabs(x) / (speed * speed);
            return -t * left;
        }
        case VISCOUS:
            *slope = -1.0;
            return -x;
        case QUADRATIC:
            *slope = -2.0 * fabs(x);
            return -x * fabs(x);
        default:
            *slope = 0.0;
            return 1.0;
    }
}

/* Sum of the terms of one state, and its derivative by the state. */
static double sum(const Model *m, size_t state, double x, double *slope) {
    double total = 0.0;
    *slope = 0.0;
    for (size_t k = 0; k < TERMS; k++) {
        if (terms[k].state != state || m->own[k] == 0.0) continue;
        double by_state, by_speed;
        total += m->own[k] * form(&terms[k], x, m->own[TERMS + k], &by_state, &by_speed);
        *slope += m->own[k] * by_state;
    }
    return total;
}

/* The worse of two: a warning of the inner FMU is handed on. */
static fmi2Status worse(fmi2Status a, fmi2Status b) { return a > b ? a : b; }

static fmi2Status change(Model *m) {
    for (size_t k = 0; k < TERMS; k++) {
        m->own[k] = terms[k].start;
        m->own[TERMS + k] = terms[k].speed;
    }
    return CHANGED ? m->SetReal(m->inner, changed, CHANGED, values) : fmi2OK;
}

/* Path of a file URI, with its %20; memory of the caller's. */
static char *path_of(const char *uri, const char *below) {
    if (!uri) return NULL;
    if (!strncmp(uri, "file:", 5)) uri += 5;
    if (!strncmp(uri, "//", 2)) uri += 2;
    if (!strncmp(uri, "localhost/", 10)) uri += 9;
    char *path = malloc(strlen(uri) + strlen(below) + 1), *to = path;
    if (!path) return NULL;
    for (; *uri; uri++) {
        if (uri[0] == '%' && uri[1] && uri[2]) {
            const char code[] = {uri[1], uri[2], 0};
            *to++ = (char)strtol(code, NULL, 16);
            uri += 2;
        } else
            *to++ = *uri;
    }
    if (to > path && to[-1] == '/') to--;
    strcpy(to, below);
    return path;
}

static int load(Model *m, const char *location) {
    char *library = path_of(location, "/" INNER_LIBRARY);
    if (library) m->library = dlopen(library, RTLD_NOW | RTLD_LOCAL);
    free(library);
    if (!m->library) return 0;
#define FIND(name) \
    if (!(m->name = (fmi2##name##TYPE *)dlsym(m->library, "fmi2" #name))) return 0;
    INNER(FIND)
#undef FIND
    return 1;
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String location,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible,
                              fmi2Boolean logging) {
    Model *m = calloc(1, sizeof *m);
    const char *why = "no memory";
    if (m && (type != fmi2ModelExchange || strcmp(guid, GUID)))
        why = "this is Model Exchange alone, or the GUID of another FMU";
    else if (m && !load(m, location))
        why = "the inner FMU cannot be loaded";
    else if (m) {
        /* A URI again, of the inner resources: by the folder of these. */
        char *inner = malloc(strlen(location) + sizeof INNER_RESOURCES + 1);
        if (inner) {
            size_t end = strlen(strcpy(inner, location));
            strcpy(inner + end - (end && inner[end - 1] == '/'), "/" INNER_RESOURCES);
            m->inner = m->Instantiate(name, type, INNER_GUID, inner, callbacks, visible, logging);
            free(inner);
        }
        why = "the inner FMU refuses to be instantiated";
        if (m->inner && change(m) <= fmi2Warning) return m;
        if (m->inner) m->FreeInstance(m->inner);
    }
    if (callbacks && callbacks->logger)
        callbacks->logger(callbacks->componentEnvironment, name, fmi2Error, "error", why);
    if (m && m->library) dlclose(m->library);
    free(m);
    return NULL;
}

void fmi2FreeInstance(fmi2Component c) {
    Model *m = c;
    if (!m) return;
    m->FreeInstance(m->inner);
    dlclose(m->library);
    free(m);
}

fmi2Status fmi2Reset(fmi2Component c) {
    Model *m = c;
    const fmi2Status status = m->Reset(m->inner);
    return status > fmi2Warning ? status : worse(status, change(m));
}

/* One call of the inner FMU for a run of variables that are its own. */
#define OWN(vr) ((vr) >= FIRST && (vr) < FIRST + 2 * TERMS)

static int rate_of(fmi2ValueReference vr, size_t *state) {
    for (size_t i = 0; i < STATES; i++)
        if (rates[i] == vr) return *state = i, 1;
    return 0;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                       const fmi2Real value[]) {
    Model *m = c;
    fmi2Status status = fmi2OK;
    for (size_t k = 0, end; k < n && status <= fmi2Warning; k = end) {
        end = k + 1;
        if (OWN(vr[k])) {
            m->own[vr[k] - FIRST] = value[k];
            continue;
        }
        while (end < n && !OWN(vr[end])) end++;
        status = worse(status, m->SetReal(m->inner, vr + k, end - k, value + k));
    }
    return status;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    Model *m = c;
    double x[STATES + 1], slope;
    int known = 0;
    fmi2Status status = fmi2OK;
    for (size_t k = 0, end; k < n; k = end) {
        end = k + 1;
        if (OWN(vr[k])) {
            value[k] = m->own[vr[k] - FIRST];
            continue;
        }
        while (end < n && !OWN(vr[end])) end++;
        status = worse(status, m->GetReal(m->inner, vr + k, end - k, value + k));
        if (status > fmi2Warning) return status;
        for (size_t j = k, i; j < end; j++) {
            if (!rate_of(vr[j], &i)) continue;
            if (!known) status = worse(status, m->GetContinuousStates(m->inner, x, STATES));
            if (status > fmi2Warning) return status;
            known = 1;
            value[j] += sum(m, i, x[i], &slope);
        }
    }
    return status;
}

fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real rate[], size_t n) {
    Model *m = c;
    double x[STATES + 1], slope;
    fmi2Status status = m->GetDerivatives(m->inner, rate, n);
    if (status > fmi2Warning) return status;
    status = worse(status, m->GetContinuousStates(m->inner, x, n));
    for (size_t i = 0; i < n; i++) rate[i] += sum(m, i, x[i], &slope);
    return status;
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[],
                                        size_t nu, const fmi2ValueReference known[], size_t nk,
                                        const fmi2Real by[], fmi2Real result[]) {
    Model *m = c;
    fmi2ValueReference inner[KNOWNS];
    double seed[KNOWNS], x[STATES + 1], slope, by_speed;
    size_t count = 0, i;
    if (nk > KNOWNS) return fmi2Error;
    for (size_t k = 0; k < nk; k++) {
        if (OWN(known[k])) continue;
        inner[count] = known[k];
        seed[count++] = by[k];
    }
    fmi2Status status = fmi2OK;
    for (size_t j = 0; j < nu; j++) result[j] = 0.0;
    if (count) status = m->GetDirectionalDerivative(m->inner, unknown, nu, inner, count, seed, result);
    if (status > fmi2Warning) return status;
    status = worse(status, m->GetContinuousStates(m->inner, x, STATES));
    for (size_t j = 0; j < nu && status <= fmi2Warning; j++) {
        if (!rate_of(unknown[j], &i)) continue;
        sum(m, i, x[i], &slope);
        for (size_t k = 0; k < nk; k++) {
            double by_state;
            if (known[k] == states[i]) result[j] += slope * by[k];
            if (!OWN(known[k])) continue;
            size_t own = known[k] - FIRST, term = own % TERMS;
            if (terms[term].state != i) continue;
            double value = form(&terms[term], x[i], m->own[TERMS + term], &by_state, &by_speed);
            result[j] += (own < TERMS ? value : m->own[term] * by_speed) * by[k];
        }
    }
    return status;
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    Model *m = c;
    Saved *saved = *state ? *state : calloc(1, sizeof *saved);
    if (!saved) return fmi2Error;
    memcpy(saved->own, m->own, sizeof saved->own);
    *state = saved;
    return m->GetFMUstate(m->inner, &saved->inner);
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    Model *m = c;
    Saved *saved = state;
    memcpy(m->own, saved->own, sizeof saved->own);
    return m->SetFMUstate(m->inner, saved->inner);
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    Model *m = c;
    Saved *saved = *state;
    if (!saved) return fmi2OK;
    fmi2Status status = m->FreeFMUstate(m->inner, &saved->inner);
    free(saved);
    *state = NULL;
    return status;
}

/* The inner state has no name outside of this process: it is not promised, and refused. */
fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    return fmi2Error;
}
fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[],
                                 size_t size) {
    return fmi2Error;
}
fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size,
                                   fmi2FMUstate *state) {
    return fmi2Error;
}

/* All others are handed on as they are. */
#define HAND_ON(name, parameters, arguments) \
    fmi2Status fmi2##name parameters { \
        Model *m = c; \
        return m->name arguments; \
    }
#define GET(name, type) \
    HAND_ON(name, (fmi2Component c, const fmi2ValueReference vr[], size_t n, type value[]), \
            (m->inner, vr, n, value))
#define SET(name, type) \
    HAND_ON(name, (fmi2Component c, const fmi2ValueReference vr[], size_t n, const type value[]), \
            (m->inner, vr, n, value))
#define PLAIN(name) HAND_ON(name, (fmi2Component c), (m->inner))

GET(GetInteger, fmi2Integer)
GET(GetBoolean, fmi2Boolean)
GET(GetString, fmi2String)
SET(SetInteger, fmi2Integer)
SET(SetBoolean, fmi2Boolean)
SET(SetString, fmi2String)
PLAIN(EnterInitializationMode)
PLAIN(ExitInitializationMode)
PLAIN(Terminate)
PLAIN(EnterEventMode)
PLAIN(EnterContinuousTimeMode)
HAND_ON(SetDebugLogging,
        (fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]),
        (m->inner, on, n, categories))
HAND_ON(SetupExperiment,
        (fmi2Component c, fmi2Boolean limited, fmi2Real tolerance, fmi2Real start, fmi2Boolean ends,
         fmi2Real stop),
        (m->inner, limited, tolerance, start, ends, stop))
HAND_ON(NewDiscreteStates, (fmi2Component c, fmi2EventInfo *info), (m->inner, info))
HAND_ON(CompletedIntegratorStep,
        (fmi2Component c, fmi2Boolean no_return, fmi2Boolean *event, fmi2Boolean *end),
        (m->inner, no_return, event, end))
HAND_ON(SetTime, (fmi2Component c, fmi2Real time), (m->inner, time))
HAND_ON(SetContinuousStates, (fmi2Component c, const fmi2Real x[], size_t n), (m->inner, x, n))
HAND_ON(GetEventIndicators, (fmi2Component c, fmi2Real z[], size_t n), (m->inner, z, n))
HAND_ON(GetContinuousStates, (fmi2Component c, fmi2Real x[], size_t n), (m->inner, x, n))
HAND_ON(GetNominalsOfContinuousStates, (fmi2Component c, fmi2Real x[], size_t n), (m->inner, x, n))
