/* Makes calls that are refused, and some that are not, in a host of a certain condition; prints what was logged.
 *
 *     native_strange_host MASS DRAG A plain | stack | traps | upward | downward | towardzero | locale
 *
 * MASS, DRAG, A: the names of the parameters and the output of A = -DRAG/MASS*v + ... Conditions: stack: in a thread
 * with a stack of 32 KiB; traps: floating-point exceptions are signals; upward, ...: the rounding mode; locale: that of
 * the environment. Exit status 1 if a call returns what it should not. */

#define _GNU_SOURCE
#include <fenv.h>
#include <locale.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"
#include "interface.h"

static char logged[1 << 16];
static fmi2ValueReference mass, drag, a;

/* Without printf, which may need more stack than the FMU. */
static void logger(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                   fmi2String message, ...) {
    (void)environment;
    (void)name;
    (void)status;
    strcat(strcat(strcat(strcat(logged, category), ": "), message), "\n");
}

static const fmi2CallbackFunctions CALLBACKS = {logger, calloc, free, NULL, NULL};

static void expect(int right, const char *what) {
    if (right) return;
    fputs(what, stderr);
    exit(1);
}

static fmi2ValueReference reference_of(const char *name) {
    fmi2ValueReference vr = 0;
    while (strcmp(VARIABLES[vr].name, name) != 0)
        expect(++vr < VARIABLE_COUNT, "no such variable");
    return vr;
}

static fmi2Component new_instance(const char *name) {
    fmi2Component c = fmi2Instantiate(name, fmi2CoSimulation, MODEL_GUID, "", &CALLBACKS, fmi2False, fmi2True);
    expect(c != NULL, "no instance");
    return c;
}

static void set(fmi2Component c, fmi2ValueReference vr, double value) {
    expect(fmi2SetReal(c, &vr, 1, &value) == fmi2OK, "set");
}

static double get(fmi2Component c, fmi2ValueReference vr) {
    double value;
    expect(fmi2GetReal(c, &vr, 1, &value) == fmi2OK, "get");
    return value;
}

/* Read all Reals, but for one. */
static void get_all_but(fmi2Component c, fmi2ValueReference left_out) {
    for (unsigned vr = 0; vr < VARIABLE_COUNT; vr++)
        if (VARIABLES[vr].type == REAL && vr != left_out) get(c, vr);
}

static void start(fmi2Component c, fmi2Status expected) {
    expect(fmi2EnterInitializationMode(c) == fmi2OK, "enter");
    expect(fmi2ExitInitializationMode(c) == expected, "exit");
}

/* Values are read before they are right: a mass of zero or one whose quotients overflow, no drag. */
static void read_early(void) {
    static const double masses[] = {0.0, 5e-324};
    for (int i = 0; i < 2; i++) {
        fmi2Component c = new_instance("early");
        set(c, mass, masses[i]);
        set(c, drag, 0.0);
        get_all_but(c, a);
        if (masses[i] == 0.0) {
            double value;
            expect(fmi2GetReal(c, &a, 1, &value) == fmi2Error, "a of no mass");
        }
        fmi2FreeInstance(c);
    }
}

/* A step, and refusals with numbers that have many digits or none of their own. */
static void refuse(void) {
    static const fmi2ValueReference method = VR_solver_method;
    static char name[1000];
    const fmi2Integer wrong = -7;
    memset(name, 'n', sizeof name - 1);
    fmi2Component c = new_instance(name);
    set(c, mass, -1.0 / 3.0);
    set(c, drag, -1e-300);
    set(c, VR_solver_stepSize, -5e-324);
    expect(fmi2SetInteger(c, &method, 1, &wrong) == fmi2OK, "method");
    start(c, fmi2Error);
    fmi2FreeInstance(c);

    c = new_instance("steps");
    set(c, drag, 0.1);
    set(c, VR_solver_stepSize, 1.1);
    expect(fmi2SetupExperiment(c, fmi2False, 0.0, 0.0, fmi2True, 2.1) == fmi2OK, "setup");
    start(c, fmi2Warning);
    expect(fmi2DoStep(c, 0.0, 0.1, fmi2True) == fmi2OK, "step");
    get_all_but(c, VARIABLE_COUNT);
    expect(fmi2DoStep(c, 0.1, 2.3, fmi2True) == fmi2Error, "step beyond the end");
    expect(fmi2DoStep(c, 0.1, -0.7, fmi2True) == fmi2Error, "step back");
    static char bytes[4096];
    fmi2FMUstate state = NULL;
    size_t size;
    expect(fmi2GetFMUstate(c, &state) == fmi2OK, "state");
    expect(fmi2SerializedFMUstateSize(c, state, &size) == fmi2OK && size <= sizeof bytes, "size");
    expect(fmi2SerializeFMUstate(c, state, bytes, size) == fmi2OK, "bytes");
    bytes[100] ^= 1;
    fmi2FMUstate refused = NULL;
    expect(fmi2DeSerializeFMUstate(c, bytes, size, &refused) == fmi2Error, "damaged bytes");
    expect(fmi2SetFMUstate(c, state) == fmi2OK, "state again");
    expect(fmi2FreeFMUstate(c, &state) == fmi2OK, "free");
    fmi2FreeInstance(c);
}

static void diverge(void) {
    static const fmi2ValueReference method = VR_solver_method;
    const fmi2Integer euler = ExplicitEuler;
    fmi2Component c = new_instance("divergence");
    set(c, drag, 1e6);
    set(c, VR_solver_stepSize, 0.01);
    expect(fmi2SetInteger(c, &method, 1, &euler) == fmi2OK, "method");
    start(c, fmi2Warning);
    expect(fmi2DoStep(c, 0.0, 10.0, fmi2True) == fmi2Error, "divergence");
    fmi2FreeInstance(c);
}

static void *all(void *nothing) {
    read_early();
    refuse();
    diverge();
    return nothing;
}

static void in_small_thread(void) {
    pthread_attr_t attributes;
    pthread_t thread;
    expect(pthread_attr_init(&attributes) == 0, "attributes");
    expect(pthread_attr_setstacksize(&attributes, 32 * 1024) == 0, "stack size");
    expect(pthread_create(&thread, &attributes, all, NULL) == 0, "thread");
    expect(pthread_join(thread, NULL) == 0, "join");
}

int main(int argc, char *argv[]) {
    static const struct {
        const char *name;
        int mode;
    } roundings[] = {{"upward", FE_UPWARD}, {"downward", FE_DOWNWARD}, {"towardzero", FE_TOWARDZERO}};

    if (argc != 5) return 1;
    mass = reference_of(argv[1]);
    drag = reference_of(argv[2]);
    a = reference_of(argv[3]);
    const char *condition = argv[4];
    if (strcmp(condition, "plain") == 0) {
        all(NULL);
    } else if (strcmp(condition, "stack") == 0) {
        in_small_thread();
    } else if (strcmp(condition, "traps") == 0) {
        feenableexcept(FE_DIVBYZERO | FE_INVALID | FE_OVERFLOW);
        read_early();
        refuse();
    } else if (strcmp(condition, "locale") == 0) {
        expect(setlocale(LC_ALL, "") != NULL && *localeconv()->decimal_point == ',', "no locale with a comma");
        all(NULL);
    } else {
        for (size_t i = 0; i < sizeof roundings / sizeof *roundings; i++)
            if (strcmp(condition, roundings[i].name) == 0) fesetround(roundings[i].mode);
        refuse();
        expect(fegetround() != FE_TONEAREST, "the rounding mode is not what the host had");
    }
    fputs(logged, stdout);
    return 0;
}
