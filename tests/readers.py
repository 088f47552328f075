"""Finds the functions of the package that read files named by users, which tests of hostile files must cover."""

import ast
from pathlib import Path

PACKAGE = Path("sar_compiler").resolve()
MISSION = Path("search_and_rescue").resolve()
WAYS = {"read_file", "read_yaml", "require_regular", "regular_file", "folder_entries"}
"""The functions that read or check files for all of them."""


class _Calls(ast.NodeVisitor):
    def __init__(self, module: str) -> None:
        self.module, self.around, self.found = module, list[str](), set[str]()

    def visit_FunctionDef(self, node: ast.FunctionDef | ast.ClassDef) -> None:
        self.around.append(node.name)
        self.generic_visit(node)
        self.around.pop()

    visit_ClassDef = visit_FunctionDef  # noqa: N815

    def visit_Call(self, node: ast.Call) -> None:
        name = getattr(node.func, "id", getattr(node.func, "attr", ""))
        if name in WAYS:
            self.found.add(f"{self.module}:{'.'.join(self.around)}")
        self.generic_visit(node)


def readers_in(path: Path, tree: ast.Module) -> set[str]:
    """Return the functions of a module that read files, as `module.py:Class.function`."""
    path = path.resolve()
    if path == PACKAGE / "opener.py":
        return set()
    calls = _Calls(str(path.relative_to(PACKAGE if path.is_relative_to(PACKAGE) else MISSION.parent)))
    calls.visit(tree)
    return calls.found
