/* One instance of the model: state, evaluation with caches, directional derivatives, saved states.
 *
 * This layer knows no FMI version; `fmi2.c` and `fmi3.c` translate between it and the standard.
 * Every function that can fail logs one message that says where, what was found, what was expected
 * and what to do, and leaves the instance as it was.
 */
#ifndef INSTANCE_H
#define INSTANCE_H

#include <stddef.h>
#include <stdint.h>

#include "integrator.h"
#include "model.h"

/* The values are those of fmi2Status and fmi3Status. */
typedef enum { STATUS_OK = 0, STATUS_DISCARD = 2, STATUS_ERROR = 3 } Status;

typedef enum { MODEL_EXCHANGE, CO_SIMULATION } Kind;

/* Phases of an instance's life, one bit each so that a function can allow several. */
typedef enum {
    INSTANTIATED = 1,
    INITIALIZATION = 2,
    EVENT = 4,
    CONTINUOUS = 8,
    STEP = 16,
    STEP_FAILED = 32,
    TERMINATED = 64
} Phase;

/* Groups of variables, in the order of their value references. */
typedef enum { GROUP_X, GROUP_XDOT, GROUP_U, GROUP_P, GROUP_W, GROUP_TIME, GROUP_NONE } Group;

static inline Group group_of(unsigned reference) {
    const int64_t r = reference; /* signed, as groups may be empty */
    return r < REFERENCE_XDOT   ? GROUP_X
           : r < REFERENCE_U    ? GROUP_XDOT
           : r < REFERENCE_P    ? GROUP_U
           : r < REFERENCE_W    ? GROUP_P
           : r < REFERENCE_TIME ? GROUP_W
           : r == REFERENCE_TIME ? GROUP_TIME
                                 : GROUP_NONE;
}

/* Everything that affects the future of an instance, and nothing else. */
typedef struct {
    double time, stop_time; /* stop_time is infinite if not given */
    double tolerance;
    Memory memory;                    /* of the integrator */
    double value[NX + NU + NP + 1];   /* x, u, p as in model_start */
    int phase, kind;
    unsigned char given[NX + 1]; /* 1 for each state that the importer has set before the start */
} State;

typedef struct Instance Instance;

/* Passes a finished message on to the importer. */
typedef void Log(const Instance *instance, Status status, const char *category,
                 const char *message);

/* The importer's side of an instance. */
typedef struct {
    Log *log;
    void (*callback)(void); /* the importer's logger, for `log` to cast back; may be NULL */
    void *environment;
    void *(*allocate)(size_t count, size_t size); /* zeroed memory, as calloc */
    void (*release)(void *memory);
    int log_information; /* errors are always logged */
} Importer;

struct Instance {
    State state;
    Importer importer;
    const char *function; /* the function that is being called, for messages */
    unsigned valid;       /* which of the caches belong to the state */
    int together; /* whether Jacobians bring derivatives along, for an importer that asks for both */
    double at_point[NX + NW + NNZ_XU + 1]; /* xdot, w and nonzeros, as model_linearisation */
    double jacobian_p[NNZ_P + 1];
    double work[2 * NX + NW + 1];
    /* Value references of the Jacobian's rows, der(x) and w, and of its columns, x and u. */
    unsigned rows[NX + NW + 1], columns[NX + NU + 1];
    Rosenbrock integrator;
    char name[]; /* of the instance */
};

/* NULL after a message if the name is empty, the token is another one, or memory is short. */
Instance *instance_create(Kind kind, const char *name, const char *token, const char *function,
                          const Importer *importer);
void instance_free(Instance *i);

/* Logs a message, printf-like, under the name of the function being called. Returns `status`. */
#ifdef __GNUC__
__attribute__((format(printf, 3, 4)))
#endif
Status report(const Instance *i, Status status, const char *format, ...);
void inform(const Instance *i, const char *message);

/* Logs that the function being called is not allowed in this phase; returns false. */
int refuse_phase(const Instance *i, unsigned phases);

/* True if `function` may be called in this phase; else logs an error. NULL is no instance. */
static inline int allowed(Instance *i, const char *function, unsigned phases) {
    if (i == NULL) {
        return 0;
    }
    i->function = function;
    return ((unsigned)i->state.phase & phases) != 0 || refuse_phase(i, phases);
}

void enter(Instance *i, Phase phase);

Status instance_setup(Instance *i, int tolerance_defined, double tolerance, double start_time,
                      int stop_time_defined, double stop_time);
void instance_reset(Instance *i);

Status instance_get(Instance *i, const unsigned reference[], size_t n, double value[]);
Status instance_set(Instance *i, const unsigned reference[], size_t n, const double value[]);
Status instance_set_time(Instance *i, double time);
Status instance_set_states(Instance *i, const double x[], size_t n);
Status instance_get_states(Instance *i, double x[], size_t n);
Status instance_get_derivatives(Instance *i, double xdot[], size_t n);
Status instance_get_nominals(Instance *i, double nominal[], size_t n);
Status instance_check_assertions(Instance *i);

/* sensitivity = J seed, and J' seed; J are the rows of the unknowns, the columns of the knowns. */
Status instance_directional(Instance *i, const unsigned unknown[], size_t unknowns,
                            const unsigned known[], size_t knowns, const double seed[],
                            double sensitivity[]);
Status instance_adjoint(Instance *i, const unsigned unknown[], size_t unknowns,
                        const unsigned known[], size_t knowns, const double seed[],
                        double sensitivity[]);

/* Integrates from `start` to `start + size`. After STATUS_DISCARD and after a violated assertion
 * the instance stands at its last accepted internal step. */
Status instance_step(Instance *i, double start, double size);

/* Saved states. `*saved` is allocated if it is NULL and overwritten if not. */
Status instance_save(Instance *i, void **saved);
Status instance_restore(Instance *i, const void *saved);
void instance_discard(const Instance *i, void **saved);
size_t instance_serialized_size(void);
Status instance_serialize(const Instance *i, const void *saved, void *bytes, size_t size);
Status instance_deserialize(Instance *i, const void *bytes, size_t size, void **saved);

#endif
