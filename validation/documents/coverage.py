"""Where each formula, figure and code cell of the two documents is treated, or why not.

(what, where): `where` names a study and what to look for in its rows, tables and pictures.
"""

CRAWFORD = (
    ("(1), (2)", "none: the force and its law, from which (3) follows; the signs are among the errata"),
    ("(3)", "errata; trajectory and elliptic_period solve it with the right sign"),
    ("(4), (5)", "errata (4); crawford: period (14) over that of (5)"),
    ("(6), (7)", "errata (6): the constant along the FMU's motion"),
    ("(8)", "crawford: rate of the half swing that falls"),
    ("(9)", "crawford: time by (9) from the lowest point"),
    ("(10), (11), (14)", "crawford: period by (10), (11), (14), by quadrature"),
    ("(12), (13)", "crawford: (12) and (13), both equalities"),
    ("(15)", "crawford: kinetic energy is the loss of potential"),
    ("(16)", "crawford: F by (18)-(19) against Carlson's R_F; errata: order of the arguments"),
    ("(17)", "crawford: series, numbers of terms"),
    ("(18), (19)", "crawford: descent, recursions; errata: the root, the limit"),
    ("(20)", "crawford: AGM; elliptic_period uses AGM(1, k')"),
    ("(21)-(25)", "crawford: figure 2; stability: limits and growth of ExplicitEuler"),
    ("(26)-(28)", "crawford: (27) times (28) is 1, figure 3 by (28) as printed and by the nonlinear method"),
    ("(29)-(31)", "crawford: figures 4 to 6; errata: x and y; stability: ExplicitMidPoint2"),
    ("(32)", "crawford: figures 7 to 9; elliptic_period, trajectory: RK4"),
    ("figure 1", "none: a sketch of the pendulum"),
    ("figures 2 to 9", "crawford: numbers at 5, 10 and 20 s, pictures with the error below"),
    ("section 1, simple rules", "crawford: (14) at 90 deg by 16 intervals, table of 32; errata"),
    ("section 4, sinusoid", "crawford: sinusoid with the exact period; errata"),
    ("section 6, filters", "none: no formula, no pendulum"),
)

GRILLO = (
    ("equation of the pendulum, tau = M/(L^2*m)", "all studies; errata: gamma, l and L"),
    ("linearisation", "impulse_response: departure from linear motion"),
    ("In[5], K2 and W02 as printed", "none: 0.002 and 9.8066 are the parameters, to the digits shown"),
    ("frequency response h(w)", "grillo: response at w, Bode plot in dB, resonance enlarged"),
    ("In[6], Bode plot as printed", "errata: numbers and picture of the printed and the right system"),
    ("impulse response, nabla", "impulse_response: all dampings; errata: nabla, 39.2246 and 39.226596"),
    ("In[7], plot over 200 s", "impulse_response: picture over 200 s, with the misprint below"),
    ("free evolution", "grillo: rows and pictures; errata: the roots"),
    (
        "response to a Gaussian pulse o_g(t)",
        "grillo: Gaussian pulse of the document; errata: printed and right",
    ),
    (
        "In[8], I by quad, plot over -10 to 10 s",
        "grillo: constant I by quadrature, picture; errata: its digits",
    ),
    ("appendix, partial fractions, a^2", "errata: impulse response; grillo: response at w is their sum"),
    ("appendix, FT[exp(eta*t)*theta(t)]", "errata"),
    (
        "appendix, c1 = 1/(i*sqrt(nabla))",
        "impulse_response: its sum is the response that is held against the FMU",
    ),
    ("appendix, general solution", "grillo: general solution, initial state and drive together"),
    ("appendix, nabla = 4*a^2", "impulse_response uses a, errata nabla: both against the same FMU"),
    ("appendix, Gaussian pulse", "errata: completion of the square, A, lower limit, sign, constant I"),
    ("appendix, odd integral is 0", "none: by symmetry"),
)
