/* The FMI 2.0 functions: values in and out, checks, errors, state. No physics, and no global that can change.
 *
 * slave.py is the specification, texts included. A user's mistake is fmi2Error with the reason in the log, and leaves
 * the instance as it was before the call. Errors and warnings are always logged; there are no other messages. */

#include "fmi2Functions.h"

#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "pendulum.h"

typedef enum { INSTANTIATED, INITIALIZATION, STEPPING, TERMINATED } Mode;
typedef const fmi2ValueReference *References;

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
    int digits = -1; /* after the first */
    while (!isnan(value) && ++digits < 17) {
        snprintf(shown.text, sizeof shown.text, "%.*e", digits, value);
        if (strtod(shown.text, NULL) == value) break;
    }
    const char *mark = strchr(shown.text, 'e'); /* none in inf and nan */
    const int exponent = mark == NULL ? INT32_MAX : atoi(mark + 1);
    if (-5 < exponent && exponent < 16)
        snprintf(shown.text, sizeof shown.text, "%.*f", digits > exponent ? digits - exponent : 1, value);
    return shown;
}

/* The variable with a value and what is allowed. */
static Text describe(const Variable *variable, double value) {
    Text text = {""};
    append(&text, variable->type == INTEGER ? "%s = %.0f" : "%s = ", variable->name, value);
    if (variable->type == REAL) append(&text, "%s %s", repr(value).text, variable->unit);
    append(&text, " (allowed: %s)", variable->allowed);
    return text;
}

/* Log a message, without `%` because importers use it as a format, and return `status`. */
static fmi2Status tell(const Instance *self, fmi2Status status, const char *format, ...) {
    const fmi2CallbackFunctions *with = &self->callbacks;
    const bool error = status == fmi2Error;
    Text text = {""}, shown = {""};
    if (error && *self->name) append(&text, "%.400s: ", self->name);
    const size_t length = strlen(text.text);
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text.text + length, sizeof text.text - length, format, arguments);
    va_end(arguments);
    for (const char *from = text.text; *from; from++) append(&shown, *from == '%' ? "percent" : "%c", *from);
    if (with->logger != NULL)
        with->logger(with->componentEnvironment, self->name, status, error ? "logStatusError" : "logStatusWarning",
                     shown.text);
    return status;
}

/* What the state means */

static Method method_of(const State *state) {
    return (Method)state->values[VR_solver_method];
}

static Pendulum pendulum_of(const State *state) {
    const double *values = state->values;
    return pendulum(values[VR_m], values[VR_L], values[VR_gamma], values[VR_g], values[VR_tau], state->tau_derivatives);
}

static double value_of(const State *state, fmi2ValueReference vr) {
    const Pendulum p = pendulum_of(state);
    switch (vr) {
    case VR_phi: return state->phi;
    case VR_w: return state->w;
    case VR_a: return acceleration(&p, 0.0, state->phi, state->w);
    case VR_E: return energy(&p, state->phi, state->w);
    case VR_solver_nfev: return state->nfev;
    default: return state->values[vr];
    }
}

/* Set a parameter or the input; with the start values the state, so that outputs are right before the first step. */
static void store(State *state, fmi2ValueReference vr, double value) {
    state->values[vr] = value;
    if (vr == VR_phi_start) state->phi = value;
    if (vr == VR_w_start) state->w = value;
}

/* What is wrong with the parameters, each after "; "; if nothing is, with what they are multiplied and divided to. */
static Text problems_of(const State *state) {
    const Pendulum p = pendulum_of(state);
    const struct { const char *name; double value; const char *unit; } made[] = {
        {"J = m*L^2", p.J, "kg.m2"}, {"gamma/m", p.damping_rate, "1/s"}, {"g/L", p.w02, "1/s2"}};
    Text problems = {""};
    for (const Variable *variable = VARIABLES; variable < VARIABLES + VARIABLE_COUNT; variable++) {
        const double value = state->values[variable - VARIABLES];
        if (variable->causality == PARAMETER && !(variable->lowest <= value && value <= variable->highest))
            append(&problems, "; %s", describe(variable, value).text);
    }
    const bool has_inertia = isfinite(p.J) && p.J > 0.0;
    for (int i = 0, count = *problems.text ? 0 : has_inertia ? 3 : 1; i < count; i++)
        if (!has_inertia || !isfinite(made[i].value))
            append(&problems, "; %s = %s %s is out of the range of a double", made[i].name, repr(made[i].value).text,
                   made[i].unit);
    return problems;
}

/* What to do about substeps of h [s] that went wrong or will. */
static Text advice(Method method, const Pendulum *p, double h) {
    const double limit = stability_limit(method, p), stable = 0.9999 * limit; /* below it when rounded to five digits */
    const char *name = METHODS[method].name;
    Text text = {""};
    if (limit == 0.0)
        append(&text, "%s has no stable step size for this pendulum (stability limit 0 s): use %s or %s", name,
               METHODS[ExplicitRungeKutta4].name, METHODS[ImplicitEuler].name);
    else if (h <= limit)
        append(&text, "%s s is within the stability limit of %s for this pendulum (%.6g s): "
               "check the torque and the start values", repr(h).text, name, limit);
    else
        append(&text, "the stability limit of %s for this pendulum is %.6g s: use solver.stepSize = %.5g s or less, "
               "or %s", name, limit, stable, METHODS[ImplicitEuler].name);
    return text;
}

/* Checks: fmi2OK, which is 0, or fmi2Error and a message */

static fmi2Status check_mode(const Instance *self, Mode mode, const char *call) {
    if (self == NULL || self->state.mode == (int32_t)mode) return self == NULL ? fmi2Error : fmi2OK;
    return tell(self, fmi2Error, "%s is allowed in mode %s only, the instance is in mode %s", call, MODE_NAMES[mode],
                MODE_NAMES[self->state.mode]);
}

static fmi2Status check_arrays(const Instance *self, size_t count, const void *one, const void *other) {
    enum { MOST = 65536 }; /* far more than there are variables */
    if (self == NULL) return fmi2Error;
    if (count > MOST) return tell(self, fmi2Error, "%zu values in one call (allowed: at most %d)", count, MOST);
    return count == 0 || (one != NULL && other != NULL) ? fmi2OK : tell(self, fmi2Error, "an argument is NULL");
}

static fmi2Status check_type(const Instance *self, Type type, fmi2ValueReference vr) {
    if (vr >= VARIABLE_COUNT)
        return tell(self, fmi2Error, "value reference %u is unknown (allowed: 0..%d)", vr, VARIABLE_COUNT - 1);
    return VARIABLES[vr].type == type ? fmi2OK : tell(self, fmi2Error, "%s (value reference %u) is not of type %s",
                                                      VARIABLES[vr].name, vr, TYPE_NAMES[type]);
}

static fmi2Status check_settable(const Instance *self, Type type, fmi2ValueReference vr) {
    if (check_type(self, type, vr)) return fmi2Error;
    const Causality causality = VARIABLES[vr].causality;
    const char *name = VARIABLES[vr].name;
    if (causality == OUTPUT) return tell(self, fmi2Error, "%s is an output: it cannot be set", name);
    if (self->state.mode == TERMINATED) return tell(self, fmi2Error, "%s cannot be set: the run has ended", name);
    if (self->state.mode != STEPPING || causality == INPUT) return fmi2OK;
    return tell(self, fmi2Error, "%s is a fixed parameter: it can be set until initialization ends, not after", name);
}

static fmi2Status check_derivative(const Instance *self, Causality causality, fmi2ValueReference vr, int order,
                                   int max_order) {
    if (check_type(self, REAL, vr)) return fmi2Error;
    const char *name = VARIABLES[vr].name, *needed = causality == INPUT ? "input" : "output";
    if (VARIABLES[vr].causality != causality) return tell(self, fmi2Error, "%s is not an %s", name, needed);
    if (1 <= order && order <= max_order) return fmi2OK;
    return tell(self, fmi2Error, "derivative of order %d of %s (allowed: 1..%d)", order, name, max_order);
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
    if (size == 1)
        status = tell(self, fmi2Error, "the instance name is missing");
    else if (type != fmi2CoSimulation)
        status = tell(self, fmi2Error, "the FMU is for co-simulation, not for model exchange");
    else if (guid == NULL || strcmp(guid, MODEL_GUID) != 0)
        status = tell(self, fmi2Error, "the GUID is %.400s instead of %s: modelDescription.xml is not that of this binary",
                      guid == NULL ? "missing" : guid, MODEL_GUID);
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
    const Pendulum p = pendulum_of(state);
    const Method method = method_of(state);
    const double h = longest_substep(method, &p, state->values[VR_solver_stepSize]);
    if (h <= stability_limit(method, &p)) return fmi2OK;
    return tell(c, fmi2Warning, "solver.stepSize = %s s is unstable: %s", repr(h).text, advice(method, &p, h).text);
}

fmi2Status fmi2Terminate(fmi2Component c) {
    if (c == NULL) return fmi2Error;
    ((Instance *)c)->state.mode = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
    Instance *self = c;
    if (self == NULL) return fmi2Error;
    self->step_status = fmi2OK;
    self->state = (State){.latest_end = INFINITY, .mode = INSTANTIATED};
    for (unsigned vr = 0; vr < VARIABLE_COUNT; vr++) store(&self->state, vr, VARIABLES[vr].start);
    return fmi2OK;
}

/* Variables */

static fmi2Status get(const Instance *self, Type type, References vr, size_t n, void *values) {
    if (check_arrays(self, n, vr, values)) return fmi2Error;
    for (size_t i = 0; i < n; i++) {
        if (check_type(self, type, vr[i])) return fmi2Error;
        const State *state = &self->state;
        const double value = value_of(state, vr[i]);
        if ((vr[i] == VR_a || vr[i] == VR_E) && !isfinite(value))
            return tell(self, fmi2Error, "%s is out of the range of a double at phi = %s rad, w = %s rad/s, "
                        "tau = %s N.m", VARIABLES[vr[i]].name, repr(state->phi).text, repr(state->w).text,
                        repr(state->values[VR_tau]).text);
        if (type == REAL) ((fmi2Real *)values)[i] = value;
        else ((fmi2Integer *)values)[i] = (fmi2Integer)value;
    }
    return fmi2OK;
}

static fmi2Status set(Instance *self, Type type, References vr, size_t n, const void *values) {
    if (check_arrays(self, n, vr, values)) return fmi2Error;
    for (size_t i = 0; i < n; i++)
        if (check_settable(self, type, vr[i])) return fmi2Error;
    for (size_t i = 0; i < n; i++)
        store(&self->state, vr[i], type == REAL ? ((const fmi2Real *)values)[i] : ((const fmi2Integer *)values)[i]);
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
                                       const fmi2Real value[]) {
    if (check_arrays(c, n, vr, value) || check_arrays(c, n, order, order)) return fmi2Error;
    for (size_t i = 0; i < n; i++) {
        if (check_derivative(c, INPUT, vr[i], order[i], MAX_INPUT_ORDER) || check_settable(c, REAL, vr[i]))
            return fmi2Error;
        if (!isfinite(value[i]))
            return tell(c, fmi2Error, "derivative of order %d of tau = %s (allowed: finite)", order[i],
                        repr(value[i]).text);
    }
    for (size_t i = 0; i < n; i++) ((Instance *)c)->state.tau_derivatives[order[i] - 1] = value[i];
    return fmi2OK;
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, References vr, size_t n, const fmi2Integer order[],
                                        fmi2Real value[]) {
    if (check_arrays(c, n, vr, value) || check_arrays(c, n, order, order)) return fmi2Error;
    const State *state = &((const Instance *)c)->state;
    const Pendulum p = pendulum_of(state);
    for (size_t i = 0; i < n; i++) {
        if (check_derivative(c, OUTPUT, vr[i], order[i], MAX_OUTPUT_ORDER)) return fmi2Error;
        value[i] = time_derivative(&p, state->phi, state->w, (int)vr[i], order[i]);
        if (!isfinite(value[i]))
            return tell(c, fmi2Error, "derivative of order %d of %s is out of the range of a double", order[i],
                        VARIABLES[vr[i]].name);
    }
    return fmi2OK;
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, References unknown, size_t unknowns, References known,
                                        size_t knowns, const fmi2Real dvKnown[], fmi2Real dvUnknown[]) {
    if (check_mode(c, STEPPING, "fmi2GetDirectionalDerivative") || check_arrays(c, unknowns, unknown, dvUnknown) ||
        check_arrays(c, knowns, known, dvKnown))
        return fmi2Error;
    const State *state = &((const Instance *)c)->state;
    const Pendulum p = pendulum_of(state);
    for (size_t i = 0; i < unknowns; i++) {
        if (check_derivative(c, OUTPUT, unknown[i], 1, 1)) return fmi2Error;
        dvUnknown[i] = 0.0;
        for (size_t j = 0; j < knowns; j++) {
            if (known[j] != VR_phi && known[j] != VR_w && known[j] != VR_tau)
                return tell(c, fmi2Error, "no partial derivative with respect to value reference %u "
                            "(allowed: those of phi, w, tau)", known[j]);
            dvUnknown[i] +=
                dvKnown[j] * partial_derivative(&p, state->phi, state->w, (int)unknown[i], (int)known[j]);
        }
    }
    return fmi2OK;
}

/* Steps */

static fmi2Status do_step(Instance *self, double time, double step) {
    State *state = &self->state;
    const double end = time + step, tau = state->values[VR_tau];
    if (state->mode != STEPPING)
        return tell(self, fmi2Error, "no step in mode %s: initialize the instance first", MODE_NAMES[state->mode]);
    if (!(0.0 < step && step < INFINITY))
        return tell(self, fmi2Error, "no step from t = %s s: communicationStepSize = %s s (allowed: > 0 and finite)",
                    repr(time).text, repr(step).text);
    if (!(isfinite(end) && end <= state->latest_end))
        return tell(self, fmi2Error, "no step from t = %s s over %s s: it must end at a finite time, not beyond the "
                    "stop time (latest end %s s)", repr(time).text, repr(step).text, repr(state->latest_end).text);
    if (!isfinite(tau))
        return tell(self, fmi2Error, "no step from t = %s s: %s", repr(time).text,
                    describe(&VARIABLES[VR_tau], tau).text);
    const Pendulum p = pendulum_of(state);
    const Method method = method_of(state);
    const double longest = longest_substep(method, &p, state->values[VR_solver_stepSize]);
    const double n = substeps(time, step, longest), h = step / n;
    if (n > MAX_SUBSTEPS)
        return tell(self, fmi2Error, "no step from t = %s s: a communication step of %s s would need %.3g substeps of "
                    "%s s, at most %d are allowed", repr(time).text, repr(step).text, n, repr(longest).text,
                    MAX_SUBSTEPS);
    double phi = state->phi, w = state->w;
    const int64_t nfev = integrate(method, &p, &phi, &w, h, 0, (int64_t)n);
    if (!(isfinite(phi) && isfinite(w))) {
        int64_t count = 0;
        for (phi = state->phi, w = state->w; isfinite(phi) && isfinite(w); count++)
            integrate(method, &p, &phi, &w, h, count, 1);
        return tell(self, fmi2Error, "diverged at t = %s s: substep %lld of %s s with %s left the range of a double; "
                    "%s", repr(time + (double)count * h).text, (long long)count, repr(h).text, METHODS[method].name,
                    advice(method, &p, h).text);
    }
    state->phi = phi;
    state->w = w;
    state->time = end;
    state->nfev = nfev < INT32_MAX - state->nfev ? state->nfev + (int32_t)nfev : INT32_MAX;
    memset(state->tau_derivatives, 0, sizeof state->tau_derivatives);
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean noSetFMUStatePriorToCurrentPoint) {
    (void)noSetFMUStatePriorToCurrentPoint; /* nothing is kept for going back */
    return c == NULL ? fmi2Error : (((Instance *)c)->step_status = do_step(c, time, step));
}

/* Steps are never pending, and the FMU never ends a run by itself. */

enum { NO_KIND = -1 };

static fmi2Status check_status(const Instance *self, const void *value, int kind, int known) {
    return check_arrays(self, 1, value, value) ? fmi2Error : kind == known ? fmi2OK : fmi2Discard;
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value) {
    const fmi2Status status = check_status(c, value, kind, fmi2DoStepStatus);
    if (status == fmi2OK) *value = ((const Instance *)c)->step_status;
    return status;
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

fmi2Status fmi2GetIntegerStatus(void *c, fmi2StatusKind s, fmi2Integer *v) { return check_status(c, v, s, NO_KIND); }
fmi2Status fmi2GetStringStatus(void *c, fmi2StatusKind s, fmi2String *v) { return check_status(c, v, s, NO_KIND); }
fmi2Status fmi2CancelStep(void *c) { return c == NULL ? fmi2Error : tell(c, fmi2Error, "there is no step to cancel"); }

/* State */

/* CRC-32 of all of a snapshot but the checksum. */
static uint32_t checksum_of(const Snapshot *snapshot) {
    const unsigned char *bytes = (const unsigned char *)snapshot;
    uint32_t crc = UINT32_MAX;
    for (size_t i = sizeof snapshot->checksum; i < sizeof *snapshot; i++) {
        crc ^= bytes[i];
        for (int bit = 0; bit < 8; bit++) crc = crc >> 1 ^ (crc & 1 ? UINT32_C(0xEDB88320) : 0);
    }
    return ~crc;
}

static fmi2Status check_snapshot(const Instance *self, const Snapshot *snapshot) {
    const State *state = &snapshot->state;
    const double method = state->values[VR_solver_method];
    if (snapshot->checksum != checksum_of(snapshot))
        return tell(self, fmi2Error, "cannot restore the state: the bytes are damaged (wrong checksum)");
    if (strncmp(snapshot->format, STATE_FORMAT, sizeof snapshot->format) != 0)
        return tell(self, fmi2Error, "cannot restore the state: it is of '%.60s', this is '%s'", snapshot->format,
                    STATE_FORMAT);
    if (INSTANTIATED <= state->mode && state->mode <= TERMINATED && state->nfev >= 0 && INT32_MIN <= method &&
        method <= INT32_MAX && (state->mode != STEPPING ||
                                (isfinite(state->phi) && isfinite(state->w) && !*problems_of(state).text)))
        return fmi2OK;
    return tell(self, fmi2Error, "cannot restore the state: no instance can be in it");
}

/* Copy `snapshot` to where FMUstate points to, or into new memory if it points to NULL. */
static fmi2Status give(const Instance *self, const Snapshot *snapshot, fmi2FMUstate *FMUstate) {
    if (*FMUstate == NULL) *FMUstate = malloc(sizeof *snapshot);
    if (*FMUstate == NULL) return tell(self, fmi2Error, "there is no memory for a state");
    memcpy(*FMUstate, snapshot, sizeof *snapshot);
    return fmi2OK;
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
    if (check_arrays(c, 1, FMUstate, FMUstate)) return fmi2Error;
    Snapshot snapshot = {.state = ((const Instance *)c)->state};
    memcpy(snapshot.format, STATE_FORMAT, sizeof STATE_FORMAT);
    snapshot.checksum = checksum_of(&snapshot);
    return give(c, &snapshot, FMUstate);
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate) {
    Instance *self = c;
    if (check_arrays(self, 1, FMUstate, FMUstate) || check_snapshot(self, FMUstate)) return fmi2Error;
    self->state = ((const Snapshot *)FMUstate)->state;
    self->step_status = fmi2OK;
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
    *size = sizeof(Snapshot);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte bytes[], size_t size) {
    if (check_arrays(c, 1, FMUstate, bytes)) return fmi2Error;
    if (size < sizeof(Snapshot))
        return tell(c, fmi2Error, "cannot serialize the state into %zu bytes (allowed: at least %zu)", size,
                    sizeof(Snapshot));
    memcpy(bytes, FMUstate, sizeof(Snapshot));
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *FMUstate) {
    if (check_arrays(c, 1, bytes, FMUstate)) return fmi2Error;
    Snapshot snapshot;
    if (size != sizeof snapshot)
        return tell(c, fmi2Error, "cannot restore the state: the bytes are damaged (%zu instead of %zu)", size,
                    sizeof snapshot);
    memcpy(&snapshot, bytes, sizeof snapshot);
    return check_snapshot(c, &snapshot) ? fmi2Error : give(c, &snapshot, FMUstate);
}
