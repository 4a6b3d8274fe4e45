import hashlib
import os
import re
import shutil
import signal
import subprocess
import sys
import tarfile
import tomllib
from collections.abc import Sequence
from errno import ENOSPC
from pathlib import Path
from typing import NoReturn

import fmpy
import pytest
from fmpy.util import read_csv, read_ref_opt_file
from fmpy.validation import validate_fmu

import build_fmu
from damped_pendulum.interface import INTERFACE
from native import build as native
from tests.toolchain import need_zig, on_linux

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


def full_disk(path: Path, _: object, *__: object, **___: object) -> NoReturn:
    path.touch()
    raise OSError(ENOSPC, "No space left on device")


def test_a_disk_that_fills_up_is_one_line_and_nothing_is_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(Path, "write_bytes", full_disk)
    with pytest.raises(SystemExit) as exit:
        build_fmu.main(["--output", str(tmp_path / "x.fmu")])
    assert exit.value.code == 2
    assert capsys.readouterr().err == (
        f"build_fmu.py: --output {tmp_path / 'x.fmu'}: No space left on device\n"
    )
    assert list(tmp_path.iterdir()) == []


def test_a_release_on_a_disk_that_fills_up_leaves_nothing(
    fmu_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("build", "build_native"):
        monkeypatch.setattr(build_fmu, name, lambda path: shutil.copyfile(fmu_path, path))
    write, sizes = Path.write_bytes, iter((1, 1))

    def filling(path: Path, data: bytes) -> int:
        return write(path, data) if next(sizes, 0) else full_disk(path, data)

    monkeypatch.setattr(Path, "write_bytes", filling)
    with pytest.raises(OSError, match="No space left on device"):
        build_fmu.build_release(tmp_path / "release")
    assert list(tmp_path.iterdir()) == []


def test_a_readme_that_cannot_be_written_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    readme = tmp_path / "README.md"
    readme.touch()
    monkeypatch.setattr(build_fmu, "README", readme)
    monkeypatch.setattr(Path, "write_text", full_disk)
    with pytest.raises(SystemExit) as exit:
        build_fmu.main(["--readme"])
    assert exit.value.code == 2
    assert capsys.readouterr().err == f"build_fmu.py: --readme {readme}: No space left on device\n"


@on_linux
@pytest.mark.parametrize("arrived", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_is_a_line_and_nothing_is_left(tmp_path: Path, arrived: signal.Signals) -> None:
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    started = subprocess.Popen(
        [sys.executable, ROOT / "build_fmu.py", "--output", tmp_path / "x.fmu"],
        env=os.environ | {"TMPDIR": str(temporary)},
        stderr=subprocess.PIPE,
        text=True,
    )
    while not any(temporary.glob("*/*")):  # it builds, in a folder that it will remove
        assert started.poll() is None
    started.send_signal(arrived)
    _, said = started.communicate()
    assert (started.returncode, said) == (130, "build_fmu.py: interrupted\n")
    assert [path.name for path in tmp_path.iterdir()] == ["temporary"]
    assert list(temporary.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--output", "x.zip"], "x.zip: must be a file that ends in .fmu"),
        (["--output", str(ROOT / "LICENSE" / "x.fmu")], "x.fmu"),
        (["--outputs", "x"], "--outputs"),
        (["--output", "a\nb"], r"--output a\nb: must be a file"),
        (["--output", "x.fmu", "--readme"], "--readme: not allowed with argument --output"),
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


# A release


@pytest.fixture(scope="module")
def release(tmp_path_factory: pytest.TempPathFactory) -> Path:
    need_zig()
    folder = tmp_path_factory.mktemp("release")
    done = command("--release", str(folder))
    assert done.returncode == 0, done.stderr
    return folder


def test_a_release_has_both_fmus_and_what_their_users_test_with(release: Path) -> None:
    assert {
        "CHANGELOG.md",
        "CITATION.cff",
        "DampedPendulum.fmu",
        "DampedPendulumNative.fmu",
        "LICENSE",
        "README.md",
        "SHA256SUMS",
        "conduct.json",
        "cross_check/DampedPendulum/DampedPendulum_in.csv",
        "cross_check/DampedPendulumNative/DampedPendulumNative_ref.opt",
        "reference_results/experiments.json",
        "reference_results/fmi-ls-ref.txt",
        "reference_results/large_swing.ssv",
        "validation/error_against_run_time.png",
    } <= files(release)
    binaries = {
        name.split("/")[1]
        for name in build_fmu.read_entries(release / "DampedPendulumNative.fmu")
        if name.startswith("binaries/")
    }
    assert binaries == {target.platform for target in native.TARGETS}


def test_the_checksums_of_a_release_are_of_all_its_files(release: Path) -> None:
    lines = [line.split("  ") for line in (release / "SHA256SUMS").read_text("utf-8").splitlines()]
    assert {name for _, name in lines} == files(release) - {"SHA256SUMS"}
    for digest, name in lines:
        assert sha256(release / name) == digest


def test_a_release_is_the_same_bytes_each_time(release: Path, tmp_path: Path) -> None:
    assert command("--release", str(tmp_path / "again")).returncode == 0
    sums = "SHA256SUMS"
    assert (tmp_path / "again" / sums).read_bytes() == (release / sums).read_bytes()


@pytest.mark.parametrize("name", ["DampedPendulum", "DampedPendulumNative"])
def test_fmpy_runs_the_cross_check_of_a_release(release: Path, name: str) -> None:
    folder = release / "cross_check" / name
    options = read_ref_opt_file(folder / f"{name}_ref.opt")
    exact = read_csv(folder / f"{name}_ref.csv")
    found = fmpy.simulate_fmu(
        str(release / f"{name}.fmu"),
        start_time=options["StartTime"],
        stop_time=options["StopTime"],
        output_interval=options["OutputIntervalLength"],
        input=read_csv(folder / f"{name}_in.csv"),
        output=["phi", "w"],
    )
    assert (found["time"] == exact["time"]).all()
    for variable, bound in (("phi", 3e-11), ("w", 6e-11)):  # those of README
        assert abs(found[variable] - exact[variable]).max() <= bound


def test_a_release_goes_into_a_new_or_an_empty_directory_only(tmp_path: Path) -> None:
    need_zig()
    (tmp_path / "old").touch()
    result = command("--release", str(tmp_path))
    assert result.returncode == 2
    assert result.stderr.endswith("must be a new or an empty directory\n")
    assert [path.name for path in tmp_path.iterdir()] == ["old"]


def test_the_versions_agree() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["version"]
    citation = (ROOT / "CITATION.cff").read_text("utf-8")
    version, date = re.findall(
        r"^## \[(.+)\] - (.+)$", (ROOT / "CHANGELOG.md").read_text("utf-8"), re.MULTILINE
    )[0]
    assert version == project == INTERFACE.version
    assert f"\nversion: {version}\n" in citation
    assert f"\ndate-released: {date}\n" in citation
    assert INTERFACE.released == f"{date}T00:00:00Z"


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
        "tests/conduct.json",
        "fmu_src/reference_results/extra/org.fmi-standard.fmi-ls-ref/driven_in.csv",
    } <= files(sdist)
    assert not [name for name in files(sdist) if "__pycache__" in name]
    assert (sdist / ".ci" / "run").stat().st_mode & 0o100


def test_a_package_index_refuses_the_distribution(sdist: Path) -> None:
    assert "Classifier: Private :: Do Not Upload" in (sdist / "PKG-INFO").read_text("utf-8").splitlines()


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
