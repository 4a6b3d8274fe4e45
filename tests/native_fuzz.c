/* Calls the FMI functions in random order with random arguments, NULL and absurd ones included.
 *
 *     native_fuzz SEED CALLS
 *
 * Made to run under AddressSanitizer and UndefinedBehaviorSanitizer. Beyond what those find it checks that no call is
 * fatal, that x and v stay finite between steps, and that an error changes nothing that can be seen. Prints how often
 * each status came back. */

#include <float.h>
#include <math.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "fmi2Functions.h"
#include "interface.h"

enum { INSTANCES = 4, STATES = 4, MOST = 8, BYTES = 4096 };

enum { METHOD_COUNT = sizeof METHODS / sizeof *METHODS - 1 }; /* they count from 1 */

static fmi2ValueReference input, x; /* of the input and of the first output, which the other three Reals follow */

static uint64_t seed;
static fmi2Component instances[INSTANCES];
static fmi2FMUstate states[STATES];
static char bytes[BYTES];
static size_t size;
static long counts[6];

/* splitmix64 */
static uint64_t random_bits(void) {
    uint64_t z = (seed += UINT64_C(0x9e3779b97f4a7c15));
    z = (z ^ (z >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94d049bb133111eb);
    return z ^ (z >> 31);
}

static unsigned below(unsigned n) {
    return (unsigned)(random_bits() % n);
}

static double random_real(void) {
    static const double special[] = {0.0,       -0.0,    1.0,      -1.0,    1e-3,   10.0,  NAN,    INFINITY,
                                     -INFINITY, DBL_MAX, -DBL_MAX, DBL_MIN, 5e-324, 1e300, 1e-300, 1e6};
    if (below(4) == 0) return special[below(sizeof special / sizeof *special)];
    if (below(8) == 0) {
        const uint64_t bits = random_bits();
        double value;
        memcpy(&value, &bits, sizeof value);
        return value;
    }
    return 20.0 * (double)below(1u << 30) / (1u << 30) - 5.0;
}

/* A communication step [s]: short, so that it does not take minutes, or refused. */
static double random_step(void) {
    static const double special[] = {0.0, -1.0, 5e-324, 1e300, NAN, INFINITY};
    return below(4) ? 0.02 * (1 + below(4)) : special[below(6)];
}

static int32_t random_integer(void) {
    return below(3) ? (int32_t)below(8) - 1 : (int32_t)random_bits();
}

/* Mostly a count that fits, else one that no array has. */
static size_t random_count(void) {
    static const size_t absurd[] = {SIZE_MAX, SIZE_MAX / 2, (size_t)1 << 32, (size_t)1 << 20};
    return below(20) ? below(MOST + 1) : absurd[below(4)];
}

static void *or_null(void *pointer) {
    return below(20) ? pointer : NULL;
}

static void logger(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                   fmi2String message, ...) {
    char text[2048];
    va_list arguments;
    va_start(arguments, message);
    vsnprintf(text, sizeof text, message, arguments);
    va_end(arguments);
    if (environment != &seed || name == NULL || *category == '\0' || *text == '\0' || status == fmi2OK) abort();
}

static void instantiate(fmi2Component *place) {
    const fmi2CallbackFunctions with = {logger, calloc, free, NULL, &seed};
    const fmi2CallbackFunctions without = {NULL, NULL, NULL, NULL, NULL};
    fmi2FreeInstance(*place);
    const char *wrong_name = below(2) ? "" : NULL;
    const char *wrong_guid = below(2) ? "%s%n" : NULL;
    const char *name = below(20) ? "%s%n fuzz" : wrong_name;
    const char *guid = below(20) ? MODEL_GUID : wrong_guid;
    const fmi2CallbackFunctions *callbacks = below(20) ? &with : &without;
    if (below(20) == 0) callbacks = NULL;
    *place =
        fmi2Instantiate(name, (fmi2Type)(below(20) != 0), guid, or_null("file:///%s"), callbacks, fmi2False, fmi2True);
}

static void corrupt(void) {
    if (size == 0) return;
    if (below(2)) {
        bytes[below((unsigned)size)] ^= (char)(1u << below(8));
    } else {
        size = below(BYTES);
    }
}

/* What can be seen of an instance. */
typedef struct {
    double reals[4];
    fmi2Integer integers[2];
} View;

static View look(fmi2Component c) {
    const fmi2ValueReference reals[] = {x, x + 1, 0, input};
    static const fmi2ValueReference integers[] = {VR_solver_nfev, VR_solver_method};
    View view;
    memset(&view, 0, sizeof view);
    if (c != NULL &&
        (fmi2GetReal(c, reals, 4, view.reals) != fmi2OK || fmi2GetInteger(c, integers, 2, view.integers) != fmi2OK))
        abort();
    return view;
}

/* Directional derivatives in Initialization Mode, which other calls seldom leave an instance in. */
static fmi2Status start_of_derivatives(fmi2Component c, const fmi2ValueReference known[],
                                       const fmi2ValueReference unknown[], const fmi2Real direction[],
                                       fmi2Real values[]) {
    fmi2Reset(c);
    for (int i = 0; i < MOST; i++) {
        const double value = random_real();
        fmi2SetReal(c, &known[i], 1, &value);
    }
    fmi2EnterInitializationMode(c);
    const fmi2Status status = fmi2GetDirectionalDerivative(c, unknown, MOST, known, MOST, direction, values);
    for (int i = 0; i < MOST; i++)
        if (status == fmi2OK ? !isfinite(values[i]) : values[i] != 0.0) abort();
    fmi2Reset(c);
    return fmi2OK;
}

static fmi2Status call(fmi2Component c, unsigned function) {
    fmi2ValueReference vr[MOST], known[MOST];
    fmi2Real reals[MOST], more[MOST];
    fmi2Integer integers[MOST], orders[MOST];
    fmi2Boolean booleans[MOST] = {0};
    fmi2String strings[MOST] = {"a", "b", "c", "d", "e", "f", "g", "h"};
    static const fmi2String known_categories[] = {"logStatusWarning", "logStatusDiscard", "logStatusError"};
    fmi2String categories[MOST];
    for (int i = 0; i < MOST; i++) {
        vr[i] = below(16) ? below(VARIABLE_COUNT + 1) : (fmi2ValueReference)random_bits();
        known[i] = below(4) ? input + below(3) : below(VARIABLE_COUNT + 2);
        reals[i] = random_real();
        more[i] = 0.0;
        integers[i] = random_integer();
        categories[i] = below(20) ? known_categories[below(3)] : below(2) ? "%s#" : NULL;
        orders[i] = below(4) ? 1 + (fmi2Integer)below(3) : random_integer();
    }
    if (below(2)) vr[0] = known[0] = input;
    if (below(2)) {
        for (int i = 0; i < MOST; i++) {
            vr[i] = x + below(4);
            if (below(2)) known[i] = below(input + 1);
        }
    }
    const size_t n = below(3) ? 1 : random_count();
    fmi2FMUstate *state = &states[below(STATES)];
    fmi2Status status;
    double end;
    size_t needed;
    switch (function) {
    case 0: return fmi2SetDebugLogging(c, (fmi2Boolean)below(2), n, or_null(categories));
    case 1:
        end = random_real();
        return fmi2SetupExperiment(c, fmi2True, random_real(), below(4) ? 0.0 : random_real(), below(4) == 0, end);
    case 2: return fmi2EnterInitializationMode(c);
    case 3: return fmi2ExitInitializationMode(c);
    case 4: return below(50) ? fmi2OK : fmi2Terminate(c);
    case 5: return below(20) ? fmi2OK : fmi2Reset(c);
    case 6: return fmi2GetReal(c, or_null(vr), n, or_null(reals));
    case 7: return fmi2GetInteger(c, or_null(vr), n, or_null(integers));
    case 8: return fmi2GetBoolean(c, or_null(vr), n, or_null(booleans));
    case 9: return fmi2GetString(c, or_null(vr), n, or_null(strings));
    case 10: return fmi2SetReal(c, or_null(vr), n, or_null(reals));
    case 11: return fmi2SetInteger(c, or_null(vr), n, or_null(integers));
    case 12: return fmi2SetBoolean(c, or_null(vr), n, or_null(booleans));
    case 13: return fmi2SetString(c, or_null(vr), n, or_null(strings));
    case 14: return fmi2SetRealInputDerivatives(c, or_null(vr), n, or_null(orders), or_null(reals));
    case 15: return fmi2GetRealOutputDerivatives(c, or_null(known), n, or_null(orders), or_null(reals));
    case 16: return fmi2GetDirectionalDerivative(c, or_null(vr), n, or_null(known), n, or_null(reals), or_null(more));
    case 17: return fmi2GetFMUstate(c, or_null(state));
    case 18: return fmi2SetFMUstate(c, *state);
    case 19: return fmi2FreeFMUstate(c, or_null(state));
    case 20: return fmi2SerializedFMUstateSize(c, *state, or_null(&needed));
    case 21:
        status = fmi2SerializeFMUstate(c, *state, or_null(bytes), below(4) ? BYTES : below(BYTES));
        if (status == fmi2OK && fmi2SerializedFMUstateSize(c, *state, &size) != fmi2OK) abort();
        return status;
    case 22: {
        corrupt();
        return fmi2OK;
    }
    case 23: {
        fmi2FMUstate new = below(2) ? *state : (fmi2FMUstate)&bytes[below(BYTES)];
        const fmi2FMUstate held = new;
        status = fmi2DeSerializeFMUstate(c, or_null(bytes), size, or_null(&new));
        if (status == fmi2OK) {
            if (new == held) abort();
            free(*state);
            *state = new;
        } else if (new != held) {
            abort();
        }
        return status;
    }
    case 24: return fmi2CancelStep(c);
    case 25: return fmi2GetStatus(c, (fmi2StatusKind)below(5), or_null(&status));
    case 26: return fmi2GetRealStatus(c, (fmi2StatusKind)below(5), or_null(&end));
    case 27: return fmi2GetIntegerStatus(c, (fmi2StatusKind)below(5), or_null(integers));
    case 28: return fmi2GetBooleanStatus(c, (fmi2StatusKind)below(5), or_null(booleans));
    case 29: return fmi2GetStringStatus(c, (fmi2StatusKind)below(5), or_null(strings));
    case 30: return start_of_derivatives(c, known, vr, reals, more);
    default: return fmi2DoStep(c, random_real(), random_step(), fmi2True);
    }
}

/* Bring an instance to where steps are possible. */
static void start(fmi2Component c) {
    const fmi2ValueReference step_size = VR_solver_stepSize, method = VR_solver_method;
    const double h = 1e-3;
    const fmi2Integer number = 1 + (fmi2Integer)below(METHOD_COUNT);
    fmi2Reset(c);
    fmi2SetReal(c, &step_size, 1, &h);
    fmi2SetInteger(c, &method, 1, &number);
    fmi2EnterInitializationMode(c);
    counts[fmi2ExitInitializationMode(c)]++;
}

int main(int argc, char *argv[]) {
    if (argc != 3) return 1;
    seed = strtoull(argv[1], NULL, 10);
    const long calls = strtol(argv[2], NULL, 10);
    while (VARIABLES[input].causality != INPUT)
        input++;
    while (VARIABLES[x].causality != OUTPUT)
        x++;
    for (long i = 0; i < calls; i++) {
        const unsigned which = below(INSTANCES);
        if (instances[which] == NULL || below(200) == 0) instantiate(&instances[which]);
        fmi2Component c = below(50) ? instances[which] : NULL;
        if (c != NULL && below(30) == 0) start(c);
        const View before = look(c);
        const fmi2Status status = call(c, below(40));
        const View after = look(c);
        if (status < fmi2OK || status > fmi2Error) abort();
        if (status == fmi2Error && memcmp(&before, &after, sizeof before) != 0) abort();
        if (c == NULL && status == fmi2Warning) abort();
        counts[status]++;
    }
    for (int i = 0; i < STATES; i++)
        free(states[i]);
    for (int i = 0; i < INSTANCES; i++)
        fmi2FreeInstance(instances[i]);
    printf("ok %ld, warning %ld, discard %ld, error %ld\n", counts[0], counts[1], counts[2], counts[3]);
    return 0;
}
