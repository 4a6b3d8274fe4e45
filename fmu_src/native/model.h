/* The contract of a model: what its one C file defines, besides the tables in interface.h.
 *
 * A model is one equation of motion with one input u,
 *
 *     der(x) = v,   der(v) = a(drive, x, v),   drive = a multiple of u
 *
 * with the parameters solver.method and solver.stepSize and the local variable solver.nfev. [x] is the unit of x.
 *
 * A host may read outputs and derivatives before the parameters are checked, so that what is not about steps is called
 * with any values. A function fails by a result that is not finite; the host is told what could not be computed, or
 * that the step diverged. Inline is what is called in every step: a call costs as much as its arithmetic. */
#ifndef MODEL_H
#define MODEL_H

#include <stdbool.h>
#include <stdint.h>

#include "interface.h"
#include "text.h"

/* The model's file defines `static const double MODEL_REST`, the x [x] of the small swings that the stability limits
 * are for; v and drive are 0 there. */

/* What the parameters make of the equation; the model's file defines `struct Model`. */
typedef struct Model Model;

/* Whether a can be computed at all: no parameter is zero that something is divided by. */
static bool model_exists(const double values[VARIABLE_COUNT]);

/* The model with the parameters among `values`, which are by value reference. */
static inline Model model_of(const double values[VARIABLE_COUNT]);

/* Add to `problems`, by append_out_of_range(), what the model cannot compute with although each parameter is allowed by
 * itself, as it is here; initialization is refused if anything is added. */
static void model_check(const double values[VARIABLE_COUNT], Text *problems);

/* The drive [x/s2] by the input `u` [its unit], over `factor`: linear in u. */
static inline double model_drive(const Model *model, double u, double factor);

/* a [x/s2]. */
static inline double model_acceleration(const Model *model, double drive, double x, double v);

/* Solve V = v + b*a(drive, X, V), X = x + b*V for a stage b [s] of an implicit method, put X and V in the place of x
 * and v, and return how often a was evaluated. */
static inline int64_t model_implicit_stage(const Model *model, double b, double drive, double *x, double *v);

/* The b [s] below which these equations have a single solution; INFINITY: they always have. */
static double model_longest_implicit_stage(const Model *model);

/* Advance x and v by h [s]: their Taylor series up to TAYLOR_ORDER. The drive is a polynomial: drive[k] is its term
 * with h^k [x/s2]. */
static inline void model_taylor_step(const Model *model, const double drive[MAX_INPUT_ORDER + 1], double h, double *x,
                                     double *v);

/* An output [its unit] other than x, v and a. */
static double model_output(const double values[VARIABLE_COUNT], unsigned output);

/* The partial derivative [their units] of a or an output of model_output() with respect to x, v, u or a parameter. */
static double model_partial_derivative(const Model *model, double drive, double x, double v, unsigned output,
                                       unsigned known);

/* A moment of a motion. */
typedef struct {
    double drive, drive1; /* and its derivative with respect to time [x/s2, x/s3] */
    double x, v, a;       /* [x, x/s, x/s2] */
} Moment;

/* The derivative [its unit/s] of an output of model_output() with respect to time. */
static double model_output_derivative(const Model *model, const Moment *at, unsigned output);

/* Given to the model, for a model_implicit_stage() that knows no better: Newton's method on a and its partial
 * derivatives, to the last bits where b is below model_longest_implicit_stage(). */
static inline int64_t newton_stage(const Model *model, double b, double drive, double *x, double *v);

/* Given to the model, for model_taylor_step(): the sum of a series, from its last term on. */
static inline double total(const double terms[TAYLOR_ORDER + 1]);

/* Given to the model, too: the term k of the product of two series, of which the terms up to k are known. */
static inline double convolution(const double *first, const double *second, int k);

/* Given to the model: add that `name`, a product or quotient of parameters, is out of range with its value [unit]. */
static inline void append_out_of_range(Text *problems, const char *name, double value, const char *unit);

#endif
