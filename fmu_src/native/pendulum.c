#include <float.h>
#include <math.h>
#include "pendulum.h"

/* A fused multiply-add rounds once where Python rounds twice. */
#if defined __clang__
#pragma STDC FP_CONTRACT OFF
#elif defined __GNUC__
#pragma GCC optimize("fp-contract=off")
#elif defined _MSC_VER
#pragma fp_contract(off)
#endif

/* A double as mantissa*2^power: products of mantissas alone neither overflow nor lose digits. */
typedef struct {
    double mantissa;
    int power;
} Split;

static Split split(double value) {
    Split parts = {value, 0};
    if (isfinite(value)) parts.mantissa = frexp(value, &parts.power);
    return parts;
}

/* The product of a few factors without overflow or lost digits on the way to it. */
static double product(const double factors[], int count) {
    double mantissa = 1.0;
    int power = 0;
    for (int i = 0; i < count; i++) {
        const Split factor = split(factors[i]);
        mantissa *= factor.mantissa;
        power += factor.power;
    }
    return ldexp(mantissa, power);
}

static double moment_of_inertia(double m, double L) {
    const Split mass = split(m);
    const Split length = split(L);
    return ldexp(mass.mantissa * length.mantissa * length.mantissa, mass.power + 2 * length.power);
}

/* torque/(J*factor), also where J leaves the range of a double; zero is always +0.0. */
static double per_inertia(double torque, double m, double L, double factor) {
    const double moment = m * L;
    const double J = moment * L;
    const double divisor = J * factor;
    if (DBL_MIN <= moment && DBL_MIN <= J && divisor < INFINITY) return torque / divisor + 0.0;
    const Split mass = split(m);
    const Split length = split(L);
    const Split push = split(torque);
    const double inertia = mass.mantissa * length.mantissa * length.mantissa * factor;
    return ldexp(push.mantissa / inertia, push.power - mass.power - 2 * length.power) + 0.0;
}

static Pendulum pendulum(const double values[VARIABLE_COUNT], const double derivatives[MAX_INPUT_ORDER]) {
    const double m = values[VR_m];
    const double L = values[VR_L];
    const double g = values[VR_g];
    Pendulum p = {
        .m = m,
        .L = L,
        .g = g,
        .damping_rate = values[VR_gamma] / m,
        .w02 = g / L,
        .drive[0] = per_inertia(values[VR_tau], m, L, 1.0),
        .method = (Method)(int)values[VR_solver_method],
    };
    double factorial = 1.0;
    for (int k = 1; k <= MAX_INPUT_ORDER; k++) {
        factorial *= k;
        if (derivatives[k - 1] == 0.0) continue;
        p.drive[k] = per_inertia(derivatives[k - 1], m, L, factorial);
        if (p.drive[k] != 0.0) p.order = k;
    }
    return p;
}

static inline double drive_at(const Pendulum *p, double t) {
    double drive = p->drive[p->order];
    for (int k = p->order; k > 0; k--) drive = drive * t + p->drive[k - 1];
    return drive;
}

static inline double acceleration(const Pendulum *p, double t, double phi, double w) {
    double a = p->order == 0 ? p->drive[0] : drive_at(p, t);
    if (p->damping_rate != 0.0) a -= p->damping_rate * w;
    if (p->w02 != 0.0) a -= p->w02 * sin(phi);
    return a;
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
    const double potential =
        2.0 * mass.mantissa * gravity.mantissa * length.mantissa * (half.mantissa * half.mantissa);
    const int kinetic_power = mass.power + 2 * (length.power + rate.power);
    const int potential_power = mass.power + gravity.power + length.power + 2 * half.power;
    if (potential == 0.0) return ldexp(kinetic, kinetic_power);
    if (kinetic == 0.0) return ldexp(potential, potential_power);
    const int power = kinetic_power > potential_power ? kinetic_power : potential_power;
    return ldexp(ldexp(kinetic, kinetic_power - power) + ldexp(potential, potential_power - power), power);
}

static double time_derivative(const Pendulum *p, double t, double phi, double w, int output, int order) {
    const double k = p->damping_rate;
    const double s = p->w02 * sin(phi);
    const double c = p->w02 * cos(phi);
    const double drive1 = p->drive[1] + t * (2.0 * p->drive[2] + t * 3.0 * p->drive[3]);
    const double drive2 = 2.0 * p->drive[2] + t * 6.0 * p->drive[3];
    const double a = acceleration(p, t, phi, w);
    const double a1 = drive1 - k * a - c * w;
    const double a2 = drive2 - k * a1 - c * a + s * w * w;
    const double push = drive_at(p, t) - k * w; /* der(E) = J*w*push, the power of torque and drag */
    const double push1 = drive1 - k * a;
    switch (output) {
    case VR_phi: return order == 1 ? w : a;
    case VR_w: return order == 1 ? a : a1;
    case VR_a: return order == 1 ? a1 : a2;
    default: break;
    }
    if (order == 1) return product((const double[]){p->m, p->L, p->L, w, push}, 5);
    return product((const double[]){p->m, p->L, p->L, a * push + w * push1}, 4);
}

static double partial_derivative_of_a(const Pendulum *p, double phi, double w, int known) {
    const double drive = p->drive[0];
    switch (known) {
    case VR_phi:
    case VR_phi_start: return -p->w02 * cos(phi);
    case VR_w:
    case VR_w_start: return -p->damping_rate;
    case VR_tau: return per_inertia(1.0, p->m, p->L, 1.0);
    case VR_m: return (p->damping_rate * w - drive) / p->m;
    case VR_L: return (p->w02 * sin(phi) - 2.0 * drive) / p->L;
    case VR_gamma: return -w / p->m;
    case VR_g: return -sin(phi) / p->L;
    default: return 0.0;
    }
}

static double partial_derivative_of_E(const Pendulum *p, double phi, double w, int known) {
    const double half = sin(phi / 2.0);
    switch (known) {
    case VR_phi:
    case VR_phi_start: return product((const double[]){p->m, p->g, p->L, sin(phi)}, 4);
    case VR_w:
    case VR_w_start: return product((const double[]){p->m, p->L, p->L, w}, 4);
    case VR_m: return energy(1.0, p->L, p->g, phi, w);
    case VR_L: return product((const double[]){p->m, p->L, w, w}, 4) +
                      product((const double[]){2.0, p->m, p->g, half, half}, 5);
    case VR_g: return product((const double[]){2.0, p->m, p->L, half, half}, 5);
    default: return 0.0;
    }
}

static double partial_derivative(const Pendulum *p, double phi, double w, int output, int known) {
    switch (output) {
    case VR_phi: return known == VR_phi || known == VR_phi_start ? 1.0 : 0.0;
    case VR_w: return known == VR_w || known == VR_w_start ? 1.0 : 0.0;
    case VR_a: return partial_derivative_of_a(p, phi, w, known);
    default: return partial_derivative_of_E(p, phi, w, known);
    }
}

/* The methods: each advances phi and w by the substep of h that begins at t, and returns its evaluations. They and what
 * they call are inline, because a call costs as much as the arithmetic of a stage. */

static inline int64_t explicit_euler(const Pendulum *p, double t, double h, double *phi, double *w) {
    const double a = acceleration(p, t, *phi, *w);
    *phi += h * *w;
    *w += h * a;
    return 1;
}

static inline int64_t explicit_midpoint2(const Pendulum *p, double t, double h, double *phi, double *w) {
    const double half = h / 2;
    const double a1 = acceleration(p, t, *phi, *w);
    const double w2 = *w + half * a1;
    const double a2 = acceleration(p, t + half, *phi + half * *w, w2);
    *phi += h * w2;
    *w += h * a2;
    return 2;
}

static inline int64_t explicit_runge_kutta4(const Pendulum *p, double t, double h, double *phi, double *w) {
    const double half = h / 2;
    const double sixth = h / 6;
    const double middle = *phi + half * *w;
    const double end = *phi + h * *w;
    const double a1 = acceleration(p, t, *phi, *w);
    const double a2 = acceleration(p, t + half, middle, *w + half * a1);
    const double a3 = acceleration(p, t + half, middle + half * half * a1, *w + half * a2);
    const double a4 = acceleration(p, t + h, end + half * h * a2, *w + h * a3);
    const double a23 = a2 + a3;
    const double a123 = a1 + a23;
    *phi = end + sixth * h * a123;
    *w += sixth * (a123 + a23 + a4);
    return 4;
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

static inline int64_t implicit_euler(const Pendulum *p, double t, double h, double *phi, double *w) {
    const double denominator = 1.0 + h * p->damping_rate;
    const double kick = h * p->w02 / denominator;
    const double s = h * kick;
    const double v = (*w + h * drive_at(p, t + h)) / denominator;
    const double c = *phi + h * v;
    *phi = c;
    *w = v;
    if (s == 0.0) return 1;
    const int64_t evaluations = solve_kepler(s, c, phi);
    *w -= kick * sin(*phi);
    return evaluations;
}

static inline int64_t substeps_of(int64_t (*step)(const Pendulum *, double, double, double *, double *),
                                  const Pendulum *given, double *phi, double *w, double h, int64_t first, int64_t n) {
    const Pendulum p = *given; /* a copy that no call can change */
    double x = *phi;
    double v = *w;
    int64_t nfev = 0;
    for (int64_t i = first; i < first + n && isfinite(x) && isfinite(v); i++)
        nfev += step(&p, (double)i * h, h, &x, &v);
    *phi = x;
    *w = v;
    return nfev;
}

/* A loop for each method: a choice in the loop would cost a tenth. */
static int64_t integrate(const Pendulum *p, double *phi, double *w, double h, int64_t first, int64_t n) {
    switch (p->method) {
    case ExplicitEuler: return substeps_of(explicit_euler, p, phi, w, h, first, n);
    case ExplicitMidPoint2: return substeps_of(explicit_midpoint2, p, phi, w, h, first, n);
    case ExplicitRungeKutta4: return substeps_of(explicit_runge_kutta4, p, phi, w, h, first, n);
    default: return substeps_of(implicit_euler, p, phi, w, h, first, n);
    }
}

static double stability_limit(const Pendulum *p) {
    const double k = p->damping_rate;
    const double w0 = sqrt(fabs(p->w02));
    if (p->method == ImplicitEuler || (k == 0.0 && w0 == 0.0)) return INFINITY;
    if (k >= 2.0 * w0) {
        const double ratio = w0 / k;
        return METHODS[p->method].real_limit / (k * (0.5 + sqrt(0.25 - ratio * ratio)));
    }
    /* (|R(h*lambda)|^2 - 1)/h in rising powers of h, R the stability function, in units of w0 */
    const double z = k / w0;
    const double z2 = z * z;
    const double z3 = z2 * z;
    const double z4 = z2 * z2;
    const double growth[][8] = {
        [ExplicitEuler] = {-z, 1.0},
        [ExplicitMidPoint2] = {-z, z2 / 2, -z / 2, 0.25},
        [ExplicitRungeKutta4] = {-z, z2 / 2, -z3 / 6, z4 / 24, (z - z3) / 24, z2 / 48 - 1.0 / 72, -z / 144,
                                 1.0 / 576},
    };
    const double *leading = growth[p->method];
    while (*leading == 0.0) leading++;
    if (*leading > 0.0) return 0.0;
    double stable = 0.0;
    double unstable = 4.0; /* |R| > 1 for every method and damping at |h*lambda| = 4 */
    for (;;) {
        const double middle = 0.5 * (stable + unstable);
        if (!(stable < middle && middle < unstable)) return stable / w0;
        double value = 0.0;
        for (int i = 7; i >= 0; i--) value = value * middle + growth[p->method][i];
        if (value <= 0.0) {
            stable = middle;
        } else {
            unstable = middle;
        }
    }
}

static double unique_root_limit(const Pendulum *p) {
    if (p->method != ImplicitEuler || p->w02 == 0.0) return INFINITY;
    const double w0 = sqrt(fabs(p->w02));
    const double half = p->damping_rate / (2.0 * w0);
    return (half + sqrt(half * half + 1.0)) / w0 * (1.0 - 1e-9);
}

static double clock_noise(double time, double duration) {
    return 4.0 * DBL_EPSILON * (fabs(time) + duration);
}

static double substeps(double time, double duration, double max_step) {
    const double n = (duration - clock_noise(time, duration)) / max_step;
    if (n > MAX_SUBSTEPS) return n;
    return n > 1.0 ? ceil(n) : 1.0;
}
