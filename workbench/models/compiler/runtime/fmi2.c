/* FMI 2.0 for Model Exchange and Co-Simulation.
 *
 * Extension: fmi2SetReal may set continuous states and tunable parameters at any time after
 * initialization, as some importers do. On a Co-Simulation instance between steps, fmi2SetTime,
 * fmi2Get/SetContinuousStates, fmi2GetDerivatives, fmi2GetNominalsOfContinuousStates,
 * fmi2GetEventIndicators and fmi2CompletedIntegratorStep work as in Model Exchange, so that an
 * observer can correct the state of a model that integrates itself. Source: J. Brembeck,
 * A. Pfeiffer, M. Fleps-Dezasse, M. Otter, K. Wernersson and H. Elmqvist, Nonlinear State
 * Estimation with an Extended FMI 2.0 Co-Simulation Interface, 10th International Modelica
 * Conference, 2014.
 */
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"
#include "instance.h"

enum {
    INITIALIZED = EVENT | CONTINUOUS | STEP,
    COMPUTED = INITIALIZATION | INITIALIZED | STEP_FAILED | TERMINATED, /* results can be read */
    ALWAYS = INSTANTIATED | COMPUTED
};

/* Returns from the calling function unless the instance is in one of the phases. */
#define REQUIRE(phases)                           \
    do {                                          \
        if (!allowed(c, __func__, (phases))) {    \
            return fmi2Error;                     \
        }                                         \
    } while (0)

static fmi2Status null_argument(const Instance *i, const char *name) {
    return (fmi2Status)report(i, STATUS_ERROR, "'%s' is NULL. Pass a variable.", name);
}

static fmi2Status unsupported(const Instance *i, const char *what) {
    return (fmi2Status)report(i, STATUS_ERROR,
                              "%s. Heed the capability flags and variables in "
                              "modelDescription.xml.",
                              what);
}

static void log_message(const Instance *i, Status status, const char *category,
                        const char *message) {
    const fmi2CallbackLogger logger = (fmi2CallbackLogger)i->importer.callback;
    char format[2048];
    size_t length = 0;
    if (logger == NULL) {
        return;
    }
    /* The importer takes the message for a printf format. */
    for (; *message != '\0' && length + 2 < sizeof format; message++) {
        if (*message == '%') {
            format[length++] = '%';
        }
        format[length++] = *message;
    }
    format[length] = '\0';
    logger(i->importer.environment, i->name, (fmi2Status)status, category, format);
}

/* Inquire, create, destroy */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String categories[]) {
    REQUIRE(ALWAYS);
    Instance *const i = c;
    int information = nCategories == 0;
    if (nCategories > 0 && categories == NULL) {
        return null_argument(i, "categories");
    }
    for (size_t n = 0; n < nCategories; n++) {
        if (categories[n] == NULL) {
            return null_argument(i, "categories");
        }
        information = information || strcmp(categories[n], "logAll") == 0;
    }
    i->importer.log_information = loggingOn && information;
    return fmi2OK;
}

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible,
                              fmi2Boolean loggingOn) {
    (void)fmuResourceLocation;
    (void)visible;
    if (functions == NULL) {
        return NULL;
    }
    const int own_memory = functions->allocateMemory == NULL || functions->freeMemory == NULL;
    const Importer importer = {.log = log_message,
                               .callback = (void (*)(void))functions->logger,
                               .environment = functions->componentEnvironment,
                               .allocate = own_memory ? calloc : functions->allocateMemory,
                               .release = own_memory ? free : functions->freeMemory,
                               .log_information = loggingOn};
    return instance_create(fmuType == fmi2CoSimulation ? CO_SIMULATION : MODEL_EXCHANGE,
                           instanceName, fmuGUID, __func__, &importer);
}

void fmi2FreeInstance(fmi2Component c) { instance_free(c); }

/* Initialize, terminate, reset */

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance,
                               fmi2Real startTime, fmi2Boolean stopTimeDefined,
                               fmi2Real stopTime) {
    REQUIRE(INSTANTIATED);
    return (fmi2Status)instance_setup(c, toleranceDefined, tolerance, startTime, stopTimeDefined,
                                      stopTime);
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    REQUIRE(INSTANTIATED);
    enter(c, INITIALIZATION);
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    REQUIRE(INITIALIZATION);
    Instance *const i = c;
    const Status status = instance_check_assertions(i);
    if (status == STATUS_OK) {
        enter(i, i->state.kind == CO_SIMULATION ? STEP : EVENT);
    }
    return (fmi2Status)status;
}

fmi2Status fmi2Terminate(fmi2Component c) {
    REQUIRE(INITIALIZED | STEP_FAILED);
    enter(c, TERMINATED);
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
    REQUIRE(ALWAYS);
    instance_reset(c);
    return fmi2OK;
}

/* Variables */

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                       fmi2Real value[]) {
    REQUIRE(COMPUTED);
    return (fmi2Status)instance_get(c, vr, nvr, value);
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                       const fmi2Real value[]) {
    REQUIRE(INSTANTIATED | INITIALIZATION | INITIALIZED);
    return (fmi2Status)instance_set(c, vr, nvr, value);
}

/* The model has no variables but Real ones. */
#define NO_VARIABLES(Type)                                                                      \
    fmi2Status fmi2Get##Type(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,        \
                             fmi2##Type value[]) {                                              \
        (void)vr;                                                                               \
        (void)value;                                                                            \
        REQUIRE(COMPUTED);                                                                      \
        return nvr == 0 ? fmi2OK : unsupported(c, "the model has no " #Type " variables");      \
    }                                                                                           \
    fmi2Status fmi2Set##Type(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,        \
                             const fmi2##Type value[]) {                                        \
        (void)vr;                                                                               \
        (void)value;                                                                            \
        REQUIRE(INSTANTIATED | INITIALIZATION | INITIALIZED);                                   \
        return nvr == 0 ? fmi2OK : unsupported(c, "the model has no " #Type " variables");      \
    }

NO_VARIABLES(Integer)
NO_VARIABLES(Boolean)
NO_VARIABLES(String)

/* Saved states */

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
    REQUIRE(ALWAYS);
    return (fmi2Status)instance_save(c, FMUstate);
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate) {
    REQUIRE(ALWAYS);
    return (fmi2Status)instance_restore(c, FMUstate);
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
    REQUIRE(ALWAYS);
    instance_discard(c, FMUstate);
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size) {
    REQUIRE(ALWAYS);
    (void)FMUstate;
    if (size == NULL) {
        return null_argument(c, "size");
    }
    *size = instance_serialized_size();
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate,
                                 fmi2Byte serializedState[], size_t size) {
    REQUIRE(ALWAYS);
    return (fmi2Status)instance_serialize(c, FMUstate, serializedState, size);
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte serializedState[], size_t size,
                                   fmi2FMUstate *FMUstate) {
    REQUIRE(ALWAYS);
    return (fmi2Status)instance_deserialize(c, serializedState, size, FMUstate);
}

/* Partial derivatives */

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown_ref[],
                                        size_t nUnknown, const fmi2ValueReference vKnown_ref[],
                                        size_t nKnown, const fmi2Real dvKnown[],
                                        fmi2Real dvUnknown[]) {
    REQUIRE(COMPUTED);
    return (fmi2Status)instance_directional(c, vUnknown_ref, nUnknown, vKnown_ref, nKnown, dvKnown,
                                            dvUnknown);
}

/* Model Exchange */

fmi2Status fmi2EnterEventMode(fmi2Component c) {
    REQUIRE(EVENT | CONTINUOUS);
    enter(c, EVENT);
    return fmi2OK;
}

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *eventInfo) {
    REQUIRE(EVENT);
    if (eventInfo == NULL) {
        return null_argument(c, "eventInfo");
    }
    *eventInfo = (fmi2EventInfo){0}; /* the model has no events: all is false */
    return fmi2OK;
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) {
    REQUIRE(EVENT);
    enter(c, CONTINUOUS);
    return fmi2OK;
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c,
                                       fmi2Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi2Boolean *enterEventMode,
                                       fmi2Boolean *terminateSimulation) {
    REQUIRE(CONTINUOUS | STEP);
    (void)noSetFMUStatePriorToCurrentPoint;
    if (enterEventMode == NULL || terminateSimulation == NULL) {
        return null_argument(c, enterEventMode == NULL ? "enterEventMode" : "terminateSimulation");
    }
    *enterEventMode = fmi2False;
    *terminateSimulation = fmi2False;
    return (fmi2Status)instance_check_assertions(c);
}

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) {
    REQUIRE(INITIALIZED);
    return (fmi2Status)instance_set_time(c, time);
}

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t nx) {
    REQUIRE(CONTINUOUS | STEP);
    return (fmi2Status)instance_set_states(c, x, nx);
}

fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real derivatives[], size_t nx) {
    REQUIRE(COMPUTED);
    return (fmi2Status)instance_get_derivatives(c, derivatives, nx);
}

fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real eventIndicators[], size_t ni) {
    REQUIRE(COMPUTED);
    (void)eventIndicators;
    return ni == 0 ? fmi2OK : unsupported(c, "the model has no event indicators");
}

fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t nx) {
    REQUIRE(COMPUTED);
    return (fmi2Status)instance_get_states(c, x, nx);
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x_nominal[], size_t nx) {
    REQUIRE(ALWAYS);
    return (fmi2Status)instance_get_nominals(c, x_nominal, nx);
}

/* Co-Simulation */

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[]) {
    REQUIRE(INSTANTIATED | INITIALIZATION | STEP);
    (void)vr;
    (void)order;
    (void)value;
    return nvr == 0 ? fmi2OK : unsupported(c, "inputs are not interpolated");
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                        const fmi2Integer order[], fmi2Real value[]) {
    REQUIRE(STEP | STEP_FAILED | TERMINATED);
    (void)vr;
    (void)order;
    (void)value;
    return nvr == 0 ? fmi2OK : unsupported(c, "derivatives of outputs are not available");
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint,
                      fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint) {
    REQUIRE(STEP);
    (void)noSetFMUStatePriorToCurrentPoint;
    const Status status = instance_step(c, currentCommunicationPoint, communicationStepSize);
    if (status == STATUS_DISCARD) {
        enter(c, STEP_FAILED);
    }
    return (fmi2Status)status;
}

fmi2Status fmi2CancelStep(fmi2Component c) {
    REQUIRE(STEP | STEP_FAILED);
    return unsupported(c, "steps do not run asynchronously, so none can be cancelled");
}

/* Steps are never pending; what remains to ask is how far the last one came. */

static fmi2Status no_status(const Instance *i) {
    return (fmi2Status)report(i, STATUS_DISCARD,
                              "this status is not available, because steps are never pending. Ask "
                              "for fmi2LastSuccessfulTime or fmi2Terminated.");
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind s, fmi2Status *value) {
    REQUIRE(STEP | STEP_FAILED | TERMINATED);
    (void)s;
    (void)value;
    return no_status(c);
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *value) {
    REQUIRE(STEP | STEP_FAILED | TERMINATED);
    const Instance *const i = c;
    if (s != fmi2LastSuccessfulTime) {
        return no_status(i);
    }
    if (value == NULL) {
        return null_argument(i, "value");
    }
    *value = i->state.time;
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind s, fmi2Integer *value) {
    REQUIRE(STEP | STEP_FAILED | TERMINATED);
    (void)s;
    (void)value;
    return no_status(c);
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind s, fmi2Boolean *value) {
    REQUIRE(STEP | STEP_FAILED | TERMINATED);
    if (s != fmi2Terminated) {
        return no_status(c);
    }
    if (value == NULL) {
        return null_argument(c, "value");
    }
    *value = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind s, fmi2String *value) {
    REQUIRE(STEP | STEP_FAILED | TERMINATED);
    (void)s;
    (void)value;
    return no_status(c);
}
