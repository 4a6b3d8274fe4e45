/* What the FMI functions ask for: values in and out, derivatives, checks in words, steps, of any model. */
#ifndef SIMULATION_H
#define SIMULATION_H

#include <stdbool.h>

#include "interface.h"
#include "text.h"

/* All that the future of a model depends on; of doubles alone, so that there is no padding in a saved state. */
typedef struct {
    double values[VARIABLE_COUNT];             /* by value reference; those of computed outputs are not used */
    double input_derivatives[MAX_INPUT_ORDER]; /* of the input, of order 1, 2, ... [its unit/s, /s2, ...] */
    double elapsed; /* since the input and these were set [s]: 0, or the length of the last step */
} Simulation;

/* Give every variable its start value. */
static void reset(Simulation *simulation);

/* Set a parameter or an input, whatever the value is. */
static void set_value(Simulation *simulation, unsigned reference, double value);

/* Set the derivative of an input [its unit/s^order] at the beginning of the next step, for that step alone. */
static void set_input_derivative(Simulation *simulation, unsigned reference, int order, double value);

/* The value of a variable [its unit]; not finite where it cannot be computed. */
static double value_of(const Simulation *simulation, unsigned reference);

/* Whether the FMU calculates a variable, so that it cannot be set. */
static bool is_calculated(unsigned reference);

/* Whether a variable is computed when it is asked for. */
static bool is_computed(unsigned reference);

/* The derivative of an output with respect to time [its unit/s]; not finite where it cannot be computed. */
static double time_derivative(const Simulation *simulation, unsigned output);

/* Whether there is a partial derivative of `unknown` with respect to `known`. */
static bool has_partial_derivative(unsigned unknown, unsigned known, bool initializing);

/* Write which partial derivatives there are. */
static void describe_partial_derivatives(bool initializing, Text *text);

/* The partial derivative of an output with respect to a variable [their units]; not finite: it cannot be computed. */
static double partial_derivative(const Simulation *simulation, unsigned unknown, unsigned known);

/* Write the values on which the outputs depend. */
static void describe_values(const Simulation *simulation, Text *text);

/* Write what is wrong with the parameters, and return whether anything is. */
static bool has_problems(const Simulation *simulation, Text *text);

/* Write what a user should know although the parameters are allowed, and return whether there is anything. */
static bool has_warnings(const Simulation *simulation, Text *text);

/* Whether there can be these values, by themselves or as those of an instance that is `stepping`. */
static bool can_be(const Simulation *simulation, bool stepping, Text *scratch);

/* Whether nothing has happened since the start values were set. */
static bool is_at_start(const Simulation *simulation);

/* Advance from `time` over `duration` [s]; return false, the reason in `text` and nothing changed, if it cannot be. */
static bool make_step(Simulation *simulation, double time, double duration, Text *text);

#endif
