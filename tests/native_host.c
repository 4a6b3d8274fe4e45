/* Loads a FMU's shared library, runs the default experiment and prints the final angle [rad] with 17 digits.
 *
 *     native_host LIBRARY GUID VALUE_REFERENCE_OF_PHI
 *
 * Exit status 1 if anything fails, or if the process has loaded Python. */

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "fmi2Functions.h"
#include "native_load.h"

static void logger(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                   fmi2String message, ...) {
    va_list arguments;
    (void)environment;
    fprintf(stderr, "%s: status %d, %s: ", name, (int)status, category);
    va_start(arguments, message);
    vfprintf(stderr, message, arguments);
    va_end(arguments);
    fputc('\n', stderr);
}

static int maps_contain(const char *word) {
    char line[4096];
    int found = 0;
    FILE *maps = fopen("/proc/self/maps", "r");
    while (maps != NULL && fgets(line, sizeof line, maps) != NULL)
        found |= strstr(line, word) != NULL;
    if (maps != NULL) fclose(maps);
    return found;
}

int main(int argc, char *argv[]) {
    if (argc != 4) return 1;
    fmi2InstantiateTYPE *instantiate;
    fmi2SetupExperimentTYPE *setup;
    fmi2EnterInitializationModeTYPE *enter;
    fmi2ExitInitializationModeTYPE *leave;
    fmi2DoStepTYPE *do_step;
    fmi2GetRealTYPE *get_real;
    fmi2TerminateTYPE *terminate;
    fmi2FreeInstanceTYPE *free_instance;
    const Function functions[] = {
        {"fmi2Instantiate", &instantiate},
        {"fmi2SetupExperiment", &setup},
        {"fmi2EnterInitializationMode", &enter},
        {"fmi2ExitInitializationMode", &leave},
        {"fmi2DoStep", &do_step},
        {"fmi2GetReal", &get_real},
        {"fmi2Terminate", &terminate},
        {"fmi2FreeInstance", &free_instance},
    };
    void *library = load(argv[1], functions, sizeof functions / sizeof *functions);
    if (library == NULL) return 1;
    const fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, NULL};
    const double stop = 10.0, step = 0.01;
    const int steps = 1000;
    fmi2Component c = instantiate("host", fmi2CoSimulation, argv[2], "no-uri: %s%n", &callbacks, fmi2False, fmi2True);
    if (c == NULL || setup(c, fmi2False, 0.0, 0.0, fmi2True, stop) != fmi2OK || enter(c) != fmi2OK ||
        leave(c) != fmi2OK)
        return 1;
    for (int i = 0; i < steps; i++)
        if (do_step(c, i * step, step, fmi2True) != fmi2OK) return 1;
    const fmi2ValueReference phi_reference = (fmi2ValueReference)atoi(argv[3]);
    double phi;
    if (get_real(c, &phi_reference, 1, &phi) != fmi2OK || terminate(c) != fmi2OK) return 1;
    free_instance(c);
    if (maps_contain("libpython")) {
        fprintf(stderr, "Python is loaded\n");
        return 1;
    }
    CLOSE(library);
    printf("phi %.17g\n", phi);
    return 0;
}
