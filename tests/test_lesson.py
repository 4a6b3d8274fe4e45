"""The lesson: its form, its statements, and its exercises, in a kernel of this Python."""

import ast
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from math import log, nan, pi, radians, sqrt
from pathlib import Path

import nbformat
import pytest
from jupyter_client import KernelManager
from jupyter_client.kernelspec import KernelSpecManager
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError

from validation.references import discrete

pytestmark = pytest.mark.slow

LESSON = Path(__file__).resolve().parent.parent / "validation" / "lesson.ipynb"
NOTEBOOK = nbformat.reads(LESSON.read_text("utf-8"), as_version=4)
HANGING = 3600  # a kernel that has not answered by then [s] hangs
CODE = {cell.id: cell.source for cell in NOTEBOOK.cells if cell.cell_type == "code"}


def test_the_notebook_is_valid_and_written_as_nbformat_writes() -> None:
    nbformat.validate(NOTEBOOK)
    assert LESSON.read_text("utf-8") == nbformat.writes(NOTEBOOK) + "\n"
    assert (NOTEBOOK.nbformat, NOTEBOOK.nbformat_minor) == (4, 5)


def test_the_notebook_holds_no_outputs_and_nothing_of_the_machine_that_wrote_it() -> None:
    assert NOTEBOOK.metadata == {
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
        "language_info": {"name": "python"},
    }
    for cell in NOTEBOOK.cells:
        assert not cell.metadata
        assert cell.cell_type == "markdown" or (cell.outputs, cell.execution_count) == ([], None)


def test_it_needs_fmpy_and_the_references_alone() -> None:
    found = set()
    for node in (node for source in CODE.values() for node in ast.walk(ast.parse(source))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    foreign = {name for name in found if name.partition(".")[0] not in sys.stdlib_module_names}
    assert foreign == {"fmpy", "matplotlib.pyplot", "numpy", "validation.references"}


def test_every_figure_is_followed_by_what_to_see() -> None:
    figures = [i for i, cell in enumerate(NOTEBOOK.cells) if "plt.show()" in cell.source]
    assert len(figures) == 7
    assert all(NOTEBOOK.cells[i + 1].source.startswith("**See") for i in figures)


@dataclass(frozen=True)
class Lesson:
    """The executed notebook and its kernel."""

    client: NotebookClient

    def run(self, code: str) -> str:
        """Return what `code` prints; an error raises CellExecutionError."""
        cell = nbformat.v4.new_code_cell(code)
        self.client.nb.cells.append(cell)
        self.client.execute_cell(cell, len(self.client.nb.cells) - 1)
        return "".join(output.text for output in cell.outputs if output.name == "stdout")

    def run_apart(self, code: str) -> str:
        """Do the same without a change of the notebook's variables."""
        return self.run(f"exec({code!r}, dict(globals()))")


@pytest.fixture(scope="module")
def project(fmu_path: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder that has of the project what the notebook needs, and nothing else."""
    folder = tmp_path_factory.mktemp("project")
    (folder / "dist").mkdir()
    shutil.copy(fmu_path, folder / "dist" / "DampedPendulum.fmu")
    shutil.copytree(
        LESSON.parent / "references", folder / "validation" / "references", ignore=lambda *_: ["__pycache__"]
    )
    shutil.copy(LESSON.parent / "__init__.py", folder / "validation")
    return folder


@pytest.fixture(scope="module")
def lesson(project: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lesson]:
    pytest.importorskip("matplotlib", reason="the lesson needs matplotlib: pip install '.[report]'")
    home = tmp_path_factory.mktemp("home")
    with pytest.MonkeyPatch.context() as patch:
        # Nothing of the user's comes in, nor do fonts that are sought for the first time.
        patch.setenv("JUPYTER_PLATFORM_DIRS", "1")
        for name in ("IPYTHONDIR", "JUPYTER_CONFIG_DIR", "JUPYTER_DATA_DIR", "JUPYTER_RUNTIME_DIR"):
            patch.setenv(name, str(home / name))
        patch.setenv("MPLCONFIGDIR", str(home))
        patch.delenv("MPLBACKEND", raising=False)  # the kernel has its own
        subprocess.run([sys.executable, "-c", "import matplotlib.font_manager"], check=True)
        # Without folders to look in, the kernel's specification is the one of this Python.
        kernel = KernelManager(kernel_spec_manager=KernelSpecManager(kernel_dirs=[]))
        notebook = nbformat.reads(LESSON.read_text("utf-8"), as_version=4)
        place = {"metadata": {"path": project / "validation"}}
        patience = {"timeout": None, "startup_timeout": HANGING, "iopub_timeout": HANGING}
        client = NotebookClient(notebook, km=kernel, resources=place, **patience)
        with client.setup_kernel(cleanup_kc=True):
            for i, cell in enumerate(notebook.cells):
                client.execute_cell(cell, i)
            yield Lesson(client)


def test_it_runs_in_the_python_of_the_tests(lesson: Lesson) -> None:
    assert lesson.run("print(sys.executable)").strip() == sys.executable


def test_stderr_has_the_warnings_that_the_text_speaks_of_and_nothing_else(lesson: Lesson) -> None:
    told = {
        cell.id: "".join(output.text for output in cell.outputs if output.get("name") == "stderr")
        for cell in lesson.client.nb.cells
        if cell.cell_type == "code"
    }
    found = {
        name: re.findall(r"(\w+) (?:has no stable step|for this .* is (.*) s: )", text)
        for name, text in told.items()
    }
    assert {name: warnings for name, warnings in found.items() if told[name]} == {
        "energy-runs": [("ExplicitEuler", ""), ("ExplicitMidPoint2", "")],
        "stability-runs": [("ExplicitRungeKutta4", "0.903202")],
    }
    assert [told[name].count("\n") for name in ("energy-runs", "stability-runs")] == [2, 1]


def test_every_figure_is_drawn(lesson: Lesson) -> None:
    for cell in lesson.client.nb.cells:
        pictures = [output for output in cell.get("outputs", ()) if "image/png" in output.get("data", ())]
        assert len(pictures) == ("plt.show()" in cell.source)


def test_a_missing_fmu_is_told_in_one_sentence(lesson: Lesson) -> None:
    with pytest.raises(CellExecutionError, match=r"missing\.fmu does not exist: run python"):
        lesson.run_apart(CODE["fmu"].replace("DampedPendulum", "missing"))


SLOW = "references.overdamped_fall(np.arange(1.0, 61.0), radians(90), 1000.0, w02)[1]"
# What the text says -> an expression that is true if so.
STATEMENTS = {
    "the points lie on the exact curve": (
        # along the tangent a passage is displaced by w02*H^3/3 and a relative (w*H)^2/2 of that, w < 6.3 rad/s
        "max(abs(T - references.period(a, w02)) for T, a in zip(periods, np.radians(amplitudes)))"
        " <= 1.01 * w02 * 0.01**3 / 3"
    ),
    "up to 20 deg the period is T0 to one percent": "references.period(radians(20), w02) <= 1.01 * T0",
    "the error of RK4 falls as h^4": (
        "np.allclose(np.diff(np.log2(found['ExplicitRungeKutta4'][3:7, 1])), -4, rtol=0, atol=0.1)"
    ),
    "that of the midpoint method as h^2": (
        "np.allclose(np.diff(np.log2(found['ExplicitMidPoint2'][5:, 1])), -2, rtol=0, atol=0.1)"
    ),
    "that of Euler as h, if h is small": (
        "np.allclose(np.diff(np.log2(found['ExplicitEuler'][7:, 1])), -1, rtol=0, atol=0.1)"
    ),
    "and not if it is large": "np.log2(found['ExplicitEuler'][1, 1] / found['ExplicitEuler'][2, 1]) > 1.1",
    "TaylorSeries is below 1e-13 at once": "max(found['TaylorSeries'][:, 1]) < 1e-13",
    "the Euler methods are wrong by the factor of the table": (
        # the nonlinear rate differs by about the square of the angle, at most 1 deg*sqrt(7.1)
        "all(abs(np.log(energy[name][-1]) / (2000 * np.log(factor[name])) - 1) <= radians(1) ** 2 * 7.1"
        " for name in ('ExplicitEuler', 'ImplicitEuler'))"
    ),
    "the midpoint method and RK4 drift like t": (
        "all(abs(abs(energy[name][-1] - 1) / abs(energy[name][100] - 1) - 2) <= 0.1"
        " for name in ('ExplicitMidPoint2', 'ExplicitRungeKutta4'))"
    ),
    "ImplicitTrapezoid comes back": (
        "max(abs(energy['ImplicitTrapezoid'][101:] - 1)) <= 1.1 * max(abs(energy['ImplicitTrapezoid'][:101] - 1))"
    ),
    "ten milliseconds decide between decay and growth": (
        "distance[0.9][-1] < 1e-3 / 10 and distance[0.91][-1] > 1e-3 * 10"
    ),
    "by the factor |R| a step": (
        "all(np.allclose(values[:51], 1e-3 * abs(1 + z + z**2/2 + z**3/6 + z**4/24) ** n[:51], rtol=0.02, atol=0)"
        " for values, z in ((values, 1j * h * w0) for h, values in distance.items()))"
    ),
    "some hundred evaluations, a hundred thousand for RK4": (
        "all(fall[name]['solver.nfev'][-1] < 1000 for name in fall if name != 'ExplicitRungeKutta4')"
        " and 90_000 < fall['ExplicitRungeKutta4']['solver.nfev'][-1] < 110_000"
    ),
    "the angles lie on each other": (
        "max(np.max(np.abs(run['phi'] - fall['SDIRK4']['phi'])) for run in fall.values()) < radians(0.1)"
    ),
    "the rate of ImplicitTrapezoid jumps between 0 and twice its value": (
        f"np.all(np.abs(fall['ImplicitTrapezoid']['w'][1:] / {SLOW} - np.tile([2, 0], 30)) < 0.1)"
    ),
    "that of ImplicitEuler and TRBDF2 does not": (  # R(-1000) is 0.001 and -0.005
        f"all(np.all(np.abs(fall[name]['w'][1:] / {SLOW} - 1) < 0.01) for name in ('ImplicitEuler', 'TRBDF2'))"
    ),
}


@pytest.mark.parametrize("statement", STATEMENTS)
def test_what_the_text_says_is_so(lesson: Lesson, statement: str) -> None:
    assert lesson.run(f"print({STATEMENTS[statement]})").strip() == "True"


def test_the_limit_of_rk4_is_shown(lesson: Lesson) -> None:
    (cell,) = (cell for cell in lesson.client.nb.cells if cell.id == "limit")
    assert "0.9032 s" in "".join(output.text for output in cell.outputs)


def estimate() -> float:
    """Return the error that exercise 2 asks for, from the motion that the tableau of RK4 makes."""
    t = [i / 10 for i in range(101)]
    coarse, fine = (
        discrete.motion("ExplicitRungeKutta4", t, radians(30), 0.0, 0.0, 9.80665, h)[0][-1]
        for h in (0.01, 0.005)
    )
    return float(coarse - fine) / 15


ESTIMATE = estimate()
# The answers, in more digits or another way than the checks take.
RIGHT = {
    1: 159.7539,  # AGM(1, cos(x/2)) = 1/2
    2: ESTIMATE,
    3: 1.691086e-5,  # log(1.01)/(60*w02), less a relative h^2*w02/2
    4: 0.1019716,  # 1/9.80665
    5: 1000 / 9.80665 * log(1 + sqrt(2)),  # tan(45 deg)/tan(22.5 deg) = 1 + sqrt(2)
}
# Exercise, wrong answer, how it comes about, what the reader is told.
WRONG = [
    (1, radians(RIGHT[1]), "in rad", "the period is 1.000*T0"),
    (1, 150.0, "off by ten degrees", "the period is 1.762*T0"),
    (1, 200.0, "beyond the upright position", "rad (allowed: -pi to pi"),
    (1, nan, "NaN", "rad (allowed: -pi to pi"),
    (2, -ESTIMATE, "the other sign", "-1.01 times the true error"),
    (2, 16 * ESTIMATE, "of the coarse run", "16.2 times the true error"),
    (2, 15 * ESTIMATE, "not divided", "15.2 times the true error"),
    (2, 15 / 16 * ESTIMATE, "divided by 2^4", "0.949 times the true error"),
    (2, 5 * ESTIMATE, "as if of order 2", "5.06 times the true error"),
    (2, nan, "NaN", "nan times the true error"),
    (3, 100 * RIGHT[3], "1 for 1 percent", "grows by 170"),
    (3, 60 * RIGHT[3], "in a second", "grows by 81"),
    (3, nan, "NaN", "grows by nan"),
    (4, 2.0, "2*m/gamma, of strong drag", "|R| is 6.18"),
    (4, 2 * RIGHT[4], "half the damping rate", "|R| is 1.0972"),
    (4, 0.9032, "of RK4", "|R| is 2.8"),
    (4, 0.0, "no step", "|R| is 1.0000"),
    (4, nan, "NaN", "|R| is nan"),
    (5, 1000 / 9.80665 * pi / 4, "as if linear", "the bob is at 49.0"),
    (5, RIGHT[5] - 0.2, "interpolated badly", "the bob is at 45.08 deg"),
    (5, nan, "NaN", "after nan s"),
]


def with_answer(number: int, answer: float) -> str:
    question, given = CODE[f"answer-{number}"], f"answer_{number} = None"
    assert question.count(given) == 1
    return question.replace(given, f"answer_{number} = float('{answer}')") + "\n" + CODE[f"check-{number}"]


@pytest.mark.parametrize("number", RIGHT)
def test_an_exercise_without_an_answer_waits(lesson: Lesson, number: int) -> None:
    (cell,) = (cell for cell in lesson.client.nb.cells if cell.id == f"check-{number}")
    assert [output.text for output in cell.outputs] == [f"Exercise {number} waits for its answer.\n"]


@pytest.mark.parametrize("number", RIGHT)
def test_a_right_answer_passes(lesson: Lesson, number: int) -> None:
    assert f"Exercise {number} is right" in lesson.run_apart(with_answer(number, RIGHT[number]))


@pytest.mark.parametrize(
    ("number", "answer", "told"),
    [pytest.param(number, answer, told, id=f"{number}-{mistake}") for number, answer, mistake, told in WRONG],
)
def test_a_wrong_answer_is_told_so(lesson: Lesson, number: int, answer: float, told: str) -> None:
    with pytest.raises(CellExecutionError, match=re.escape(told)):
        lesson.run_apart(with_answer(number, answer))
