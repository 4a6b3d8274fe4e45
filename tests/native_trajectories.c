/* Prints runs of a FMU's shared library with 17 digits, so that those of two machines can be compared.
 *
 *     native_trajectories LIBRARY GUID
 *
 * Each method moves the default pendulum freely and under a torque. In the middle of a run its state goes through bytes
 * and back, past a step that it undoes. A line: method, driven or not, step, phi, w, a, E, evaluations. */

#include <dlfcn.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

enum { PHI_START = 4, METHOD = 6, STEP_SIZE = 7, TAU = 8, PHI = 9, NFEV = 13 }; /* value references */

enum { METHODS = 8, TAYLOR = 8, OUTPUTS = 4, STEPS = 200 };

static fmi2InstantiateTYPE *instantiate;
static fmi2FreeInstanceTYPE *free_instance;
static fmi2SetupExperimentTYPE *set_up;
static fmi2EnterInitializationModeTYPE *enter;
static fmi2ExitInitializationModeTYPE *leave;
static fmi2GetRealTYPE *get_real;
static fmi2GetIntegerTYPE *get_integer;
static fmi2SetRealTYPE *set_real;
static fmi2SetIntegerTYPE *set_integer;
static fmi2DoStepTYPE *do_step;
static fmi2GetFMUstateTYPE *get_state;
static fmi2SetFMUstateTYPE *set_state;
static fmi2FreeFMUstateTYPE *free_state;
static fmi2SerializedFMUstateSizeTYPE *state_size;
static fmi2SerializeFMUstateTYPE *serialize;
static fmi2DeSerializeFMUstateTYPE *deserialize;

static const struct {
    const char *name;
    void *function;
} FUNCTIONS[] = {
    {"fmi2Instantiate", &instantiate},      {"fmi2FreeInstance", &free_instance},
    {"fmi2SetupExperiment", &set_up},       {"fmi2EnterInitializationMode", &enter},
    {"fmi2ExitInitializationMode", &leave}, {"fmi2GetReal", &get_real},
    {"fmi2GetInteger", &get_integer},       {"fmi2SetReal", &set_real},
    {"fmi2SetInteger", &set_integer},       {"fmi2DoStep", &do_step},
    {"fmi2GetFMUstate", &get_state},        {"fmi2SetFMUstate", &set_state},
    {"fmi2FreeFMUstate", &free_state},      {"fmi2SerializedFMUstateSize", &state_size},
    {"fmi2SerializeFMUstate", &serialize},  {"fmi2DeSerializeFMUstate", &deserialize},
};

static const double STEP = 0.05;

static void logger(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                   fmi2String message, ...) {
    (void)environment, (void)name, (void)status, (void)category;
    fprintf(stderr, "%s\n", message);
}

static bool set(fmi2Component c, fmi2ValueReference reference, double value) {
    return set_real(c, &reference, 1, &value) == fmi2OK;
}

static bool print_outputs(fmi2Component c, int method, bool driven, int step) {
    const fmi2ValueReference references[OUTPUTS] = {PHI, PHI + 1, PHI + 2, PHI + 3};
    const fmi2ValueReference evaluations = NFEV;
    fmi2Real values[OUTPUTS];
    fmi2Integer nfev;
    if (get_real(c, references, OUTPUTS, values) != fmi2OK || get_integer(c, &evaluations, 1, &nfev) != fmi2OK)
        return false;
    printf("%d %d %d %.17g %.17g %.17g %.17g %d\n", method, driven, step, values[0], values[1], values[2], values[3],
           nfev);
    return true;
}

/* Make a step that is undone by a state that went through bytes. */
static bool go_astray_and_back(fmi2Component c, double time) {
    fmi2FMUstate state = NULL;
    fmi2FMUstate copy = NULL;
    size_t size;
    if (get_state(c, &state) != fmi2OK || state_size(c, state, &size) != fmi2OK) return false;
    fmi2Byte *bytes = malloc(size);
    const bool done = bytes != NULL && serialize(c, state, bytes, size) == fmi2OK &&
                      deserialize(c, bytes, size, &copy) == fmi2OK && do_step(c, time, 3.0, fmi2False) == fmi2OK &&
                      set_state(c, copy) == fmi2OK && free_state(c, &state) == fmi2OK && free_state(c, &copy) == fmi2OK;
    free(bytes);
    return done;
}

static bool run(const char *guid, int method, bool driven) {
    const fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, NULL};
    const fmi2ValueReference reference = METHOD;
    fmi2Component c = instantiate("host", fmi2CoSimulation, guid, "", &callbacks, fmi2False, fmi2False);
    if (c == NULL || set_integer(c, &reference, 1, &method) != fmi2OK || !set(c, PHI_START, 2.0)) return false;
    if (method == TAYLOR && !set(c, STEP_SIZE, STEP)) return false;
    if (set_up(c, fmi2False, 0.0, 0.0, fmi2False, 0.0) != fmi2OK || enter(c) != fmi2OK || leave(c) > fmi2Warning)
        return false;
    for (int step = 0; step < STEPS; step++) {
        if (driven && !set(c, TAU, step % 7 - 3)) return false;
        if (step == STEPS / 2 && !go_astray_and_back(c, step * STEP)) return false;
        if (do_step(c, step * STEP, STEP, fmi2True) != fmi2OK || !print_outputs(c, method, driven, step)) return false;
    }
    free_instance(c);
    return true;
}

int main(int argc, char *argv[]) {
    if (argc != 3) return 1;
    void *library = dlopen(argv[1], RTLD_NOW | RTLD_LOCAL);
    if (library == NULL) return 1;
    for (size_t i = 0; i < sizeof FUNCTIONS / sizeof *FUNCTIONS; i++) {
        void *address = dlsym(library, FUNCTIONS[i].name);
        if (address == NULL) return 1;
        memcpy(FUNCTIONS[i].function, &address, sizeof address);
    }
    for (int method = 1; method <= METHODS; method++)
        if (!run(argv[2], method, false) || !run(argv[2], method, true)) return 1;
    dlclose(library);
    return 0;
}
