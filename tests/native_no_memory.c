/* Instantiates where calloc has no memory: compiled, as the sources are, with -Dcalloc=failing_calloc. */

#include <stdio.h>
#include <stdlib.h>

#include "fmi2Functions.h"
#include "interface.h"

void *failing_calloc(size_t count, size_t size) {
    (void)count;
    (void)size;
    return NULL;
}

static void logger(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                   fmi2String message, ...) {
    (void)environment;
    printf("%s %d %s %s\n", name, (int)status, category, message);
}

int main(void) {
    const fmi2CallbackFunctions with = {logger, NULL, free, NULL, NULL};
    const fmi2CallbackFunctions without = {NULL, NULL, free, NULL, NULL};
    const fmi2CallbackFunctions *all[] = {&with, &without, NULL};
    for (int i = 0; i < 3; i++)
        if (fmi2Instantiate("poor", fmi2CoSimulation, MODEL_GUID, "", all[i], fmi2False, fmi2False) != NULL) return 1;
    return 0;
}
