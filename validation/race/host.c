/* A compiled importer: takes the communication steps of an FMU and reads its outputs after each. */

#include <stddef.h>

enum { WARNING = 1, ORDERS = 3 };

typedef int DoStep(void *component, double time, double step, int no_set_state_prior);
typedef int GetReal(void *component, const unsigned *references, size_t n, double *values);
typedef int SetReal(void *component, const unsigned *references, size_t n, const double *values);
typedef int SetDerivatives(void *component, const unsigned *references, size_t n, const int *orders,
                           const double *values);

size_t run(DoStep *do_step, GetReal *get_real, SetReal *set_real, SetDerivatives *set_derivatives, void *component,
           size_t steps, const double *times, size_t width, const unsigned *outputs, double *rows, unsigned input,
           const double *input_values);

/* Take `steps` steps between the `times`, and write `width` outputs a row. `input_values` has the input and its first
 * three derivatives at the beginning of each step; NULL: there is no input. Return the number of steps that succeeded.
 */
size_t run(DoStep *do_step, GetReal *get_real, SetReal *set_real, SetDerivatives *set_derivatives, void *component,
           size_t steps, const double *times, size_t width, const unsigned *outputs, double *rows, unsigned input,
           const double *input_values) {
    const unsigned inputs[ORDERS] = {input, input, input};
    const int orders[ORDERS] = {1, 2, 3};
    for (size_t i = 0; i < steps; i++) {
        if (input_values != NULL) {
            const double *values = input_values + i * (1 + ORDERS);
            if (set_real(component, &input, 1, values) > WARNING) return i;
            if (set_derivatives(component, inputs, ORDERS, orders, values + 1) > WARNING) return i;
        }
        if (do_step(component, times[i], times[i + 1] - times[i], 1) > WARNING) return i;
        if (get_real(component, outputs, width, rows + i * width) > WARNING) return i;
    }
    return steps;
}
