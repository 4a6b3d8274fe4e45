"""The rivals solve the same equation as the FMU, and the answers that they are held against are exact."""

from dataclasses import replace
from functools import partial
from math import sqrt
from pathlib import Path

import numpy as np
import pytest
from mpmath import mp

from validation import references
from validation.fmu import W02, Experiment, Fmu
from validation.race import carriers, compiler, contest, rivals, scenes
from validation.race.rivals import PYTHON_RIVALS, Solver
from validation.race.scenes import DAMPED, LONG, OFTEN, PULSE, ROTATION, STIFF, TRAIN, UNDAMPED, Scene, exact

SHORT = replace(DAMPED, stop=2.0, points=2)
JUMPS = replace(TRAIN, stop=2.0, points=4, held=TRAIN.held[:4])


def compiled(name: str) -> Solver:
    found = list(rivals.compiled_rivals())
    solver = next((rival for rival in found if isinstance(rival, Solver) and rival.name == name), None)
    if solver is None:
        pytest.skip("; ".join(text for text in found if isinstance(text, str)))
    return solver


@pytest.mark.parametrize(
    "scene",
    [SHORT, PULSE, JUMPS, replace(OFTEN, stop=0.1, points=100), replace(STIFF, stop=0.02, points=2)],
    ids=lambda s: s.name,
)
@pytest.mark.parametrize("name", [*(rival.name for rival in PYTHON_RIVALS), "heyoka", "odeint, f in C"])
def test_a_rival_solves_the_equation(name: str, scene: Scene) -> None:
    rival = next((rival for rival in PYTHON_RIVALS if rival.name == name), None) or compiled(name)
    outcome = rival.prepare(scene, 1e-9, 10.0)()
    assert outcome.failure == ""
    # A tolerance is that of a step; a hundredfold is left for what the steps add up to.
    assert contest.errors(scene, outcome).largest <= 1e-7


def test_a_rival_that_is_too_slow_is_cut_off() -> None:
    radau = next(rival for rival in PYTHON_RIVALS if rival.name == "Radau")
    outcome = radau.prepare(UNDAMPED[0], 1e-9, 1e-3)()
    assert outcome.failure == "cut off at 0.001 s"
    assert np.isnan(contest.errors(UNDAMPED[0], outcome).largest)


def test_heyoka_is_cut_off_by_its_steps() -> None:
    assert "cut off" in compiled("heyoka").prepare(UNDAMPED[0], 1e-9, 1e-6)().failure


@pytest.mark.parametrize(
    ("scene", "held"),
    [(UNDAMPED[0], 0.0), (DAMPED, 0.0), (PULSE, 0.0), (TRAIN, 5.0)],
    ids=lambda value: getattr(value, "name", None),
)
def test_the_right_hand_side_in_c_is_that_in_python(scene: Scene, held: float) -> None:
    try:
        f = rivals.compiled(scene, held)
    except compiler.NoCompilerError as error:
        pytest.skip(str(error))
    g = rivals.in_python(scene, held)
    for t, phi, w in ((0.0, 0.5, -2.0), (3.9, -3.0, 1e-3), (4.2, 40.0, 7.0)):
        y = np.array([phi, w])
        # Two sums of three terms, each rounded a few times.
        size = scene.k2 * abs(w) + W02 + held
        assert f(t, y)[0] == g(t, y)[0] == w
        assert f(t, y)[1] == pytest.approx(g(t, y)[1], rel=0, abs=4 * 2.3e-16 * size)


def test_the_jacobian_is_the_derivative_of_the_right_hand_side() -> None:
    f, y, h = rivals.in_python(DAMPED), np.array([0.7, -1.1]), 1e-5
    columns = [(np.array(f(0.0, y + h * e)) - np.array(f(0.0, y - h * e))) / (2 * h) for e in np.eye(2)]
    # Central differences: h^2/6 times the third derivative, and rounding by 1e-16*10/h.
    assert np.array(rivals.jacobian(DAMPED)(0.0, y)) == pytest.approx(np.array(columns).T, rel=0, abs=1e-9)


def test_without_headers_or_a_compiler_the_rival_is_left_out_with_a_reason(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def none(*_: object) -> None:
        raise compiler.NoCompilerError("no C compiler (cc, gcc, clang)")

    monkeypatch.setattr(rivals, "_compiled_module", none)
    monkeypatch.setattr(rivals, "find_spec", lambda name: None)
    assert list(rivals.compiled_rivals()) == [
        "heyoka is left out: pip install '.[peers]'",
        "SciPy's odeint with a right-hand side in C is left out: no C compiler (cc, gcc, clang)",
    ]


@pytest.mark.parametrize("name", [*(rival.name for rival in PYTHON_RIVALS), "heyoka", "odeint, f in C"])
def test_a_rival_begins_anew_where_the_torque_jumps(name: str) -> None:
    """A single step over both halves of the scene does not see that the torque of the second is another one."""
    rival = next((rival for rival in PYTHON_RIVALS if rival.name == name), None) or compiled(name)
    scene = replace(JUMPS, stop=0.02, points=2, held=(5.0, -5.0))
    phi = rival.prepare(scene, 1e-9, 10.0)().phi
    # From rest: +5*h^2/2, then the rate 5*h for h, less 5*h^2/2; drag, gravity take (k2 + w02*h)*h of it at most.
    h = scene.step
    assert phi == pytest.approx([0.0, 2.5 * h * h, 5 * h * h], rel=(0.5 + W02 * h) * h * 2, abs=1e-12)


# References


def test_the_reference_of_a_train_of_jumps_is_linear_where_it_is_small() -> None:
    small = 1e-6
    scene = replace(JUMPS, held=tuple(small * u for u in JUMPS.held))
    phi, w = references.polynomial_response([[u] for u in scene.held], scene.step, scene.k2, W02)
    # Four pushes change by 10*small at most, and each adds that over w02; the sine is short by a sixth of the cube.
    bound = W02 * (4 * 10 * small / W02) ** 3 / 6 * scene.stop**2 / 2
    assert np.max(np.abs(exact(scene)[0] - phi)) <= bound
    assert np.max(np.abs(exact(scene)[1] - w)) <= sqrt(W02) * bound


@pytest.mark.parametrize("scene", UNDAMPED, ids=lambda scene: scene.name)
def test_undamped_references_agree_with_elliptic_functions(scene: Scene) -> None:
    phi, w = references.motion(scene.grid, scene.phi0, scene.rate0, W02)
    # An ulp of the amplitude, as far as the period depends on it, 6 rad/s at most; and a few ulps of w0*t.
    slope = references.period_slope(scene.phi0, W02) / references.period(scene.phi0, W02)
    bound = 6.3 * scene.stop * (4.5e-16 * slope + 4 * 2.3e-16)
    assert np.max(np.abs(exact(scene)[0] - phi)) <= bound
    assert np.max(np.abs(exact(scene)[1] - w)) <= sqrt(W02) * bound


def test_the_angle_of_the_rotation_grows_by_whole_turns() -> None:
    k = ROTATION.rate0 / (2 * sqrt(W02))
    with mp.workdps(30):
        turn = float(2 * mp.ellipk(mp.mpf(1) / mp.mpf(k) ** 2) / (mp.mpf(k) * mp.sqrt(W02)))
    scene = replace(ROTATION, stop=3 * turn, points=3)
    assert exact(scene)[0] == pytest.approx([0, *(2 * np.pi * n for n in (1, 2, 3))], rel=0, abs=1e-13)


def test_the_thousandth_period_ends_where_it_began() -> None:
    phi, w = exact(LONG)
    # 1000*2*pi rad of phase, each known to a few ulps.
    bound = 1000 * 2 * np.pi * 4 * 2.3e-16
    assert abs(phi[-1] - LONG.phi0) <= bound
    assert abs(w[-1]) <= sqrt(W02) * bound
    assert bound <= LONG.targets[-1] / 10


def test_the_polynomial_of_the_drive_is_its_cubic_about_the_middle() -> None:
    drive, n, h = scenes.Gaussian(2.0, 4.0, 0.09), 37, 0.1
    t = n * h
    d0, d1, d2, d3 = drive.polynomials(h, n + 1)[n]
    with mp.workdps(30):
        taylor = mp.taylor(lambda x: 2 * mp.exp(-((x - 4) ** 2) / (2 * mp.mpf("0.09"))), mp.mpf(t + h / 2), 3)
        for s in (0.0, 0.05, 0.1):
            expected = float(sum(c * (mp.mpf(s) - mp.mpf(h) / 2) ** k for k, c in enumerate(taylor)))
            assert d0 + s * (d1 + s * (d2 / 2 + s * d3 / 6)) == pytest.approx(expected, rel=1e-12, abs=0)


# The host in C


@pytest.mark.parametrize("carrier", ["native"], indirect=True, scope="session")
def test_the_host_in_c_gives_the_bits_of_that_in_python(fmu_path: Path, carrier: str) -> None:
    try:
        host = carriers.compiled_host()
    except compiler.NoCompilerError as error:
        pytest.skip(str(error))
    held = Experiment(2.0, 0.1, {"gamma": 0.5}, lambda t: 0.3, ("phi", "w"))
    constant = replace(held, inputs=np.tile([0.3, 0.0, 0.0, 0.0], (20, 1)))
    with Fmu(fmu_path) as fmu:
        ours, theirs, ourselves = fmu.run_in(host, constant), fmu.run(held), fmu.run(constant)
        lost = fmu.run_in(host, Experiment(1.0, 0.1, {"gamma": 1e6}, record=("phi", "w")))
    assert (ours["phi"] == theirs["phi"]).all()
    assert (ours["w"] == theirs["w"]).all()
    assert (ourselves["w"] == theirs["w"]).all()
    assert lost.failure
    assert np.isnan(lost["phi"][-1])


def test_an_fmu_that_does_not_interpolate_refuses_derivatives_of_its_input(
    fmu_path: Path, carrier: str
) -> None:
    experiment = Experiment(0.2, 0.1, inputs=np.ones((2, 2)))
    with Fmu(fmu_path) as fmu:
        assert fmu.interpolates == (carrier == "native")
        if fmu.interpolates:
            # From rest phi is between tau/J*t^2/2 and that less w02*t^2/12 of it, for tau = 1 + t.
            expected = 0.2**2 / 2 + 0.2**3 / 6
            start = {"phi_start": 0.0, "gamma": 0.0}
            phi = fmu.run(replace(experiment, start=start, inputs=np.array([[1.0, 1.0], [1.1, 1.0]])))["phi"][
                -1
            ]
            assert expected * (1 - W02 * 0.2**2 / 12) <= phi <= expected
        else:
            with pytest.raises(
                ValueError, match=r"does not interpolate its input: canInterpolateInputs is false$"
            ):
                fmu.run(experiment)


def test_a_driven_scene_is_recorded_on_its_grid_alone(fmu_path: Path) -> None:
    with Fmu(fmu_path) as fmu:
        prepare = partial(carriers.solvers(fmu)[2].prepare, PULSE)
        outcome = prepare(4, 1.0)()
    assert len(outcome.phi) == len(PULSE.grid)
