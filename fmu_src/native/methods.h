/* The fixed-step methods for der(x) = v, der(v) = a(t, x, v), their substeps and what to say where they go wrong.
 *
 * The Python modules of the same methods are the specification: the order of the operations is theirs, so
 * that the results are the same bits. t [s] counts from the beginning of a communication step. */
#ifndef METHODS_H
#define METHODS_H

#include <stdbool.h>
#include <stdint.h>

#include "model.h"
#include "text.h"

/* A model, what drives it, and the method that integrates it. */
typedef struct {
    Model model;
    double drive[MAX_INPUT_ORDER + 1]; /* as a polynomial in t: its coefficients [x/s2, x/s3, ...] */
    int order;                         /* of the polynomial; 0: the drive is held */
    Method method;
} Motion;

/* The motion under an input of value `u`, with the `derivatives` of order 1, 2, ... [its unit/s, /s2, ...]. */
static inline Motion motion(Model model, Method method, double u, const double derivatives[MAX_INPUT_ORDER]);

/* The drive at t [x/s2]. */
static inline double drive_at(const Motion *p, double t);

/* The polynomial of the drive about t: drive[k] is its term with h^k [x/s2]. */
static inline void drive_terms(const Motion *p, double t, double h, double drive[MAX_INPUT_ORDER + 1]);

/* a at t [x/s2]. */
static inline double acceleration(const Motion *p, double t, double x, double v);

/* Largest substep [s] that is stable for small swings; 0: none is, INFINITY: every one is. */
static double stability_limit(const Motion *p);

/* Upper bound of the substeps [s] where a user allows `step_size` [s]: implicit stages have a single solution, too. */
static double longest_substep(const Motion *p, double step_size);

/* Write that substeps of `h` [s] are unstable and what to do about it, and return whether they are. */
static bool is_unstable(const Motion *p, double h, Text *text);

/* Advance x and v from `time` over `duration` by substeps of at most `max_step` [s], and add the evaluations of a to
 * `nfev`; return false, the reason in `text` and nothing changed, if that is impossible. */
static bool advance(const Motion *p, double time, double duration, double max_step, double *x, double *v, int64_t *nfev,
                    Text *text);

#endif
