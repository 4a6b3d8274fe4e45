#include "simulation.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

#include "methods.h"
#include "model.h"

static const double NO_DERIVATIVES[MAX_INPUT_ORDER] = {0.0};

static inline Motion motion_under(const Simulation *simulation, const double derivatives[MAX_INPUT_ORDER]) {
    const double *values = simulation->values;
    const Method method = (Method)(int)values[VR_solver_method];
    return motion(model_of(values), method, values[MODEL.input], derivatives);
}

static inline Motion motion_of(const Simulation *simulation) {
    return motion_under(simulation, simulation->input_derivatives);
}

/* Values */

/* After a step the input goes on as it was during the step; what is set then begins anew. */
static void begin_input(Simulation *simulation) {
    if (simulation->elapsed == 0.0) return;
    memset(simulation->input_derivatives, 0, sizeof simulation->input_derivatives);
    simulation->elapsed = 0.0;
}

static bool is_calculated(unsigned reference) {
    return VARIABLES[reference].causality == OUTPUT || VARIABLES[reference].causality == LOCAL;
}

static void reset(Simulation *simulation) {
    *simulation = (Simulation){.elapsed = 0.0};
    for (unsigned vr = 0; vr < VARIABLE_COUNT; vr++)
        if (!is_calculated(vr)) set_value(simulation, vr, VARIABLES[vr].start);
}

/* A start value is that of the output, too, so that it is right before the first step. */
static void set_value(Simulation *simulation, unsigned reference, double value) {
    simulation->values[reference] = value;
    if (reference == MODEL.x_start) simulation->values[MODEL.x] = value;
    if (reference == MODEL.v_start) simulation->values[MODEL.v] = value;
    if (reference == MODEL.input) begin_input(simulation);
}

static void set_input_derivative(Simulation *simulation, unsigned reference, int order, double value) {
    (void)reference; /* there is one input */
    begin_input(simulation);
    simulation->input_derivatives[order - 1] = value;
}

static bool is_computed(unsigned reference) {
    return VARIABLES[reference].causality == OUTPUT && reference != MODEL.x && reference != MODEL.v;
}

/* What is computed is so for itself alone: before initialization a parameter may be zero that others are divided by. */
static double value_of(const Simulation *simulation, unsigned reference) {
    const double *values = simulation->values;
    if (!is_computed(reference)) return values[reference];
    if (reference != MODEL.a) return model_output(values, reference);
    const double x = values[MODEL.x];
    const double v = values[MODEL.v];
    if (!model_exists(values) || !isfinite(x) || !isfinite(v)) return NAN;
    const Motion p = motion_of(simulation);
    return acceleration(&p, simulation->elapsed, x, v) + 0.0;
}

static void describe_values(const Simulation *simulation, Text *text) {
    const unsigned references[] = {MODEL.x, MODEL.v, MODEL.input};
    clear(text);
    for (int i = 0; i < 3; i++) {
        const Variable *variable = &VARIABLES[references[i]];
        append(text, "%s%s = %s %s", i == 0 ? "" : ", ", variable->name, repr(simulation->values[references[i]]).text,
               variable->unit);
    }
}

/* Derivatives */

_Static_assert(MAX_OUTPUT_ORDER == 1, "time_derivative() has all orders");

static Moment moment_of(const Motion *p, double t, double x, double v) {
    double drive[MAX_INPUT_ORDER + 1];
    drive_terms(p, t, 1.0, drive);
    return (Moment){
        .drive = drive[0],
        .drive1 = drive[1],
        .x = x,
        .v = v,
        .a = acceleration(p, t, x, v),
    };
}

static double time_derivative(const Simulation *simulation, unsigned output) {
    const double x = simulation->values[MODEL.x];
    const double v = simulation->values[MODEL.v];
    const Motion p = motion_of(simulation);
    const Moment at = moment_of(&p, simulation->elapsed, x, v);
    if (output == MODEL.x) return v;
    if (output == MODEL.v) return at.a;
    if (output != MODEL.a) return model_output_derivative(&p.model, &at, output);
    const double a_x = model_partial_derivative(&p.model, at.drive, x, v, MODEL.a, MODEL.x);
    const double a_v = model_partial_derivative(&p.model, at.drive, x, v, MODEL.a, MODEL.v);
    return at.drive1 + a_v * at.a + a_x * v;
}

static bool has_partial_derivative(unsigned unknown, unsigned known, bool initializing) {
    if (VARIABLES[unknown].causality != OUTPUT) return false;
    if (known == MODEL.input) return true;
    return initializing ? VARIABLES[known].causality == PARAMETER : known == MODEL.x || known == MODEL.v;
}

static void describe_partial_derivatives(bool initializing, Text *text) {
    const char *input = VARIABLES[MODEL.input].name;
    clear(text);
    if (initializing) {
        append(text, "of outputs by Real parameters, %s", input);
    } else {
        append(text, "of outputs by %s, %s, %s", VARIABLES[MODEL.x].name, VARIABLES[MODEL.v].name, input);
    }
}

/* By the start values as by x and v, which they are in Initialization Mode. */
static double partial_derivative(const Simulation *simulation, unsigned unknown, unsigned known) {
    const double *values = simulation->values;
    const unsigned by = known == MODEL.x_start ? MODEL.x : known == MODEL.v_start ? MODEL.v : known;
    if (unknown == MODEL.x || unknown == MODEL.v) return unknown == by ? 1.0 : 0.0;
    const Motion p = motion_of(simulation);
    return model_partial_derivative(&p.model, p.drive[0], values[MODEL.x], values[MODEL.v], unknown, by);
}

/* Checks */

/* Add a variable with its value and what is allowed. */
static void append_variable(Text *text, unsigned reference, double value) {
    const Variable *variable = &VARIABLES[reference];
    if (variable->type == INTEGER) {
        append(text, "%s = %d (allowed: %s)", variable->name, (int)value, variable->allowed);
    } else {
        append(text, "%s = %s %s (allowed: %s)", variable->name, repr(value).text, variable->unit, variable->allowed);
    }
}

static bool is_allowed(const Simulation *simulation, unsigned parameter) {
    const double value = simulation->values[parameter];
    return VARIABLES[parameter].lowest <= value && value <= VARIABLES[parameter].highest;
}

static inline void append_out_of_range(Text *problems, const char *name, double value, const char *unit) {
    append(problems, "%s%s = %s %s is out of the range of a double", *problems->text == '\0' ? "" : "; ", name,
           repr(value).text, unit);
}

/* The model is asked when each parameter by itself is allowed. */
static bool has_problems(const Simulation *simulation, Text *text) {
    clear(text);
    for (unsigned vr = 0; vr < VARIABLE_COUNT; vr++) {
        if (VARIABLES[vr].causality != PARAMETER || is_allowed(simulation, vr)) continue;
        if (*text->text != '\0') append(text, "; ");
        append_variable(text, vr, simulation->values[vr]);
    }
    if (*text->text == '\0') model_check(simulation->values, text);
    return *text->text != '\0';
}

static bool has_warnings(const Simulation *simulation, Text *text) {
    const Motion p = motion_of(simulation);
    return is_unstable(&p, longest_substep(&p, simulation->values[VR_solver_stepSize]), text);
}

static bool is_integer(double value) {
    return INT32_MIN <= value && value <= INT32_MAX && value == (double)(int32_t)value;
}

static bool can_be(const Simulation *simulation, bool stepping, Text *scratch) {
    const double *values = simulation->values;
    for (int k = 0; k < MAX_INPUT_ORDER; k++)
        if (!isfinite(simulation->input_derivatives[k])) return false;
    if (!(0.0 <= simulation->elapsed && simulation->elapsed < INFINITY)) return false;
    if (!is_integer(values[VR_solver_method])) return false;
    if (!is_integer(values[VR_solver_nfev]) || values[VR_solver_nfev] < 0.0) return false;
    if (!stepping) return true;
    return isfinite(values[MODEL.x]) && isfinite(values[MODEL.v]) && !has_problems(simulation, scratch);
}

/* Start values may be NaN, which equals itself in bytes only. */
static bool is_at_start(const Simulation *simulation) {
    const double *values = simulation->values;
    const bool x_is_start = memcmp(&values[MODEL.x], &values[MODEL.x_start], sizeof *values) == 0;
    const bool v_is_start = memcmp(&values[MODEL.v], &values[MODEL.v_start], sizeof *values) == 0;
    return x_is_start && v_is_start && values[VR_solver_nfev] == 0.0 && simulation->elapsed == 0.0;
}

/* Steps */

static bool make_step(Simulation *simulation, double time, double duration, Text *text) {
    double *values = simulation->values;
    if (!isfinite(values[MODEL.input])) {
        clear(text);
        append(text, "no step from t = %s s: ", repr(time).text);
        append_variable(text, MODEL.input, values[MODEL.input]);
        return false;
    }
    const bool continued = simulation->elapsed > 0.0; /* nothing was set since the last step: the input is held */
    const Motion p = motion_under(simulation, continued ? NO_DERIVATIVES : simulation->input_derivatives);
    const double max_step = longest_substep(&p, values[VR_solver_stepSize]);
    int64_t nfev = (int64_t)values[VR_solver_nfev];
    if (!advance(&p, time, duration, max_step, &values[MODEL.x], &values[MODEL.v], &nfev, text)) return false;
    values[VR_solver_nfev] = fmin((double)nfev, INT32_MAX);
    if (continued) begin_input(simulation);
    simulation->elapsed = duration;
    return true;
}
