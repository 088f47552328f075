"""The page of the Python API: `python docs/site/api_page.py` in the project's folder writes `docs/reference/api.md`, see `make schemas`.

The page is generated from the sources. It lists each public name with its arguments and the first paragraph of its docstring. Other pages of
the site contain the whole docstrings.
"""

import ast
import importlib
import inspect
import os
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs/reference/api.md"
GROUPS = {
    "sar_compiler": "Load, check, compile, simulate, verify and run trees.",
    "sar_compiler.execution": "Run missions from a Python program.",
    "sar_compiler.leaves": "Write and register leaves, controls and decorators.",
    "sar_compiler.missions": "Write missions.",
    "sar_compiler.testing": "Test trees and leaves.",
}
HEAD = """# Python API

This page lists all public names. All other names may change without notice. The docstrings in the sources describe arguments, units and
errors. For examples, see the pages [Use sar_compiler from Python](../how-to/use-from-python.md) and
[Write leaves](../how-to/write-a-leaf.md).
"""
_PUBLIC = re.compile(r"^    from (\S+) import (\w+) as \2$", re.MULTILINE)
_Definition = ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef


def page() -> str:
    """Return the page, generated from the sources."""
    return "\n".join([HEAD, *(line for group in GROUPS for line in _group(group))])


def _group(group: str) -> Iterator[str]:
    """Yield the lines about the names of a public module."""
    module = importlib.import_module(group)
    homes = {name: home for home, name in _PUBLIC.findall(inspect.getsource(module))}
    yield f"## {group}\n\n{GROUPS[group]}\n"
    for name in sorted(module.__all__, key=str.lower):
        path, node = _definition(_file(homes.get(name, group)), name)
        yield f"- **`{name}{_arguments(node)}`** ([source]({os.path.relpath(path, PAGE.parent)})){_summary(node)}"
        if isinstance(node, ast.ClassDef):
            methods = {each.name: each for each in _public_methods(path, node)}
            yield from (f"    - `{each.name}{_arguments(each)}`{_summary(each)}" for each in methods.values())
    yield ""


def _file(module: str) -> Path:
    path = ROOT.joinpath(*module.split("."))
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


def _definition(path: Path, name: str) -> "tuple[Path, ast.stmt | None]":
    """Return the file that defines a name of a module, and the definition; None for a constant or a name of another project."""
    for node in _parsed(path).body:
        if isinstance(node, _Definition) and node.name == name:
            return path, node
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("sar_compiler"):
            for each in node.names:
                if (each.asname or each.name) == name:
                    return _definition(_file(node.module), each.name)
    return path, None


@cache
def _parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def _public_methods(path: Path, node: ast.ClassDef) -> "Iterator[ast.FunctionDef | ast.AsyncFunctionDef]":
    """Yield the public methods and properties of a class, those of its base classes first."""
    for base in node.bases:
        home, found = _definition(path, ast.unparse(base).partition("[")[0])
        if isinstance(found, ast.ClassDef):
            yield from _public_methods(home, found)
    for each in node.body:
        if isinstance(each, (ast.FunctionDef, ast.AsyncFunctionDef)) and not each.name.startswith("_"):
            yield each


def _arguments(node: "ast.stmt | None") -> str:
    """Return the arguments of a function or a constructor; an empty string for a property or a constant."""
    if isinstance(node, ast.ClassDef):
        own = [each for each in node.body if isinstance(each, ast.FunctionDef) and each.name == "__init__"]
        fields = [
            each.target.id
            for each in node.body
            if isinstance(each, ast.AnnAssign) and isinstance(each.target, ast.Name)
        ]
        public = ", ".join(name for name in fields if not name.startswith("_"))
        return _arguments(own[0]) if own else f"({public})" if public else ""
    if not isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
        return ""
    if any("property" in ast.unparse(each) for each in node.decorator_list):
        return ""
    made = ast.parse(f"def f({ast.unparse(node.args)}): ...").body[0]
    for each in ast.walk(made):
        if isinstance(each, ast.arg):
            each.annotation = None
    return "(" + re.sub(r"^(self|cls)(, |$)", "", ast.unparse(made.args)) + ")"  # type: ignore[attr-defined]


def _summary(node: "ast.stmt | None") -> str:
    text = ast.get_docstring(node) if isinstance(node, _Definition) else None
    return f": {' '.join(text.partition(chr(10) * 2)[0].split())}" if text else ""


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
