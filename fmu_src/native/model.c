#include <math.h>
#include <stdint.h>
#include <string.h>
#include "model.h"

static const double NO_DERIVATIVES[MAX_INPUT_ORDER] = {0.0};

static Pendulum pendulum_of(const Model *model) {
    return pendulum(model->values, model->input_derivatives);
}

static double longest_substep(const Model *model, const Pendulum *p) {
    return fmin(model->values[VR_solver_stepSize], unique_root_limit(p));
}

/* After a step the torque goes on as it was during the step; what is set then begins anew. */
static void begin_torque(Model *model) {
    if (model->elapsed == 0.0) return;
    memset(model->input_derivatives, 0, sizeof model->input_derivatives);
    model->elapsed = 0.0;
}

static void model_reset(Model *model) {
    *model = (Model){.elapsed = 0.0};
    for (unsigned vr = 0; vr < VARIABLE_COUNT; vr++)
        if (VARIABLES[vr].causality != OUTPUT) model_set(model, vr, VARIABLES[vr].start);
}

/* A start value is that of the output, too, so that it is right before the first step. */
static void model_set(Model *model, unsigned reference, double value) {
    model->values[reference] = value;
    if (reference == VR_phi_start) model->values[VR_phi] = value;
    if (reference == VR_w_start) model->values[VR_w] = value;
    if (reference == VR_tau) begin_torque(model);
}

static void model_set_input_derivative(Model *model, unsigned reference, int order, double value) {
    (void)reference; /* tau is the only input */
    begin_torque(model);
    model->input_derivatives[order - 1] = value;
}

/* What only `a` and `E` need is computed for them alone: before initialization a mass may be zero. */
static double model_value(const Model *model, unsigned reference) {
    const double *values = model->values;
    const double phi = values[VR_phi];
    const double w = values[VR_w];
    if (reference == VR_E) return energy(values[VR_m], values[VR_L], values[VR_g], phi, w);
    if (reference != VR_a) return values[reference];
    if (values[VR_m] == 0.0 || values[VR_L] == 0.0 || !isfinite(phi) || !isfinite(w)) return NAN;
    const Pendulum p = pendulum_of(model);
    return acceleration(&p, model->elapsed, phi, w) + 0.0;
}

static bool model_computes(unsigned reference) {
    return reference == VR_a || reference == VR_E;
}

static double model_time_derivative(const Model *model, unsigned reference, int order) {
    const Pendulum p = pendulum_of(model);
    return time_derivative(&p, model->elapsed, model->values[VR_phi], model->values[VR_w], (int)reference, order);
}

static bool model_has_partial_derivative(unsigned unknown, unsigned known, bool initializing) {
    if (VARIABLES[unknown].causality != OUTPUT) return false;
    if (known == VR_tau) return true;
    return initializing ? VARIABLES[known].causality == PARAMETER : known == VR_phi || known == VR_w;
}

static const char *model_partial_derivatives(bool initializing) {
    return initializing ? "of outputs by Real parameters, tau" : "of outputs by phi, w, tau";
}

static double model_partial_derivative(const Model *model, unsigned unknown, unsigned known) {
    const Pendulum p = pendulum_of(model);
    return partial_derivative(&p, model->values[VR_phi], model->values[VR_w], (int)unknown, (int)known);
}

static void model_describe(const Model *model, Text *text) {
    append(text, "phi = %s rad, w = %s rad/s, tau = %s N.m", repr(model->values[VR_phi]).text,
           repr(model->values[VR_w]).text, repr(model->values[VR_tau]).text);
}

/* Add a variable with its value and what is allowed. */
static void append_variable(Text *text, unsigned reference, double value) {
    const Variable *variable = &VARIABLES[reference];
    if (variable->type == INTEGER) {
        append(text, "%s = %d (allowed: %s)", variable->name, (int)value, variable->allowed);
    } else {
        append(text, "%s = %s %s (allowed: %s)", variable->name, repr(value).text, variable->unit, variable->allowed);
    }
}

static bool is_allowed(const Model *model, unsigned parameter) {
    const double value = model->values[parameter];
    return VARIABLES[parameter].lowest <= value && value <= VARIABLES[parameter].highest;
}

/* Add to a list of problems what a product or quotient of parameters is. */
static void append_out_of_range(Text *text, const char *name, double value, const char *unit) {
    append(text, "%s%s = %s %s is out of the range of a double", *text->text == '\0' ? "" : "; ", name,
           repr(value).text, unit);
}

/* The products and quotients are looked at when each parameter by itself is allowed. */
static bool model_has_problems(const Model *model, Text *text) {
    clear(text);
    for (unsigned vr = 0; vr < VARIABLE_COUNT; vr++) {
        if (VARIABLES[vr].causality != PARAMETER || is_allowed(model, vr)) continue;
        if (*text->text != '\0') append(text, "; ");
        append_variable(text, vr, model->values[vr]);
    }
    if (*text->text != '\0') return true;
    const double J = moment_of_inertia(model->values[VR_m], model->values[VR_L]);
    if (!(0.0 < J && J < INFINITY)) {
        append_out_of_range(text, "J = m*L^2", J, "kg.m2");
        return true;
    }
    const double damping_rate = model->values[VR_gamma] / model->values[VR_m];
    const double w02 = model->values[VR_g] / model->values[VR_L];
    if (!isfinite(damping_rate)) append_out_of_range(text, "gamma/m", damping_rate, "1/s");
    if (!isfinite(w02)) append_out_of_range(text, "g/L", w02, "1/s2");
    return *text->text != '\0';
}

/* Add what to do about substeps of h [s] that went wrong or will. */
static void append_advice(Text *text, const Pendulum *p, double h) {
    const char *name = METHODS[p->method].name;
    const char *implicit = METHODS[ImplicitEuler].name;
    const double limit = stability_limit(p);
    const double stable = 0.9999 * limit; /* stays below the limit when it is rounded to five digits */
    if (limit == 0.0) {
        append(text, "%s has no stable step size for this pendulum (stability limit 0 s): use %s or %s", name,
               METHODS[ExplicitRungeKutta4].name, implicit);
    } else if (h <= limit) {
        append(text, "%s s is within the stability limit of %s for this pendulum (%s s): ", repr(h).text, name,
               rounded(limit, 6).text);
        append(text, "check the torque and the start values");
    } else {
        append(text, "the stability limit of %s for this pendulum is %s s: ", name, rounded(limit, 6).text);
        append(text, "use solver.stepSize = %s s or less, or %s", rounded(stable, 5).text, implicit);
    }
}

static bool model_has_warnings(const Model *model, Text *text) {
    const Pendulum p = pendulum_of(model);
    const double h = longest_substep(model, &p);
    if (h <= stability_limit(&p)) return false;
    clear(text);
    append(text, "solver.stepSize = %s s is unstable: ", repr(h).text);
    append_advice(text, &p, h);
    return true;
}

static bool is_integer(double value) {
    return INT32_MIN <= value && value <= INT32_MAX && value == (double)(int32_t)value;
}

static bool model_is_possible(const Model *model, bool stepping, Text *scratch) {
    const double *values = model->values;
    for (int k = 0; k < MAX_INPUT_ORDER; k++)
        if (!isfinite(model->input_derivatives[k])) return false;
    if (!(0.0 <= model->elapsed && model->elapsed < INFINITY)) return false;
    if (!is_integer(values[VR_solver_method])) return false;
    if (!is_integer(values[VR_solver_nfev]) || values[VR_solver_nfev] < 0.0) return false;
    if (!stepping) return true;
    return isfinite(values[VR_phi]) && isfinite(values[VR_w]) && !model_has_problems(model, scratch);
}

/* Write that, and where, the substeps of h [s] from `time` left the range of a double: take them one by one. */
static void report_divergence(const Model *model, const Pendulum *p, double time, double h, Text *text) {
    double phi = model->values[VR_phi];
    double w = model->values[VR_w];
    int64_t count = 0;
    while (isfinite(phi) && isfinite(w)) {
        integrate(p, &phi, &w, h, count, 1);
        count++;
    }
    clear(text);
    append(text, "diverged at t = %s s: substep %lld of ", repr(time + (double)count * h).text, (long long)count);
    append(text, "%s s with %s left the range of a double; ", repr(h).text, METHODS[p->method].name);
    append_advice(text, p, h);
}

/* Write why there are no substeps for a step, and return whether that is so. */
static bool has_no_substeps(double time, double duration, double max_step, double n, Text *text) {
    const double noise = clock_noise(time, duration);
    if (n <= MAX_SUBSTEPS && noise <= max_step) return false;
    clear(text);
    if (n > MAX_SUBSTEPS) {
        append(text, "no step from t = %s s: a communication step of %s s ", repr(time).text, repr(duration).text);
        append(text, "would need %s substeps of %s s, at most %d are allowed", rounded(n, 3).text,
               repr(max_step).text, MAX_SUBSTEPS);
    } else {
        append(text, "no step from t = %s s over %s s: ", repr(time).text, repr(duration).text);
        append(text, "its times are rounded to %s s, which is more than the longest substep (%s s)",
               repr(noise).text, repr(max_step).text);
    }
    return true;
}

static bool model_step(Model *model, double time, double duration, Text *text) {
    double *values = model->values;
    if (!isfinite(values[VR_tau])) {
        clear(text);
        append(text, "no step from t = %s s: ", repr(time).text);
        append_variable(text, VR_tau, values[VR_tau]);
        return false;
    }
    const bool continued = model->elapsed > 0.0; /* nothing was set since the last step: the torque is held */
    const Pendulum p = pendulum(values, continued ? NO_DERIVATIVES : model->input_derivatives);
    const double max_step = longest_substep(model, &p);
    const double n = substeps(time, duration, max_step);
    if (has_no_substeps(time, duration, max_step, n, text)) return false;
    double phi = values[VR_phi];
    double w = values[VR_w];
    const int64_t nfev = integrate(&p, &phi, &w, duration / n, 0, (int64_t)n);
    if (!(isfinite(phi) && isfinite(w))) {
        report_divergence(model, &p, time, duration / n, text);
        return false;
    }
    values[VR_phi] = phi + 0.0; /* -0.0 becomes 0.0 */
    values[VR_w] = w + 0.0;
    values[VR_solver_nfev] = fmin(values[VR_solver_nfev] + (double)nfev, INT32_MAX);
    if (continued) begin_torque(model);
    model->elapsed = duration;
    return true;
}
