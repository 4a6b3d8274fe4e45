"""Build dist/DampedPendulum.fmu, dist/DampedPendulumNative.fmu, or a release of both: the same sources, the same bytes.

pythonfmu packs the Python sources, a C compiler makes the binaries of the native FMU. This program adds what belongs
into a FMU (documentation, licences, icon, a GUID derived from the contents), packs it reproducibly and refuses to leave
a FMU that FMPy's validation complains about.
"""

from __future__ import annotations

import argparse
import hashlib
import html
import json
import re
import shutil
import signal
import sys
import tempfile
import uuid
import zipfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from importlib.util import find_spec
from math import inf
from pathlib import Path
from sys import float_info
from typing import Any, NoReturn
from xml.etree import ElementTree

from fmpy.validation import validate_fmu
from pythonfmu import Fmi2Slave
from pythonfmu.builder import FmuBuilder

ROOT = Path(__file__).resolve().parent
SOURCES = ROOT / "fmu_src"
sys.path.insert(0, str(SOURCES))

from fmi.description import complete  # noqa: E402  # found through the line above
from methods.solvers import METHODS, SolverMethod, stability_limit  # noqa: E402
from native import build as native  # noqa: E402
from slave import SLAVE  # noqa: E402

INTERFACE = SLAVE.interface
PACKAGES = sorted(path.parent.name for path in SOURCES.glob("*/__init__.py"))
MODEL_PACKAGE = SLAVE.model.__module__.partition(".")[0]
DEFAULT_OUTPUT = ROOT / "dist" / f"{INTERFACE.model_name}.fmu"
NATIVE_OUTPUT = ROOT / "dist" / f"{native.MODEL_NAME}.fmu"
DESCRIPTION = "modelDescription.xml"
DOCUMENTATION = SOURCES / "documentation"
REFERENCE_RESULTS = SOURCES / "reference_results"  # laid out as in the FMU
ICON = DOCUMENTATION / "model.png"
CONDUCT = ROOT / "tests" / "conduct.json"
README = ROOT / "README.md"
PURPOSE = (
    f"Build dist/{DEFAULT_OUTPUT.name}, dist/{NATIVE_OUTPUT.name}, or a release of both: "
    "the same sources, the same bytes."
)
SCRIPT = """\
from {package}.fmi.wrapper import keep_alive
from {package}.slave import {model}

keep_alive(globals())  # pythonfmu 0.7 releases the names of this script once too often with every instance
"""
NAMESPACE = uuid.UUID("5f0c5b1e-5d5c-4f0e-9b0a-3d9d3c1a7e42")  # of the GUIDs of this project

REFERENCES = REFERENCE_RESULTS / "extra" / "org.fmi-standard.fmi-ls-ref"
CROSS_CHECK = "driven"  # with an input and the default parameters, as the cross-check asks
CROSS_CHECK_README = """\
Cross-check files of {fmu} {version}: its default parameters under a torque that changes at every second, held against
the exact motion. Error at most {bounds[phi]:g} rad in phi, {bounds[w]:g} rad/s in w: {reason}.
"""
# Of the project, those that it has, under the same names in a release.
DOCUMENTS = ("CHANGELOG.md", "CITATION.cff", "LICENSE", "README.md", "validation/error_against_run_time.png")


class BuildError(Exception):
    """A FMU that cannot be built, with everything that is wrong with it."""


def build(output: Path = DEFAULT_OUTPUT, sources: Path = SOURCES) -> Path:
    """Build the FMU from `sources` and return its path.

    Raises
    ------
    BuildError : the result does not pass the validation; nothing is left at `output`
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        script = stage(sources, folder / "resources")
        write_documentation(folder / "documentation", "pythonfmu")
        packed = folder / output.name
        with restored_imports():
            FmuBuilder.build_FMU(
                script,
                dest=packed,
                project_files=[script.parent / script.stem.removesuffix("_slave")],
                documentation_folder=folder / "documentation",
                canGetAndSetFMUstate=True,
                canSerializeFMUstate=True,
            )
        entries = read_entries(packed) | {"model.png": ICON.read_bytes()} | files_below(REFERENCE_RESULTS)
    derive_guid(entries)
    return write_fmu(output, entries)


def build_native(
    output: Path = NATIVE_OUTPUT, binaries: Callable[[str], dict[str, bytes]] = native.binaries
) -> Path:
    """Build the FMU without Python from the C sources and return its path; `binaries` compiles for a GUID.

    Raises
    ------
    BuildError : the result does not pass the validation; nothing is left at `output`
    native.CompilerError, native.ModelFileError : there is no C compiler, or not the one C file of the model
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_documentation(folder / "documentation", "native")
        entries = files_below(folder) | files_below(REFERENCE_RESULTS)
    entries |= {"model.png": ICON.read_bytes(), DESCRIPTION: native_description()} | in_sources(
        native.sources(guid="")
    )
    guid = derive_guid(entries)
    entries |= in_sources(native.sources(guid)) | binaries(guid)
    return write_fmu(output, entries)


def files_below(folder: Path) -> dict[str, bytes]:
    """Return the files in and below `folder`, of which there may be none, by their names relative to it."""
    files = [path for path in folder.rglob("*") if path.is_file()]
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def in_sources(files: dict[str, bytes]) -> dict[str, bytes]:
    """Return `files` under their names in a FMU."""
    return {f"sources/{name}": content for name, content in files.items()}


def native_description() -> bytes:
    """Return modelDescription.xml of the native FMU: that of the slave, with what the native binary can do."""
    slave = SLAVE(instance_name=native.MODEL_NAME)
    slave.register_variables()
    slave.modelName = native.MODEL_NAME
    slave.log_categories = {
        category: slave.log_categories[category]
        for category in ("logStatusWarning", "logStatusDiscard", "logStatusError")
    }
    root = complete(Fmi2Slave.to_xml(slave), INTERFACE, states=True)
    root.set("generationTool", f"{Path(__file__).name} {INTERFACE.version}")
    co_simulation = next(root.iter("CoSimulation"))
    co_simulation.attrib |= {
        "needsExecutionTool": "false",
        "canInterpolateInputs": "true",
        "maxOutputDerivativeOrder": str(native.MAX_OUTPUT_ORDER),
        "canGetAndSetFMUstate": "true",
        "canSerializeFMUstate": "true",
        "providesDirectionalDerivative": "true",
    }
    files = ElementTree.SubElement(co_simulation, "SourceFiles")
    for name in native.SOURCES:
        ElementTree.SubElement(files, "File", name=name)
    ElementTree.indent(root, "\t")
    text: bytes = ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True)
    return text


def write_fmu(output: Path, entries: dict[str, bytes]) -> Path:
    """Write a FMU that passes the validation, or nothing, to `output`; return it."""
    with tempfile.TemporaryDirectory() as name:
        packed = Path(name, output.name)
        write_entries(packed, entries)
        problems = validate_fmu(str(packed))
        if problems:
            raise BuildError("\n".join(problems))
        output.parent.mkdir(parents=True, exist_ok=True)
        unfinished = output.with_name(f".{output.name}.partial")
        try:
            unfinished.write_bytes(packed.read_bytes())
            unfinished.replace(output)
        finally:
            unfinished.unlink(missing_ok=True)
    return output


def stage(sources: Path, folder: Path) -> Path:
    """Copy the packages and the script into `folder` under names with a digest of the sources; return the script.

    Modules are cached by name for the whole process of the importer, so two builds that share a name would share
    the code of the first.
    """
    files = [path for package in PACKAGES for path in sorted((sources / package).rglob("*.py"))]
    files.append(sources / "slave.py")
    digest = hashlib.sha256(SCRIPT.encode())
    for path in files:
        digest.update(path.relative_to(sources).as_posix().encode() + b"\0" + path.read_bytes())
    package = f"{MODEL_PACKAGE}_{digest.hexdigest()[:8]}"
    own_import = re.compile(rf"^from ({'|'.join(PACKAGES)})\b", re.MULTILINE)
    for path in files:
        target = folder / package / path.relative_to(sources)
        target.parent.mkdir(parents=True, exist_ok=True)
        text = own_import.sub(rf"from {package}.\1", path.read_text("utf-8"))
        target.write_text(text, "utf-8", newline="\n")
    (folder / package / "__init__.py").touch()
    # pythonfmu compiles the script anew for every instance and never frees it, so there is next to nothing in it.
    script = folder / f"{package}_slave.py"
    script.write_text(SCRIPT.format(package=package, model=INTERFACE.model_name), "utf-8", newline="\n")
    return script


def build_release(folder: Path) -> Path:
    """Write both FMUs and what their users test with into `folder`, which is new or empty, and return it.

    Documents, conduct and reference results that the project does not have are left out.

    Raises
    ------
    BuildError, native.CompilationError, native.ModelFileError : as of the builds; nothing is left in `folder`
    """
    with tempfile.TemporaryDirectory() as name:
        fmus = build(Path(name, DEFAULT_OUTPUT.name)), build_native(Path(name, NATIVE_OUTPUT.name))
        files = {fmu.name: fmu.read_bytes() for fmu in fmus}
    own = {name: ROOT / name for name in DOCUMENTS} | {"conduct.json": CONDUCT}
    files |= {name: path.read_bytes() for name, path in own.items() if path.exists()}
    for source, content in files_below(REFERENCE_RESULTS).items():
        files[f"reference_results/{Path(source).name}"] = content
    if REFERENCE_RESULTS.exists():
        for fmu in fmus:
            files |= cross_check(fmu.stem)
    sums = [f"{hashlib.sha256(content).hexdigest()}  {name}\n" for name, content in sorted(files.items())]
    files["SHA256SUMS"] = "".join(sums).encode()
    try:
        for name, content in files.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(content)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    return folder


def experiments() -> list[dict[str, Any]]:
    """Return the experiments of the reference results: names, start values, files, bounds."""
    text = (REFERENCES / "experiments.json").read_text("utf-8")
    found: list[dict[str, Any]] = json.loads(text)["experiments"]
    return found


def cross_check(name: str) -> dict[str, bytes]:
    """Return the files of the FMI cross-check (rules 4.1) for the FMU `name`."""
    (experiment,) = (experiment for experiment in experiments() if experiment["name"] == CROSS_CHECK)
    options = {
        "StartTime": 0.0,
        "StopTime": experiment["stop_time"],
        "StepSize": experiment["communication_step"],
        "RelTol": float_info.epsilon,  # the reference is exact but for its rounding to doubles
        "OutputIntervalLength": experiment["communication_step"],
    }
    files = {
        f"{name}_ref.csv": (REFERENCES / experiment["result"]).read_bytes(),
        f"{name}_in.csv": (REFERENCES / experiment["input"]).read_bytes(),
        f"{name}_ref.opt": "".join(f"{option},{value!r}\n" for option, value in options.items()).encode(),
        "README.md": CROSS_CHECK_README.format(fmu=name, version=INTERFACE.version, **experiment).encode(),
    }
    return {f"cross_check/{name}/{file}": content for file, content in files.items()}


@contextmanager
def restored_imports() -> Iterator[None]:
    """Undo what pythonfmu's builder leaves in sys.path and sys.modules."""
    path, modules = list(sys.path), set(sys.modules)
    write_bytecode, sys.dont_write_bytecode = sys.dont_write_bytecode, True
    try:
        yield
    finally:
        sys.dont_write_bytecode = write_bytecode
        sys.path[:] = path
        for name in set(sys.modules) - modules:
            if name.startswith(MODEL_PACKAGE):
                del sys.modules[name]


def read_entries(archive: Path) -> dict[str, bytes]:
    """Return the files of an archive by name."""
    with zipfile.ZipFile(archive) as packed:
        return {name: packed.read(name) for name in packed.namelist()}


def derive_guid(entries: dict[str, bytes]) -> str:
    """Replace the GUID in modelDescription.xml by one that is derived from all the contents, and return it."""
    without = re.sub(rb'guid="[^"]*"', b'guid=""', entries[DESCRIPTION])
    digest = hashlib.sha256()
    for entry, content in sorted((entries | {DESCRIPTION: without}).items()):
        digest.update(entry.encode() + b"\0" + hashlib.sha256(content).digest())
    guid = str(uuid.uuid5(NAMESPACE, digest.hexdigest()))
    entries[DESCRIPTION] = without.replace(b'guid=""', f'guid="{guid}"'.encode(), 1)
    return guid


def write_entries(archive: Path, entries: dict[str, bytes]) -> None:
    """Write an archive that depends on names and contents only."""
    with zipfile.ZipFile(archive, "w") as packed:
        for name, content in sorted(entries.items()):
            info = zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))
            info.compress_type = zipfile.ZIP_DEFLATED
            info.create_system = 3  # the attributes below are Unix ones on every system
            info.external_attr = (0o755 if name.startswith("binaries/") else 0o644) << 16
            packed.writestr(info, content)


def variable_rows() -> list[Sequence[str]]:
    """Return the table of the variables, header first."""
    rows: list[Sequence[str]] = [("name", "type", "unit", "kind", "start", "allowed", "description")]
    for variable in INTERFACE.variables:
        start = "" if variable.start is None else repr(variable.start)
        if isinstance(variable.start, SolverMethod):
            start = f"{variable.start.name} ({variable.start.value})"
        allowed = variable.range.text if variable.range else ""
        unit = INTERFACE.unit_of(variable)
        rows.append(
            (variable.name, variable.type, unit, variable.causality, start, allowed, variable.description)
        )
    return rows


def method_rows() -> list[Sequence[str]]:
    """Return the table of the methods, header first; the limits are those of small motions of the default model."""
    start = {variable.name: variable.start or 0.0 for variable in INTERFACE.variables}
    motion = SLAVE.model(*map(start.__getitem__, SLAVE.model._fields)).motion(0.0)
    rows: list[Sequence[str]] = [
        (
            "value",
            "solver.method",
            "order",
            "evaluations per substep",
            "stable step: undamped",
            "default drag",
            "strong drag",
        )
    ]
    for method in SolverMethod:
        known = METHODS[method]
        limits = [stability_limit(method, rate, motion.w02) for rate in (0.0, motion.damping_rate)]
        stiff = (
            "any step" if known.real_limit == inf else f"{known.real_limit:.4g} {SLAVE.names.damping_time}"
        )
        shown = ["any step" if h == inf else "no step" if h == 0 else f"{h:.4g} s" for h in limits]
        implicit = sum(row[-1] != 0.0 for row in known.tableau)
        stages = f"{implicit} or more (Newton)" if known.stages is None else str(known.stages)
        rows.append((str(method.value), method.name, str(known.order), stages, *shown, stiff))
    return rows


def reference_rows() -> list[Sequence[str]]:
    """Return the table of the reference results, header first: the exact state at the end and the bounds."""
    rows: list[Sequence[str]] = [
        (
            "experiment",
            "start values",
            "communication step",
            "phi(10 s), exact",
            "w(10 s), exact",
            "error at most",
        )
    ]
    for experiment in experiments():
        _, phi, w = (REFERENCES / experiment["result"]).read_text("utf-8").splitlines()[-1].split(",")
        start = ", ".join(f"{name} = {value!r}" for name, value in experiment["start_values"].items())
        torque = f"; torque of `{experiment['input']}`" if experiment["input"] else ""
        rows.append(
            (
                f"`{experiment['name']}`",
                (start or "the defaults") + torque,
                f"{experiment['communication_step']!r} s",
                f"{phi} rad",
                f"{w} rad/s",
                f"{experiment['bounds']['phi']:g} rad, {experiment['bounds']['w']:g} rad/s",
            )
        )
    return rows


def markdown(rows: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    header, *body = rows
    lines = [header, ["---"] * len(header), *body]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def html_table(rows: Iterable[Sequence[str]]) -> str:
    """Return a table in HTML."""

    def line(tag: str, row: Sequence[str]) -> str:
        return "<tr>" + "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in row) + "</tr>\n"

    header, *body = rows
    return f"<table>\n{line('th', header)}{''.join(line('td', row) for row in body)}</table>\n"


def write_documentation(folder: Path, carrier: str) -> None:
    """Write the documentation of the FMU "pythonfmu" or "native": description, external dependencies, licences."""
    licenses = folder / "licenses"
    licenses.mkdir(parents=True)
    shutil.copyfile(ROOT / "LICENSE", licenses / "license.txt")
    shutil.copyfile(DOCUMENTATION / carrier / "third_party.txt", licenses / "third_party.txt")
    needs = (DOCUMENTATION / carrier / "externalDependencies.txt").read_text("utf-8")
    (folder / "externalDependencies.txt").write_text(
        needs.replace("@MODEL_NAME@", native.MODEL_NAME), "utf-8", newline="\n"
    )
    page = (DOCUMENTATION / "index.html").read_text("utf-8")
    page = re.sub(
        r"<!-- only (\w+) -->\n(.*?)<!-- end -->\n",
        lambda part: part[2] if part[1] == carrier else "",
        page,
        flags=re.DOTALL,
    )
    for mark, content in (
        ("VERSION", INTERFACE.version),
        ("VARIABLES", html_table(variable_rows())),
        ("METHODS", html_table(method_rows())),
    ):
        page = page.replace(f"<!-- {mark} -->", content)
    (folder / "index.html").write_text(page, "utf-8", newline="\n")


def _between_marks(table: str, found: re.Match[str]) -> str:
    return f"{found[1]}\n{table}\n{found[2]}"


def readme_with_tables(text: str) -> str:
    """Return README with those of its tables that are data made anew."""
    tables = {"variables": variable_rows, "methods": method_rows, "reference results": reference_rows}
    for mark, rows in tables.items():
        if f"<!-- {mark} -->" in text:
            text = re.sub(
                rf"(<!-- {mark} -->\n).*?(<!-- end of {mark} -->)",
                partial(_between_marks, markdown(rows())),
                text,
                flags=re.DOTALL,
            )
    return text


def write_readme(path: Path) -> Path:
    """Write README with those of its tables that are data made anew, and return its path."""
    path.write_text(readme_with_tables(path.read_text("utf-8")), "utf-8", newline="\n")
    return path


class Parser(argparse.ArgumentParser):
    """Command line whose errors are one line and exit status 2."""

    def error(self, message: str) -> NoReturn:
        """Exit with `message`."""
        one_line = "\\n".join(message.splitlines())  # names of files may be of several
        self.exit(2, f"{self.prog}: {one_line}\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    parser = Parser(prog="build_fmu.py", description=PURPOSE)
    parser.add_argument("--native", action="store_true", help="build the FMU without Python")
    target = parser.add_mutually_exclusive_group()
    target.add_argument(
        "--output", type=Path, metavar="FILE.fmu", help="where to write the FMU instead of into dist"
    )
    target.add_argument(
        "--readme", action="store_true", help="write the tables of README.md anew instead of building"
    )
    target.add_argument(
        "--release",
        type=Path,
        metavar="DIR",
        help="build both FMUs with reference results, cross-check files, conduct as data and SHA256SUMS",
    )
    options = parser.parse_args(arguments)
    if options.release is not None:
        option, output = "--release", options.release
    elif options.readme:
        option, output = "--readme", README
    else:
        option, output = "--output", options.output or (NATIVE_OUTPUT if options.native else DEFAULT_OUTPUT)
    try:
        written = write(parser, options, output)
    except (BuildError, native.CompilationError) as error:
        print(f"build_fmu.py: nothing was written:\n{error}", file=sys.stderr)
        return 1
    except (native.CompilerError, native.ModelFileError) as error:
        parser.error(f"--native: {error}")
    except OSError as error:
        file = f" ({error.filename})" if error.filename not in (None, str(output)) else ""
        parser.error(f"{option} {output}: {error.strerror or error}{file}")
    except KeyboardInterrupt:
        parser.exit(130, "build_fmu.py: interrupted\n")
    print(written)
    return 0


def write(parser: Parser, options: argparse.Namespace, output: Path) -> Path:
    """Write what the options ask for to `output` and return it, or exit where it cannot be written there."""
    if options.release is not None:
        if find_spec("ziglang") is None:
            parser.error("--release: needs the package ziglang, which compiles for every platform")
        if output.exists() and (not output.is_dir() or any(output.iterdir())):
            parser.error(f"--release {output}: must be a new or an empty directory")
        return build_release(output)
    if options.readme:
        return write_readme(output)
    if output.suffix != ".fmu" or output.is_dir():
        parser.error(f"--output {output}: must be a file that ends in .fmu")
    return build_native(output) if options.native else build(output)


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # as Ctrl-C, so that nothing is left behind
    sys.exit(main())
