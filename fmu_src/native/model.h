/* What the FMI functions ask of the model: values in and out, checks in words, steps. */
#ifndef MODEL_H
#define MODEL_H

#include <stdbool.h>
#include "interface.h"
#include "text.h"

/* All that the future of the model depends on; of doubles alone, so that there is no padding in a saved state. */
typedef struct {
    double values[VARIABLE_COUNT];             /* by value reference; those of a and E are computed when asked for */
    double input_derivatives[MAX_INPUT_ORDER]; /* of the input, of order 1, 2, ... [its unit/s, /s2, ...] */
    double elapsed;                            /* since the input and these were set [s]: 0, or the length of the last step */
} Model;

/* Give every variable its start value. */
static void model_reset(Model *model);

/* Set a parameter or an input. */
static void model_set(Model *model, unsigned reference, double value);

/* Set the derivative of an input at the beginning of the next step, for that step alone. */
static void model_set_input_derivative(Model *model, unsigned reference, int order, double value);

/* The value of a variable; not finite where it cannot be computed. */
static double model_value(const Model *model, unsigned reference);

/* Whether a variable is computed when it is asked for. */
static bool model_computes(unsigned reference);

/* The derivative of an output with respect to time. */
static double model_time_derivative(const Model *model, unsigned reference, int order);

/* Whether there is a partial derivative of `unknown` with respect to `known`, in words, too. */
static bool model_has_partial_derivative(unsigned unknown, unsigned known, bool initializing);
static const char *model_partial_derivatives(bool initializing);

/* The partial derivative of an output with respect to a variable. */
static double model_partial_derivative(const Model *model, unsigned unknown, unsigned known);

/* Write the values on which the outputs depend. */
static void model_describe(const Model *model, Text *text);

/* Write what is wrong with the parameters, and return whether anything is. */
static bool model_has_problems(const Model *model, Text *text);

/* Write what a user should know although the parameters are allowed, and return whether there is anything. */
static bool model_has_warnings(const Model *model, Text *text);

/* Whether the model can be in this state, by itself or as that of an instance that is `stepping`. */
static bool model_is_possible(const Model *model, bool stepping, Text *scratch);

/* Advance from `time` over `duration`; return false, the reason in `text` and nothing changed, if that is impossible. */
static bool model_step(Model *model, double time, double duration, Text *text);

#endif
