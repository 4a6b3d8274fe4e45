/* Solves implicit stages in the model's way and by the Newton's method that is given to models, and prints the largest
 * differences: of x and v, in units of the last place of the numbers that they are made of, and the most evaluations.
 *
 *     native_stage SEED STAGES
 *
 * Includes all of the FMU, to reach functions that are static. */

#include "all.c"

#include <stdio.h>

static uint64_t seed;

/* splitmix64, as a number in 0 to 1 */
static double fraction(void) {
    uint64_t z = (seed += UINT64_C(0x9e3779b97f4a7c15));
    z = (z ^ (z >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94d049bb133111eb);
    return (double)((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

int main(int argc, char *argv[]) {
    if (argc != 3) return 1;
    seed = strtoull(argv[1], NULL, 10);
    double worst = 0.0;
    int64_t most = 0;
    for (int i = atoi(argv[2]); i > 0; i--) {
        double values[VARIABLE_COUNT] = {0.0};
        values[VR_m] = 1.0;
        values[VR_L] = exp(4.0 * fraction() - 2.0);
        values[VR_g] = 40.0 * fraction() - 20.0;
        values[VR_gamma] = 10.0 * fraction();
        const Model model = model_of(values);
        const double b = 0.9 * fraction() * model_longest_implicit_stage(&model);
        const double drive = 20.0 * fraction() - 10.0;
        const double x_before = 20.0 * fraction() - 10.0;
        const double v_before = 20.0 * fraction() - 10.0;
        double x[2] = {x_before, x_before};
        double v[2] = {v_before, v_before};
        model_implicit_stage(&model, b, drive, &x[0], &v[0]);
        const int64_t evaluations = newton_stage(&model, b, drive, &x[1], &v[1]);
        const double rate = fabs(v_before) + b * (fabs(drive) + fabs(model.w02) + model.damping_rate * fabs(v[0]));
        worst = fmax(worst, fabs(v[1] - v[0]) / (DBL_EPSILON * rate));
        worst = fmax(worst, fabs(x[1] - x[0]) / (DBL_EPSILON * (fabs(x_before) + b * rate)));
        if (!isfinite(x[1]) || !isfinite(v[1])) return 1;
        if (evaluations > most) most = evaluations;
    }
    printf("%.1f %d\n", worst, (int)most);
    return 0;
}
