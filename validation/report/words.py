"""Words of the report that no study measures: the glossary, and which method is for which task."""

GLOSSARY = {
    "phi, w, a, E": "angle [rad], its rate [rad/s], its acceleration [rad/s2], mechanical energy [J]",
    "m, L, g, gamma": "mass of the bob, length of the rod, gravity acceleration, drag coefficient of the bob",
    "k2": "damping rate gamma/m [1/s] of phi'' + k2*phi' + w02*sin(phi) = drive",
    "w0, w02": "angular frequency of small swings, sqrt(g/L), and its square",
    "drive": "torque over the moment of inertia, tau/(m*L^2) [1/s2]",
    "alpha, k, k'": "amplitude, sin(alpha/2) and cos(alpha/2) of an undamped swing",
    "K, F, sn, cn, dn": "complete and incomplete elliptic integral of the first kind, and Jacobi's elliptic functions; "
    "DLMF 19 and 22",
    "AGM": "arithmetic-geometric mean: the common limit of the two means, taken again and again",
    "T": "period of an undamped swing; T0 = 2*pi/w0 for small ones",
    "critically damped": "k2 = 2*w0: with less drag a small swing oscillates, with more it creeps back (overdamped)",
    "nabla": "4*w02 - k2^2, above 0 for swings that oscillate",
    "separatrix": "the motion that just reaches the upright position; it separates swings from rotations",
    "h": "substep: the step of the integration method, bounded by solver.stepSize",
    "H": "communication step: the step of the importer, divided into equal substeps",
    "held input": "the torque is set at the beginning of a communication step and stays until its end",
    "image": "a held cosine contains other frequencies, w + 2*pi*j/H; they are its images",
    "chord, cubic": "line, and polynomial of degree 3, that stand for an input in a communication step",
    "order p": "errors at a fixed time fall like h^p",
    "tableau": "the coefficients A and b that define a Runge-Kutta method; a stage is one of its evaluations",
    "lambda, z": "lambda: rate of a small motion, exp(lambda*t); z = h*lambda",
    "R(z)": "stability function: a step multiplies y of y' = lambda*y by R(h*lambda); stable where |R| <= 1",
    "stiff": "part of the motion dies out much faster than the rest moves, here by strong drag",
    "L-stable": "stable at every step, and what dies out at once is ended at once: R(-infinity) = 0",
    "discrete motion": "what a method does to the pendulum by its tableau, computed apart from the FMU",
    "modified equation": "the differential equation whose exact solution the discrete motion is, as a series in h",
    "phase error, drift": "RK4's h^4 error shifts the phase; its h^5 error changes the energy, and so the period",
    "leading term, next term": "the first term of an error as a series in h, and the one after it",
    "round-off, ulp": "what comes of rounding each result to a double; an ulp is the distance of neighbouring doubles",
    "floor": "the error that is left when only round-off is",
    "radius of convergence": "the step at which the Taylor series of the motion stops to converge",
    "nfev": "evaluations of the acceleration",
    "native FMU": "DampedPendulumNative.fmu, the same model in C; the other one is written in Python",
    "rival": "another integrator that solves the same motion: SciPy's solve_ivp (RK45, DOP853, LSODA, Radau, BDF) and "
    "odeint; heyoka",
    "bare loop": "the substeps of a method written for this pendulum alone, without an FMU",
    "round": "one turn in which all that race are run once; times are medians of rounds",
    "interval": "of a median: holds the true one with a probability of 95 percent",
    "margin": "how often the measured number fits into its bound; a row with a margin below 1 fails",
    "row about the FMU": "a row that a fault in what the FMU gets or gives can break; shown in the study of faults",
    "row about formulas": "a row about the documents and the closed forms; no fault of the FMU moves it",
    "row about run times": "the ratio of two run times; it depends on the machine and on what else runs there",
    "conventions": "1.5 x a leading term whose next one is not computed; a next term of which only the power is known, "
    "with a coefficient of 2; 4 sigma (standard deviations) of a random walk of roundings; 0.1 of an observed order",
}

TASKS = (
    (
        "free and driven swings, gamma/m up to about 10/s",
        "ExplicitRungeKutta4",
        "the default; it errs by 1e-12 to 4e-12 rad a second with h = 1 ms, by 1e-8 to 4e-8 with 10 ms; stable for h "
        "below 0.8 s and gamma/m*h below 2.7",
    ),
    (
        "the last digits, long communication steps, long undamped runs",
        "TaylorSeries",
        "h = 0.1 s from 90 deg is right to 2e-13 rad for 20 s; h has to stay well below the radius of convergence",
    ),
    (
        "stiff drag: gamma/m*h above 2.7",
        "TRBDF2, SDIRK4",
        "stable at every step, what drag ends at once is ended at once; TRBDF2 for errors down to 1e-6, SDIRK4 below",
    ),
    (
        "undamped swings with long steps that keep their energy",
        "ImplicitTrapezoid",
        "no step is unstable and the amplitude stays; order 2",
    ),
    (
        "teaching what a method does wrong",
        "ExplicitEuler, ExplicitMidPoint2, ImplicitEuler",
        "energy grows, grows slowly, falls; see the phase portrait",
    ),
)
