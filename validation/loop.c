/* Each method with a held torque, as one would write it for one pendulum alone; what they take is in loops.py. */

#include <math.h>

#define LOOP(name)                                                                                                     \
    double name(double drive, double damping_rate, double w02, double phi, double w, double h, int n);                 \
    double name(double drive, double damping_rate, double w02, double phi, double w, double h, int n)

LOOP(explicit_euler) {
    for (int i = 0; i < n; i++) {
        const double a = drive - damping_rate * w - w02 * sin(phi);
        phi += h * w;
        w += h * a;
    }
    return phi;
}

LOOP(explicit_midpoint2) {
    const double half = h / 2;
    for (int i = 0; i < n; i++) {
        const double a1 = drive - damping_rate * w - w02 * sin(phi);
        const double w2 = w + half * a1;
        const double a2 = drive - damping_rate * w2 - w02 * sin(phi + half * w);
        phi += h * w2;
        w += h * a2;
    }
    return phi;
}

LOOP(explicit_runge_kutta4) {
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

/* The root x of x + s*sin(x) = c, 0 <= s < 1, by Newton's method from x = c. */
static inline double kepler(double s, double c) {
    double x = c;
    for (;;) {
        const double before = x, slope = 1 + s * cos(x);
        const double correction = ((x - c) + s * sin(x)) / slope;
        x -= correction;
        /* What is left is a quarter of an ulp or less. */
        if (s * correction * correction <= 0x1p-54 * slope * fabs(x) || x == before) return x;
    }
}

LOOP(implicit_euler) {
    const double denominator = 1 + h * damping_rate;
    const double kick = h * w02 / denominator, push = h * drive, s = h * kick;
    for (int i = 0; i < n; i++) {
        const double v = (w + push) / denominator;
        phi = kepler(s, phi + h * v);
        w = v - kick * sin(phi);
    }
    return phi;
}

/* The sine of the end is that of the next beginning. */
LOOP(implicit_trapezoid) {
    const double b = h / 2, denominator = 1 + b * damping_rate;
    const double kick = b * w02 / denominator, push = b * drive, s = b * kick;
    double change = b * (drive - damping_rate * w - w02 * sin(phi)); /* of w by half a step */
    for (int i = 0; i < n; i++) {
        const double middle = w + change;
        const double v = (middle + push) / denominator;
        phi = kepler(s, phi + b * w + b * v);
        w = v - kick * sin(phi);
        change = w - middle;
    }
    return phi;
}

/* The trapezoidal rule to (2 - sqrt(2))*h, and Gear's formula to h. */
LOOP(tr_bdf2) {
    const double diagonal = 1 / (2 + sqrt(2)), weight = sqrt(2) / 4;
    const double b = h * diagonal, weight_h = h * weight, kicks = weight / diagonal;
    const double denominator = 1 + b * damping_rate;
    const double kick = b * w02 / denominator, push = b * drive, s = b * kick;
    double kick0 = b * (drive - damping_rate * w - w02 * sin(phi));
    for (int i = 0; i < n; i++) {
        const double middle = w + kick0;
        double v = (middle + push) / denominator;
        const double w1 = v - kick * sin(kepler(s, phi + b * w + b * v));
        const double known = w + kicks * kick0 + kicks * (w1 - middle);
        v = (known + push) / denominator;
        phi = kepler(s, phi + weight_h * w + weight_h * w1 + b * v);
        w = v - kick * sin(phi);
        kick0 = w - known;
    }
    return phi;
}

/* Hairer, Wanner II, eq. (IV.6.16). */
LOOP(sdirk4) {
    const double b = h / 4, denominator = 1 + b * damping_rate;
    const double kick = b * w02 / denominator, push = b * drive, s = b * kick;
    const double h10 = h * (1.0 / 2);
    const double h20 = h * (17.0 / 50), h21 = h * (-1.0 / 25);
    const double h30 = h * (371.0 / 1360), h31 = h * (-137.0 / 2720), h32 = h * (15.0 / 544);
    const double h40 = h * (25.0 / 24), h41 = h * (-49.0 / 48), h42 = h * (125.0 / 16), h43 = h * (-85.0 / 12);
    const double k20 = 34.0 / 25, k21 = -4.0 / 25;
    const double k30 = 371.0 / 340, k31 = -137.0 / 680, k32 = 15.0 / 136;
    const double k40 = 25.0 / 6, k41 = -49.0 / 12, k42 = 125.0 / 4, k43 = -85.0 / 3;
    for (int i = 0; i < n; i++) {
        double v = (w + push) / denominator;
        const double w0 = v - kick * sin(kepler(s, phi + b * v));
        const double kick0 = w0 - w;
        double before = w + 2 * kick0;
        v = (before + push) / denominator;
        const double w1 = v - kick * sin(kepler(s, phi + h10 * w0 + b * v));
        const double kick1 = w1 - before;
        before = w + k20 * kick0 + k21 * kick1;
        v = (before + push) / denominator;
        const double w2 = v - kick * sin(kepler(s, phi + h20 * w0 + h21 * w1 + b * v));
        const double kick2 = w2 - before;
        before = w + k30 * kick0 + k31 * kick1 + k32 * kick2;
        v = (before + push) / denominator;
        const double w3 = v - kick * sin(kepler(s, phi + h30 * w0 + h31 * w1 + h32 * w2 + b * v));
        const double kick3 = w3 - before;
        v = (w + k40 * kick0 + k41 * kick1 + k42 * kick2 + k43 * kick3 + push) / denominator;
        phi = kepler(s, phi + h40 * w0 + h41 * w1 + h42 * w2 + h43 * w3 + b * v);
        w = v - kick * sin(phi);
    }
    return phi;
}

/* The Taylor series of phi, w, sin(phi) and cos(phi), each term with its power of h. */
LOOP(taylor_series) {
    enum { ORDER = 16 };

    double rates[ORDER + 1], sines[ORDER + 1], cosines[ORDER + 1];
    for (int i = 0; i < n; i++) {
        rates[0] = w;
        sines[0] = sin(phi);
        cosines[0] = cos(phi);
        for (int k = 0; k < ORDER; k++) {
            const double ratio = h / (k + 1);
            double sine = 0, cosine = 0;
            for (int j = 0; j <= k; j++) {
                sine += rates[j] * cosines[k - j];
                cosine += rates[j] * sines[k - j];
            }
            phi += ratio * rates[k];
            rates[k + 1] = ratio * ((k == 0 ? drive : 0) - damping_rate * rates[k] - w02 * sines[k]);
            sines[k + 1] = ratio * sine;
            cosines[k + 1] = -ratio * cosine;
        }
        w = 0;
        for (int k = ORDER; k >= 0; k--)
            w += rates[k];
    }
    return phi;
}
