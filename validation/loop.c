/* The arithmetic of ExplicitRungeKutta4 with a held torque, as one would write it for one pendulum alone. */

#include <math.h>

double loop(double drive, double damping_rate, double w02, double phi, double w, double h, int n);

double loop(double drive, double damping_rate, double w02, double phi, double w, double h, int n) {
    const double half = h / 2, sixth = h / 6, half_half = half * half, half_h = half * h, sixth_h = sixth * h;
    for (int i = 0; i < n; i++) {
        const double middle = phi + half * w, end = phi + h * w;
        const double a1 = drive - damping_rate * w - w02 * sin(phi);
        const double a2 = drive - damping_rate * (w + half * a1) - w02 * sin(middle);
        const double a3 = drive - damping_rate * (w + half * a2) - w02 * sin(middle + half_half * a1);
        const double a4 = drive - damping_rate * (w + h * a3) - w02 * sin(end + half_h * a2);
        const double a23 = a2 + a3, a123 = a1 + a23;
        phi = end + sixth_h * a123;
        w += sixth * (a123 + a23 + a4);
    }
    return phi;
}
