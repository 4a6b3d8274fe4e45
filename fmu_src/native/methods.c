#include "methods.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>

/* Motion */

static inline Motion motion(Model model, Method method, double u, const double derivatives[MAX_INPUT_ORDER]) {
    Motion p = {.model = model, .method = method};
    p.drive[0] = model_drive(&p.model, u, 1.0);
    double factorial = 1.0;
    for (int k = 1; k <= MAX_INPUT_ORDER; k++) {
        factorial *= k;
        if (derivatives[k - 1] == 0.0) continue;
        p.drive[k] = model_drive(&p.model, derivatives[k - 1], factorial);
        if (p.drive[k] != 0.0) p.order = k;
    }
    return p;
}

static inline double drive_at(const Motion *p, double t) {
    double drive = p->drive[p->order];
    for (int k = p->order; k > 0; k--)
        drive = drive * t + p->drive[k - 1];
    return drive;
}

static inline double acceleration(const Motion *p, double t, double x, double v) {
    return model_acceleration(&p->model, p->order == 0 ? p->drive[0] : drive_at(p, t), x, v);
}

/* Methods: each advances x and v by the substep of h that begins at t, and returns its evaluations; the implicit ones
 * have the loop over the substeps, too. They and what they call are inline, because a call costs as much as the
 * arithmetic of a stage. */

static inline int64_t explicit_euler(const Motion *p, double t, double h, double *x, double *v) {
    const double a = acceleration(p, t, *x, *v);
    *x += h * *v;
    *v += h * a;
    return 1;
}

static inline int64_t explicit_midpoint2(const Motion *p, double t, double h, double *x, double *v) {
    const double half = h / 2;
    const double a1 = acceleration(p, t, *x, *v);
    const double v2 = *v + half * a1;
    const double a2 = acceleration(p, t + half, *x + half * *v, v2);
    *x += h * v2;
    *v += h * a2;
    return 2;
}

static inline int64_t explicit_runge_kutta4(const Motion *p, double t, double h, double *x, double *v) {
    const double half = h / 2;
    const double sixth = h / 6;
    const double middle = *x + half * *v;
    const double end = *x + h * *v;
    const double a1 = acceleration(p, t, *x, *v);
    const double a2 = acceleration(p, t + half, middle, *v + half * a1);
    const double a3 = acceleration(p, t + half, middle + half * half * a1, *v + half * a2);
    const double a4 = acceleration(p, t + h, end + half * h * a2, *v + h * a3);
    const double a23 = a2 + a3;
    const double a123 = a1 + a23;
    *x = end + sixth * h * a123;
    *v += sixth * (a123 + a23 + a4);
    return 4;
}

/* The residual rises with the rate where the solution is a single one, so that its sign says on which side that lies.
 */
static inline int64_t newton_stage(const Model *model, double b, double drive, double *x, double *v) {
    const double x_before = *x;
    const double v_before = *v;
    *x = x_before + b * v_before;
    double low = -INFINITY;
    double high = INFINITY;
    double last_move = INFINITY;
    for (int64_t evaluations = 1;; evaluations++) {
        const double a = model_acceleration(model, drive, *x, *v);
        const double a_x = model_partial_derivative(model, drive, *x, *v, MODEL.a, MODEL.x);
        const double a_v = model_partial_derivative(model, drive, *x, *v, MODEL.a, MODEL.v);
        const double residual = (*v - v_before) - b * a;
        const double correction = residual / (1.0 - b * (a_v + b * a_x));
        if (residual > 0.0) {
            high = *v;
        } else {
            low = *v;
        }
        /* Newton's method doubles the digits: after a step this small all are right. */
        const bool is_last = fabs(correction) <= 1e-9 * (fabs(*v) + fabs(v_before) + fabs(b * a));
        const bool is_slow = fabs(correction) > 0.5 * last_move || !(low < *v - correction && *v - correction < high);
        const bool bisects = !is_last && is_slow && isfinite(high - low);
        const double next = bisects ? 0.5 * (low + high) : *v - correction;
        last_move = fabs(next - *v);
        *v = next;
        *x = x_before + b * next;
        if (is_last || !isfinite(*x) || next == low || next == high) return evaluations;
        if (evaluations == MAX_EVALUATIONS) {
            *x = NAN;
            *v = NAN;
            return evaluations;
        }
    }
}

static inline double total(const double terms[TAYLOR_ORDER + 1]) {
    double value = 0.0;
    for (int k = TAYLOR_ORDER; k >= 0; k--)
        value += terms[k];
    return value;
}

static inline double convolution(const double *first, const double *second, int k) {
    double product = first[0] * second[k];
    for (int j = 1; j <= k; j++)
        product += first[j] * second[k - j];
    return product;
}

static inline void drive_terms(const Motion *p, double t, double h, double drive[MAX_INPUT_ORDER + 1]) {
    for (int k = 0; k <= MAX_INPUT_ORDER; k++)
        drive[k] = p->drive[k];
    for (int i = 0; i < p->order; i++)
        for (int k = p->order - 1; k >= i; k--)
            drive[k] += t * drive[k + 1];
    double power = 1.0;
    for (int k = 1; k <= p->order; k++) {
        power *= h;
        drive[k] *= power;
    }
}

static inline int64_t taylor_series(const Motion *p, double t, double h, double *x, double *v) {
    double drive[MAX_INPUT_ORDER + 1];
    drive_terms(p, t, h, drive);
    model_taylor_step(&p->model, drive, h, x, v);
    return TAYLOR_ORDER;
}

static inline int64_t substeps_of(int64_t (*step)(const Motion *, double, double, double *, double *),
                                  const Motion *given, double *x, double *v, double h, int64_t first, int64_t n) {
    const Motion p = *given; /* a copy that no call can change */
    double x_then = *x;
    double v_then = *v;
    int64_t nfev = 0;
    for (int64_t i = first; i < first + n && isfinite(x_then) && isfinite(v_then); i++)
        nfev += step(&p, (double)i * h, h, &x_then, &v_then);
    *x = x_then;
    *v = v_then;
    return nfev;
}

/* The substeps of a diagonally implicit Runge-Kutta method by its tableau, as implicit.py has them. */
static inline int64_t diagonally_implicit(Method method, const Motion *given, double *x, double *v, double h,
                                          int64_t first, int64_t n) {
    const Motion p = *given; /* a copy that no call can change */
    const int stages = METHODS[method].stages;
    const double diagonal = METHODS[method].A[stages - 1][stages - 1];
    const double b = h * diagonal;
    const bool is_explicit = METHODS[method].A[0][0] == 0.0;
    double x_then = *x;
    double rates[MAX_STAGES];
    double kicks[MAX_STAGES]; /* b*a of each stage */
    rates[stages - 1] = *v;
    kicks[stages - 1] = is_explicit ? b * acceleration(&p, (double)first * h, *x, *v) : 0.0;
    int64_t nfev = is_explicit ? 1 : 0;
    for (int64_t i = first; i < first + n && isfinite(x_then) && isfinite(rates[stages - 1]); i++) {
        const double x_before = x_then;
        const double v_before = rates[stages - 1];
        rates[0] = v_before;
        kicks[0] = kicks[stages - 1];
        for (int k = is_explicit ? 1 : 0; k < stages; k++) {
            const double *row = METHODS[method].A[k];
            double v_known = v_before;
            double node = row[k];
            x_then = x_before;
            for (int j = 0; j < k; j++) {
                x_then += h * row[j] * rates[j];
                v_known += row[j] / diagonal * kicks[j];
                node += row[j];
            }
            rates[k] = v_known;
            nfev += model_implicit_stage(&p.model, b, drive_at(&p, (double)i * h + node * h), &x_then, &rates[k]);
            kicks[k] = rates[k] - v_known;
        }
    }
    *x = x_then;
    *v = rates[stages - 1];
    return nfev;
}

/* Integrate over the substeps first, ..., first + n - 1 of h [s] while the state is finite; return the evaluations.
 * A loop for each method: a choice in the loop would cost a tenth. */
static int64_t integrate(const Motion *p, double *x, double *v, double h, int64_t first, int64_t n) {
    switch (p->method) {
    case ExplicitEuler: return substeps_of(explicit_euler, p, x, v, h, first, n);
    case ExplicitMidPoint2: return substeps_of(explicit_midpoint2, p, x, v, h, first, n);
    case ExplicitRungeKutta4: return substeps_of(explicit_runge_kutta4, p, x, v, h, first, n);
    case ImplicitEuler: return diagonally_implicit(ImplicitEuler, p, x, v, h, first, n);
    case ImplicitTrapezoid: return diagonally_implicit(ImplicitTrapezoid, p, x, v, h, first, n);
    case TRBDF2: return diagonally_implicit(TRBDF2, p, x, v, h, first, n);
    case SDIRK4: return diagonally_implicit(SDIRK4, p, x, v, h, first, n);
    default: return substeps_of(taylor_series, p, x, v, h, first, n);
    }
}

/* Limits */

static double polynomial(const double *coefficients, int count, double h) {
    double value = 0.0;
    for (int i = count - 1; i >= 0; i--)
        value = value * h + coefficients[i];
    return value;
}

/* The coefficients of (|R(h*lambda)|^2 - 1)/h in rising powers of h, R the polynomial of exp of this degree, h in units
 * of 1/w0, the damping rate z < 2 in units of w0. Up to `order` they are those of exp(-z*h). */
static void growth(int order, double z, double coefficients[2 * TAYLOR_ORDER]) {
    double factorials[TAYLOR_ORDER + 1] = {1.0};
    double cosines[TAYLOR_ORDER + 1] = {1.0, -0.5 * z}; /* of the multiples of the argument of lambda */
    for (int k = 1; k <= order; k++)
        factorials[k] = factorials[k - 1] * k;
    for (int k = 2; k <= order; k++)
        cosines[k] = -z * cosines[k - 1] - cosines[k - 2];
    double power = 1.0;
    for (int m = 1; m <= order; m++) {
        power *= -z;
        coefficients[m - 1] = power / factorials[m];
    }
    for (int m = order + 1; m <= 2 * order; m++) {
        coefficients[m - 1] = 0.0;
        for (int i = m - order; i <= order; i++)
            coefficients[m - 1] += cosines[abs(2 * i - m)] / (factorials[i] * factorials[m - i]);
    }
}

/* The damping rate [1/s] of small swings. */
static double damping_rate(const Motion *p) {
    return -model_partial_derivative(&p->model, 0.0, MODEL_REST, 0.0, MODEL.a, MODEL.v);
}

/* The angular frequency [rad/s] of small swings without damping; of swings as fast as this where the model runs away
 * from where it rests. */
static double frequency(const Motion *p) {
    return sqrt(fabs(model_partial_derivative(&p->model, 0.0, MODEL_REST, 0.0, MODEL.a, MODEL.x)));
}

static double stability_limit(const Motion *p) {
    const double k = damping_rate(p);
    const double w0 = frequency(p);
    if (METHODS[p->method].real_limit == INFINITY || (k == 0.0 && w0 == 0.0)) return INFINITY;
    if (k >= 2.0 * w0) {
        const double ratio = w0 / k;
        return METHODS[p->method].real_limit / (k * (0.5 + sqrt(0.25 - ratio * ratio)));
    }
    const int count = 2 * METHODS[p->method].order;
    double coefficients[2 * TAYLOR_ORDER];
    growth(METHODS[p->method].order, k / w0, coefficients);
    const double *leading = coefficients;
    while (*leading == 0.0)
        leading++;
    if (*leading > 0.0) return 0.0;
    /* Beyond an unstable gap a method may be stable once more: the bracket grows from zero by steps of a sixteenth. */
    double stable = 0.0;
    double unstable = 0.0625;
    while (polynomial(coefficients, count, unstable) <= 0.0) {
        stable = unstable;
        unstable += 0.0625;
    }
    for (;;) {
        const double middle = 0.5 * (stable + unstable);
        if (!(stable < middle && middle < unstable)) return stable / w0;
        if (polynomial(coefficients, count, middle) <= 0.0) {
            stable = middle;
        } else {
            unstable = middle;
        }
    }
}

/* Upper bound of the substeps [s] by the implicit stages. */
static double longest_of_stages(const Motion *p) {
    const int stages = METHODS[p->method].stages;
    if (stages == 0) return INFINITY;
    return model_longest_implicit_stage(&p->model) / METHODS[p->method].A[stages - 1][stages - 1];
}

static double longest_substep(const Motion *p, double step_size) {
    return fmin(step_size, longest_of_stages(p));
}

/* Add the setting of a step size that stays below `limit` [s] when it is rounded to five digits. */
static void append_stable_step(Text *text, double limit) {
    append(text, "solver.stepSize = %s s or less", rounded(0.9999 * limit, 5).text);
}

/* Add, after `words`, the setting of a method that allows longer substeps; nothing where none is as accurate. */
static void append_better_method(Text *text, const char *words, const Motion *p) {
    Motion rk4 = *p;
    rk4.method = ExplicitRungeKutta4;
    const double limit = stability_limit(&rk4);
    if (damping_rate(p) >= 2.0 * frequency(p)) {
        append(text, "%ssolver.method = %d (%s) ", words, TRBDF2, METHODS[TRBDF2].name);
        append(text, "or %d (%s)", SDIRK4, METHODS[SDIRK4].name);
    } else if (limit > stability_limit(p)) {
        append(text, "%ssolver.method = %d (%s) with ", words, rk4.method, METHODS[rk4.method].name);
        append_stable_step(text, limit);
    }
}

/* Add what to do about substeps of h [s] that went wrong or will. */
static void append_advice(Text *text, const Motion *p, double h) {
    const char *name = METHODS[p->method].name;
    const double limit = stability_limit(p);
    if (limit == 0.0) {
        append(text, "%s has no stable step size for this %s: use ", name, MODEL.system);
        append_better_method(text, "", p);
    } else if (h > limit) {
        append(text, "the stability limit of %s for this %s is %s s: use ", name, MODEL.system, rounded(limit, 6).text);
        append_stable_step(text, limit);
        append_better_method(text, ", or ", p);
    } else {
        if (limit == INFINITY) {
            append(text, "%s is stable at every step size for small swings of this %s: ", name, MODEL.system);
        } else {
            append(text, "%s s is within the stability limit of %s for small swings of this %s ", repr(h).text, name,
                   MODEL.system);
            append(text, "(%s s): ", rounded(limit, 6).text);
        }
        append(text, "check the %s and the start values, or use a smaller solver.stepSize", MODEL.quantity);
    }
}

static bool is_unstable(const Motion *p, double h, Text *text) {
    if (h <= stability_limit(p)) return false;
    clear(text);
    append(text, "substeps of solver.stepSize = %s s would be unstable: ", repr(h).text);
    append_advice(text, p, h);
    return true;
}

/* Steps */

/* Rounding noise [s] in a communication step of `duration` [s] from `time` [s]: importers form it as a difference. */
static double clock_noise(double time, double duration) {
    return 4.0 * DBL_EPSILON * (fabs(time) + duration);
}

/* Number of equal substeps, none longer than max_step [s] but for that noise, up to a tenth of max_step, and none
 * longer than `longest` [s] >= max_step; a whole number up to MAX_SUBSTEPS. */
static double substeps(double time, double duration, double max_step, double longest) {
    const double n = (duration - fmin(clock_noise(time, duration), max_step / 10.0)) / max_step;
    if (n > MAX_SUBSTEPS) return n;
    const double fewest = n > 1.0 ? ceil(n) : 1.0;
    return duration / fewest <= longest ? fewest : fewest + 1.0;
}

/* Write why there are no substeps for a step, and return whether that is so. */
static bool has_no_substeps(double time, double duration, double max_step, double n, Text *text) {
    const double noise = clock_noise(time, duration);
    if (n <= MAX_SUBSTEPS && noise <= max_step) return false;
    clear(text);
    if (n > MAX_SUBSTEPS) {
        append(text, "no step from t = %s s: a communication step of %s s ", repr(time).text, repr(duration).text);
        append(text, "would need %s substeps of %s s, at most %d are allowed", rounded(n, 3).text, repr(max_step).text,
               MAX_SUBSTEPS);
    } else {
        append(text, "no step from t = %s s over %s s: ", repr(time).text, repr(duration).text);
        append(text, "its times are rounded to %s s, which is more than the longest substep (%s s)", repr(noise).text,
               repr(max_step).text);
    }
    return true;
}

/* Write that, and where, the n substeps of h [s] from `time` left the range of a double: take them one by one. */
static void report_divergence(const Motion *p, double x, double v, double time, double h, int64_t n, Text *text) {
    int64_t count = 0;
    while (isfinite(x) && isfinite(v) && count < n) {
        integrate(p, &x, &v, h, count, 1);
        count++;
    }
    clear(text);
    append(text, "diverged at t = %s s: substep %lld of ", repr(time + (double)count * h).text, (long long)count);
    append(text, "%s s with %s left the range of a double; ", repr(h).text, METHODS[p->method].name);
    append_advice(text, p, h);
}

static bool advance(const Motion *p, double time, double duration, double max_step, double *x, double *v, int64_t *nfev,
                    Text *text) {
    /* The noise of a clock may take an implicit stage to half of the margin of its length. */
    const double n = substeps(time, duration, max_step, longest_of_stages(p) * (1.0 + 5e-10));
    if (has_no_substeps(time, duration, max_step, n, text)) return false;
    const double h = duration / n;
    double x_then = *x;
    double v_then = *v;
    const int64_t evaluations = integrate(p, &x_then, &v_then, h, 0, (int64_t)n);
    if (!(isfinite(x_then) && isfinite(v_then))) {
        report_divergence(p, *x, *v, time, h, (int64_t)n, text);
        return false;
    }
    *x = x_then + 0.0; /* -0.0 becomes 0.0 */
    *v = v_then + 0.0;
    *nfev += evaluations;
    return true;
}
