/* All of the FMU in one translation unit: its functions are static, so that sources of several FMUs can be linked into
 * one program. Compiled with -DFMI2_OVERRIDE_FUNCTION_PREFIX, as for a shared library, the FMI functions have no prefix. */

#if !defined FMI2_FUNCTION_PREFIX && !defined FMI2_OVERRIDE_FUNCTION_PREFIX
#define FMI2_FUNCTION_PREFIX DampedPendulumNative_
#endif

#if defined __FAST_MATH__ || defined _M_FP_FAST || (defined __FINITE_MATH_ONLY__ && __FINITE_MATH_ONLY__ > 0)
#error "without -ffast-math, -Ofast, /fp:fast: those take out the tests for NaN and infinity, and change the results"
#endif

#include "text.c"
#include "pendulum.c"
#include "model.c"
#include "fmi2.c"
