/* The FMI 2.0 functions: values in and out, checks, errors, state. No physics, and no global that can change.
 *
 * fmi/shell.py is the specification, texts included. A user's mistake is fmi2Error with the reason in the log, and
 * leaves the instance and the arguments as they were before the call. Errors, warnings and what is discarded are logged
 * with debug logging off, too, as their status asks for (2.1.3), but for warnings that a host has switched off by their
 * category. There are no other messages. */

#include <float.h>
#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include "fmi2Functions.h"
#include "simulation.h"
#include "text.h"

enum {
    MOST = 65536,   /* values in a call, far more than there are variables */
    MOST_TEXT = 400 /* bytes of a host's text in a message */
};

typedef enum { READ, SET, GET_DERIVATIVE, SET_DERIVATIVE } Use; /* of variables */

typedef enum { INSTANTIATED, INITIALIZATION, STEPPING, TERMINATED } Mode;

static const char *const MODE_NAMES[] = {"instantiated", "initialization", "stepping", "terminated"};
static const char *const TYPE_NAMES[] = {"Real", "Integer", "Boolean", "String"};

/* What to do for a step to be possible. */
static const char *const BEFORE_STEPS[] = {
    [INSTANTIATED] = "initialize the instance first",
    [INITIALIZATION] = "call fmi2ExitInitializationMode first",
    [TERMINATED] = "reset the instance first",
};

/* Of messages, by their status. */
static const char *const CATEGORIES[] = {
    [fmi2Warning] = "logStatusWarning",
    [fmi2Discard] = "logStatusDiscard",
    [fmi2Error] = "logStatusError",
};

/* All that the future of an instance depends on; fmi2FMUstate points to one, and its bytes are the serialized state. */
typedef struct {
    uint32_t checksum; /* of all that follows, in what fmi2FMUstate points to */
    char format[60];   /* what the values mean */
    Simulation simulation;
    double time;                  /* end of the last step [s] */
    double start_time, stop_time; /* of the experiment [s]; INFINITY: no stop time */
    int64_t mode;
} State;

_Static_assert(sizeof STATE_FORMAT <= sizeof(((State *)NULL)->format), "the name of the format fits");
_Static_assert(sizeof(State) == 64 + sizeof(Simulation) + 4 * 8, "there is no padding");

typedef struct {
    fmi2CallbackFunctions callbacks;
    bool logs_warnings;
    State state;
    Text reason;  /* what the model says */
    Text message; /* with it */
    Text logged;  /* the message as the logger gets it */
    char name[];
} Instance;

/* Messages */

/* Log a message and return `status`. */
static fmi2Status tell(Instance *self, fmi2Status status, const char *format, ...) {
    clear(&self->message);
    append(&self->message, "%.*s: ", (int)length_within(self->name, MOST_TEXT), self->name);
    va_list arguments;
    va_start(arguments, format);
    append_list(&self->message, format, arguments);
    va_end(arguments);
    if (self->callbacks.logger == NULL || (status == fmi2Warning && !self->logs_warnings)) return status;
    escape(&self->logged, self->message.text);
    self->callbacks.logger(self->callbacks.componentEnvironment, self->name, status, CATEGORIES[status],
                           self->logged.text);
    return status;
}

/* Checks: fmi2OK, which is 0, or fmi2Error and a message */

/* Check that a call is allowed now. */
static fmi2Status check_mode(Instance *self, Mode mode, const char *call) {
    if (self == NULL) return fmi2Error;
    if (self->state.mode == (int64_t)mode) return fmi2OK;
    return tell(self, fmi2Error, "%s is allowed in mode %s only, the instance is in mode %s%s", call, MODE_NAMES[mode],
                MODE_NAMES[self->state.mode], self->state.mode > (int64_t)mode ? ": reset the instance first" : "");
}

/* Check the arguments of a call for `count` values, which are not looked at where there are none. */
static fmi2Status check_arrays(Instance *self, size_t count, const void *one, const void *other) {
    if (self == NULL) return fmi2Error;
    if (count > MOST) return tell(self, fmi2Error, "%zu values in one call (allowed: at most %d)", count, MOST);
    if (count > 0 && (one == NULL || other == NULL)) return tell(self, fmi2Error, "an argument is NULL");
    return fmi2OK;
}

/* Check that a variable can be set now. */
static fmi2Status check_settable(Instance *self, fmi2ValueReference reference) {
    const Variable *variable = &VARIABLES[reference];
    if (is_calculated(reference))
        return tell(self, fmi2Error, "%s is %s: it cannot be set", variable->name,
                    variable->causality == OUTPUT ? "an output" : "a local variable");
    if (self->state.mode == TERMINATED)
        return tell(self, fmi2Error, "%s cannot be set: the run has ended, reset the instance first", variable->name);
    if (self->state.mode == STEPPING && variable->causality == PARAMETER)
        return tell(self, fmi2Error, "%s is a fixed parameter: it can be set until initialization ends, not after",
                    variable->name);
    return fmi2OK;
}

/* Check a call for `n` variables, or for their derivatives of the `orders`. */
static fmi2Status check(Instance *self, Use use, Type type, const fmi2ValueReference vr[], size_t n, const void *values,
                        const fmi2Integer orders[]) {
    const bool derivative = use == GET_DERIVATIVE || use == SET_DERIVATIVE;
    const bool set = use == SET || use == SET_DERIVATIVE;
    const int max_order = set ? MAX_INPUT_ORDER : MAX_OUTPUT_ORDER;
    const fmi2Real *reals = values;
    if (check_arrays(self, n, vr, values)) return fmi2Error;
    if (derivative && check_arrays(self, n, orders, orders)) return fmi2Error;
    for (size_t i = 0; i < n; i++) {
        if (vr[i] >= VARIABLE_COUNT)
            return tell(self, fmi2Error, "value reference %u is unknown (allowed: 0..%d)", vr[i], VARIABLE_COUNT - 1);
        const Variable *variable = &VARIABLES[vr[i]];
        const char *name = variable->name;
        if (variable->type != type)
            return tell(self, fmi2Error, "%s (value reference %u) is not of type %s", name, vr[i], TYPE_NAMES[type]);
        if (derivative && variable->causality != (set ? INPUT : OUTPUT))
            return tell(self, fmi2Error, "%s is not an %s", name, set ? "input" : "output");
        if (derivative && (orders[i] < 1 || orders[i] > max_order))
            return tell(self, fmi2Error, "derivative of order %d of %s (allowed: 1..%d)", orders[i], name, max_order);
        if (use == SET_DERIVATIVE && !isfinite(reals[i]))
            return tell(self, fmi2Error, "derivative of order %d of %s = %s (allowed: finite)", orders[i], name,
                        repr(reals[i]).text);
        if (set && check_settable(self, vr[i])) return fmi2Error;
    }
    return fmi2OK;
}

/* Inquire platform and version number (2.1.4) */

/* That of the headers: "default". */
const char *fmi2GetTypesPlatform(void) {
    return fmi2TypesPlatform;
}

/* That of the headers: "2.0". */
const char *fmi2GetVersion(void) {
    return fmi2Version;
}

/* Creation, destruction and logging of an instance (2.1.5) */

/* Why there is no instance, or fmi2OK; the message needs an instance all the same. */
static fmi2Status check_instantiation(Instance *self, fmi2Type type, fmi2String guid) {
    const char *given = guid == NULL ? "missing" : guid;
    if (self->name[strspn(self->name, " \t\r\n\v\f")] == '\0')
        return tell(self, fmi2Error, "the instance name is missing");
    if (type != fmi2CoSimulation) return tell(self, fmi2Error, "the FMU is for co-simulation alone");
    if (strcmp(given, MODEL_GUID) != 0)
        return tell(self, fmi2Error, "the GUID is %.*s instead of %s: modelDescription.xml is of another binary",
                    (int)length_within(given, MOST_TEXT), given, MODEL_GUID);
    return fmi2OK;
}

/* Memory is taken here and for a state alone, and of the host nothing is kept but its callbacks. */
fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean loggingOn) {
    (void)resources; /* there are none */
    (void)visible;   /* there is no window */
    (void)loggingOn; /* there are no debug messages */
    const char *given = name == NULL ? "" : name;
    const size_t size = strlen(given) + 1;
    Instance *self = calloc(1, sizeof *self + size);
    if (self == NULL) {
        if (functions != NULL && functions->logger != NULL)
            functions->logger(functions->componentEnvironment, given, fmi2Error, CATEGORIES[fmi2Error],
                              "there is no memory for an instance");
        return NULL;
    }
    memcpy(self->name, given, size);
    if (functions != NULL) self->callbacks = *functions;
    self->logs_warnings = true;
    fmi2Reset(self);
    if (check_instantiation(self, type, guid) == fmi2OK) return self;
    free(self);
    return NULL;
}

/* NULL is no instance, and nothing to free. */
void fmi2FreeInstance(fmi2Component c) {
    free(c);
}

/* Of the categories the warnings alone can be switched off, by a list that has them or, of what stays on, has not. */
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t n, const fmi2String categories[]) {
    Instance *self = c;
    bool listed[sizeof CATEGORIES / sizeof *CATEGORIES] = {false};
    if (check_arrays(self, n, categories, categories)) return fmi2Error;
    for (size_t i = 0; i < n; i++) {
        if (categories[i] == NULL) return tell(self, fmi2Error, "an argument is NULL");
        int status = fmi2Warning;
        while (status <= fmi2Error && strcmp(categories[i], CATEGORIES[status]) != 0)
            status++;
        if (status > fmi2Error)
            return tell(self, fmi2Error, "log category %.*s is unknown (allowed: %s, %s, %s)",
                        (int)length_within(categories[i], MOST_TEXT), categories[i], CATEGORIES[fmi2Warning],
                        CATEGORIES[fmi2Discard], CATEGORIES[fmi2Error]);
        listed[status] = true;
    }
    self->logs_warnings = n == 0 || listed[fmi2Warning] == (loggingOn != fmi2False);
    return fmi2OK;
}

/* Initialization, termination, and resetting an instance (2.1.6) */

/* A second call replaces all of the first. A fixed-step method has no use for the tolerance. */
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean stopDefined, fmi2Real stop) {
    (void)toleranceDefined;
    (void)tolerance;
    Instance *self = c;
    if (check_mode(self, INSTANTIATED, "fmi2SetupExperiment")) return fmi2Error;
    if (!isfinite(start) || (stopDefined && !(start <= stop)))
        return tell(self, fmi2Error, "startTime = %s s must be finite and not beyond stopTime = %s s", repr(start).text,
                    stopDefined ? repr(stop).text : "None");
    self->state.time = start;
    self->state.start_time = start;
    self->state.stop_time = stopDefined ? stop : INFINITY;
    return fmi2OK;
}

/* Nothing is computed: outputs are when they are read. */
fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    Instance *self = c;
    if (check_mode(self, INSTANTIATED, "fmi2EnterInitializationMode")) return fmi2Error;
    self->state.mode = INITIALIZATION;
    return fmi2OK;
}

/* Check the parameters, all problems in one message, and warn of an unstable step size. */
fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    Instance *self = c;
    if (check_mode(self, INITIALIZATION, "fmi2ExitInitializationMode")) return fmi2Error;
    if (has_problems(&self->state.simulation, &self->reason))
        return tell(self, fmi2Error, "cannot initialize: %s", self->reason.text);
    self->state.mode = STEPPING;
    if (has_warnings(&self->state.simulation, &self->reason)) return tell(self, fmi2Warning, "%s", self->reason.text);
    return fmi2OK;
}

/* Allowed in every mode; the values can still be read. */
fmi2Status fmi2Terminate(fmi2Component c) {
    Instance *self = c;
    if (self == NULL) return fmi2Error;
    self->state.mode = TERMINATED;
    return fmi2OK;
}

/* Allowed in every mode; what is logged stays as it is set. */
fmi2Status fmi2Reset(fmi2Component c) {
    Instance *self = c;
    if (self == NULL) return fmi2Error;
    self->state = (State){.stop_time = INFINITY, .mode = INSTANTIATED};
    memcpy(self->state.format, STATE_FORMAT, sizeof STATE_FORMAT);
    reset(&self->state.simulation);
    return fmi2OK;
}

/* Getting and setting variable values (2.1.7) */

/* Nothing is written before all values are known to be finite; what is set is handed back as it is. */
static fmi2Status get(Instance *self, Type type, const fmi2ValueReference vr[], size_t n, void *values) {
    if (check(self, READ, type, vr, n, values, NULL)) return fmi2Error;
    const Simulation *simulation = &self->state.simulation;
    double outputs[VARIABLE_COUNT];
    for (size_t i = 0; i < n; i++) {
        outputs[vr[i]] = value_of(simulation, vr[i]);
        if (isfinite(outputs[vr[i]]) || !is_computed(vr[i])) continue;
        describe_values(simulation, &self->reason);
        return tell(self, fmi2Error, "%s is out of the range of a double at %s", VARIABLES[vr[i]].name,
                    self->reason.text);
    }
    for (size_t i = 0; i < n; i++) {
        if (type == REAL) {
            ((fmi2Real *)values)[i] = outputs[vr[i]];
        } else {
            ((fmi2Integer *)values)[i] = (fmi2Integer)outputs[vr[i]];
        }
    }
    return fmi2OK;
}

/* Values are checked when initialization ends or a step begins, not here: hosts set them in any order. */
static fmi2Status set(Instance *self, Type type, const fmi2ValueReference vr[], size_t n, const void *values) {
    if (check(self, SET, type, vr, n, values, NULL)) return fmi2Error;
    for (size_t i = 0; i < n; i++) {
        const double value = type == REAL ? ((const fmi2Real *)values)[i] : ((const fmi2Integer *)values)[i];
        set_value(&self->state.simulation, vr[i], value);
    }
    return fmi2OK;
}

/* Outputs are computed here, for what was set last. */
fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real values[]) {
    return get(c, REAL, vr, n, values);
}

/* Enumerations, too. */
fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Integer values[]) {
    return get(c, INTEGER, vr, n, values);
}

/* No variable is of this type. */
fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Boolean values[]) {
    return get(c, BOOLEAN, vr, n, values);
}

/* No variable is of this type. */
fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2String values[]) {
    return get(c, STRING, vr, n, values);
}

/* A start value is at once that of its output. */
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real values[]) {
    return set(c, REAL, vr, n, values);
}

/* Enumerations, too. */
fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer values[]) {
    return set(c, INTEGER, vr, n, values);
}

/* No variable is of this type. */
fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Boolean values[]) {
    return set(c, BOOLEAN, vr, n, values);
}

/* No variable is of this type. */
fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2String values[]) {
    return set(c, STRING, vr, n, values);
}

/* Getting and setting the complete FMU state (2.1.8) */

/* CRC-32 of all of a state but the checksum. */
static uint32_t checksum_of(const State *state) {
    const unsigned char *bytes = (const unsigned char *)state;
    uint32_t crc = UINT32_MAX;
    for (size_t i = sizeof state->checksum; i < sizeof *state; i++) {
        crc ^= bytes[i];
        for (int bit = 0; bit < 8; bit++)
            crc = crc >> 1 ^ (crc & 1 ? UINT32_C(0xEDB88320) : 0);
    }
    return ~crc;
}

/* Whether an instance can be in this state. */
static bool is_possible(const State *state, Text *scratch) {
    if (!(INSTANTIATED <= state->mode && state->mode <= TERMINATED)) return false;
    if (!isfinite(state->time) || !isfinite(state->start_time) || !(state->start_time <= state->stop_time))
        return false;
    const bool before_steps = state->mode == INSTANTIATED || state->mode == INITIALIZATION;
    if (before_steps && !is_at_start(&state->simulation)) return false;
    return can_be(&state->simulation, state->mode == STEPPING, scratch);
}

/* Check that a state is whole, of this model, and one that an instance can be in. */
static fmi2Status check_state(Instance *self, const State *state) {
    if (state->checksum != checksum_of(state))
        return tell(self, fmi2Error, "cannot restore the state: the bytes are damaged (wrong checksum)");
    if (strncmp(state->format, STATE_FORMAT, sizeof state->format) != 0)
        return tell(self, fmi2Error, "cannot restore the state: it is of '%.*s', this is '%s'",
                    (int)sizeof state->format, state->format, STATE_FORMAT);
    if (!is_possible(state, &self->reason))
        return tell(self, fmi2Error, "cannot restore the state: no instance can be in it");
    return fmi2OK;
}

/* A state that is pointed to already is used again. */
fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
    Instance *self = c;
    if (check_arrays(self, 1, FMUstate, FMUstate)) return fmi2Error;
    State *copy = *FMUstate == NULL ? malloc(sizeof *copy) : *FMUstate;
    if (copy == NULL) return tell(self, fmi2Error, "there is no memory for a state");
    *copy = self->state;
    copy->checksum = checksum_of(copy);
    *FMUstate = copy;
    return fmi2OK;
}

/* All of the instance but its name and what is logged. */
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate) {
    Instance *self = c;
    if (check_arrays(self, 1, FMUstate, FMUstate)) return fmi2Error;
    const State *state = FMUstate;
    if (check_state(self, state)) return fmi2Error;
    self->state = *state;
    return fmi2OK;
}

/* No state is nothing to free. */
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
    if (c == NULL) return fmi2Error;
    if (FMUstate == NULL) return fmi2OK;
    free(*FMUstate);
    *FMUstate = NULL;
    return fmi2OK;
}

/* The same for every state. */
fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size) {
    if (check_arrays(c, 1, FMUstate, size)) return fmi2Error;
    *size = sizeof(State);
    return fmi2OK;
}

/* There may be more room than a state needs. */
fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte bytes[], size_t size) {
    if (check_arrays(c, 1, FMUstate, bytes)) return fmi2Error;
    if (size < sizeof(State)) return tell(c, fmi2Error, "a state needs %zu bytes, there are %zu", sizeof(State), size);
    memcpy(bytes, FMUstate, sizeof(State));
    return fmi2OK;
}

/* Always a new state: what the variable held, which need not be a state, is not looked at. */
fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *FMUstate) {
    Instance *self = c;
    if (check_arrays(self, 1, bytes, FMUstate)) return fmi2Error;
    if (size != sizeof(State))
        return tell(self, fmi2Error, "cannot restore the state: the bytes are damaged (%zu, not %zu)", size,
                    sizeof(State));
    State *state = malloc(sizeof *state);
    if (state == NULL) return tell(self, fmi2Error, "there is no memory for a state");
    memcpy(state, bytes, sizeof *state);
    if (check_state(self, state)) {
        free(state);
        return fmi2Error;
    }
    *FMUstate = state;
    return fmi2OK;
}

/* Getting partial derivatives (2.1.9) */

/* Check that there are all derivatives of a call for directional derivatives, and not too many. */
static fmi2Status check_partial_derivatives(Instance *self, const fmi2ValueReference unknown[], size_t unknowns,
                                            const fmi2ValueReference known[], size_t knowns) {
    const bool initializing = self->state.mode == INITIALIZATION;
    if (knowns > 0 && unknowns > MOST / knowns)
        return tell(self, fmi2Error, "%zu unknowns by %zu knowns in one call (allowed: at most %d derivatives)",
                    unknowns, knowns, MOST);
    for (size_t i = 0; i < unknowns; i++)
        for (size_t k = 0; k < knowns; k++)
            if (!has_partial_derivative(unknown[i], known[k], initializing)) {
                describe_partial_derivatives(initializing, &self->reason);
                return tell(self, fmi2Error, "no derivative of %s with respect to %s (allowed: %s)",
                            VARIABLES[unknown[i]].name, VARIABLES[known[k]].name, self->reason.text);
            }
    return fmi2OK;
}

/* The derivative of one unknown in the direction of the knowns. */
static double directional_derivative(const Simulation *simulation, fmi2ValueReference unknown,
                                     const fmi2ValueReference known[], size_t knowns, const fmi2Real direction[]) {
    double sum = 0.0;
    for (size_t k = 0; k < knowns; k++)
        sum += direction[k] * partial_derivative(simulation, unknown, known[k]);
    return sum;
}

/* In Initialization Mode the knowns are the parameters and the input, later the states and the input. Nothing is
 * written before all values are known to be finite. */
fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[], size_t unknowns,
                                        const fmi2ValueReference known[], size_t knowns, const fmi2Real dvKnown[],
                                        fmi2Real dvUnknown[]) {
    Instance *self = c;
    if (self == NULL) return fmi2Error;
    if (self->state.mode == INSTANTIATED)
        return tell(self, fmi2Error, "fmi2GetDirectionalDerivative is not allowed in mode instantiated");
    if (check(self, READ, REAL, known, knowns, dvKnown, NULL)) return fmi2Error;
    if (check(self, READ, REAL, unknown, unknowns, dvUnknown, NULL)) return fmi2Error;
    if (check_partial_derivatives(self, unknown, unknowns, known, knowns)) return fmi2Error;
    const Simulation *simulation = &self->state.simulation;
    double derivatives[VARIABLE_COUNT];
    for (size_t i = 0; i < unknowns; i++) {
        derivatives[unknown[i]] = directional_derivative(simulation, unknown[i], known, knowns, dvKnown);
        if (!isfinite(derivatives[unknown[i]]))
            return tell(self, fmi2Error, "directional derivative of %s is out of the range of a double",
                        VARIABLES[unknown[i]].name);
    }
    for (size_t i = 0; i < unknowns; i++)
        dvUnknown[i] = derivatives[unknown[i]];
    return fmi2OK;
}

/* Transfer of input/output values and parameters (4.2.1) */

/* They are those at the beginning of the next step, and for that step alone. */
fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                       const fmi2Integer orders[], const fmi2Real values[]) {
    Instance *self = c;
    if (check(self, SET_DERIVATIVE, REAL, vr, n, values, orders)) return fmi2Error;
    for (size_t i = 0; i < n; i++)
        set_input_derivative(&self->state.simulation, vr[i], orders[i], values[i]);
    return fmi2OK;
}

/* Nothing is written before all values are known to be finite. */
fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                        const fmi2Integer orders[], fmi2Real values[]) {
    Instance *self = c;
    if (check(self, GET_DERIVATIVE, REAL, vr, n, values, orders)) return fmi2Error;
    const Simulation *simulation = &self->state.simulation;
    for (size_t i = 0; i < n; i++)
        if (!isfinite(time_derivative(simulation, vr[i])))
            return tell(self, fmi2Error, "derivative of order %d of %s is out of the range of a double", orders[i],
                        VARIABLES[vr[i]].name);
    for (size_t i = 0; i < n; i++)
        values[i] = time_derivative(simulation, vr[i]);
    return fmi2OK;
}

/* Computation (4.2.2) */

/* Whether a step over `duration` [s] may end at `end` [s]. The clock of a host that adds up its steps is rounded, and
 * FMPy takes what is within 1e-9 of the stop time for it. */
static bool is_within_experiment(const State *state, double duration, double end) {
    if (!isfinite(end)) return false;
    if (end <= state->stop_time) return true;
    const double largest = fmax(fabs(state->start_time), fabs(state->stop_time));
    const double noise = fmax(4.0 * DBL_EPSILON * largest, fmin(1e-9 * largest, duration / 10.0));
    return end <= state->stop_time + noise;
}

/* All of a step or nothing is made; what the host set is held, or goes on as its derivatives say. */
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean noSetFMUStatePriorToCurrentPoint) {
    (void)noSetFMUStatePriorToCurrentPoint; /* nothing is kept for going back */
    Instance *self = c;
    if (self == NULL) return fmi2Error;
    State *state = &self->state;
    const double end = time + step;
    if (state->mode != STEPPING)
        return tell(self, fmi2Error, "no step in mode %s: %s", MODE_NAMES[state->mode], BEFORE_STEPS[state->mode]);
    if (!(0.0 < step && step < INFINITY))
        return tell(self, fmi2Error, "no step from t = %s s: communicationStepSize = %s s (allowed: > 0 and finite)",
                    repr(time).text, repr(step).text);
    if (!is_within_experiment(state, step, end))
        return tell(self, fmi2Error,
                    "no step from t = %s s over %s s: it must end at a finite time, not beyond the stop time (%s s)",
                    repr(time).text, repr(step).text, repr(state->stop_time).text);
    if (!make_step(&state->simulation, time, step, &self->reason))
        return tell(self, fmi2Error, "%s", self->reason.text);
    state->time = end;
    return fmi2OK;
}

/* There is no step to cancel: all are made at once. */
fmi2Status fmi2CancelStep(fmi2Component c) {
    Instance *self = c;
    return self == NULL ? fmi2Error : tell(self, fmi2Error, "there is no step to cancel");
}

/* Retrieving status information from the slave (4.2.3) */

/* Steps are never pending, and the FMU never ends a run by itself: what else could be asked for has no value. */
static fmi2Status check_status(Instance *self, const void *value, fmi2StatusKind kind, bool known) {
    if (check_arrays(self, 1, value, value)) return fmi2Error;
    return known ? fmi2OK : tell(self, fmi2Discard, "there is no status of kind %d: no step is pending", (int)kind);
}

/* Of no kind. */
fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value) {
    return check_status(c, value, kind, false);
}

/* The end of the last step [s], or the start time. */
fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
    Instance *self = c;
    const fmi2Status status = check_status(self, value, kind, kind == fmi2LastSuccessfulTime);
    if (status == fmi2OK) *value = self->state.time;
    return status;
}

/* Of no kind. */
fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value) {
    return check_status(c, value, kind, false);
}

/* Whether the FMU ended the run: never. */
fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
    const fmi2Status status = check_status(c, value, kind, kind == fmi2Terminated);
    if (status == fmi2OK) *value = fmi2False;
    return status;
}

/* Of no kind. */
fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value) {
    return check_status(c, value, kind, false);
}
