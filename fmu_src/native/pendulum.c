/* The damped pendulum. damped_pendulum/model.py is the specification: the order of the operations is its, so that the
 * results are the same bits.
 *
 *     J*der(w) = tau - gamma*L^2*w - m*g*L*sin(phi),   der(phi) = w,   J = m*L^2
 *
 * phi [rad] counts from the downward vertical; w [rad/s]. */

#include <float.h>
#include <math.h>

#include "model.h"
#include "scaling.h"

static const double MODEL_REST = 0.0; /* [rad] */

struct Model {
    double m, L, g;      /* mass [kg], length [m], gravity [m/s2] */
    double damping_rate; /* gamma/m [1/s] */
    double w02;          /* g/L [rad/s2] */
};

static bool model_exists(const double values[VARIABLE_COUNT]) {
    return values[VR_m] != 0.0 && values[VR_L] != 0.0;
}

static inline Model model_of(const double values[VARIABLE_COUNT]) {
    return (Model){
        .m = values[VR_m],
        .L = values[VR_L],
        .g = values[VR_g],
        .damping_rate = values[VR_gamma] / values[VR_m],
        .w02 = values[VR_g] / values[VR_L],
    };
}

static double moment_of_inertia(double m, double L) {
    const Split mass = split(m);
    const Split length = split(L);
    return ldexp(mass.mantissa * length.mantissa * length.mantissa, mass.power + 2 * length.power);
}

static void model_check(const double values[VARIABLE_COUNT], Text *problems) {
    const double J = moment_of_inertia(values[VR_m], values[VR_L]);
    if (!(0.0 < J && J < INFINITY)) {
        append_out_of_range(problems, "J = m*L^2", J, "kg.m2");
        return;
    }
    const Model model = model_of(values);
    if (!isfinite(model.damping_rate)) append_out_of_range(problems, "gamma/m", model.damping_rate, "1/s");
    if (!isfinite(model.w02)) append_out_of_range(problems, "g/L", model.w02, "1/s2");
}

/* tau/J, also where J leaves the range of a double; zero is always +0.0. */
static inline double model_drive(const Model *model, double tau, double factor) {
    const double moment = model->m * model->L;
    const double J = moment * model->L;
    const double divisor = J * factor;
    if (DBL_MIN <= moment && DBL_MIN <= J && divisor < INFINITY) return tau / divisor + 0.0;
    const Split mass = split(model->m);
    const Split length = split(model->L);
    const Split torque = split(tau);
    const double inertia = mass.mantissa * length.mantissa * length.mantissa * factor;
    return ldexp(torque.mantissa / inertia, torque.power - mass.power - 2 * length.power) + 0.0;
}

static inline double model_acceleration(const Model *model, double drive, double phi, double w) {
    double a = drive;
    if (model->damping_rate != 0.0) a -= model->damping_rate * w;
    if (model->w02 != 0.0) a -= model->w02 * sin(phi);
    return a;
}

/* Solve x + s*sin(x) = c for |s| < 1 by Newton's method to the last bit; bisection keeps x between bounds. */
static inline int64_t solve_kepler(double s, double c, double *root) {
    double low = c - 2.0 * fabs(s);
    double high = c + 2.0 * fabs(s);
    double x = c;
    for (int64_t evaluations = 1;; evaluations++) {
        const double residual = (x - c) + s * sin(x);
        const double slope = 1.0 + s * cos(x);
        const double correction = residual / slope;
        if (residual > 0.0) {
            high = x;
        } else {
            low = x;
        }
        double next = x - correction;
        *root = next;
        /* The error left after a Newton step is below |s|*correction^2/(2*slope): a quarter of the last place. */
        if (fabs(s) * correction * correction <= DBL_EPSILON / 4.0 * slope * fabs(next) || next == x)
            return evaluations;
        if (!(low < next && next < high)) {
            next = 0.5 * (low + high);
            *root = x;
            if (!(low < next && next < high)) return evaluations;
        }
        x = next;
    }
}

/* Without the rate there is one equation for the angle x, x + s*sin(x) = c. */
static inline int64_t model_implicit_stage(const Model *model, double b, double drive, double *phi, double *w) {
    const double denominator = 1.0 + b * model->damping_rate;
    const double kick = b * model->w02 / denominator;
    const double s = b * kick;
    const double v = (*w + b * drive) / denominator;
    const double c = *phi + b * v;
    *phi = c;
    *w = v;
    if (s == 0.0) return 1;
    const int64_t evaluations = solve_kepler(s, c, phi);
    *w -= kick * sin(*phi);
    return evaluations;
}

/* |s| must stay below 1. */
static double model_longest_implicit_stage(const Model *model) {
    if (model->w02 == 0.0) return INFINITY;
    const double w0 = sqrt(fabs(model->w02));
    const double half = model->damping_rate / (2.0 * w0);
    return (half + sqrt(half * half + 1.0)) / w0 * (1.0 - 1e-9);
}

/* Terms with their powers of h, by der(sin(phi)) = w*cos(phi), der(cos(phi)) = -w*sin(phi). Unrolled, for in a loop
 * each term would wait for the memory that the one before was just written to. */
static inline void model_taylor_step(const Model *model, const double drive[MAX_INPUT_ORDER + 1], double h, double *phi,
                                     double *w) {
    double angle[TAYLOR_ORDER + 1] = {*phi};
    double rate[TAYLOR_ORDER + 1] = {*w};
    double sine[TAYLOR_ORDER + 1] = {sin(*phi)};
    double cosine[TAYLOR_ORDER + 1] = {cos(*phi)};
#pragma GCC unroll 16
    for (int k = 0; k < TAYLOR_ORDER; k++) {
        const double ratio = h / (k + 1);
        double a = k <= MAX_INPUT_ORDER ? drive[k] : 0.0;
        if (model->damping_rate != 0.0) a -= model->damping_rate * rate[k];
        if (model->w02 != 0.0) a -= model->w02 * sine[k];
        angle[k + 1] = ratio * rate[k];
        rate[k + 1] = ratio * a;
        double rate_cosine = 0.0;
        double rate_sine = 0.0;
#pragma GCC unroll 16
        for (int j = 1; j < k; j++) {
            rate_cosine += rate[j] * cosine[k - j];
            rate_sine += rate[j] * sine[k - j];
        }
        /* The newest terms come last: the others are added while these are computed. */
        if (k > 0) {
            rate_cosine += rate[k] * cosine[0];
            rate_sine += rate[k] * sine[0];
        }
        rate_cosine += rate[0] * cosine[k];
        rate_sine += rate[0] * sine[k];
        sine[k + 1] = ratio * rate_cosine;
        cosine[k + 1] = -ratio * rate_sine;
    }
    *phi = total(angle);
    *w = total(rate);
}

/* The potential energy is 2*m*g*L*sin(phi/2)^2: 1 - cos(phi) would lose the digits of small swings. */
static double energy(double m, double L, double g, double phi, double w) {
    const Split mass = split(m);
    const Split length = split(L);
    const Split gravity = split(g);
    const Split rate = split(w);
    const Split half = split(sin(phi / 2.0));
    const double inertia = mass.mantissa * length.mantissa * length.mantissa;
    const double kinetic = 0.5 * inertia * rate.mantissa * rate.mantissa;
    const double potential = 2.0 * mass.mantissa * gravity.mantissa * length.mantissa * (half.mantissa * half.mantissa);
    const int kinetic_power = mass.power + 2 * (length.power + rate.power);
    const int potential_power = mass.power + gravity.power + length.power + 2 * half.power;
    if (potential == 0.0) return ldexp(kinetic, kinetic_power);
    if (kinetic == 0.0) return ldexp(potential, potential_power);
    const int power = kinetic_power > potential_power ? kinetic_power : potential_power;
    return ldexp(ldexp(kinetic, kinetic_power - power) + ldexp(potential, potential_power - power), power);
}

/* The only one is E [J], 0 at rest in the lowest point. */
static double model_output(const double values[VARIABLE_COUNT], unsigned output) {
    (void)output;
    return energy(values[VR_m], values[VR_L], values[VR_g], values[VR_phi], values[VR_w]);
}

static double partial_derivative_of_a(const Model *model, double drive, double phi, double w, unsigned known) {
    switch (known) {
    case VR_phi: return -model->w02 * cos(phi);
    case VR_w: return -model->damping_rate;
    case VR_tau: return model_drive(model, 1.0, 1.0);
    case VR_m: return (model->damping_rate * w - drive) / model->m;
    case VR_L: return (model->w02 * sin(phi) - 2.0 * drive) / model->L;
    case VR_gamma: return -w / model->m;
    case VR_g: return -sin(phi) / model->L;
    default: return 0.0;
    }
}

static double partial_derivative_of_E(double m, double L, double g, double phi, double w, unsigned known) {
    const double half = sin(phi / 2.0);
    switch (known) {
    case VR_phi: return product((const double[]){m, g, L, sin(phi)}, 4);
    case VR_w: return product((const double[]){m, L, L, w}, 4);
    case VR_m: return energy(1.0, L, g, phi, w);
    case VR_L: return product((const double[]){m, L, w, w}, 4) + product((const double[]){2.0, m, g, half, half}, 5);
    case VR_g: return product((const double[]){2.0, m, L, half, half}, 5);
    default: return 0.0;
    }
}

static double model_partial_derivative(const Model *model, double drive, double phi, double w, unsigned output,
                                       unsigned known) {
    if (output == VR_a) return partial_derivative_of_a(model, drive, phi, w, known);
    return partial_derivative_of_E(model->m, model->L, model->g, phi, w, known);
}

/* der(E) = J*w*push, the power of torque and drag. */
static double model_output_derivative(const Model *model, const Moment *at, unsigned output) {
    (void)output; /* E */
    const double push = at->drive - model->damping_rate * at->v;
    return product((const double[]){model->m, model->L, model->L, at->v, push}, 5);
}
