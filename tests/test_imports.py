"""Modules of the package import one another at their heads, without circles."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from importlib.util import resolve_name
from pathlib import Path

import pytest
import sandboil

ROOT = Path(sandboil.__file__).parent

# What may be imported where it is used: libraries that take long to load, and that few need.
LATE = {"matplotlib", "pandas", "scipy"}


def modules() -> dict[str, Path]:
    """Every module of the package by its name; a package by that of its folder."""
    found = {}
    for path in ROOT.rglob("*.py"):
        parts = path.relative_to(ROOT.parent).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


MODULES = modules()


def imports(node: ast.AST, *, late: bool = False) -> Iterator[tuple[ast.Import | ast.ImportFrom, bool]]:
    """Import statements below a node, and whether they stand in a function; none that are for types alone."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.If) and ast.unparse(child.test) == "TYPE_CHECKING":
            continue
        if isinstance(child, ast.Import | ast.ImportFrom):
            yield child, late
        yield from imports(child, late=late or isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef))


def names(statement: ast.Import | ast.ImportFrom, module: str) -> list[str]:
    """The modules that a statement in a module names."""
    if isinstance(statement, ast.Import):
        return [alias.name for alias in statement.names]
    package = module if MODULES[module].name == "__init__.py" else module.rpartition(".")[0]
    source = resolve_name("." * statement.level + (statement.module or ""), package)
    parts = [f"{source}.{alias.name}" for alias in statement.names]
    return [part if part in MODULES else source for part in parts]


def needed(module: str) -> set[str]:
    """Modules of the package that must be loaded before a module, and the packages that they stand in."""
    tree = ast.parse(MODULES[module].read_text(encoding="utf-8"))
    found = set()
    for statement, late in imports(tree):
        for name in [] if late else names(statement, module):
            parts = name.split(".")
            found |= {".".join(parts[:count]) for count in range(1, len(parts) + 1)}
    # A package is being loaded while its own modules are.
    return {name for name in found & MODULES.keys() if not f"{module}.".startswith(f"{name}.")}


def test_no_module_waits_for_itself() -> None:
    try:
        order = list(TopologicalSorter({module: needed(module) for module in MODULES}).static_order())
    except CycleError as error:
        pytest.fail(" needs ".join(error.args[1]))
    assert set(order) == MODULES.keys()


def test_only_slow_libraries_are_imported_where_they_are_used() -> None:
    late = {
        (module, name)
        for module, path in MODULES.items()
        for statement, is_late in imports(ast.parse(path.read_text(encoding="utf-8")))
        if is_late
        for name in names(statement, module)
    }
    assert not {(module, name) for module, name in late if name.partition(".")[0] not in LATE}
