/* The FMI 2.0 functions: values in and out, checks, errors, state. No physics, and no global that can change.
 *
 * A user's mistake is fmi2Error with the reason in the log, and leaves the instance as it was before the call. Errors
 * and warnings are always logged; there are no other messages. */

#include "fmi2Functions.h"

#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "pendulum.h"

typedef enum { INSTANTIATED, INITIALIZATION, STEPPING, TERMINATED } Mode;

static const char *const MODE_NAMES[] = {"instantiated", "initialization", "stepping", "terminated"};
static const char *const TYPE_NAMES[] = {"Real", "Integer", "Boolean", "String"};

/* All that the future of an instance depends on. */
typedef struct {
    double values[VARIABLE_COUNT];           /* of parameters and input, by value reference */
    double tau_derivatives[MAX_INPUT_ORDER]; /* of order 1, 2, ... [N.m/s, N.m/s2, ...], for the next step */
    double phi, w, time, latest_end;         /* [rad, rad/s, s, s]; the time is the end of the last step */
    int32_t nfev, mode;
} State;

/* What fmi2FMUstate points to; its bytes are the serialized state. */
typedef struct {
    uint32_t checksum; /* of all that follows */
    char format[60];   /* of the state: model and version */
    State state;
} Snapshot;

_Static_assert(sizeof STATE_FORMAT <= 60 && sizeof(Snapshot) == 72 + 8 * (VARIABLE_COUNT + MAX_INPUT_ORDER + 4),
               "the name of the format fits, and there is no padding");

typedef struct {
    fmi2CallbackFunctions callbacks;
    State state;
    fmi2Status step_status;
    char name[];
} Instance;

typedef struct {
    char text[1024];
} Text;

static void append(Text *text, const char *format, ...) {
    const size_t length = strlen(text->text);
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text->text + length, sizeof text->text - length, format, arguments);
    va_end(arguments);
}

/* A decimal that reads back as `value`, like Python's. */
static Text repr(double value) {
    Text shown;
    for (int digits = 15; digits <= 17; digits++) {
        snprintf(shown.text, sizeof shown.text, "%.*g", digits, value);
        if (strtod(shown.text, NULL) == value) break;
    }
    if (shown.text[strspn(shown.text, "-0123456789")] == '\0') append(&shown, ".0");
    return shown;
}

static Text describe(int vr, double value) {
    const Variable *variable = &VARIABLES[vr];
    Text text = {""}, number = repr(value);
    if (variable->type == INTEGER) snprintf(number.text, sizeof number.text, "%.0f", value);
    append(&text, "%s = %s%s%s (allowed: %s)", variable->name, number.text, *variable->unit ? " " : "", variable->unit,
           variable->allowed);
    return text;
}

static void log_text(const Instance *self, fmi2Status status, const char *category, const char *text) {
    if (self->callbacks.logger == NULL) return;
    self->callbacks.logger(self->callbacks.componentEnvironment, self->name, status, category, "%s", text);
}

static fmi2Status fail(const Instance *self, const char *format, ...) {
    Text text;
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text.text, sizeof text.text, format, arguments);
    va_end(arguments);
    log_text(self, fmi2Error, "logStatusError", text.text);
    return fmi2Error;
}

static Pendulum pendulum_of(const State *state) {
    const double *values = state->values;
    return pendulum(values[VR_m], values[VR_L], values[VR_gamma], values[VR_g], values[VR_tau], state->tau_derivatives);
}

static Method method_of(const State *state) {
    return (Method)state->values[VR_solver_method];
}

static double max_step_of(const State *state, const Pendulum *p) {
    return fmin(state->values[VR_solver_stepSize], unique_root_limit(method_of(state), p));
}

/* Take the state from the start values, so that the outputs are right before the first step, too. */
static void begin(State *state) {
    if (state->mode >= STEPPING) return;
    state->phi = state->values[VR_phi_start];
    state->w = state->values[VR_w_start];
}

static State initial_state(void) {
    State state = {.latest_end = INFINITY, .mode = INSTANTIATED};
    for (int vr = 0; vr < VARIABLE_COUNT; vr++) state.values[vr] = VARIABLES[vr].start;
    begin(&state);
    return state;
}

/* What is wrong with the parameters, "" if nothing is. */
static Text parameter_problems(const State *state) {
    Text problems = {""};
    for (int vr = 0; vr < VARIABLE_COUNT; vr++) {
        const double value = state->values[vr];
        if (VARIABLES[vr].causality == PARAMETER && !(VARIABLES[vr].lowest <= value && value <= VARIABLES[vr].highest))
            append(&problems, "%s%s", *problems.text ? "; " : "", describe(vr, value).text);
    }
    const Pendulum p = pendulum_of(state);
    const char *const names[] = {"J = m*L^2", "gamma/m", "g/L"}, *const units[] = {"kg.m2", "1/s", "1/s2"};
    const double values[] = {p.J, p.damping_rate, p.w02};
    const bool each_allowed = !*problems.text;
    for (int i = 0; i < 3 && each_allowed; i++)
        if (!isfinite(values[i]) || (i == 0 && p.J == 0.0))
            append(&problems, "%s%s = %s %s is out of the range of a double", *problems.text ? "; " : "", names[i],
                   repr(values[i]).text, units[i]);
    return problems;
}

static Text advice(Method method, double limit) {
    const char *name = METHODS[method].name, *implicit = METHODS[ImplicitEuler].name;
    Text text = {""};
    if (limit == INFINITY)
        append(&text, "%s has no stability limit: check the torque and the start values", name);
    else if (limit == 0.0)
        append(&text, "%s has no stable step size without damping: use %s or %s", name,
               METHODS[ExplicitRungeKutta4].name, implicit);
    else
        append(&text, "the stability limit of %s for this pendulum is %.6g s: use a smaller %s or %s", name, limit,
               VARIABLES[VR_solver_stepSize].name, implicit);
    return text;
}

/* Checks: fmi2OK, or fmi2Error and a message */

static fmi2Status check_mode(const Instance *self, Mode mode, const char *call) {
    if (self == NULL) return fmi2Error;
    if (self->state.mode == (int32_t)mode) return fmi2OK;
    return fail(self, "%s in mode %s (allowed: %s)", call, MODE_NAMES[self->state.mode], MODE_NAMES[mode]);
}

static fmi2Status check_array(const Instance *self, const void *array, size_t count) {
    enum { MOST = 65536 }; /* far more than there are variables */
    if (self == NULL) return fmi2Error;
    if (count > MOST) return fail(self, "%zu values in one call (allowed: at most %d)", count, MOST);
    return count == 0 || array != NULL ? fmi2OK : fail(self, "an argument is NULL");
}

static fmi2Status check_references(const Instance *self, Type type, const fmi2ValueReference vr[], size_t nvr,
                                   const void *values) {
    if (check_array(self, vr, nvr) != fmi2OK || check_array(self, values, nvr) != fmi2OK) return fmi2Error;
    for (size_t i = 0; i < nvr; i++) {
        if (vr[i] >= VARIABLE_COUNT)
            return fail(self, "value reference %u is unknown (allowed: 0..%d)", vr[i], VARIABLE_COUNT - 1);
        const Variable *variable = &VARIABLES[vr[i]];
        if (variable->type != type)
            return fail(self, "%s (value reference %u) is not of type %s", variable->name, vr[i], TYPE_NAMES[type]);
    }
    return fmi2OK;
}

static fmi2Status check_settable(const Instance *self, Type type, const fmi2ValueReference vr[], size_t nvr,
                                 const void *values) {
    if (check_references(self, type, vr, nvr, values) != fmi2OK) return fmi2Error;
    for (size_t i = 0; i < nvr; i++) {
        const char *name = VARIABLES[vr[i]].name;
        const Causality causality = VARIABLES[vr[i]].causality;
        if (causality == OUTPUT) return fail(self, "%s is an output: it cannot be set", name);
        if (self->state.mode == TERMINATED) return fail(self, "%s cannot be set: the run has ended", name);
        if (self->state.mode == STEPPING && causality == PARAMETER)
            return fail(self, "%s is a fixed parameter: it can be set until initialization ends, not after", name);
    }
    return fmi2OK;
}

/* a, E and the derivatives divide by parameters and take the sine of phi. */
static fmi2Status check_computable(const Instance *self) {
    const double m = self->state.values[VR_m], L = self->state.values[VR_L];
    if (m != 0.0 && L != 0.0 && m * L * L != 0.0 && !isinf(self->state.phi)) return fmi2OK;
    return fail(self, "the outputs cannot be computed from the present parameters");
}

static fmi2Status check_derivatives(const Instance *self, Causality causality, const fmi2ValueReference vr[],
                                    const fmi2Integer order[], size_t nvr, int max_order) {
    if (check_array(self, order, nvr) != fmi2OK) return fmi2Error;
    for (size_t i = 0; i < nvr; i++) {
        const char *name = VARIABLES[vr[i]].name, *needed = causality == INPUT ? "input" : "output";
        if (VARIABLES[vr[i]].causality != causality) return fail(self, "%s is not an %s", name, needed);
        if (order[i] < 1 || order[i] > max_order)
            return fail(self, "derivative of order %d of %s (allowed: 1..%d)", order[i], name, max_order);
    }
    return fmi2OK;
}

/* Inquiry, logging, life of an instance */

const char *fmi2GetTypesPlatform(void) {
    return fmi2TypesPlatform;
}

const char *fmi2GetVersion(void) {
    return fmi2Version;
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String categories[]) {
    (void)loggingOn; /* there are no debug messages */
    return check_array(c, categories, nCategories);
}

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation, const fmi2CallbackFunctions *functions,
                              fmi2Boolean visible, fmi2Boolean loggingOn) {
    (void)fmuResourceLocation, (void)visible, (void)loggingOn; /* no resources, no window, no debug messages */
    const size_t size = instanceName == NULL ? 1 : strlen(instanceName) + 1;
    Instance *self = calloc(1, sizeof *self + size);
    if (self == NULL) return NULL;
    if (size > 1) memcpy(self->name, instanceName, size);
    if (functions != NULL) self->callbacks = *functions;
    self->state = initial_state();
    if (size == 1)
        fail(self, "the instance name is missing");
    else if (fmuType != fmi2CoSimulation)
        fail(self, "the FMU is for co-simulation, not for model exchange");
    else if (fmuGUID == NULL || strcmp(fmuGUID, MODEL_GUID) != 0)
        fail(self, "the GUID is %s instead of %s: modelDescription.xml is not that of this binary",
             fmuGUID == NULL ? "missing" : fmuGUID, MODEL_GUID);
    else
        return self;
    free(self);
    return NULL;
}

void fmi2FreeInstance(fmi2Component c) {
    free(c);
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance, fmi2Real startTime,
                               fmi2Boolean stopTimeDefined, fmi2Real stopTime) {
    (void)toleranceDefined, (void)tolerance; /* a fixed-step method has no use for it */
    Instance *self = c;
    if (check_mode(self, INSTANTIATED, "fmi2SetupExperiment") != fmi2OK) return fmi2Error;
    if (!isfinite(startTime) || (stopTimeDefined && isnan(stopTime)))
        return fail(self, "startTime = %s s, stopTime = %s s (allowed: finite start, no stop that is not a number)",
                    repr(startTime).text, repr(stopTime).text);
    self->state.time = startTime;
    /* Importers that add up their steps arrive a little beyond the stop time. */
    self->state.latest_end = stopTimeDefined ? stopTime + 1e-9 * fmax(fabs(startTime), fabs(stopTime)) : INFINITY;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    Instance *self = c;
    if (check_mode(self, INSTANTIATED, "fmi2EnterInitializationMode") != fmi2OK) return fmi2Error;
    self->state.mode = INITIALIZATION;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    Instance *self = c;
    if (check_mode(self, INITIALIZATION, "fmi2ExitInitializationMode") != fmi2OK) return fmi2Error;
    const Text problems = parameter_problems(&self->state);
    if (*problems.text) return fail(self, "cannot initialize: %s", problems.text);
    self->state.mode = STEPPING;
    const Pendulum p = pendulum_of(&self->state);
    const Method method = method_of(&self->state);
    const double limit = stability_limit(method, &p), max_step = max_step_of(&self->state, &p);
    if (max_step <= limit) return fmi2OK;
    Text warning = describe(VR_solver_stepSize, max_step);
    append(&warning, " is unstable: %s", advice(method, limit).text);
    log_text(self, fmi2Warning, "logStatusWarning", warning.text);
    return fmi2Warning;
}

fmi2Status fmi2Terminate(fmi2Component c) {
    Instance *self = c;
    if (check_mode(self, STEPPING, "fmi2Terminate") != fmi2OK) return fmi2Error;
    self->state.mode = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
    Instance *self = c;
    if (self == NULL) return fmi2Error;
    self->state = initial_state();
    self->step_status = fmi2OK;
    return fmi2OK;
}

/* Variables */

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[]) {
    const Instance *self = c;
    if (check_references(self, REAL, vr, nvr, value) != fmi2OK) return fmi2Error;
    for (size_t i = 0; i < nvr; i++)
        if ((vr[i] == VR_a || vr[i] == VR_E) && check_computable(self) != fmi2OK) return fmi2Error;
    const State *state = &self->state;
    const Pendulum p = pendulum_of(state);
    for (size_t i = 0; i < nvr; i++)
        switch (vr[i]) {
        case VR_phi: value[i] = state->phi; break;
        case VR_w: value[i] = state->w; break;
        case VR_a: value[i] = acceleration(&p, 0.0, state->phi, state->w); break;
        case VR_E: value[i] = energy(&p, state->phi, state->w); break;
        default: value[i] = state->values[vr[i]];
        }
    return fmi2OK;
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Integer value[]) {
    const Instance *self = c;
    if (check_references(self, INTEGER, vr, nvr, value) != fmi2OK) return fmi2Error;
    for (size_t i = 0; i < nvr; i++)
        value[i] = vr[i] == VR_solver_nfev ? self->state.nfev : (fmi2Integer)self->state.values[vr[i]];
    return fmi2OK;
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Boolean value[]) {
    return check_references(c, BOOLEAN, vr, nvr, value);
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2String value[]) {
    return check_references(c, STRING, vr, nvr, value);
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[]) {
    Instance *self = c;
    if (check_settable(self, REAL, vr, nvr, value) != fmi2OK) return fmi2Error;
    for (size_t i = 0; i < nvr; i++) self->state.values[vr[i]] = value[i];
    begin(&self->state);
    return fmi2OK;
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer value[]) {
    Instance *self = c;
    if (check_settable(self, INTEGER, vr, nvr, value) != fmi2OK) return fmi2Error;
    for (size_t i = 0; i < nvr; i++) self->state.values[vr[i]] = value[i];
    return fmi2OK;
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Boolean value[]) {
    return check_settable(c, BOOLEAN, vr, nvr, value);
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2String value[]) {
    return check_settable(c, STRING, vr, nvr, value);
}

/* Derivatives; those of tau are at the beginning of the next step, and for that step alone. */

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[]) {
    Instance *self = c;
    if (check_references(self, REAL, vr, nvr, value) != fmi2OK ||
        check_derivatives(self, INPUT, vr, order, nvr, MAX_INPUT_ORDER) != fmi2OK ||
        check_settable(self, REAL, vr, nvr, value) != fmi2OK)
        return fmi2Error;
    for (size_t i = 0; i < nvr; i++)
        if (!isfinite(value[i]))
            return fail(self, "derivative of order %d of tau = %s (allowed: finite)", order[i], repr(value[i]).text);
    for (size_t i = 0; i < nvr; i++) self->state.tau_derivatives[order[i] - 1] = value[i];
    return fmi2OK;
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                        const fmi2Integer order[], fmi2Real value[]) {
    const Instance *self = c;
    if (check_references(self, REAL, vr, nvr, value) != fmi2OK ||
        check_derivatives(self, OUTPUT, vr, order, nvr, MAX_OUTPUT_ORDER) != fmi2OK || check_computable(self) != fmi2OK)
        return fmi2Error;
    const Pendulum p = pendulum_of(&self->state);
    for (size_t i = 0; i < nvr; i++)
        value[i] = time_derivative(&p, self->state.phi, self->state.w, (int)vr[i], order[i]);
    return fmi2OK;
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown_ref[], size_t nUnknown,
                                        const fmi2ValueReference vKnown_ref[], size_t nKnown, const fmi2Real dvKnown[],
                                        fmi2Real dvUnknown[]) {
    const Instance *self = c;
    if (check_mode(self, STEPPING, "fmi2GetDirectionalDerivative") != fmi2OK ||
        check_references(self, REAL, vUnknown_ref, nUnknown, dvUnknown) != fmi2OK ||
        check_references(self, REAL, vKnown_ref, nKnown, dvKnown) != fmi2OK)
        return fmi2Error;
    for (size_t i = 0; i < nUnknown; i++)
        if (VARIABLES[vUnknown_ref[i]].causality != OUTPUT)
            return fail(self, "no partial derivative of %s (allowed: outputs)", VARIABLES[vUnknown_ref[i]].name);
    for (size_t j = 0; j < nKnown; j++)
        if (vKnown_ref[j] != VR_tau && vKnown_ref[j] != VR_phi && vKnown_ref[j] != VR_w)
            return fail(self, "no partial derivative with respect to %s (allowed: phi, w, tau)",
                        VARIABLES[vKnown_ref[j]].name);
    const Pendulum p = pendulum_of(&self->state);
    for (size_t i = 0; i < nUnknown; i++) {
        dvUnknown[i] = 0.0;
        for (size_t j = 0; j < nKnown; j++)
            dvUnknown[i] += dvKnown[j] * partial_derivative(&p, self->state.phi, self->state.w, (int)vUnknown_ref[i],
                                                            (int)vKnown_ref[j]);
    }
    return fmi2OK;
}

/* Steps */

/* Find the substep that left the range of a double by taking them one by one. */
static fmi2Status report_divergence(const Instance *self, const Pendulum *p, double time, double h) {
    const Method method = method_of(&self->state);
    double phi = self->state.phi, w = self->state.w;
    int64_t count = 0;
    for (; isfinite(phi) && isfinite(w); count++) integrate(method, p, &phi, &w, h, count, 1);
    return fail(self, "diverged at t = %s s: substep %lld of %s s with %s left the range of a double; %s",
                repr(time + (double)count * h).text, (long long)count, repr(h).text, METHODS[method].name,
                advice(method, stability_limit(method, p)).text);
}

static fmi2Status do_step(Instance *self, double time, double step) {
    State *state = &self->state;
    const double end = time + step, tau = state->values[VR_tau];
    if (state->mode != STEPPING)
        return fail(self, "no step in mode %s: initialize the instance first", MODE_NAMES[state->mode]);
    if (!(0.0 < step && step < INFINITY))
        return fail(self, "no step from t = %s s: communicationStepSize = %s s (allowed: > 0 and finite)",
                    repr(time).text, repr(step).text);
    if (!(isfinite(end) && end <= state->latest_end))
        return fail(self, "no step from t = %s s over %s s: it must end at a finite time, not beyond the stop time "
                    "(latest end %s s)", repr(time).text, repr(step).text, repr(state->latest_end).text);
    if (!isfinite(tau)) return fail(self, "no step from t = %s s: %s", repr(time).text, describe(VR_tau, tau).text);
    const Pendulum p = pendulum_of(state);
    const double max_step = max_step_of(state, &p), n = substeps(time, step, max_step), h = step / n;
    if (n > MAX_SUBSTEPS)
        return fail(self, "no step from t = %s s: a communication step of %s s would need %.3g substeps of %s s, "
                    "at most %d are allowed", repr(time).text, repr(step).text, n, repr(max_step).text, MAX_SUBSTEPS);
    double phi = state->phi, w = state->w;
    const int64_t nfev = integrate(method_of(state), &p, &phi, &w, h, 0, (int64_t)n);
    if (!(isfinite(phi) && isfinite(w))) return report_divergence(self, &p, time, h);
    state->phi = phi;
    state->w = w;
    state->time = end;
    state->nfev = nfev < INT32_MAX - state->nfev ? state->nfev + (int32_t)nfev : INT32_MAX;
    memset(state->tau_derivatives, 0, sizeof state->tau_derivatives);
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint) {
    (void)noSetFMUStatePriorToCurrentPoint; /* nothing is kept for going back */
    Instance *self = c;
    if (self == NULL) return fmi2Error;
    return self->step_status = do_step(self, currentCommunicationPoint, communicationStepSize);
}

/* Steps are never pending, and the FMU never ends a run by itself. */

fmi2Status fmi2CancelStep(fmi2Component c) {
    return c == NULL ? fmi2Error : fail(c, "there is no step to cancel");
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind s, fmi2Status *value) {
    if (check_array(c, value, 1) != fmi2OK) return fmi2Error;
    if (s == fmi2DoStepStatus) *value = ((const Instance *)c)->step_status;
    return s == fmi2DoStepStatus ? fmi2OK : fmi2Discard;
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *value) {
    if (check_array(c, value, 1) != fmi2OK) return fmi2Error;
    if (s == fmi2LastSuccessfulTime) *value = ((const Instance *)c)->state.time;
    return s == fmi2LastSuccessfulTime ? fmi2OK : fmi2Discard;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind s, fmi2Boolean *value) {
    if (check_array(c, value, 1) != fmi2OK) return fmi2Error;
    if (s == fmi2Terminated) *value = fmi2False;
    return s == fmi2Terminated ? fmi2OK : fmi2Discard;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind s, fmi2Integer *value) {
    (void)s;
    return check_array(c, value, 1) != fmi2OK ? fmi2Error : fmi2Discard;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind s, fmi2String *value) {
    (void)s;
    return check_array(c, value, 1) != fmi2OK ? fmi2Error : fmi2Discard;
}

/* State */

static uint32_t crc32(const unsigned char *bytes, size_t size) {
    uint32_t crc = UINT32_MAX;
    for (size_t i = 0; i < size; i++) {
        crc ^= bytes[i];
        for (int bit = 0; bit < 8; bit++) crc = crc >> 1 ^ (crc & 1 ? UINT32_C(0xEDB88320) : 0);
    }
    return ~crc;
}

static uint32_t checksum_of(const Snapshot *snapshot) {
    return crc32((const unsigned char *)snapshot->format, sizeof *snapshot - sizeof snapshot->checksum);
}

static fmi2Status check_snapshot(const Instance *self, const Snapshot *snapshot) {
    const State *state = &snapshot->state;
    const double method = state->values[VR_solver_method];
    if (snapshot->checksum != checksum_of(snapshot))
        return fail(self, "cannot restore the state: the bytes are damaged (wrong checksum)");
    if (strncmp(snapshot->format, STATE_FORMAT, sizeof snapshot->format) != 0)
        return fail(self, "cannot restore the state: it is not of %s", STATE_FORMAT);
    const bool started = state->mode >= STEPPING, finite = isfinite(state->phi) && isfinite(state->w);
    if (state->mode < INSTANTIATED || state->mode > TERMINATED || state->nfev < 0 || !(fabs(method) <= INT32_MAX) ||
        (started && (!finite || *parameter_problems(state).text)))
        return fail(self, "cannot restore the state: no instance can be in it");
    return fmi2OK;
}

/* Copy `snapshot` to where FMUstate points to, or into new memory if it points to NULL. */
static fmi2Status give(const Instance *self, const Snapshot *snapshot, fmi2FMUstate *FMUstate) {
    if (*FMUstate == NULL) *FMUstate = malloc(sizeof *snapshot);
    if (*FMUstate == NULL) return fail(self, "there is no memory for a state");
    memcpy(*FMUstate, snapshot, sizeof *snapshot);
    return fmi2OK;
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
    if (check_array(c, FMUstate, 1) != fmi2OK) return fmi2Error;
    Snapshot snapshot = {.state = ((const Instance *)c)->state};
    memcpy(snapshot.format, STATE_FORMAT, sizeof STATE_FORMAT);
    snapshot.checksum = checksum_of(&snapshot);
    return give(c, &snapshot, FMUstate);
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate) {
    Instance *self = c;
    if (check_array(self, FMUstate, 1) != fmi2OK || check_snapshot(self, FMUstate) != fmi2OK) return fmi2Error;
    self->state = ((const Snapshot *)FMUstate)->state;
    self->step_status = fmi2OK;
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
    if (c == NULL) return fmi2Error;
    if (FMUstate == NULL) return fmi2OK;
    free(*FMUstate);
    *FMUstate = NULL;
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size) {
    if (check_array(c, FMUstate, 1) != fmi2OK || check_array(c, size, 1) != fmi2OK) return fmi2Error;
    *size = sizeof(Snapshot);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte serializedState[], size_t size) {
    if (check_array(c, FMUstate, 1) != fmi2OK || check_array(c, serializedState, 1) != fmi2OK) return fmi2Error;
    if (size < sizeof(Snapshot))
        return fail(c, "cannot serialize the state into %zu bytes (allowed: at least %zu)", size, sizeof(Snapshot));
    memcpy(serializedState, FMUstate, sizeof(Snapshot));
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte serializedState[], size_t size,
                                   fmi2FMUstate *FMUstate) {
    if (check_array(c, serializedState, 1) != fmi2OK || check_array(c, FMUstate, 1) != fmi2OK) return fmi2Error;
    if (size != sizeof(Snapshot))
        return fail(c, "cannot restore the state: it has %zu bytes instead of %zu", size, sizeof(Snapshot));
    Snapshot snapshot;
    memcpy(&snapshot, serializedState, sizeof snapshot);
    return check_snapshot(c, &snapshot) != fmi2OK ? fmi2Error : give(c, &snapshot, FMUstate);
}
