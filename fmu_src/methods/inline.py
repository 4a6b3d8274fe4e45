"""Explicit solvers with the acting terms of the acceleration written into their loops, as one would by hand.

A call costs CPython more than the arithmetic of a stage, and a scene should not pay for terms that are zero. The result
equals that of the solver as it reads in `explicit.py` bit for bit, but for the sign of a zero.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping
from functools import cache
from inspect import getsource
from itertools import repeat
from typing import Any

from .explicit import explicit_euler, explicit_midpoint2, explicit_runge_kutta4
from .motion import Motion, Solver


def inlined(solver: Solver, motion: Motion) -> Solver:
    """Return `solver` for motions with the acting terms of `motion`; unchanged where it has no source to rewrite.

    A term whose coefficient is zero is left out, which changes no value but the sign of a zero where its factor is
    finite.
    """
    acting = tuple(map(bool, motion.coefficients()))
    return _inlined(solver, type(motion), acting)


def _source(solver: Solver) -> str | None:
    try:
        return getsource(solver)
    except OSError:  # an importer that ships bytecode only
        return None


# Read now: importers remove the files of an instance, while Python keeps the modules.
_EXPLICIT: tuple[Solver, ...] = (explicit_euler, explicit_midpoint2, explicit_runge_kutta4)
_SOURCES = {solver: _source(solver) for solver in _EXPLICIT}


@cache
def _inlined(solver: Solver, motion: type[Motion], acting: tuple[bool, ...]) -> Solver:
    source = _SOURCES.get(solver)
    if source is None:
        return solver
    terms = motion.terms()
    expression = " + ".join(term for term, acts in zip(terms.values(), acting, strict=True) if acts)
    # No name of a model may be one of the solver.
    own = {name: ast.Name(f"{name}_of_model") for name in terms}
    tree = _Inline(own, expression or "0.0").visit(ast.parse(source))
    names: dict[str, Any] = {"repeat": repeat, **motion.functions()}
    exec(ast.unparse(tree), names)
    inlined_solver: Solver = names[tree.body[0].name]
    return inlined_solver


class _Inline(ast.NodeTransformer):
    """Replaces acceleration(y, z) by the expression with y for x and z for v."""

    def __init__(self, coefficients: Mapping[str, ast.Name], expression: str) -> None:
        self.coefficients, self.expression = coefficients, expression

    def visit_Assign(self, node: ast.Assign) -> ast.AST:
        if ast.unparse(node) == "acceleration = motion.acceleration()":
            names = ", ".join(name.id for name in self.coefficients.values())
            return ast.parse(f"{names} = motion.coefficients()").body[0]
        return self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> ast.AST:
        if not (isinstance(node.func, ast.Name) and node.func.id == "acceleration"):
            return self.generic_visit(node)
        x, v = node.args
        expression: ast.expr = _Substitute({**self.coefficients, "x": x, "v": v}).visit(
            ast.parse(self.expression, mode="eval").body
        )
        return expression


class _Substitute(ast.NodeTransformer):
    def __init__(self, values: Mapping[str, ast.expr]) -> None:
        self.values = values

    def visit_Name(self, node: ast.Name) -> ast.AST:
        return self.values.get(node.id, node)
