import hashlib
import shutil
import subprocess
import sys
import tarfile
from collections.abc import Sequence
from pathlib import Path

import pytest
from fmpy.validation import validate_fmu

import build_fmu

ROOT = Path(__file__).resolve().parent.parent


def sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def command(*arguments: str, optimize: Sequence[str] = ()) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *optimize, ROOT / "build_fmu.py", *arguments],
        capture_output=True,
        text=True,
        cwd=ROOT,
        check=False,
    )


def changed_sources(folder: Path, file: str, old: str, new: str) -> Path:
    shutil.copytree(build_fmu.SOURCES, folder, ignore=shutil.ignore_patterns("__pycache__"))
    text = (folder / file).read_text("utf-8")
    assert old in text
    (folder / file).write_text(text.replace(old, new), "utf-8")
    return folder


def test_the_same_sources_give_the_same_bytes(fmu_path: Path, tmp_path: Path) -> None:
    again = tmp_path / "again.fmu"
    assert command("--output", str(again)).returncode == 0  # in another process
    assert sha256(again) == sha256(fmu_path)


@pytest.mark.parametrize("optimize", ["-O", "-OO"])
def test_python_without_assertions_or_docstrings_builds_the_same_bytes(
    fmu_path: Path, tmp_path: Path, optimize: str
) -> None:
    again = tmp_path / "again.fmu"
    done = command("--output", str(again), optimize=[optimize])
    assert done.returncode == 0, done.stderr
    assert sha256(again) == sha256(fmu_path)
    page = command("--help", optimize=[optimize])
    assert page.returncode == 0
    assert page.stdout == command("--help").stdout


def test_other_sources_give_other_module_names_and_another_guid(fmu_path: Path, tmp_path: Path) -> None:
    sources = changed_sources(tmp_path / "src", "methods/explicit.py", "h / 6", "h / 6.0")
    other = build_fmu.build(tmp_path / "other.fmu", sources)
    names, other_names = (set(build_fmu.read_entries(path)) for path in (fmu_path, other))
    modules = {name for name in names if "damped_pendulum" in name}
    assert {"model.py", "solvers.py", "shell.py", "slave.py"} <= {Path(name).name for name in modules}
    assert not modules & other_names
    guids = [
        build_fmu.read_entries(path)["modelDescription.xml"].split(b'guid="')[1][:36]
        for path in (fmu_path, other)
    ]
    assert guids[0] != guids[1]


def test_the_fmu_is_valid_and_complete(fmu_path: Path) -> None:
    assert validate_fmu(str(fmu_path)) == []
    entries = build_fmu.read_entries(fmu_path)
    assert {
        "documentation/index.html",
        "documentation/externalDependencies.txt",
        "documentation/licenses/license.txt",
        "documentation/licenses/third_party.txt",
        "model.png",
        "binaries/linux64/DampedPendulum.so",
        "binaries/win64/DampedPendulum.dll",
    } <= set(entries)
    assert not [name for name in entries if "__pycache__" in name]
    page = entries["documentation/index.html"].decode()
    assert "<!--" not in page  # every mark is filled in
    assert "solver.stepSize" in page
    assert "ImplicitEuler" in page


def test_an_invalid_fmu_is_not_written_and_all_problems_are_printed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(build_fmu, "validate_fmu", lambda path: ["first problem", "second problem"])
    assert build_fmu.main(["--output", str(tmp_path / "x.fmu")]) == 1
    assert "first problem\nsecond problem" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--output", "x.zip"], "x.zip: must be a file that ends in .fmu"),
        (["--output", str(ROOT / "LICENSE" / "x.fmu")], "x.fmu"),
        (["--outputs", "x"], "--outputs"),
        (["surplus"], "surplus"),
    ],
)
def test_wrong_use_is_one_line_and_status_2(arguments: list[str], words: str) -> None:
    result = command(*arguments)
    assert result.returncode == 2
    assert words in result.stderr
    assert len(result.stderr.splitlines()) == 1


def test_help_is_enough() -> None:
    result = command("--help")
    assert result.returncode == 0
    assert "--output" in result.stdout
    assert "DampedPendulum.fmu" in result.stdout


# The source distribution


def generated(folder: str, names: list[str]) -> set[str]:
    made = shutil.ignore_patterns(".*", "__pycache__", "*.egg-info")(folder, names)
    return made | ({"dist", "report", "build"} & set(names) if Path(folder) == ROOT else set())


@pytest.fixture(scope="module")
def sdist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of an unpacked source distribution."""
    folder = tmp_path_factory.mktemp("sdist")
    tree = folder / "tree"
    shutil.copytree(ROOT, tree, ignore=generated)
    shutil.copytree(ROOT / ".ci", tree / ".ci")
    program = "from setuptools import build_meta; print(build_meta.build_sdist('..'))"
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tree, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    with tarfile.open(folder / done.stdout.splitlines()[-1]) as archive:
        archive.extractall(folder / "unpacked", filter="data")
    (unpacked,) = (folder / "unpacked").iterdir()
    return unpacked


def files(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def test_a_source_distribution_contains_all_that_is_needed(sdist: Path) -> None:
    tree = sdist.parent.parent / "tree"
    assert {name for name in files(tree) if ".egg-info/" not in name} <= files(sdist)
    assert {
        "README.md",
        "LICENSE",
        "CHANGELOG.md",
        "CITATION.cff",
        ".ci/run",
        "build_fmu.py",
        "fmu_src/native/fmi2.c",
        "validation/loop.c",
        "validation/error_against_run_time.png",
        "tests/native_host.c",
    } <= files(sdist)
    assert not [name for name in files(sdist) if "__pycache__" in name]
    assert (sdist / ".ci" / "run").stat().st_mode & 0o100


def test_a_source_distribution_builds_the_same_fmu(sdist: Path, fmu_path: Path, tmp_path: Path) -> None:
    again = tmp_path / "again.fmu"
    done = subprocess.run([sys.executable, "build_fmu.py", "--output", again], cwd=sdist, check=False)
    assert done.returncode == 0
    assert sha256(again) == sha256(fmu_path)


def test_a_source_distribution_has_all_the_tests(sdist: Path) -> None:
    collected = [
        subprocess.run(
            [sys.executable, "-m", "pytest", "--collect-only", "-q", "-p", "no:cacheprovider"],
            cwd=folder,
            capture_output=True,
            text=True,
            check=False,
        ).stdout.splitlines()[-1]
        for folder in (ROOT, sdist)
    ]
    assert [line.split(" in ")[0] for line in collected] == [collected[0].split(" in ")[0]] * 2
    assert "tests collected" in collected[0]
