#include "instance.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

/* COLD keeps messages, and what is called rarely, out of the code of frequent calls. APART keeps
 * long code out of that of its caller. */
#ifdef __GNUC__
#define COLD __attribute__((noinline, cold))
#define APART __attribute__((noinline))
#else
#define COLD
#define APART
#endif

enum { DERIVATIVES = 1, ALGEBRAICS = 2, JACOBIAN_XU = 4, JACOBIAN_P = 8 }; /* bits of `valid` */

static const double default_tolerance = 1e-6;

/* The states are the first values; inputs and parameters follow. */
static const double *inputs(const Instance *i) { return i->state.value + NX; }
static const double *parameters(const Instance *i) { return i->state.value + NX + NU; }

/* Messages ------------------------------------------------------------------------------------ */

Status report(const Instance *i, Status status, const char *format, ...) {
    char message[1024];
    const int length = snprintf(message, sizeof message, "%s: ", i->function);
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(message + length, sizeof message - (size_t)length, format, arguments);
    va_end(arguments);
    i->importer.log(i, status, "logStatusError", message);
    return status;
}

void inform(const Instance *i, const char *message) {
    if (i->importer.log_information) {
        i->importer.log(i, STATUS_OK, "logAll", message);
    }
}

static const struct {
    Phase phase;
    const char *name;
} phase_names[] = {{INSTANTIATED, "instantiated"},
                   {INITIALIZATION, "initialization mode"},
                   {EVENT, "event mode"},
                   {CONTINUOUS, "continuous-time mode"},
                   {STEP, "step mode"},
                   {STEP_FAILED, "step failed"},
                   {TERMINATED, "terminated"}};

/* Names of all phases in the set, separated by commas. */
static void name_phases(unsigned phases, char *text, size_t size) {
    size_t length = 0;
    text[0] = '\0';
    for (size_t n = 0; n < sizeof phase_names / sizeof *phase_names; n++) {
        if ((phases & phase_names[n].phase) != 0 && length < size) {
            length += (size_t)snprintf(text + length, size - length, "%s%s",
                                       length > 0 ? ", " : "", phase_names[n].name);
        }
    }
}

int refuse_phase(const Instance *i, unsigned phases) {
    char found[64], expected[128];
    name_phases((unsigned)i->state.phase, found, sizeof found);
    name_phases(phases, expected, sizeof expected);
    report(i, STATUS_ERROR,
           "called in phase '%s', allowed in: %s. Call the functions in the order of the FMI "
           "standard's state machine.",
           found, expected);
    return 0;
}

void enter(Instance *i, Phase phase) {
    i->state.phase = phase;
    if (i->importer.log_information) {
        char name[64], message[80];
        name_phases(phase, name, sizeof name);
        snprintf(message, sizeof message, "Phase: %s.", name);
        inform(i, message);
    }
}

/* Before the start: gives the states that the importer has not set their start values, which
 * parameters, inputs and the start time may change. */
static COLD void start_states(Instance *i) {
#if STARTS_FOLLOW
    State *const s = &i->state;
    double start[NX + 1];
    if (model_starts(s->time, s->value, inputs(i), parameters(i), start) == 0) {
        for (int n = 0; n < NX; n++) {
            if (!s->given[n]) {
                s->value[n] = start[n];
            }
        }
    }
    i->valid = 0;
#else
    (void)i;
#endif
}

static int before_start(const Instance *i) {
    return ((unsigned)i->state.phase & (INSTANTIATED | INITIALIZATION)) != 0;
}

/* Life ---------------------------------------------------------------------------------------- */

Instance *instance_create(Kind kind, const char *name, const char *token, const char *function,
                          const Importer *importer) {
    const size_t length = name == NULL ? 0 : strlen(name);
    Instance *const i = importer->allocate(1, sizeof *i + length + 1);
    if (i == NULL) {
        return NULL;
    }
    if (length > 0) {
        memcpy(i->name, name, length);
    }
    i->importer = *importer;
    i->function = function;
    i->state.kind = kind;
    for (int row = 0; row < NX + NW; row++) {
        i->rows[row] = (unsigned)(row < NX ? REFERENCE_XDOT + row : REFERENCE_W + row - NX);
    }
    for (int column = 0; column < NX + NU; column++) {
        i->columns[column] = (unsigned)(column < NX ? column : REFERENCE_U + column - NX);
    }
    const int same_model = token != NULL && strcmp(token, MODEL_TOKEN) == 0;
    if (length == 0) {
        report(i, STATUS_ERROR, "the instance name is %s. Give the instance a name.",
               name == NULL ? "NULL" : "empty");
    } else if (!same_model) {
        report(i, STATUS_ERROR,
               "the instantiation token (guid) is '%s', but this library was built for '%s'. Use "
               "the modelDescription.xml and the library of one and the same FMU.",
               token == NULL ? "NULL" : token, MODEL_TOKEN);
    }
    if (length == 0 || !same_model) {
        instance_free(i);
        return NULL;
    }
    instance_reset(i);
    return i;
}

void instance_free(Instance *i) {
    if (i != NULL) {
        i->importer.release(i);
    }
}

void instance_reset(Instance *i) {
    State *const s = &i->state;
    s->time = 0.0;
    s->stop_time = INFINITY;
    s->tolerance = default_tolerance;
    memset(&s->memory, 0, sizeof s->memory);
    memcpy(s->value, model_start, (NX + NU + NP) * sizeof *s->value);
    memset(s->given, 0, sizeof s->given);
    i->valid = 0;
    enter(i, INSTANTIATED);
}

Status instance_setup(Instance *i, int tolerance_defined, double tolerance, double start_time,
                      int stop_time_defined, double stop_time) {
    /* Below 1e-13 the error estimate is rounding. */
    if (tolerance_defined && !(tolerance >= 1e-13 && tolerance < 1.0)) {
        return report(i, STATUS_ERROR,
                      "tolerance is %g, expected at least 1e-13 and less than 1. Give another "
                      "one, or none for %g.",
                      tolerance, default_tolerance);
    }
    if (!isfinite(start_time) || (stop_time_defined && !(stop_time >= start_time))) {
        return report(i, STATUS_ERROR,
                      "start time %g and stop time %g, expected a finite start and a stop that "
                      "is not earlier. Correct the times.",
                      start_time, stop_time);
    }
    i->state.tolerance = tolerance_defined ? tolerance : default_tolerance;
    i->state.time = start_time;
    i->state.stop_time = stop_time_defined ? stop_time : INFINITY;
    i->valid = 0;
    start_states(i);
    return STATUS_OK;
}

/* Evaluation ---------------------------------------------------------------------------------- */

static COLD Status not_finite(const Instance *i, int reference, double time) {
    return report(i, STATUS_DISCARD,
                  "the variable with value reference %d is not finite at time %.9g. Check the "
                  "states, inputs and parameters, or take a smaller step.",
                  reference, time);
}

/* Derivatives, brought up to date; NULL if one is not finite. */
static const double *derivatives(Instance *i) {
    double *const xdot = i->at_point;
    if ((i->valid & DERIVATIVES) == 0) {
        const State *const s = &i->state;
        i->together |= (i->valid & JACOBIAN_XU) != 0;
        const int failed = model_derivatives(s->time, s->value, inputs(i), parameters(i), xdot);
        for (int n = 0; n < NX; n++) {
            if (failed || !isfinite(xdot[n])) {
                not_finite(i, REFERENCE_XDOT + n, s->time);
                return NULL;
            }
        }
        i->valid |= DERIVATIVES;
    }
    return xdot;
}

/* Outputs and local variables, likewise. A value that is not asked for may be anything. */
static const double *algebraics(Instance *i) {
    double *const w = i->at_point + NX;
    if ((i->valid & ALGEBRAICS) == 0) {
        const State *const s = &i->state;
        if (model_algebraics(s->time, s->value, inputs(i), parameters(i), w) != 0) {
            not_finite(i, REFERENCE_W, s->time);
            return NULL;
        }
        i->valid |= ALGEBRAICS;
    }
    return w;
}

/* Derivatives, algebraics and nonzeros of the Jacobian in one evaluation. */
static int linearise(Instance *i) {
    const State *const s = &i->state;
    if (model_linearisation(s->time, s->value, inputs(i), parameters(i), i->at_point) != 0) {
        return 1;
    }
    int finite = 1; /* else `derivatives` says what is not */
    for (int n = 0; n < NX; n++) {
        finite &= isfinite(i->at_point[n]) != 0;
    }
    i->valid |= ALGEBRAICS | (finite ? DERIVATIVES : 0);
    return 0;
}

/* Nonzeros of the Jacobian with respect to [x, u] (JACOBIAN_XU) or to p (JACOBIAN_P). */
static COLD const double *jacobian(Instance *i, unsigned which) {
    double *const nonzeros = which == JACOBIAN_XU ? i->at_point + NX + NW : i->jacobian_p;
    if ((i->valid & which) == 0) {
        const State *const s = &i->state;
        const int failed =
            which == JACOBIAN_XU && i->together ? linearise(i)
            : which == JACOBIAN_XU
                ? model_jacobian_xu(s->time, s->value, inputs(i), parameters(i), nonzeros)
                : model_jacobian_p(s->time, s->value, inputs(i), parameters(i), nonzeros);
        if (failed) {
            report(i, STATUS_DISCARD,
                   "the Jacobian cannot be evaluated at time %.9g. Check the states, inputs and "
                   "parameters.",
                   s->time);
            return NULL;
        }
        i->valid |= which;
    }
    return nonzeros;
}

static Status unknown_reference(const Instance *i, unsigned reference) {
    return report(i, STATUS_ERROR,
                  "value reference %u is no variable of the model, expected 0 to %d. Take the "
                  "references from modelDescription.xml.",
                  reference, REFERENCE_TIME);
}

static COLD Status null_pointer(const Instance *i) {
    return report(i, STATUS_ERROR, "an argument is NULL, expected an array or variable. Pass it.");
}

/* Place in `State.value` of a state, input or parameter. */
static unsigned place_of(unsigned reference) {
    return group_of(reference) == GROUP_X ? reference : reference - NX;
}

Status instance_get(Instance *i, const unsigned reference[], size_t n, double value[]) {
    if (n > 0 && (reference == NULL || value == NULL)) {
        return null_pointer(i);
    }
    for (size_t k = 0; k < n; k++) {
        const double *source;
        switch (group_of(reference[k])) {
        case GROUP_X:
        case GROUP_U:
        case GROUP_P:
            value[k] = i->state.value[place_of(reference[k])];
            break;
        case GROUP_XDOT:
            if ((source = derivatives(i)) == NULL) {
                return STATUS_DISCARD;
            }
            value[k] = source[reference[k] - REFERENCE_XDOT];
            break;
        case GROUP_W:
            if ((source = algebraics(i)) == NULL) {
                return STATUS_DISCARD;
            }
            value[k] = source[reference[k] - REFERENCE_W];
            if (!isfinite(value[k])) {
                return not_finite(i, (int)reference[k], i->state.time);
            }
            break;
        case GROUP_TIME:
            value[k] = i->state.time;
            break;
        case GROUP_NONE:
            return unknown_reference(i, reference[k]);
        }
    }
    return STATUS_OK;
}

/* Checks that a variable may be set now. */
static COLD Status check_settable(const Instance *i, unsigned reference) {
    const unsigned before_start = INSTANTIATED | INITIALIZATION;
    const char *what = NULL;
    unsigned phases = 0;
    switch (group_of(reference)) {
    case GROUP_X:
        what = "a continuous state";
        phases = before_start | EVENT | CONTINUOUS | STEP; /* an extension, see fmi2.c */
        break;
    case GROUP_XDOT:
        what = "a derivative, which the model computes";
        break;
    case GROUP_U:
        what = "an input";
        phases = before_start | EVENT | CONTINUOUS | STEP;
        break;
    case GROUP_P:
        if (model_tunable[reference - REFERENCE_P]) {
            what = "a tunable parameter";
            phases = before_start | EVENT | CONTINUOUS | STEP;
        } else {
            what = "a fixed parameter";
            phases = before_start;
        }
        break;
    case GROUP_W:
        what = "an output or local variable, which the model computes";
        break;
    case GROUP_TIME:
        what = "the time";
        break;
    case GROUP_NONE:
        return unknown_reference(i, reference);
    }
    if ((phases & (unsigned)i->state.phase) == 0) {
        char found[64], expected[128];
        name_phases((unsigned)i->state.phase, found, sizeof found);
        name_phases(phases, expected, sizeof expected);
        return report(i, STATUS_ERROR,
                      "value reference %u is %s, set in phase '%s', but settable in: %s. Nothing "
                      "was set; leave it out.",
                      reference, what, found, phases == 0 ? "none" : expected);
    }
    return STATUS_OK;
}

static COLD Status refuse_value(const Instance *i, unsigned reference, double value) {
    return report(i, STATUS_ERROR,
                  "%g for the variable with value reference %u, expected a finite number. Nothing "
                  "was set; check where the value comes from.",
                  value, reference);
}

/* Whether a variable may not take a value. */
static inline int unfit(unsigned reference, double value) {
    return !isfinite(value) &&
           !(isnan(value) && (int64_t)reference >= REFERENCE_P - MISSABLE_INPUTS &&
             (int64_t)reference < REFERENCE_P);
}

static COLD Status check_finite(const Instance *i, const unsigned reference[], int n,
                                const double value[]) {
    for (int k = 0; k < n; k++) {
        if (unfit(reference[k], value[k])) {
            return refuse_value(i, reference[k], value[k]);
        }
    }
    return STATUS_OK;
}

/* Writes a value; zero if these bits stood there before. */
static inline uint64_t replace(double *target, double value) {
    uint64_t before, after;
    memcpy(&before, target, sizeof before);
    memcpy(&after, &value, sizeof after);
    memcpy(target, &after, sizeof after);
    return before ^ after;
}

/* Sets `count` states and inputs from column `first` of the Jacobian on. Importers often set what has
 * not changed. Inline, as its callers pass constant counts, of which compilers make short code. */
static inline Status set_columns(Instance *i, int first, int count, const double value[]) {
    double sum = 0.0;
    for (int k = 0; k < count; k++) {
        sum += value[k];
    }
    /* Finite only if all values are, so that mostly one check does; finite ones may overflow it. */
    if (!isfinite(sum) && check_finite(i, i->columns + first, count, value) != STATUS_OK) {
        return STATUS_ERROR;
    }
    uint64_t changed = 0;
    for (int k = 0; k < count; k++) {
        changed |= replace(&i->state.value[first + k], value[k]);
    }
    if (changed != 0) {
        i->valid = 0;
    }
    return STATUS_OK;
}

/* Sets any variables that may be set. */
static Status set_any(Instance *i, const unsigned reference[], size_t n, const double value[]) {
    if (n > 0 && (reference == NULL || value == NULL)) {
        return null_pointer(i);
    }
    for (size_t k = 0; k < n; k++) {
        const Group group = group_of(reference[k]);
        /* Every phase in which importers may set anything allows states and inputs. */
        if (group != GROUP_X && group != GROUP_U && check_settable(i, reference[k]) != STATUS_OK) {
            return STATUS_ERROR;
        }
        if (unfit(reference[k], value[k])) {
            return refuse_value(i, reference[k], value[k]);
        }
    }
    uint64_t changed = 0;
    for (size_t k = 0; k < n; k++) {
        changed |= replace(&i->state.value[place_of(reference[k])], value[k]);
    }
    if (changed != 0) {
        i->valid = 0;
    }
    if (STARTS_FOLLOW && before_start(i)) {
        for (size_t k = 0; k < n; k++) {
            if (group_of(reference[k]) == GROUP_X) {
                i->state.given[reference[k]] = 1;
            }
        }
        start_states(i);
    }
    return STATUS_OK;
}

Status instance_set(Instance *i, const unsigned reference[], size_t n, const double value[]) {
    /* All inputs in their order; see above for their phases. */
    if (n == NU && !(STARTS_FOLLOW && before_start(i)) && reference != NULL && value != NULL &&
        memcmp(reference, i->columns + NX, NU * sizeof *reference) == 0) {
        return set_columns(i, NX, NU, value);
    }
    return set_any(i, reference, n, value);
}

Status instance_set_time(Instance *i, double time) {
    if (!isfinite(time)) {
        return report(i, STATUS_ERROR, "time is %g, expected a finite number. Nothing was set.",
                      time);
    }
    if (i->state.time != time) {
        i->state.time = time;
        i->valid = 0;
    }
    return STATUS_OK;
}

/* Checks the array of a function that passes one value for each continuous state. */
static Status check_length(const Instance *i, const double *array, size_t n) {
    if (n != NX) {
        return report(i, STATUS_ERROR,
                      "the array has %lu values, expected %d, one for each continuous state. Pass "
                      "an array of that length.",
                      (unsigned long)n, NX);
    }
    return array == NULL && NX > 0 ? null_pointer(i) : STATUS_OK;
}

Status instance_set_states(Instance *i, const double x[], size_t n) {
    const Status status = check_length(i, x, n);
    if (STARTS_FOLLOW && status == STATUS_OK && before_start(i)) {
        for (int k = 0; k < NX; k++) { // memset of no states is an error to compilers
            i->state.given[k] = 1;
        }
    }
    return status == STATUS_OK ? set_columns(i, 0, NX, x) : status;
}

Status instance_get_states(Instance *i, double x[], size_t n) {
    const Status status = check_length(i, x, n);
    for (int k = 0; k < NX && status == STATUS_OK; k++) {
        x[k] = i->state.value[k];
    }
    return status;
}

Status instance_get_derivatives(Instance *i, double xdot[], size_t n) {
    const Status status = check_length(i, xdot, n);
    const double *const source = status == STATUS_OK ? derivatives(i) : NULL;
    if (source == NULL) {
        return status == STATUS_OK ? STATUS_DISCARD : status;
    }
    for (int k = 0; k < NX; k++) {
        xdot[k] = source[k];
    }
    return STATUS_OK;
}

Status instance_get_nominals(Instance *i, double nominal[], size_t n) {
    const Status status = check_length(i, nominal, n);
    for (int k = 0; k < NX && status == STATUS_OK; k++) {
        nominal[k] = model_nominal[k];
    }
    return status;
}

static Status assertion_violated(const Instance *i, int number, double time) {
    return report(i, STATUS_ERROR,
                  "assertion violated at time %.9g: %s. The model is not valid beyond; check the "
                  "states, inputs and parameters.",
                  time, model_assertion_text[number]);
}

Status instance_check_assertions(Instance *i) {
    const State *const s = &i->state;
    const int number =
        first_violated(s->time, s->value, inputs(i), parameters(i), i->integrator.holds);
    return number < 0 ? STATUS_OK : assertion_violated(i, number, s->time);
}

/* Partial derivatives ------------------------------------------------------------------------- */

static COLD Status no_unknown(const Instance *i, unsigned reference) {
    return report(i, STATUS_ERROR,
                  "value reference %u is no unknown, expected a state, derivative, output or local "
                  "variable. Take the unknowns from the model structure in modelDescription.xml.",
                  reference);
}

static COLD Status no_known(const Instance *i, unsigned reference) {
    return report(i, STATUS_ERROR,
                  "value reference %u is no known, expected a state, input or parameter. Take the "
                  "knowns from the model structure in modelDescription.xml.",
                  reference);
}

/* Place of an unknown in `work`, which holds x, der(x), w; -1 if it is none. */
static int unknown_place(unsigned reference) {
    const int64_t r = reference;
    return r < REFERENCE_U                          ? (int)r
           : r >= REFERENCE_W && r < REFERENCE_TIME ? (int)r - REFERENCE_W + REFERENCE_U
                                                    : -1;
}

/* Column of a known: x and u, then p; -1 if it is none. */
static int known_column(unsigned reference) {
    const Group group = group_of(reference);
    return group == GROUP_X || group == GROUP_U || group == GROUP_P ? (int)place_of(reference) : -1;
}

/* The nonzeros of a column of the Jacobian. */
typedef struct {
    const double *nonzero;
    const int *row;
    int length;
} Column;

static inline Status get_column(Instance *i, int column, Column *result) {
    const int is_parameter = column >= NX + NU;
    const double *const nonzeros = jacobian(i, is_parameter ? JACOBIAN_P : JACOBIAN_XU);
    if (nonzeros == NULL) {
        return STATUS_DISCARD;
    }
    const int *const start = is_parameter ? model_jacobian_p_column + (column - NX - NU)
                                          : model_jacobian_xu_column + column;
    const int *const row = is_parameter ? model_jacobian_p_row : model_jacobian_xu_row;
    result->nonzero = nonzeros + start[0];
    result->row = row + start[0];
    result->length = start[1] - start[0];
    return STATUS_OK;
}

static COLD Status not_differentiable(const Instance *i, unsigned reference) {
    return report(i, STATUS_DISCARD,
                  "the partial derivative for value reference %u is not finite at time %.9g. Check "
                  "the seed, the states, inputs and parameters.",
                  reference, i->state.time);
}

/* Zero for each unknown. Returns the place of the first if they stand one after the other, as in a
 * column of all derivatives, else -1. */
static int clear_block(const unsigned unknown[], size_t unknowns, double sensitivity[]) {
    unsigned gaps = 0;
    for (size_t k = 0; k < unknowns; k++) {
        gaps |= unknown[k] - unknown[0] - (unsigned)k;
    }
    for (size_t k = 0; k < unknowns; k++) {
        sensitivity[k] = 0.0;
    }
    const int first = gaps == 0 && unknowns > 0 ? unknown_place(unknown[0]) : -1;
    const int last = first >= 0 ? unknown_place(unknown[unknowns - 1]) : -1;
    return last - first == (int64_t)unknowns - 1 ? first : -1;
}

/* The product with one known, for a cleared block of unknowns: nonzeros go where they belong. */
static Status directional_block(Instance *i, const unsigned unknown[], size_t unknowns, int first,
                                int number, double seed, double sensitivity[]) {
    Column column;
    if (get_column(i, number, &column) != STATUS_OK) {
        return STATUS_DISCARD;
    }
    for (int n = 0; n < column.length; n++) {
        const size_t k = (size_t)(NX + column.row[n] - first); /* huge if it is before the block */
        if (k < unknowns) {
            const double product = column.nonzero[n] * seed;
            if (!isfinite(product)) {
                return not_differentiable(i, unknown[k]);
            }
            sensitivity[k] = product;
        }
    }
    const size_t own = (size_t)(number - first);
    if (number < NX && own < unknowns) {
        sensitivity[own] = seed;
    }
    return STATUS_OK;
}

/* The product with any knowns, for any unknowns. */
static APART Status directional_any(Instance *i, const unsigned unknown[], size_t unknowns,
                                    const unsigned known[], size_t knowns, const double seed[],
                                    double sensitivity[]) {
    if ((unknowns > 0 && (unknown == NULL || sensitivity == NULL)) ||
        (knowns > 0 && (known == NULL || seed == NULL))) {
        return null_pointer(i);
    }
    const double only = knowns == 1 ? seed[0] : 0.0;
    const int only_known = isnormal(only) ? known_column(known[0]) : -1;
    const int first = only_known >= 0 ? clear_block(unknown, unknowns, sensitivity) : -1;
    if (first >= 0) {
        return directional_block(i, unknown, unknowns, first, only_known, only, sensitivity);
    }
    memset(i->work, 0, sizeof i->work);
    for (size_t k = 0; k < knowns; k++) {
        const int number = known_column(known[k]);
        Column column;
        if (number < 0) {
            return no_known(i, known[k]);
        }
        if (seed[k] == 0.0) {
            continue;
        }
        if (get_column(i, number, &column) != STATUS_OK) {
            return STATUS_DISCARD;
        }
        for (int n = 0; n < column.length; n++) {
            i->work[NX + column.row[n]] += column.nonzero[n] * seed[k];
        }
        if (number < NX) {
            i->work[number] += seed[k];
        }
    }
    for (size_t k = 0; k < unknowns; k++) {
        const int place = unknown_place(unknown[k]);
        if (place < 0) {
            return no_unknown(i, unknown[k]);
        }
        if (!isfinite(i->work[place])) {
            return not_differentiable(i, unknown[k]);
        }
        sensitivity[k] = i->work[place];
    }
    return STATUS_OK;
}

/* The product with one column of the Jacobian, for unknowns that are `count` of its rows from `first`
 * on. Returns 0 if they are others or a product is not finite. Inline, as for set_columns. */
static inline int scale_column(const Instance *i, const unsigned unknown[], int first, int count,
                               int column, double seed, double sensitivity[]) {
    unsigned other = 0;
    for (int k = 0; k < count; k++) {
        other |= unknown[k] ^ i->rows[first + k];
    }
    if (other != 0) {
        return 0;
    }
    const double zero = seed - seed; /* not a literal, of which compilers make a call of memset */
    for (int k = 0; k < count; k++) {
        sensitivity[k] = zero;
    }
    double sum = zero; /* not finite if the seed or a product is not, so one check does for all */
    const double *const nonzero = i->at_point + NX + NW;
    const int end = model_jacobian_xu_column[column + 1];
    for (int n = model_jacobian_xu_column[column]; n < end; n++) {
        const int k = model_jacobian_xu_row[n] - first;
        if (k >= 0 && k < count) {
            sensitivity[k] = nonzero[n] * seed;
            sum += sensitivity[k];
        }
    }
    return isfinite(sum);
}

/* The product where the Jacobian is not known yet. */
static COLD Status directional_first(Instance *i, const unsigned unknown[], size_t unknowns,
                                     const unsigned known[], size_t knowns, const double seed[],
                                     double sensitivity[]) {
    if (jacobian(i, JACOBIAN_XU) == NULL) {
        return STATUS_DISCARD;
    }
    return instance_directional(i, unknown, unknowns, known, knowns, seed, sensitivity);
}

/* Leads to directional_any. A cold call in between lets compilers lay out columns for speed, while
 * directional_any itself is not cold. */
static COLD Status directional_other(Instance *i, const unsigned unknown[], size_t unknowns,
                                     const unsigned known[], size_t knowns, const double seed[],
                                     double sensitivity[]) {
    return directional_any(i, unknown, unknowns, known, knowns, seed, sensitivity);
}

Status instance_directional(Instance *i, const unsigned unknown[], size_t unknowns,
                            const unsigned known[], size_t knowns, const double seed[],
                            double sensitivity[]) {
    /* One column of all derivatives, of all outputs and local variables, or of both is what
     * importers ask for to build a Jacobian. */
    if (knowns == 1 && known != NULL && seed != NULL) {
        int64_t column = known[0]; /* signed, as groups may be empty */
        if (column >= NX) {
            column -= NX;
            if (column < NX || column >= NX + NU) {
                return directional_other(i, unknown, unknowns, known, knowns, seed, sensitivity);
            }
        }
        if ((i->valid & JACOBIAN_XU) == 0) {
            return directional_first(i, unknown, unknowns, known, knowns, seed, sensitivity);
        }
        const int c = (int)column;
        if (unknown != NULL && sensitivity != NULL &&
            ((unknowns == NX + NW &&
              scale_column(i, unknown, 0, NX + NW, c, seed[0], sensitivity)) ||
             (unknowns == NX && scale_column(i, unknown, 0, NX, c, seed[0], sensitivity)) ||
             (unknowns == NW && scale_column(i, unknown, NX, NW, c, seed[0], sensitivity)))) {
            return STATUS_OK;
        }
    }
    return directional_other(i, unknown, unknowns, known, knowns, seed, sensitivity);
}

Status instance_adjoint(Instance *i, const unsigned unknown[], size_t unknowns,
                        const unsigned known[], size_t knowns, const double seed[],
                        double sensitivity[]) {
    if ((unknowns > 0 && (unknown == NULL || seed == NULL)) ||
        (knowns > 0 && (known == NULL || sensitivity == NULL))) {
        return null_pointer(i);
    }
    memset(i->work, 0, sizeof i->work);
    for (size_t k = 0; k < unknowns; k++) {
        const int place = unknown_place(unknown[k]);
        if (place < 0) {
            return no_unknown(i, unknown[k]);
        }
        i->work[place] += seed[k];
    }
    for (size_t k = 0; k < knowns; k++) {
        const int number = known_column(known[k]);
        Column column;
        if (number < 0) {
            return no_known(i, known[k]);
        }
        if (get_column(i, number, &column) != STATUS_OK) {
            return STATUS_DISCARD;
        }
        double sum = number < NX ? i->work[number] : 0.0;
        for (int n = 0; n < column.length; n++) {
            const double weight = i->work[NX + column.row[n]];
            if (weight != 0.0) { /* an infinite entry elsewhere must not become NaN here */
                sum += column.nonzero[n] * weight;
            }
        }
        if (!isfinite(sum)) {
            return not_differentiable(i, known[k]);
        }
        sensitivity[k] = sum;
    }
    return STATUS_OK;
}

/* Co-Simulation ------------------------------------------------------------------------------- */

Status instance_step(Instance *i, double start, double size) {
    State *const s = &i->state;
    /* Importers add up or multiply; a deviation far below the step is rounding. */
    const double rounding = 1e-3 * size + 1e-12 * fabs(s->time);
    if (!(isfinite(start) && isfinite(size) && size > 0.0)) {
        return report(i, STATUS_ERROR,
                      "a step from time %g of size %g, expected a finite time and a positive size. "
                      "Correct the arguments.",
                      start, size);
    }
    if (fabs(start - s->time) > rounding) {
        return report(i, STATUS_ERROR,
                      "a step from time %.9g, but the instance stands at %.9g. Continue from "
                      "there, or restore a saved state.",
                      start, s->time);
    }
    if (start + size > s->stop_time + rounding) {
        return report(i, STATUS_ERROR,
                      "a step to time %.9g, but the stop time is %.9g. End the simulation there, "
                      "or set up a later stop time.",
                      start + size, s->stop_time);
    }
    s->time = start;
    i->valid = 0;
    Rosenbrock *const r = &i->integrator;
    switch (rosenbrock_integrate(r, inputs(i), parameters(i), s->tolerance, start + size, &s->time,
                                 s->value, &s->memory)) {
    case OUTCOME_REACHED:
        return STATUS_OK;
    case OUTCOME_ASSERTION:
        return assertion_violated(i, r->bad, r->t_bad);
    case OUTCOME_NOT_FINITE:
        return report(i, STATUS_DISCARD,
                      "stopped at time %.9g, because the variable with value reference %d has no "
                      "finite value or partial derivative at time %.9g. Check the inputs and "
                      "parameters.",
                      s->time, r->bad, r->t_bad);
    case OUTCOME_TOO_MANY_STEPS:
        return report(i, STATUS_DISCARD,
                      "stopped at time %.9g after %d internal steps, expected to reach %.9g. Take "
                      "a smaller communication step or a looser tolerance than %g.",
                      s->time, MAXIMAL_STEPS, start + size, s->tolerance);
    case OUTCOME_STEP_TOO_SMALL:
        break;
    }
    return report(i, STATUS_DISCARD,
                  "stopped at time %.9g, because no step is small enough for the tolerance %g. "
                  "Check the model for a jump or a singularity there.",
                  s->time, s->tolerance);
}

/* Saved states -------------------------------------------------------------------------------- */

static const char magic[8] = {'F', 'M', 'U', 's', 't', 'a', 't', 'e'};

typedef struct {
    char magic[8];
    uint64_t token;    /* hash of MODEL_TOKEN */
    uint64_t size;     /* of the whole */
    uint64_t checksum; /* of the state */
} Header;

/* FNV-1a, 64 bits: G. Fowler, L. C. Noll and K.-P. Vo, http://www.isthe.com/chongo/tech/comp/fnv */
static uint64_t hash(const void *bytes, size_t size) {
    const unsigned char *const byte = bytes;
    uint64_t value = UINT64_C(14695981039346656037);
    for (size_t n = 0; n < size; n++) {
        value = (value ^ byte[n]) * UINT64_C(1099511628211);
    }
    return value;
}

static Header header(const State *state) {
    Header h = {.token = hash(MODEL_TOKEN, strlen(MODEL_TOKEN)),
                .size = sizeof(Header) + sizeof(State),
                .checksum = hash(state, sizeof *state)};
    memcpy(h.magic, magic, sizeof magic);
    return h;
}

/* Copies a state into `*saved`, which is allocated if it is NULL. */
static Status store(const Instance *i, const State *state, void **saved) {
    if (saved == NULL) {
        return null_pointer(i);
    }
    if (*saved == NULL) {
        *saved = i->importer.allocate(1, sizeof *state);
        if (*saved == NULL) {
            return report(i, STATUS_ERROR, "no memory for a saved state. Free some.");
        }
    }
    memcpy(*saved, state, sizeof *state);
    return STATUS_OK;
}

Status instance_save(Instance *i, void **saved) { return store(i, &i->state, saved); }

Status instance_restore(Instance *i, const void *saved) {
    const State *const s = saved;
    if (s == NULL) {
        return null_pointer(i);
    }
    if (s->kind != i->state.kind) {
        return report(i, STATUS_ERROR,
                      "the saved state is of a %s instance and this is none. Restore it into an "
                      "instance of its kind.",
                      s->kind == CO_SIMULATION ? "Co-Simulation" : "Model Exchange");
    }
    i->state = *s;
    i->valid = 0;
    return STATUS_OK;
}

void instance_discard(const Instance *i, void **saved) {
    if (saved != NULL && *saved != NULL) {
        i->importer.release(*saved);
        *saved = NULL;
    }
}

size_t instance_serialized_size(void) { return sizeof(Header) + sizeof(State); }

Status instance_serialize(const Instance *i, const void *saved, void *bytes, size_t size) {
    if (saved == NULL || bytes == NULL) {
        return null_pointer(i);
    }
    if (size < instance_serialized_size()) {
        return report(i, STATUS_ERROR, "room for %lu bytes, expected %lu. Ask for the size first.",
                      (unsigned long)size, (unsigned long)instance_serialized_size());
    }
    const Header h = header(saved);
    memcpy(bytes, &h, sizeof h);
    memcpy((char *)bytes + sizeof h, saved, sizeof(State));
    return STATUS_OK;
}

Status instance_deserialize(Instance *i, const void *bytes, size_t size, void **saved) {
    Header found;
    State state;
    if (bytes == NULL) {
        return null_pointer(i);
    }
    if (size < instance_serialized_size()) {
        return report(i, STATUS_ERROR,
                      "%lu bytes, expected %lu: the serialized state is cut off. Serialize it "
                      "again.",
                      (unsigned long)size, (unsigned long)instance_serialized_size());
    }
    memcpy(&found, bytes, sizeof found);
    memcpy(&state, (const char *)bytes + sizeof found, sizeof state);
    const Header expected = header(&state);
    if (memcmp(&found, &expected, sizeof found) != 0) {
        return report(i, STATUS_ERROR,
                      "the bytes are %s. Serialize a state of this FMU again.",
                      memcmp(found.magic, magic, sizeof magic) != 0 ? "no serialized FMU state"
                      : found.token != expected.token ? "a state of another model"
                                                      : "a damaged state");
    }
    return store(i, &state, saved);
}
