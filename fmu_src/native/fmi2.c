/* The FMI 2.0 functions: values in and out, checks, errors, state. No physics, and no global that can change.
 *
 * slave.py is the specification, texts included. A user's mistake is fmi2Error with the reason in the log, and leaves
 * the instance as it was before the call. Errors and warnings are always logged; there are no other messages. */

#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include "fmi2Functions.h"
#include "pendulum.h"

typedef const fmi2ValueReference *References;
enum { NO_KIND = -1, MOST = 65536 }; /* of status; values in a call, far more than there are variables */
typedef enum { READ, SET, GET_DERIVATIVE, SET_DERIVATIVE } Use; /* of variables */
typedef enum { INSTANTIATED, INITIALIZATION, STEPPING, TERMINATED } Mode;
static const char *const MODE_NAMES[] = {"instantiated", "initialization", "stepping", "terminated"};
static const char *const TYPE_NAMES[] = {"Real", "Integer", "Boolean", "String"};

/* All that the future of an instance depends on; fmi2FMUstate points to one, and its bytes are the serialized state. */
typedef struct {
    uint32_t checksum;                       /* of all that follows, in what fmi2FMUstate points to */
    char format[60];                         /* model and version */
    double values[VARIABLE_COUNT];           /* by value reference; those of a and E are computed when asked for */
    double tau_derivatives[MAX_INPUT_ORDER]; /* of order 1, 2, ... [N.m/s, N.m/s2, ...], for the next step */
    double time, latest_end;                 /* end of the last step, latest one of the next [s] */
    int64_t mode;
} State;

_Static_assert(sizeof STATE_FORMAT <= 60 && sizeof(State) == 64 + 8 * (VARIABLE_COUNT + MAX_INPUT_ORDER + 3),
               "the name of the format fits, and there is no padding");

typedef struct {
    fmi2CallbackFunctions callbacks;
    State state;
    char name[];
} Instance;

/* Messages */

typedef struct { char text[4096]; } Text;

static void append(Text *text, const char *format, ...) {
    const size_t length = strlen(text->text);
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text->text + length, sizeof text->text - length, format, arguments);
    va_end(arguments);
}

/* The shortest decimal that reads back as `value`, written like Python's. */
static Text repr(double value) {
    Text shown = {"nan"};
    if (!isfinite(value)) return isnan(value) ? shown : value > 0.0 ? (Text){"inf"} : (Text){"-inf"};
    int digits = -1; /* after the first */
    do snprintf(shown.text, sizeof shown.text, "%.*e", ++digits, value);
    while (strtod(shown.text, NULL) != value);
    const int exponent = atoi(strchr(shown.text, 'e') + 1);
    if (-5 < exponent && exponent < 16)
        snprintf(shown.text, sizeof shown.text, "%.*f", digits > exponent ? digits - exponent : 1, value);
    return shown;
}

/* The variable with a value and what is allowed. */
static Text describe(int vr, double value) {
    const Variable *variable = &VARIABLES[vr];
    Text text = {""};
    append(&text, variable->type == INTEGER ? "%s = %.0f" : "%s = ", variable->name, value);
    if (variable->type == REAL) append(&text, "%s %s", repr(value).text, variable->unit);
    append(&text, " (allowed: %s)", variable->allowed);
    return text;
}

/* Log a message, without `%` because importers use it as a format, and return `status`. */
static fmi2Status tell(const Instance *self, fmi2Status status, const char *format, ...) {
    const char *category = status == fmi2Error ? "logStatusError" : "logStatusWarning";
    Text text = {""}, shown = {""};
    if (status == fmi2Error) append(&text, "%.400s: ", self->name);
    const size_t length = strlen(text.text);
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text.text + length, sizeof text.text - length, format, arguments);
    va_end(arguments);
    for (const char *from = text.text; *from; from++) append(&shown, *from == '%' ? "percent" : "%c", *from);
    if (self->callbacks.logger == NULL) return status;
    self->callbacks.logger(self->callbacks.componentEnvironment, self->name, status, category, shown.text);
    return status;
}

/* Set a variable; with a start value the output, too, so that it is right before the first step. */
static void store(double values[VARIABLE_COUNT], fmi2ValueReference vr, double value) {
    values[vr] = value;
    if (vr == VR_phi_start) values[VR_phi] = value;
    if (vr == VR_w_start) values[VR_w] = value;
}

/* What is wrong with the parameters, each after "; "; if nothing is, with what they are multiplied and divided to. */
static Text problems_of(const State *state) {
    const Pendulum p = pendulum(state->values, state->tau_derivatives);
    const struct { const char *name; double value; const char *unit; } made[] = {
        {"J = m*L^2", p.J, "kg.m2"}, {"gamma/m", p.damping_rate, "1/s"}, {"g/L", p.w02, "1/s2"}};
    Text problems = {""};
    for (int vr = 0; vr < VARIABLE_COUNT; vr++) {
        const double value = state->values[vr];
        if (VARIABLES[vr].causality == PARAMETER && !(VARIABLES[vr].lowest <= value && value <= VARIABLES[vr].highest))
            append(&problems, "; %s", describe(vr, value).text);
    }
    const bool has_inertia = isfinite(p.J) && p.J > 0.0;
    for (int i = 0, count = *problems.text ? 0 : has_inertia ? 3 : 1; i < count; i++)
        if (!has_inertia || !isfinite(made[i].value))
            append(&problems, "; %s = %s %s is out of the range of a double", made[i].name, repr(made[i].value).text,
                   made[i].unit);
    return problems;
}

/* What to do about substeps of h [s] that went wrong or will. */
static Text advice(const Pendulum *p, double h) {
    const char *name = METHODS[p->method].name, *implicit = METHODS[ImplicitEuler].name;
    const double limit = stability_limit(p), stable = 0.9999 * limit; /* stays below it when rounded to five digits */
    Text text = {""};
    if (limit == 0.0)
        append(&text, "%s has no stable step size for this pendulum (stability limit 0 s): use %s or %s", name,
               METHODS[ExplicitRungeKutta4].name, implicit);
    else if (h <= limit)
        append(&text, "%s s is within the stability limit of %s for this pendulum (%.6g s): "
               "check the torque and the start values", repr(h).text, name, limit);
    else
        append(&text, "the stability limit of %s for this pendulum is %.6g s: use solver.stepSize = %.5g s or less, "
               "or %s", name, limit, stable, implicit);
    return text;
}

/* Checks: fmi2OK, which is 0, or fmi2Error and a message */

static fmi2Status check_mode(const Instance *self, Mode mode, const char *call) {
    if (self == NULL || self->state.mode == (int64_t)mode) return self == NULL ? fmi2Error : fmi2OK;
    return tell(self, fmi2Error, "%s is allowed in mode %s only, the instance is in mode %s", call, MODE_NAMES[mode],
                MODE_NAMES[self->state.mode]);
}
static fmi2Status check_arrays(const Instance *self, size_t count, const void *one, const void *other) {
    if (self == NULL) return fmi2Error;
    if (count > MOST) return tell(self, fmi2Error, "%zu values in one call (allowed: at most %d)", count, MOST);
    return count == 0 || (one != NULL && other != NULL) ? fmi2OK : tell(self, fmi2Error, "an argument is NULL");
}

/* Check a call for `n` variables, or for their derivatives of the `orders`. */
static fmi2Status check(const Instance *self, Use use, Type type, References vr, size_t n, const void *values,
                        const fmi2Integer orders[]) {
    const bool derivative = use == GET_DERIVATIVE || use == SET_DERIVATIVE, set = use == SET || use == SET_DERIVATIVE;
    const int max_order = set ? MAX_INPUT_ORDER : MAX_OUTPUT_ORDER;
    const fmi2Real *reals = values;
    if (check_arrays(self, n, vr, values) || (derivative && check_arrays(self, n, orders, orders))) return fmi2Error;
    for (size_t i = 0; i < n; i++) {
        if (vr[i] >= VARIABLE_COUNT)
            return tell(self, fmi2Error, "value reference %u is unknown (allowed: 0..%d)", vr[i], VARIABLE_COUNT - 1);
        const char *name = VARIABLES[vr[i]].name;
        const Causality causality = VARIABLES[vr[i]].causality;
        if (VARIABLES[vr[i]].type != type)
            return tell(self, fmi2Error, "%s (value reference %u) is not of type %s", name, vr[i], TYPE_NAMES[type]);
        if (derivative && causality != (set ? INPUT : OUTPUT))
            return tell(self, fmi2Error, "%s is not an %s", name, set ? "input" : "output");
        if (derivative && (orders[i] < 1 || orders[i] > max_order))
            return tell(self, fmi2Error, "derivative of order %d of %s (allowed: 1..%d)", orders[i], name, max_order);
        if (use == SET_DERIVATIVE && !isfinite(reals[i]))
            return tell(self, fmi2Error, "derivative of order %d of %s = %s (allowed: finite)", orders[i], name,
                        repr(reals[i]).text);
        if (!set) continue;
        if (causality == OUTPUT) return tell(self, fmi2Error, "%s is an output: it cannot be set", name);
        if (self->state.mode == TERMINATED) return tell(self, fmi2Error, "%s cannot be set: the run has ended", name);
        if (self->state.mode == STEPPING && causality == PARAMETER)
            return tell(self, fmi2Error, "%s is a fixed parameter: it can be set until initialization ends, not "
                        "after", name);
    }
    return fmi2OK;
}

/* Inquiry, logging, life of an instance */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t n, const fmi2String categories[]) {
    (void)loggingOn; /* there are no debug messages */
    return check_arrays(c, n, categories, categories);
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean loggingOn) {
    (void)resources, (void)visible, (void)loggingOn; /* no resources, no window, no debug messages */
    const size_t size = name == NULL ? 1 : strlen(name) + 1;
    Instance *self = calloc(1, sizeof *self + size);
    if (self == NULL) return NULL;
    if (size > 1) memcpy(self->name, name, size);
    if (functions != NULL) self->callbacks = *functions;
    fmi2Status status = fmi2Reset(self);
    const char *given = guid == NULL ? "missing" : guid;
    if (size == 1) status = tell(self, fmi2Error, "the instance name is missing");
    else if (type != fmi2CoSimulation) status = tell(self, fmi2Error, "the FMU is for co-simulation alone");
    else if (strcmp(given, MODEL_GUID) != 0)
        status = tell(self, fmi2Error, "the GUID is %.400s instead of %s: modelDescription.xml is of another binary",
                      given, MODEL_GUID);
    if (status == fmi2OK) return self;
    free(self);
    return NULL;
}
void fmi2FreeInstance(fmi2Component c) { free(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean stopDefined, fmi2Real stop) {
    (void)toleranceDefined, (void)tolerance; /* a fixed-step method has no use for it */
    if (check_mode(c, INSTANTIATED, "fmi2SetupExperiment")) return fmi2Error;
    if (!isfinite(start) || (stopDefined && !(start <= stop)))
        return tell(c, fmi2Error, "startTime = %s s must be finite and not beyond stopTime = %s s", repr(start).text,
                    stopDefined ? repr(stop).text : "None");
    State *state = &((Instance *)c)->state;
    state->time = start;
    /* Importers that add up their steps arrive a little beyond it; FMPy allows itself a relative 1e-9. */
    if (stopDefined) state->latest_end = stop + 2e-9 * fmax(fabs(start), fabs(stop));
    return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    if (check_mode(c, INSTANTIATED, "fmi2EnterInitializationMode")) return fmi2Error;
    ((Instance *)c)->state.mode = INITIALIZATION;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    if (check_mode(c, INITIALIZATION, "fmi2ExitInitializationMode")) return fmi2Error;
    State *state = &((Instance *)c)->state;
    const Text problems = problems_of(state);
    if (*problems.text) return tell(c, fmi2Error, "cannot initialize: %s", problems.text + strlen("; "));
    state->mode = STEPPING;
    const Pendulum p = pendulum(state->values, state->tau_derivatives);
    const double h = longest_substep(&p, state->values[VR_solver_stepSize]);
    if (h <= stability_limit(&p)) return fmi2OK;
    return tell(c, fmi2Warning, "solver.stepSize = %s s is unstable: %s", repr(h).text, advice(&p, h).text);
}

fmi2Status fmi2Terminate(fmi2Component c) {
    if (c == NULL) return fmi2Error;
    ((Instance *)c)->state.mode = TERMINATED;
    return fmi2OK;
}
fmi2Status fmi2Reset(fmi2Component c) {
    Instance *self = c;
    if (self == NULL) return fmi2Error;
    self->state = (State){.latest_end = INFINITY, .mode = INSTANTIATED};
    memcpy(self->state.format, STATE_FORMAT, sizeof STATE_FORMAT);
    for (unsigned vr = 0; vr < VARIABLE_COUNT; vr++)
        if (VARIABLES[vr].causality != OUTPUT) store(self->state.values, vr, VARIABLES[vr].start);
    return fmi2OK;
}

/* Variables */

static fmi2Status get(const Instance *self, Type type, References vr, size_t n, void *values) {
    if (check(self, READ, type, vr, n, values, NULL)) return fmi2Error;
    const double *known = self->state.values, phi = known[VR_phi], w = known[VR_w];
    const Pendulum p = pendulum(known, self->state.tau_derivatives);
    for (size_t i = 0; i < n; i++) {
        const bool is_a = vr[i] == VR_a, is_E = vr[i] == VR_E;
        const double value = is_a ? acceleration(&p, 0.0, phi, w) : is_E ? energy(&p, phi, w) : known[vr[i]];
        if ((is_a || is_E) && !isfinite(value))
            return tell(self, fmi2Error, "%s is out of the range of a double at phi = %s rad, w = %s rad/s, tau = %s "
                        "N.m", VARIABLES[vr[i]].name, repr(phi).text, repr(w).text, repr(known[VR_tau]).text);
        if (type == REAL) ((fmi2Real *)values)[i] = value;
        else ((fmi2Integer *)values)[i] = (fmi2Integer)value;
    }
    return fmi2OK;
}

static fmi2Status set(Instance *self, Type type, References vr, size_t n, const void *v) {
    if (check(self, SET, type, vr, n, v, NULL)) return fmi2Error;
    for (size_t i = 0; i < n; i++)
        store(self->state.values, vr[i], type == REAL ? ((const fmi2Real *)v)[i] : ((const fmi2Integer *)v)[i]);
    return fmi2OK;
}

fmi2Status fmi2GetReal(void *c, References vr, size_t n, fmi2Real v[]) { return get(c, REAL, vr, n, v); }
fmi2Status fmi2GetInteger(void *c, References vr, size_t n, fmi2Integer v[]) { return get(c, INTEGER, vr, n, v); }
fmi2Status fmi2GetBoolean(void *c, References vr, size_t n, fmi2Boolean v[]) { return get(c, BOOLEAN, vr, n, v); }
fmi2Status fmi2GetString(void *c, References vr, size_t n, fmi2String v[]) { return get(c, STRING, vr, n, v); }
fmi2Status fmi2SetReal(void *c, References vr, size_t n, const fmi2Real v[]) { return set(c, REAL, vr, n, v); }
fmi2Status fmi2SetInteger(void *c, References vr, size_t n, const fmi2Integer v[]) { return set(c, INTEGER, vr, n, v); }
fmi2Status fmi2SetBoolean(void *c, References vr, size_t n, const fmi2Boolean v[]) { return set(c, BOOLEAN, vr, n, v); }
fmi2Status fmi2SetString(void *c, References vr, size_t n, const fmi2String v[]) { return set(c, STRING, vr, n, v); }

/* Derivatives; those of tau are at the beginning of the next step, and for that step alone. */

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, References vr, size_t n, const fmi2Integer order[],
                                       const fmi2Real v[]) {
    if (check(c, SET_DERIVATIVE, REAL, vr, n, v, order)) return fmi2Error;
    for (size_t i = 0; i < n; i++) ((Instance *)c)->state.tau_derivatives[order[i] - 1] = v[i];
    return fmi2OK;
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, References vr, size_t n, const fmi2Integer order[],
                                        fmi2Real value[]) {
    if (check(c, GET_DERIVATIVE, REAL, vr, n, value, order)) return fmi2Error;
    const State *state = &((const Instance *)c)->state;
    const Pendulum p = pendulum(state->values, state->tau_derivatives);
    for (size_t i = 0; i < n; i++) {
        value[i] = time_derivative(&p, state->values[VR_phi], state->values[VR_w], (int)vr[i], order[i]);
        if (!isfinite(value[i]))
            return tell(c, fmi2Error, "derivative of order %d of %s is out of the range of a double", order[i],
                        VARIABLES[vr[i]].name);
    }
    return fmi2OK;
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, References unknown, size_t unknowns, References known,
                                        size_t knowns, const fmi2Real dvKnown[], fmi2Real dvUnknown[]) {
    if (check_mode(c, STEPPING, "fmi2GetDirectionalDerivative") || check(c, READ, REAL, known, knowns, dvKnown, NULL) ||
        check(c, READ, REAL, unknown, unknowns, dvUnknown, NULL))
        return fmi2Error;
    const State *state = &((const Instance *)c)->state;
    const double phi = state->values[VR_phi], w = state->values[VR_w];
    const Pendulum p = pendulum(state->values, state->tau_derivatives);
    for (size_t i = 0; i < unknowns; i++) dvUnknown[i] = 0.0;
    for (size_t k = 0; k < unknowns * knowns; k++) {
        const int of = (int)unknown[k / knowns], by = (int)known[k % knowns];
        if (VARIABLES[of].causality != OUTPUT || (by != VR_phi && by != VR_w && by != VR_tau))
            return tell(c, fmi2Error, "no derivative of %s with respect to %s (allowed: outputs, phi, w, tau)",
                        VARIABLES[of].name, VARIABLES[by].name);
        dvUnknown[k / knowns] += dvKnown[k % knowns] * partial_derivative(&p, phi, w, of, by);
    }
    return fmi2OK;
}

/* Steps */

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean noSetFMUStatePriorToCurrentPoint) {
    (void)noSetFMUStatePriorToCurrentPoint; /* nothing is kept for going back */
    if (c == NULL) return fmi2Error;
    State *state = &((Instance *)c)->state;
    double *values = state->values, phi = values[VR_phi], w = values[VR_w];
    const double end = time + step, tau = values[VR_tau];
    if (state->mode != STEPPING)
        return tell(c, fmi2Error, "no step in mode %s: initialize the instance first", MODE_NAMES[state->mode]);
    if (!(0.0 < step && step < INFINITY))
        return tell(c, fmi2Error, "no step from t = %s s: communicationStepSize = %s s (allowed: > 0 and finite)",
                    repr(time).text, repr(step).text);
    if (!(isfinite(end) && end <= state->latest_end))
        return tell(c, fmi2Error, "no step from t = %s s over %s s: it must end at a finite time, not beyond the "
                    "stop time (latest end %s s)", repr(time).text, repr(step).text, repr(state->latest_end).text);
    if (!isfinite(tau))
        return tell(c, fmi2Error, "no step from t = %s s: %s", repr(time).text, describe(VR_tau, tau).text);
    const Pendulum p = pendulum(state->values, state->tau_derivatives);
    const double most = longest_substep(&p, values[VR_solver_stepSize]), n = substeps(time, step, most), h = step / n;
    if (n > MAX_SUBSTEPS)
        return tell(c, fmi2Error, "no step from t = %s s: a communication step of %s s would need %.3g substeps of "
                    "%s s, at most %d are allowed", repr(time).text, repr(step).text, n, repr(most).text, MAX_SUBSTEPS);
    const int64_t nfev = integrate(&p, &phi, &w, h, 0, (int64_t)n);
    if (!(isfinite(phi) && isfinite(w))) { /* where? take the substeps one by one */
        int64_t k = 0;
        for (phi = values[VR_phi], w = values[VR_w]; isfinite(phi) && isfinite(w); k++)
            integrate(&p, &phi, &w, h, k, 1);
        return tell(c, fmi2Error, "diverged at t = %s s: substep %lld of %s s with %s left the range of a double; "
                    "%s", repr(time + (double)k * h).text, (long long)k, repr(h).text, METHODS[p.method].name,
                    advice(&p, h).text);
    }
    values[VR_phi] = phi;
    values[VR_w] = w;
    values[VR_solver_nfev] = fmin(values[VR_solver_nfev] + (double)nfev, INT32_MAX);
    state->time = end;
    memset(state->tau_derivatives, 0, sizeof state->tau_derivatives);
    return fmi2OK;
}

/* Steps are never pending, and the FMU never ends a run by itself. */
static fmi2Status check_status(const Instance *self, const void *value, int kind, int known) {
    return check_arrays(self, 1, value, value) ? fmi2Error : kind == known ? fmi2OK : fmi2Discard;
}
fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
    const fmi2Status status = check_status(c, value, kind, fmi2LastSuccessfulTime);
    if (status == fmi2OK) *value = ((const Instance *)c)->state.time;
    return status;
}
fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
    const fmi2Status status = check_status(c, value, kind, fmi2Terminated);
    if (status == fmi2OK) *value = fmi2False;
    return status;
}
fmi2Status fmi2GetStatus(void *c, fmi2StatusKind k, fmi2Status *v) { return check_status(c, v, k, NO_KIND); }
fmi2Status fmi2GetIntegerStatus(void *c, fmi2StatusKind k, fmi2Integer *v) { return check_status(c, v, k, NO_KIND); }
fmi2Status fmi2GetStringStatus(void *c, fmi2StatusKind k, fmi2String *v) { return check_status(c, v, k, NO_KIND); }
fmi2Status fmi2CancelStep(void *c) { return c == NULL ? fmi2Error : tell(c, fmi2Error, "there is no step to cancel"); }

/* State */

/* CRC-32 of all of a state but the checksum. */
static uint32_t checksum_of(const State *state) {
    const unsigned char *bytes = (const unsigned char *)state;
    uint32_t crc = UINT32_MAX;
    for (size_t i = sizeof state->checksum; i < sizeof *state; i++) {
        crc ^= bytes[i];
        for (int bit = 0; bit < 8; bit++) crc = crc >> 1 ^ (crc & 1 ? UINT32_C(0xEDB88320) : 0);
    }
    return ~crc;
}

static fmi2Status check_state(const Instance *self, const State *state) {
    const double *values = state->values, method = values[VR_solver_method], nfev = values[VR_solver_nfev];
    if (state->checksum != checksum_of(state))
        return tell(self, fmi2Error, "cannot restore the state: the bytes are damaged (wrong checksum)");
    if (strncmp(state->format, STATE_FORMAT, sizeof state->format) != 0)
        return tell(self, fmi2Error, "cannot restore the state: it is of '%.60s', this is '%s'", state->format,
                    STATE_FORMAT);
    if (INSTANTIATED <= state->mode && state->mode <= TERMINATED && INT32_MIN <= method && method <= INT32_MAX &&
        0.0 <= nfev && nfev <= INT32_MAX &&
        (state->mode != STEPPING ||
         (isfinite(values[VR_phi]) && isfinite(values[VR_w]) && !*problems_of(state).text)))
        return fmi2OK;
    return tell(self, fmi2Error, "cannot restore the state: no instance can be in it");
}

/* Copy `state` to where FMUstate points to, or into new memory if it points to NULL. */
static fmi2Status give(const Instance *self, const State *state, fmi2FMUstate *FMUstate) {
    if (*FMUstate == NULL) *FMUstate = malloc(sizeof *state);
    if (*FMUstate == NULL) return tell(self, fmi2Error, "there is no memory for a state");
    memcpy(*FMUstate, state, sizeof *state);
    return fmi2OK;
}
fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
    if (check_arrays(c, 1, FMUstate, FMUstate)) return fmi2Error;
    State state = ((const Instance *)c)->state;
    state.checksum = checksum_of(&state);
    return give(c, &state, FMUstate);
}
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate) {
    if (check_arrays(c, 1, FMUstate, FMUstate) || check_state(c, FMUstate)) return fmi2Error;
    ((Instance *)c)->state = *(const State *)FMUstate;
    return fmi2OK;
}
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
    if (c == NULL || FMUstate == NULL) return c == NULL ? fmi2Error : fmi2OK;
    free(*FMUstate);
    *FMUstate = NULL;
    return fmi2OK;
}
fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size) {
    if (check_arrays(c, 1, FMUstate, size)) return fmi2Error;
    *size = sizeof(State);
    return fmi2OK;
}
fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte bytes[], size_t size) {
    if (check_arrays(c, 1, FMUstate, bytes)) return fmi2Error;
    if (size < sizeof(State)) return tell(c, fmi2Error, "a state needs %zu bytes, there are %zu", sizeof(State), size);
    memcpy(bytes, FMUstate, sizeof(State));
    return fmi2OK;
}
fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *FMUstate) {
    if (check_arrays(c, 1, bytes, FMUstate)) return fmi2Error;
    State state;
    if (size != sizeof state)
        return tell(c, fmi2Error, "cannot restore the state: the bytes are damaged (%zu, not %zu)", size, sizeof state);
    memcpy(&state, bytes, sizeof state);
    return check_state(c, &state) ? fmi2Error : give(c, &state, FMUstate);
}
