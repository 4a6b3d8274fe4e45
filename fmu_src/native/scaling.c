#include "scaling.h"

#include <math.h>

static inline Split split(double value) {
    Split parts = {value, 0};
    if (isfinite(value)) parts.mantissa = frexp(value, &parts.power);
    return parts;
}

static inline double product(const double factors[], int count) {
    double mantissa = 1.0;
    int power = 0;
    for (int i = 0; i < count; i++) {
        const Split factor = split(factors[i]);
        mantissa *= factor.mantissa;
        power += factor.power;
    }
    return ldexp(mantissa, power);
}
