/* The damped pendulum: motion, energy, methods. damped_pendulum/model.py and solvers.py are the specification: the
 * order of the operations is theirs, so that the results are the same bits.
 *
 *     J*der(w) = tau - gamma*L^2*w - m*g*L*sin(phi),   der(phi) = w,   J = m*L^2
 *
 * phi [rad] counts from the downward vertical; w [rad/s]; t [s] counts from the beginning of a communication step. */
#ifndef PENDULUM_H
#define PENDULUM_H

#include <stdint.h>
#include "interface.h"

typedef struct {
    double m, L, g;                    /* mass [kg], length [m], gravity [m/s2] */
    double damping_rate, w02;          /* gamma/m [1/s], g/L [rad/s2] */
    double drive[MAX_INPUT_ORDER + 1]; /* tau/J as a polynomial in t: its coefficients [rad/s2, rad/s3, ...] */
    int order;                         /* of the polynomial; 0: the torque is held */
    Method method;                     /* of integration */
} Pendulum;

/* The pendulum of the variables `values`; the torque has the `derivatives` of order 1, 2, ... [N.m/s, N.m/s2, ...]. */
static Pendulum pendulum(const double values[VARIABLE_COUNT], const double derivatives[MAX_INPUT_ORDER]);

/* Moment of inertia m*L^2 about the pivot [kg.m2]. */
static double moment_of_inertia(double m, double L);

/* der(w) [rad/s2]. */
static double acceleration(const Pendulum *p, double t, double phi, double w);

/* Mechanical energy [J], 0 at rest in the lowest point. */
static double energy(double m, double L, double g, double phi, double w);

/* First or second derivative of `output` (phi, w, a, E) with respect to time. */
static double time_derivative(const Pendulum *p, double t, double phi, double w, int output, int order);

/* Partial derivative of `output` (phi, w, a, E) at t = 0 with respect to `known`: phi, w, tau or a parameter, phi and w
 * being then the start values. */
static double partial_derivative(const Pendulum *p, double phi, double w, int output, int known);

/* Integrate over the substeps first, ..., first + n - 1 of h [s] while the state is finite; return the evaluations. */
static int64_t integrate(const Pendulum *p, double *phi, double *w, double h, int64_t first, int64_t n);

/* Largest substep [s] that is stable for small swings; 0: none is, INFINITY: every one is. */
static double stability_limit(const Pendulum *p);

/* Substep [s] below which the equation of a substep has a single root; INFINITY for the explicit methods. */
static double unique_root_limit(const Pendulum *p);

/* The rounding noise [s] in a communication step of `duration` [s] from `time` [s]: importers form it as a difference. */
static double clock_noise(double time, double duration);

/* Number of equal substeps, none longer than max_step [s] but for that noise; a whole number up to MAX_SUBSTEPS. */
static double substeps(double time, double duration, double max_step);

#endif
