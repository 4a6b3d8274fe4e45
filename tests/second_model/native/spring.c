/* The hardening spring; hardening_spring/model.py is the specification.
 *
 *     m*der(v) = F - c*v - k*x - k3*x^3,   der(x) = v
 *
 * x [m], v [m/s] */

#include <math.h>

#include "model.h"

static const double MODEL_REST = 0.0; /* [m] */

struct Model {
    double m, k, k3;                     /* mass [kg], stiffness [N/m], hardening [N/m3] */
    double damping_rate, w02, hardening; /* of the acceleration: c/m [1/s], k/m [1/s2], k3/m [1/(m2.s2)] */
};

static bool model_exists(const double values[VARIABLE_COUNT]) {
    return values[VR_m] != 0.0;
}

static inline Model model_of(const double values[VARIABLE_COUNT]) {
    const double m = values[VR_m];
    return (Model){m, values[VR_k], values[VR_k3], values[VR_c] / m, values[VR_k] / m, values[VR_k3] / m};
}

static void model_check(const double values[VARIABLE_COUNT], Text *problems) {
    const Model model = model_of(values);
    if (!isfinite(model.damping_rate)) append_out_of_range(problems, "c/m", model.damping_rate, "1/s");
    if (!isfinite(model.w02)) append_out_of_range(problems, "k/m", model.w02, "1/s2");
    if (!isfinite(model.hardening)) append_out_of_range(problems, "k3/m", model.hardening, "1/(m2.s2)");
}

static inline double model_drive(const Model *model, double force, double factor) {
    return force / (model->m * factor) + 0.0;
}

static inline double model_acceleration(const Model *model, double drive, double x, double v) {
    double a = drive;
    if (model->damping_rate != 0.0) a -= model->damping_rate * v;
    if (model->w02 != 0.0) a -= model->w02 * x;
    if (model->hardening != 0.0) a -= model->hardening * x * x * x;
    return a;
}

static inline int64_t model_implicit_stage(const Model *model, double b, double drive, double *x, double *v) {
    return newton_stage(model, b, drive, x, v);
}

/* The force rises with x. */
static double model_longest_implicit_stage(const Model *model) {
    (void)model;
    return INFINITY;
}

/* k3*x^3 is a product of series, begun with k3, which may be 0 where x^3 is inf. */
static inline void model_taylor_step(const Model *model, const double drive[MAX_INPUT_ORDER + 1], double h, double *x,
                                     double *v) {
    double positions[TAYLOR_ORDER + 1] = {*x};
    double rates[TAYLOR_ORDER + 1] = {*v};
    double first[TAYLOR_ORDER + 1];
    double second[TAYLOR_ORDER + 1];
    for (int k = 0; k < TAYLOR_ORDER; k++) {
        first[k] = model->hardening * positions[k];
        second[k] = convolution(first, positions, k);
        const double third = convolution(second, positions, k);
        const double held = k <= MAX_INPUT_ORDER ? drive[k] : 0.0;
        const double a = held - model->damping_rate * rates[k] - model->w02 * positions[k] - third;
        const double ratio = h / (k + 1);
        positions[k + 1] = ratio * rates[k];
        rates[k + 1] = ratio * a;
    }
    *x = total(positions);
    *v = total(rates);
}

/* E, the energy [J], is the only one. */
static double model_output(const double values[VARIABLE_COUNT], unsigned output) {
    (void)output;
    const double square = values[VR_x] * values[VR_x];
    const double kinetic = 0.5 * values[VR_m] * (values[VR_v] * values[VR_v]);
    return kinetic + (0.5 * values[VR_k] * square + 0.25 * values[VR_k3] * square * square);
}

static double model_partial_derivative(const Model *model, double drive, double x, double v, unsigned output,
                                       unsigned known) {
    const bool of_a = output == VR_a; /* or of E */
    const double square = x * x;
    const double cube = square * x;
    switch (known) {
    case VR_x: return of_a ? -model->w02 - 3.0 * model->hardening * x * x : model->k * x + model->k3 * x * x * x;
    case VR_v: return of_a ? -model->damping_rate : model->m * v;
    case VR_F: return of_a ? 1.0 / model->m : 0.0;
    case VR_m: return of_a ? -model_acceleration(model, drive, x, v) / model->m : 0.5 * (v * v);
    case VR_c: return of_a ? -v / model->m : 0.0;
    case VR_k: return of_a ? -x / model->m : 0.5 * square;
    case VR_k3: return of_a ? -cube / model->m : 0.25 * square * square;
    default: return 0.0;
    }
}

/* der(E) is the power of force and drag. */
static double model_output_derivative(const Model *model, const Moment *at, unsigned output) {
    (void)output; /* E */
    return model->m * at->v * (at->drive - model->damping_rate * at->v);
}
