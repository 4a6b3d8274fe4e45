/* All of the FMU in one translation unit: its functions are static, so that sources of several FMUs can be linked into
 * one program. Compiled with -DFMI2_OVERRIDE_FUNCTION_PREFIX, as for a shared library, the FMI functions have no
 * prefix. */

#if defined __FAST_MATH__ || defined _M_FP_FAST || (defined __FINITE_MATH_ONLY__ && __FINITE_MATH_ONLY__ > 0)
#error "without -ffast-math, -Ofast, /fp:fast: those take out the tests for NaN and infinity, and change the results"
#endif

/* A fused multiply-add rounds once where Python rounds twice. */
#if defined __clang__
#pragma STDC FP_CONTRACT OFF
#elif defined __GNUC__
#pragma GCC optimize("fp-contract=off")
#elif defined _MSC_VER
#pragma fp_contract(off)
#endif

#include "interface.h"

#if !defined FMI2_FUNCTION_PREFIX && !defined FMI2_OVERRIDE_FUNCTION_PREFIX
#define FMI2_FUNCTION_PREFIX MODEL_PREFIX
#endif

/* What a file uses stands before it, so that the model is inlined into the loops of the methods. */
#include "text.c"
#include "scaling.c"
#include MODEL_FILE
#include "methods.c"
#include "simulation.c"
#include "fmi2.c"
