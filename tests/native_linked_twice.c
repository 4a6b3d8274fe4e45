/* Links the sources twice, as A_ and B_, with functions of its own that are named like some in them. */

#include <stdio.h>

#include "fmi2FunctionTypes.h"
#include "interface.h"

fmi2GetVersionTYPE A_fmi2GetVersion, B_fmi2GetVersion;
fmi2InstantiateTYPE A_fmi2Instantiate, B_fmi2Instantiate;
fmi2FreeInstanceTYPE A_fmi2FreeInstance, B_fmi2FreeInstance;

double energy(void);
double acceleration(void);
int integrate(void);
int pendulum(void);
int get(void);
int tell(void);

double energy(void) {
    return 1.0;
}

double acceleration(void) {
    return 2.0;
}

int integrate(void) {
    return 3;
}

int pendulum(void) {
    return 4;
}

int get(void) {
    return 5;
}

int tell(void) {
    return 6;
}

int main(void) {
    fmi2Component a = A_fmi2Instantiate("a", fmi2CoSimulation, MODEL_GUID, "", NULL, fmi2False, fmi2False);
    fmi2Component b = B_fmi2Instantiate("b", fmi2CoSimulation, MODEL_GUID, "", NULL, fmi2False, fmi2False);
    if (a == NULL || b == NULL) return 1;
    A_fmi2FreeInstance(a);
    B_fmi2FreeInstance(b);
    printf("%s %s %g\n", A_fmi2GetVersion(), B_fmi2GetVersion(),
           energy() + acceleration() + integrate() + pendulum() + get() + tell());
    return 0;
}
