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

Pendulum pendulum(const double values[VARIABLE_COUNT], const double derivatives[MAX_INPUT_ORDER]) {
    const double m = values[VR_m], L = values[VR_L], g = values[VR_g];
    Pendulum p = {.m = m, .L = L, .g = g, .J = m * L * L, .damping_rate = values[VR_gamma] / m, .w02 = g / L,
                  .drive[0] = values[VR_tau] / (m * L * L), .method = (Method)values[VR_solver_method]};
    double divisor = p.J; /* J*k! */
    for (int k = 1; k <= MAX_INPUT_ORDER; k++) {
        p.drive[k] = derivatives[k - 1] / (divisor *= k);
        if (p.drive[k] != 0.0) p.order = k;
    }
    return p;
}

static double drive_at(const Pendulum *p, double t) {
    double drive = p->drive[p->order];
    for (int k = p->order; k > 0; k--) drive = drive * t + p->drive[k - 1];
    return drive;
}
double acceleration(const Pendulum *p, double t, double phi, double w) {
    double a = p->order == 0 ? p->drive[0] : drive_at(p, t);
    if (p->damping_rate != 0.0) a -= p->damping_rate * w;
    if (p->w02 != 0.0) a -= p->w02 * sin(phi);
    return a;
}
double energy(const Pendulum *p, double phi, double w) {
    const double half = sin(phi / 2.0); /* 1 - cos(phi) would lose the digits of small swings */
    return 0.5 * p->J * w * w + 2.0 * p->m * p->g * p->L * (half * half);
}

double time_derivative(const Pendulum *p, double phi, double w, int output, int order) {
    const double s = p->w02 * sin(phi), c = p->w02 * cos(phi), a = acceleration(p, 0.0, phi, w);
    const double a1 = p->drive[1] - p->damping_rate * a - c * w;
    const double a2 = 2.0 * p->drive[2] - p->damping_rate * a1 - c * a + s * w * w;
    const double push = p->drive[0] - p->damping_rate * w; /* der(E) = J*w*push, the power of torque and drag */
    switch (output) {
    case VR_phi: return order == 1 ? w : a;
    case VR_w: return order == 1 ? a : a1;
    case VR_a: return order == 1 ? a1 : a2;
    default: return p->J * (order == 1 ? w * push : a * push + w * (p->drive[1] - p->damping_rate * a));
    }
}
double partial_derivative(const Pendulum *p, double phi, double w, int output, int known) {
    switch (output) {
    case VR_phi: return known == VR_phi ? 1.0 : 0.0;
    case VR_w: return known == VR_w ? 1.0 : 0.0;
    case VR_a: return known == VR_phi ? -p->w02 * cos(phi) : known == VR_w ? -p->damping_rate : 1.0 / p->J;
    default: return known == VR_phi ? p->m * p->g * p->L * sin(phi) : known == VR_w ? p->J * w : 0.0;
    }
}

/* The methods: each advances phi and w by the substep of h that begins at t, and returns its evaluations. */
static int64_t explicit_euler(const Pendulum *p, double t, double h, double *phi, double *w) {
    const double a = acceleration(p, t, *phi, *w);
    *phi += h * *w;
    *w += h * a;
    return 1;
}
static int64_t explicit_midpoint2(const Pendulum *p, double t, double h, double *phi, double *w) {
    const double half = h / 2, a1 = acceleration(p, t, *phi, *w), w2 = *w + half * a1;
    const double a2 = acceleration(p, t + half, *phi + half * *w, w2);
    *phi += h * w2;
    *w += h * a2;
    return 2;
}
static int64_t explicit_runge_kutta4(const Pendulum *p, double t, double h, double *phi, double *w) {
    const double half = h / 2, sixth = h / 6, middle = *phi + half * *w, end = *phi + h * *w;
    const double a1 = acceleration(p, t, *phi, *w);
    const double a2 = acceleration(p, t + half, middle, *w + half * a1);
    const double a3 = acceleration(p, t + half, middle + half * half * a1, *w + half * a2);
    const double a4 = acceleration(p, t + h, end + half * h * a2, *w + h * a3);
    const double a23 = a2 + a3, a123 = a1 + a23;
    *phi = end + sixth * h * a123;
    *w += sixth * (a123 + a23 + a4);
    return 4;
}

/* Solve x + s*sin(x) = c for |s| < 1 by Newton's method to the last bit; bisection keeps x between bounds. */
static int64_t solve_kepler(double s, double c, double *root) {
    double low = c - 2.0 * fabs(s), high = c + 2.0 * fabs(s), x = c;
    for (int64_t evaluations = 1;; evaluations++) {
        const double residual = (x - c) + s * sin(x), slope = 1.0 + s * cos(x), correction = residual / slope;
        *(residual > 0.0 ? &high : &low) = x;
        double next = *root = x - correction;
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
static int64_t implicit_euler(const Pendulum *p, double t, double h, double *phi, double *w) {
    const double denominator = 1.0 + h * p->damping_rate, kick = h * p->w02 / denominator, s = h * kick;
    const double v = (*w + h * drive_at(p, t + h)) / denominator, c = *phi + h * v;
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
    double x = *phi, v = *w;
    int64_t nfev = 0;
    for (int64_t i = first; i < first + n && isfinite(x) && isfinite(v); i++)
        nfev += step(&p, (double)i * h, h, &x, &v);
    *phi = x;
    *w = v;
    return nfev;
}
int64_t integrate(const Pendulum *p, double *phi, double *w, double h, int64_t first, int64_t n) {
    switch (p->method) { /* a loop for each method: a choice in the loop would cost a tenth */
    case ExplicitEuler: return substeps_of(explicit_euler, p, phi, w, h, first, n);
    case ExplicitMidPoint2: return substeps_of(explicit_midpoint2, p, phi, w, h, first, n);
    case ExplicitRungeKutta4: return substeps_of(explicit_runge_kutta4, p, phi, w, h, first, n);
    default: return substeps_of(implicit_euler, p, phi, w, h, first, n);
    }
}
double stability_limit(const Pendulum *p) {
    const double k = p->damping_rate, w0 = sqrt(fabs(p->w02)), ratio = w0 / k;
    if (p->method == ImplicitEuler || (k == 0.0 && w0 == 0.0)) return INFINITY;
    if (k >= 2.0 * w0) return METHODS[p->method].real_limit / (k * (0.5 + sqrt(0.25 - ratio * ratio)));
    /* (|R(h*lambda)|^2 - 1)/h in rising powers of h, R the stability function, in units of w0 */
    const double z = k / w0, z2 = z * z, z3 = z2 * z, z4 = z2 * z2;
    const double growth[][8] = {
        [ExplicitEuler] = {-z, 1.0},
        [ExplicitMidPoint2] = {-z, z2 / 2, -z / 2, 0.25},
        [ExplicitRungeKutta4] = {-z, z2 / 2, -z3 / 6, z4 / 24, (z - z3) / 24, z2 / 48 - 1.0 / 72, -z / 144,
                                 1.0 / 576}};
    const double *leading = growth[p->method];
    while (*leading == 0.0) leading++;
    if (*leading > 0.0) return 0.0;
    double stable = 0.0, unstable = 4.0; /* |R| > 1 for every method and damping at |h*lambda| = 4 */
    for (;;) {
        const double middle = 0.5 * (stable + unstable);
        if (!(stable < middle && middle < unstable)) return stable / w0;
        double value = 0.0;
        for (int i = 7; i >= 0; i--) value = value * middle + growth[p->method][i];
        *(value <= 0.0 ? &stable : &unstable) = middle;
    }
}

double longest_substep(const Pendulum *p, double wanted) {
    if (p->method != ImplicitEuler || p->w02 == 0.0) return wanted;
    const double w0 = sqrt(fabs(p->w02)), half = p->damping_rate / (2.0 * w0);
    return fmin(wanted, (half + sqrt(half * half + 1.0)) / w0 * (1.0 - 1e-9));
}
double substeps(double time, double duration, double max_step) {
    /* Importers form the step as a difference of times; the rounding noise of those adds no substep. */
    const double noise = 4.0 * DBL_EPSILON * (fabs(time) + duration), n = (duration - noise) / max_step;
    return n > MAX_SUBSTEPS ? n : n > 1.0 ? ceil(n) : 1.0;
}
