"""Words of the report that no study measures: the glossary, and which method is for which task."""

GLOSSARY = {
    "phi, w, a, E": "angle [rad], its rate [rad/s], its acceleration [rad/s2], mechanical energy [J]",
    "m, L, g, gamma": "mass of the bob, length of the rod, gravity acceleration, drag coefficient of the bob",
    "k2": "damping rate gamma/m [1/s] of phi'' + k2*phi' + w02*sin(phi) = drive",
    "w0, w02": "angular frequency of small swings, sqrt(g/L), and its square",
    "drive": "torque over the moment of inertia, tau/(m*L^2) [1/s2]",
    "T": "period of an undamped swing; T0 = 2*pi/w0 for small ones",
    "h": "substep: the step of the integration method, bounded by solver.stepSize",
    "H": "communication step: the step of the importer, divided into equal substeps",
    "held input": "the torque is set at the beginning of a communication step and stays until its end",
    "image": "a held cosine contains other frequencies, w + 2*pi*j/H; they are its images",
    "order p": "errors at a fixed time fall like h^p",
    "R(z)": "stability function: a step multiplies y of y' = lambda*y by R(h*lambda); stable where |R| <= 1",
    "discrete motion": "what a method does to the pendulum by its tableau, computed apart from the FMU",
    "modified equation": "the differential equation whose exact solution the discrete motion is, as a series in h",
    "phase error, drift": "RK4's h^4 error shifts the phase; its h^5 error changes the energy, and so the period",
    "nfev": "evaluations of the acceleration",
    "margin": "how often the measured number fits into its bound; a row with a margin below 1 fails",
    "row about the FMU": "a row that a fault in what the FMU gets or gives can break; shown in the study of faults",
    "row about formulas": "a row about the documents and the closed forms; no fault of the FMU moves it",
    "row about run times": "the ratio of two run times; it depends on the machine and on what else runs there",
    "conventions": "1.5 x a leading term whose next one is not computed; a next term of which only the power is known, "
    "with a coefficient of 2; 4 sigma of a random walk of roundings; 0.1 of an observed order",
}

TASKS = (
    (
        "free and driven swings, gamma/m up to about 10/s",
        "ExplicitRungeKutta4",
        "the default, h = 1 ms, is right to some 1e-12 a second, 10 ms to 1e-8; stable for gamma/m*h below 2.7",
    ),
    (
        "the last digits, long communication steps, long undamped runs",
        "TaylorSeries",
        "h = 0.1 s from 90 deg is right to 1e-14 after 20 s; h has to stay well below the radius of convergence",
    ),
    (
        "stiff drag: gamma/m*h above 2.7",
        "SDIRK4",
        "stable at every step, order 4; TRBDF2 of order 2 and ImplicitEuler damp as strongly",
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
