"""What the C code gives to models: Newton's method for an implicit stage against the model's own way."""

from pathlib import Path

from native import build as native
from tests.toolchain import COMPILER, HERE, needs_compiler, output_of


@needs_compiler
def test_newtons_method_solves_what_the_model_solves_in_its_own_way(tmp_path: Path) -> None:
    for name, content in native.sources("guid").items():
        (tmp_path / name).write_bytes(content)
    options = ["-std=c11", "-O1", "-Wall", "-Wextra", "-Werror", "-pedantic", "-ffp-contract=off"]
    command = [
        COMPILER,
        *options,
        f"-I{native.FMI_HEADERS}",
        "-I.",
        HERE / "native_stage.c",
        "-lm",
        "-o",
        "stage",
    ]
    output_of(command, cwd=tmp_path)
    for seed in (1, 2, 3):
        printed = output_of([tmp_path / "stage", str(seed), "20000"])
        difference, evaluations = map(float, printed.split())
        # A slope of 1 - |s| >= 0.1 makes ten of each of the four roundings in a residual.
        assert difference <= 40.0
        assert evaluations <= 53  # bisection alone would need one for each bit
