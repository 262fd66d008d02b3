/* FMI 3.0 for Model Exchange and Co-Simulation.
 *
 * Extension: fmi3SetFloat64 may set continuous states and tunable parameters at any time after
 * initialization, as some importers do. On a Co-Simulation instance in step mode, fmi3SetTime,
 * fmi3Get/SetContinuousStates, fmi3GetContinuousStateDerivatives,
 * fmi3GetNominalsOfContinuousStates, fmi3GetEventIndicators and fmi3CompletedIntegratorStep work as
 * in Model Exchange, so that an observer can correct the state of a model that integrates itself.
 * Source: J. Brembeck, A. Pfeiffer, M. Fleps-Dezasse, M. Otter, K. Wernersson and H. Elmqvist,
 * Nonlinear State Estimation with an Extended FMI 2.0 Co-Simulation Interface, 10th International
 * Modelica Conference, 2014.
 */
#include <stdlib.h>
#include <string.h>

#include "fmi3Functions.h"
#include "instance.h"

enum {
    INITIALIZED = EVENT | CONTINUOUS | STEP,
    COMPUTED = INITIALIZATION | INITIALIZED | TERMINATED, /* results can be read */
    ALWAYS = INSTANTIATED | COMPUTED
};

/* Returns from the calling function unless the instance is in one of the phases. */
#define REQUIRE(phases)                               \
    do {                                              \
        if (!allowed(instance, __func__, (phases))) { \
            return fmi3Error;                         \
        }                                             \
    } while (0)

static fmi3Status null_argument(const Instance *i, const char *name) {
    return (fmi3Status)report(i, STATUS_ERROR, "'%s' is NULL. Pass a variable.", name);
}

static fmi3Status unsupported(const Instance *i, const char *what) {
    return (fmi3Status)report(i, STATUS_ERROR,
                              "%s. Heed the capability flags and variables in "
                              "modelDescription.xml.",
                              what);
}

/* One value for each reference, as all variables are scalars. */
static fmi3Status check_count(const Instance *i, const char *what, size_t references,
                              size_t values) {
    if (references != values) {
        return (fmi3Status)report(i, STATUS_ERROR,
                                  "%lu %s for %lu value references, expected one for each. Pass "
                                  "arrays of equal length.",
                                  (unsigned long)values, what, (unsigned long)references);
    }
    return fmi3OK;
}

static void log_message(const Instance *i, Status status, const char *category,
                        const char *message) {
    const fmi3LogMessageCallback callback = (fmi3LogMessageCallback)i->importer.callback;
    if (callback != NULL) {
        callback(i->importer.environment, (fmi3Status)status, category, message);
    }
}

/* Inquire, create, destroy */

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean loggingOn, size_t nCategories,
                               const fmi3String categories[]) {
    REQUIRE(ALWAYS);
    Instance *const i = instance;
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
    return fmi3OK;
}

static Instance *create(Kind kind, fmi3String name, fmi3String token, const char *function,
                        fmi3Boolean loggingOn, fmi3InstanceEnvironment environment,
                        fmi3LogMessageCallback logMessage) {
    const Importer importer = {.log = log_message,
                               .callback = (void (*)(void))logMessage,
                               .environment = environment,
                               .allocate = calloc,
                               .release = free,
                               .log_information = loggingOn};
    return instance_create(kind, name, token, function, &importer);
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String instanceName, fmi3String instantiationToken,
                                          fmi3String resourcePath, fmi3Boolean visible,
                                          fmi3Boolean loggingOn,
                                          fmi3InstanceEnvironment instanceEnvironment,
                                          fmi3LogMessageCallback logMessage) {
    (void)resourcePath;
    (void)visible;
    return create(MODEL_EXCHANGE, instanceName, instantiationToken, __func__, loggingOn,
                  instanceEnvironment, logMessage);
}

fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath,
    fmi3Boolean visible, fmi3Boolean loggingOn, fmi3Boolean eventModeUsed,
    fmi3Boolean earlyReturnAllowed, const fmi3ValueReference requiredIntermediateVariables[],
    size_t nRequiredIntermediateVariables, fmi3InstanceEnvironment instanceEnvironment,
    fmi3LogMessageCallback logMessage, fmi3IntermediateUpdateCallback intermediateUpdate) {
    (void)resourcePath;
    (void)visible;
    (void)earlyReturnAllowed;
    (void)requiredIntermediateVariables;
    (void)intermediateUpdate;
    Instance *const i = create(CO_SIMULATION, instanceName, instantiationToken, __func__,
                               loggingOn, instanceEnvironment, logMessage);
    if (i != NULL && (eventModeUsed || nRequiredIntermediateVariables > 0)) {
        unsupported(i, eventModeUsed ? "the model has no event mode in Co-Simulation"
                                     : "the model has no intermediate update");
        instance_free(i);
        return NULL;
    }
    return i;
}

fmi3Instance fmi3InstantiateScheduledExecution(
    fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath,
    fmi3Boolean visible, fmi3Boolean loggingOn, fmi3InstanceEnvironment instanceEnvironment,
    fmi3LogMessageCallback logMessage, fmi3ClockUpdateCallback clockUpdate,
    fmi3LockPreemptionCallback lockPreemption, fmi3UnlockPreemptionCallback unlockPreemption) {
    (void)instanceName;
    (void)instantiationToken;
    (void)resourcePath;
    (void)visible;
    (void)loggingOn;
    (void)clockUpdate;
    (void)lockPreemption;
    (void)unlockPreemption;
    if (logMessage != NULL) {
        logMessage(instanceEnvironment, fmi3Error, "logStatusError",
                   "fmi3InstantiateScheduledExecution: the model has no scheduled execution. Use "
                   "Model Exchange or Co-Simulation.");
    }
    return NULL;
}

void fmi3FreeInstance(fmi3Instance instance) { instance_free(instance); }

/* Initialize, change modes, terminate, reset */

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean toleranceDefined,
                                       fmi3Float64 tolerance, fmi3Float64 startTime,
                                       fmi3Boolean stopTimeDefined, fmi3Float64 stopTime) {
    REQUIRE(INSTANTIATED);
    const Status status =
        instance_setup(instance, toleranceDefined, tolerance, startTime, stopTimeDefined, stopTime);
    if (status == STATUS_OK) {
        enter(instance, INITIALIZATION);
    }
    return (fmi3Status)status;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) {
    REQUIRE(INITIALIZATION);
    Instance *const i = instance;
    const Status status = instance_check_assertions(i);
    if (status == STATUS_OK) {
        enter(i, i->state.kind == CO_SIMULATION ? STEP : EVENT);
    }
    return (fmi3Status)status;
}

fmi3Status fmi3EnterEventMode(fmi3Instance instance) {
    REQUIRE(EVENT | CONTINUOUS);
    enter(instance, EVENT);
    return fmi3OK;
}

fmi3Status fmi3Terminate(fmi3Instance instance) {
    REQUIRE(INITIALIZED);
    enter(instance, TERMINATED);
    return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance instance) {
    REQUIRE(ALWAYS);
    instance_reset(instance);
    return fmi3OK;
}

/* Variables */

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                          size_t nValueReferences, fmi3Float64 values[], size_t nValues) {
    REQUIRE(COMPUTED);
    const fmi3Status status = check_count(instance, "values", nValueReferences, nValues);
    return status != fmi3OK
               ? status
               : (fmi3Status)instance_get(instance, valueReferences, nValueReferences, values);
}

fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                          size_t nValueReferences, const fmi3Float64 values[], size_t nValues) {
    REQUIRE(INSTANTIATED | INITIALIZATION | INITIALIZED);
    const fmi3Status status = check_count(instance, "values", nValueReferences, nValues);
    return status != fmi3OK
               ? status
               : (fmi3Status)instance_set(instance, valueReferences, nValueReferences, values);
}

/* The model has no variables but Float64 ones. */
#define NO_VARIABLES_GET(Type)                                                                  \
    fmi3Status fmi3Get##Type(fmi3Instance instance, const fmi3ValueReference valueReferences[], \
                             size_t nValueReferences, fmi3##Type values[], size_t nValues) {    \
        (void)valueReferences;                                                                  \
        (void)values;                                                                           \
        (void)nValues;                                                                          \
        REQUIRE(COMPUTED);                                                                      \
        return nValueReferences == 0                                                            \
                   ? fmi3OK                                                                     \
                   : unsupported(instance, "the model has no " #Type " variables");             \
    }

#define NO_VARIABLES_SET(Type)                                                                  \
    fmi3Status fmi3Set##Type(fmi3Instance instance, const fmi3ValueReference valueReferences[], \
                             size_t nValueReferences, const fmi3##Type values[],                \
                             size_t nValues) {                                                  \
        (void)valueReferences;                                                                  \
        (void)values;                                                                           \
        (void)nValues;                                                                          \
        REQUIRE(INSTANTIATED | INITIALIZATION | INITIALIZED);                                   \
        return nValueReferences == 0                                                            \
                   ? fmi3OK                                                                     \
                   : unsupported(instance, "the model has no " #Type " variables");             \
    }

NO_VARIABLES_GET(Float32)
NO_VARIABLES_SET(Float32)
NO_VARIABLES_GET(Int8)
NO_VARIABLES_SET(Int8)
NO_VARIABLES_GET(UInt8)
NO_VARIABLES_SET(UInt8)
NO_VARIABLES_GET(Int16)
NO_VARIABLES_SET(Int16)
NO_VARIABLES_GET(UInt16)
NO_VARIABLES_SET(UInt16)
NO_VARIABLES_GET(Int32)
NO_VARIABLES_SET(Int32)
NO_VARIABLES_GET(UInt32)
NO_VARIABLES_SET(UInt32)
NO_VARIABLES_GET(Int64)
NO_VARIABLES_SET(Int64)
NO_VARIABLES_GET(UInt64)
NO_VARIABLES_SET(UInt64)
NO_VARIABLES_GET(Boolean)
NO_VARIABLES_SET(Boolean)
NO_VARIABLES_GET(String)
NO_VARIABLES_SET(String)

fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                         size_t nValueReferences, size_t valueSizes[], fmi3Binary values[],
                         size_t nValues) {
    REQUIRE(COMPUTED);
    (void)valueReferences;
    (void)valueSizes;
    (void)values;
    (void)nValues;
    return nValueReferences == 0 ? fmi3OK
                                 : unsupported(instance, "the model has no Binary variables");
}

fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                         size_t nValueReferences, const size_t valueSizes[],
                         const fmi3Binary values[], size_t nValues) {
    REQUIRE(INSTANTIATED | INITIALIZATION | INITIALIZED);
    (void)valueReferences;
    (void)valueSizes;
    (void)values;
    (void)nValues;
    return nValueReferences == 0 ? fmi3OK
                                 : unsupported(instance, "the model has no Binary variables");
}

/* Dependencies: every nonzero of a row of the Jacobian, elements 0 because variables are scalars */

/* Counts the states and inputs on which a variable depends, and stores them unless NULL is given.
 * -1 after a message if the reference is no unknown. */
static int dependencies(const Instance *i, fmi3ValueReference dependent,
                        fmi3ValueReference independents[]) {
    int row;
    int count = 0;
    switch (group_of(dependent)) {
    case GROUP_X: /* a state that is an output depends on itself */
        if (independents != NULL) {
            independents[0] = dependent;
        }
        return 1;
    case GROUP_XDOT:
        row = (int)dependent - REFERENCE_XDOT;
        break;
    case GROUP_W:
        row = (int)dependent - REFERENCE_W + NX;
        break;
    default:
        report(i, STATUS_ERROR,
               "value reference %u is no output or derivative. Take the unknowns from the model "
               "structure in modelDescription.xml.",
               dependent);
        return -1;
    }
    for (int column = 0; column < NX + NU; column++) {
        for (int n = model_jacobian_xu_column[column]; n < model_jacobian_xu_column[column + 1];
             n++) {
            if (model_jacobian_xu_row[n] == row) {
                if (independents != NULL) {
                    independents[count] =
                        (fmi3ValueReference)(column < NX ? column : column + NX);
                }
                count++;
            }
        }
    }
    return count;
}

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance instance,
                                               fmi3ValueReference valueReference,
                                               size_t *nDependencies) {
    REQUIRE(ALWAYS);
    if (nDependencies == NULL) {
        return null_argument(instance, "nDependencies");
    }
    const int count = dependencies(instance, valueReference, NULL);
    if (count < 0) {
        return fmi3Error;
    }
    *nDependencies = (size_t)count;
    return fmi3OK;
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance instance, fmi3ValueReference dependent,
                                       size_t elementIndicesOfDependent[],
                                       fmi3ValueReference independents[],
                                       size_t elementIndicesOfIndependents[],
                                       fmi3DependencyKind dependencyKinds[],
                                       size_t nDependencies) {
    REQUIRE(ALWAYS);
    const int count = dependencies(instance, dependent, NULL);
    if (count < 0) {
        return fmi3Error;
    }
    if (nDependencies != (size_t)count) {
        return (fmi3Status)report(instance, STATUS_ERROR,
                                  "room for %lu dependencies, expected %d. Ask for their number "
                                  "first.",
                                  (unsigned long)nDependencies, count);
    }
    if (count > 0 && (elementIndicesOfDependent == NULL || independents == NULL ||
                      elementIndicesOfIndependents == NULL || dependencyKinds == NULL)) {
        return null_argument(instance, "one of the arrays");
    }
    dependencies(instance, dependent, independents);
    for (int n = 0; n < count; n++) {
        elementIndicesOfDependent[n] = 0;
        elementIndicesOfIndependents[n] = 0;
        dependencyKinds[n] = fmi3Dependent;
    }
    return fmi3OK;
}

/* Saved states */

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *FMUState) {
    REQUIRE(ALWAYS);
    return (fmi3Status)instance_save(instance, FMUState);
}

fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState FMUState) {
    REQUIRE(ALWAYS);
    return (fmi3Status)instance_restore(instance, FMUState);
}

fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *FMUState) {
    REQUIRE(ALWAYS);
    instance_discard(instance, FMUState);
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState FMUState, size_t *size) {
    REQUIRE(ALWAYS);
    (void)FMUState;
    if (size == NULL) {
        return null_argument(instance, "size");
    }
    *size = instance_serialized_size();
    return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState FMUState,
                                 fmi3Byte serializedState[], size_t size) {
    REQUIRE(ALWAYS);
    return (fmi3Status)instance_serialize(instance, FMUState, serializedState, size);
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte serializedState[],
                                   size_t size, fmi3FMUState *FMUState) {
    REQUIRE(ALWAYS);
    return (fmi3Status)instance_deserialize(instance, serializedState, size, FMUState);
}

/* Partial derivatives */

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[],
                                        size_t nUnknowns, const fmi3ValueReference knowns[],
                                        size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,
                                        fmi3Float64 sensitivity[], size_t nSensitivity) {
    REQUIRE(COMPUTED);
    if (check_count(instance, "seeds", nKnowns, nSeed) != fmi3OK ||
        check_count(instance, "sensitivities", nUnknowns, nSensitivity) != fmi3OK) {
        return fmi3Error;
    }
    return (fmi3Status)instance_directional(instance, unknowns, nUnknowns, knowns, nKnowns, seed,
                                            sensitivity);
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[],
                                    size_t nUnknowns, const fmi3ValueReference knowns[],
                                    size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,
                                    fmi3Float64 sensitivity[], size_t nSensitivity) {
    REQUIRE(COMPUTED);
    if (check_count(instance, "seeds", nUnknowns, nSeed) != fmi3OK ||
        check_count(instance, "sensitivities", nKnowns, nSensitivity) != fmi3OK) {
        return fmi3Error;
    }
    return (fmi3Status)instance_adjoint(instance, unknowns, nUnknowns, knowns, nKnowns, seed,
                                        sensitivity);
}

/* Model Exchange */

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance) {
    REQUIRE(INITIALIZATION | EVENT);
    return fmi3OK; /* there are none */
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *discreteStatesNeedUpdate,
                                    fmi3Boolean *terminateSimulation,
                                    fmi3Boolean *nominalsOfContinuousStatesChanged,
                                    fmi3Boolean *valuesOfContinuousStatesChanged,
                                    fmi3Boolean *nextEventTimeDefined,
                                    fmi3Float64 *nextEventTime) {
    REQUIRE(EVENT);
    if (discreteStatesNeedUpdate == NULL || terminateSimulation == NULL ||
        nominalsOfContinuousStatesChanged == NULL || valuesOfContinuousStatesChanged == NULL ||
        nextEventTimeDefined == NULL || nextEventTime == NULL) {
        return null_argument(instance, "one of the results");
    }
    *discreteStatesNeedUpdate = fmi3False;
    *terminateSimulation = fmi3False;
    *nominalsOfContinuousStatesChanged = fmi3False;
    *valuesOfContinuousStatesChanged = fmi3False;
    *nextEventTimeDefined = fmi3False;
    *nextEventTime = 0.0;
    return fmi3OK;
}

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance) {
    REQUIRE(EVENT);
    enter(instance, CONTINUOUS);
    return fmi3OK;
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance,
                                       fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi3Boolean *enterEventMode,
                                       fmi3Boolean *terminateSimulation) {
    REQUIRE(CONTINUOUS | STEP);
    (void)noSetFMUStatePriorToCurrentPoint;
    if (enterEventMode == NULL || terminateSimulation == NULL) {
        return null_argument(instance,
                             enterEventMode == NULL ? "enterEventMode" : "terminateSimulation");
    }
    *enterEventMode = fmi3False;
    *terminateSimulation = fmi3False;
    return (fmi3Status)instance_check_assertions(instance);
}

fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time) {
    REQUIRE(INITIALIZED);
    return (fmi3Status)instance_set_time(instance, time);
}

fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 continuousStates[],
                                   size_t nContinuousStates) {
    REQUIRE(CONTINUOUS | STEP);
    return (fmi3Status)instance_set_states(instance, continuousStates, nContinuousStates);
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance instance, fmi3Float64 derivatives[],
                                             size_t nContinuousStates) {
    REQUIRE(COMPUTED);
    return (fmi3Status)instance_get_derivatives(instance, derivatives, nContinuousStates);
}

fmi3Status fmi3GetEventIndicators(fmi3Instance instance, fmi3Float64 eventIndicators[],
                                  size_t nEventIndicators) {
    REQUIRE(COMPUTED);
    (void)eventIndicators;
    return nEventIndicators == 0 ? fmi3OK
                                 : unsupported(instance, "the model has no event indicators");
}

fmi3Status fmi3GetContinuousStates(fmi3Instance instance, fmi3Float64 continuousStates[],
                                   size_t nContinuousStates) {
    REQUIRE(COMPUTED);
    return (fmi3Status)instance_get_states(instance, continuousStates, nContinuousStates);
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance instance, fmi3Float64 nominals[],
                                             size_t nContinuousStates) {
    REQUIRE(ALWAYS);
    return (fmi3Status)instance_get_nominals(instance, nominals, nContinuousStates);
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t *nEventIndicators) {
    REQUIRE(ALWAYS);
    if (nEventIndicators == NULL) {
        return null_argument(instance, "nEventIndicators");
    }
    *nEventIndicators = 0;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t *nContinuousStates) {
    REQUIRE(ALWAYS);
    if (nContinuousStates == NULL) {
        return null_argument(instance, "nContinuousStates");
    }
    *nContinuousStates = NX;
    return fmi3OK;
}

/* Co-Simulation */

fmi3Status fmi3EnterStepMode(fmi3Instance instance) {
    REQUIRE(ALWAYS);
    return unsupported(instance, "the model has no event mode in Co-Simulation to leave");
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance,
                                    const fmi3ValueReference valueReferences[],
                                    size_t nValueReferences, const fmi3Int32 orders[],
                                    fmi3Float64 values[], size_t nValues) {
    REQUIRE(STEP | TERMINATED);
    (void)valueReferences;
    (void)orders;
    (void)values;
    (void)nValues;
    return nValueReferences == 0
               ? fmi3OK
               : unsupported(instance, "derivatives of outputs are not available");
}

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 currentCommunicationPoint,
                      fmi3Float64 communicationStepSize,
                      fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                      fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation,
                      fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime) {
    REQUIRE(STEP);
    (void)noSetFMUStatePriorToCurrentPoint;
    Instance *const i = instance;
    if (eventHandlingNeeded == NULL || terminateSimulation == NULL || earlyReturn == NULL ||
        lastSuccessfulTime == NULL) {
        return null_argument(i, "one of the results");
    }
    const Status status = instance_step(i, currentCommunicationPoint, communicationStepSize);
    *eventHandlingNeeded = fmi3False;
    *terminateSimulation = fmi3False;
    *earlyReturn = fmi3False;
    *lastSuccessfulTime = i->state.time;
    return (fmi3Status)status;
}

/* What the model does not have: configuration mode, clocks, model partitions */

fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance) {
    REQUIRE(ALWAYS);
    return unsupported(instance, "the model has no structural parameters to configure");
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance) {
    REQUIRE(ALWAYS);
    return unsupported(instance, "the model has no structural parameters to configure");
}

fmi3Status fmi3ActivateModelPartition(fmi3Instance instance, fmi3ValueReference clockReference,
                                      fmi3Float64 activationTime) {
    REQUIRE(ALWAYS);
    (void)clockReference;
    (void)activationTime;
    return unsupported(instance, "the model has no model partitions");
}

static fmi3Status no_clocks(const Instance *i, size_t n) {
    return n == 0 ? fmi3OK : unsupported(i, "the model has no clocks");
}

fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                        size_t nValueReferences, fmi3Clock values[]) {
    REQUIRE(ALWAYS);
    (void)valueReferences;
    (void)values;
    return no_clocks(instance, nValueReferences);
}

fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                        size_t nValueReferences, const fmi3Clock values[]) {
    REQUIRE(ALWAYS);
    (void)valueReferences;
    (void)values;
    return no_clocks(instance, nValueReferences);
}

fmi3Status fmi3GetIntervalDecimal(fmi3Instance instance,
                                  const fmi3ValueReference valueReferences[],
                                  size_t nValueReferences, fmi3Float64 intervals[],
                                  fmi3IntervalQualifier qualifiers[]) {
    REQUIRE(ALWAYS);
    (void)valueReferences;
    (void)intervals;
    (void)qualifiers;
    return no_clocks(instance, nValueReferences);
}

fmi3Status fmi3GetIntervalFraction(fmi3Instance instance,
                                   const fmi3ValueReference valueReferences[],
                                   size_t nValueReferences, fmi3UInt64 counters[],
                                   fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[]) {
    REQUIRE(ALWAYS);
    (void)valueReferences;
    (void)counters;
    (void)resolutions;
    (void)qualifiers;
    return no_clocks(instance, nValueReferences);
}

fmi3Status fmi3GetShiftDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                               size_t nValueReferences, fmi3Float64 shifts[]) {
    REQUIRE(ALWAYS);
    (void)valueReferences;
    (void)shifts;
    return no_clocks(instance, nValueReferences);
}

fmi3Status fmi3GetShiftFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                size_t nValueReferences, fmi3UInt64 counters[],
                                fmi3UInt64 resolutions[]) {
    REQUIRE(ALWAYS);
    (void)valueReferences;
    (void)counters;
    (void)resolutions;
    return no_clocks(instance, nValueReferences);
}

fmi3Status fmi3SetIntervalDecimal(fmi3Instance instance,
                                  const fmi3ValueReference valueReferences[],
                                  size_t nValueReferences, const fmi3Float64 intervals[]) {
    REQUIRE(ALWAYS);
    (void)valueReferences;
    (void)intervals;
    return no_clocks(instance, nValueReferences);
}

fmi3Status fmi3SetIntervalFraction(fmi3Instance instance,
                                   const fmi3ValueReference valueReferences[],
                                   size_t nValueReferences, const fmi3UInt64 counters[],
                                   const fmi3UInt64 resolutions[]) {
    REQUIRE(ALWAYS);
    (void)valueReferences;
    (void)counters;
    (void)resolutions;
    return no_clocks(instance, nValueReferences);
}

fmi3Status fmi3SetShiftDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                               size_t nValueReferences, const fmi3Float64 shifts[]) {
    REQUIRE(ALWAYS);
    (void)valueReferences;
    (void)shifts;
    return no_clocks(instance, nValueReferences);
}

fmi3Status fmi3SetShiftFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                size_t nValueReferences, const fmi3UInt64 counters[],
                                const fmi3UInt64 resolutions[]) {
    REQUIRE(ALWAYS);
    (void)valueReferences;
    (void)counters;
    (void)resolutions;
    return no_clocks(instance, nValueReferences);
}
