"""Static checks of leaf classes, without ROS and without creating instances.

They report attributes that hide a method of a base class, and servers, topics, statuses and keys that the source uses
but the registration does not declare. Classes of this package and of libraries are not checked.
"""

import ast
import functools
import inspect
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from sar_compiler.nodes.spec import MARK, NodeSpec
from sar_compiler.opener import MODULE, UnreadableFileError, read_file
from sar_compiler.tree.diagnostic import Diagnostic, Source, Span
from sar_compiler.tree.model import NO_SPANS

_LIBRARIES = ("sar_compiler.", "py_trees.", "builtins", "abc", "typing")
_FunctionNode = ast.FunctionDef | ast.AsyncFunctionDef


class _ParsedClass(NamedTuple):
    """A class and its definition in the source code.

    Attributes:
        cls: The class.
        node: The definition of the class in the syntax tree.
        source: The file that contains the definition.
    """

    cls: type
    node: ast.ClassDef
    source: Source

    def finding(self, code: str, message: str, at: ast.AST, hint: str) -> Diagnostic:
        """Return a finding located at a syntax node of the class."""
        line, column = getattr(at, "lineno", 1), getattr(at, "col_offset", 0) + 1
        end = getattr(at, "end_col_offset", None) if getattr(at, "end_lineno", line) == line else None
        # `ast` counts columns in bytes, findings in characters. They are equal if only ASCII characters precede the
        # node in its line.
        return Diagnostic(
            code, message, self.source, Span(line, column, line, end + 1 if end else column), hint=hint
        )

    def methods(self) -> Iterator[_FunctionNode]:
        """Yield the methods of the class."""
        return (each for each in self.node.body if isinstance(each, _FunctionNode) and each.args.args)

    def assignments(self) -> Iterator[tuple[str, ast.Attribute]]:
        """Yield the name and syntax node of each instance attribute that a method sets."""
        for method in self.methods():
            own = method.args.args[0].arg
            for node in ast.walk(method):
                if (
                    isinstance(node, ast.Attribute)
                    and isinstance(node.ctx, ast.Store)
                    and isinstance(node.value, ast.Name)
                    and node.value.id == own
                ):
                    yield node.attr, node

    def replaced_methods(self) -> set[str]:
        """Return the attributes to which a method assigns a function.

        Such a function may replace a method on purpose.
        """
        found = set()
        for method in self.methods():
            types = {each.arg: ast.unparse(each.annotation) for each in method.args.args if each.annotation}
            for node in ast.walk(method):
                if isinstance(node, ast.Assign) and _is_function(node.value, types):
                    found |= {each.attr for each in node.targets if isinstance(each, ast.Attribute)}
        return found


def _is_function(value: ast.expr, annotations: Mapping[str, str]) -> bool:
    """Return whether a value is a function: a lambda, `partial(...)`, a method, or a callable argument."""
    if isinstance(value, ast.Call):
        return ast.unparse(value.func).endswith("partial")
    if isinstance(value, ast.Name):
        return "Callable" in annotations.get(value.id, "")
    return isinstance(value, (ast.Lambda, ast.Attribute))


def check_class(spec: NodeSpec) -> Iterator[Diagnostic]:
    """Yield the findings about a node's class.

    Args:
        spec: The node. If it has no class, or is declared by the import path of its class, there are no findings.
    """
    if spec.is_foreign or spec.is_by_path or spec.class_path.startswith(_LIBRARIES) or spec.cls is None:
        return
    parts = [part for base in spec.cls.__mro__ if (part := _parse_class(base)) is not None]
    if not parts or parts[0].cls is not spec.cls:
        return
    assigned = {name for part in parts for name, _ in part.assignments()}
    yield from _missing_attributes(spec, parts[0], assigned)
    for part in parts:
        yield from _hiding_attributes(part)
    yield from _undeclared_uses(spec, parts[0])
    for part in parts:
        yield from _undeclared_outcomes(spec, part)
        yield from _undeclared_keys(spec, part)


def _parse_class(cls: type) -> _ParsedClass | None:
    """Return a class with its definition; None if the class is a library's or has no source file."""
    if f"{cls.__module__}.".startswith(_LIBRARIES):
        return None
    try:
        path = inspect.getsourcefile(cls)
        module = _module(path) if path else None
    except (OSError, TypeError, UnreadableFileError):
        return None
    if module is None:
        return None
    source, tree = module
    node: ast.AST | None = tree
    for name in cls.__qualname__.split("."):
        inside = node.body if isinstance(node, (ast.Module, ast.ClassDef)) else []
        node = next((each for each in inside if isinstance(each, ast.ClassDef) and each.name == name), None)
    return _ParsedClass(cls, node, source) if isinstance(node, ast.ClassDef) else None


@functools.lru_cache(maxsize=64)
def _read_module(path: str, text: str) -> tuple[Source, ast.Module] | None:
    try:
        here = Path.cwd()
        shown = Path(path).relative_to(here) if Path(path).is_relative_to(here) else path
        return Source(str(shown), text, NO_SPANS), ast.parse(text)
    except SyntaxError:  # the file has changed since it was imported
        return None


def _module(path: str) -> tuple[Source, ast.Module] | None:
    return _read_module(path, read_file(Path(path), MODULE).data.decode("utf-8", "replace"))


def _missing_attributes(
    spec: NodeSpec, part: _ParsedClass, assigned: Collection[str]
) -> Iterator[Diagnostic]:
    """Yield findings about attributes that a base class requires, but neither the class nor a method sets."""
    cls = part.cls
    for name, example in getattr(cls, "required_attributes", {}).items():
        if not getattr(cls, name, None) and name not in assigned:
            message = f"<{spec.tag}>: the class {cls.__name__} has no '{name}'"
            hint = f"set it in the class, for example {name} = {example!r}"
            yield part.finding("faulty-class", message, part.node, hint)


def _hiding_attributes(part: _ParsedClass) -> Iterator[Diagnostic]:
    """Yield findings about attributes that hide a method or have the name of a read-only property."""
    cls, seen, replaced = part.cls, set(), part.replaced_methods()
    for name, node in part.assignments():
        known = inspect.getattr_static(cls, name, None)
        if name in seen or (name in replaced and not isinstance(known, property)):
            continue
        if inspect.isfunction(known) or isinstance(known, (classmethod, staticmethod)):
            message = f"{cls.__name__}: this attribute hides the method '{name}' of {_owner(cls, name)}"
        elif isinstance(known, property) and known.fset is None:
            message = f"{cls.__name__}: '{name}' is a read-only property of {_owner(cls, name)}"
        else:
            continue
        seen.add(name)
        yield part.finding("faulty-class", message, node, f"rename it, for example to self._{name}")


def _owner(cls: type, name: str) -> str:
    return next(base.__name__ for base in cls.__mro__ if name in vars(base))


def _undeclared_uses(spec: NodeSpec, part: _ParsedClass) -> Iterator[Diagnostic]:
    """Yield a finding about a server or topic that a leaf needs, but its registration does not declare."""
    kind = getattr(part.cls, "use_kind", "")
    if not kind or any(use.kind == kind for use in spec.uses) or (kind == "action" and _uses_nav2(spec)):
        return
    *_, attribute = getattr(part.cls, "required_attributes", {"": ""})  # the last one contains the name
    name = getattr(part.cls, attribute, "")
    shown = repr(name) if name else '"…"'
    message = f"<{spec.tag}>: {part.cls.__name__} needs the {kind} {shown}, but its registration does not list it in 'uses'"
    hint = (
        f"add uses=[Use.{kind}({shown})] to @register. A run then waits for this {kind} before the first tick"
    )
    yield part.finding("undeclared-in-class", message, _registration(part), hint)


def _uses_nav2(spec: NodeSpec) -> bool:
    return any(use.kind == "nav2" for use in spec.uses)


def _registration(part: _ParsedClass) -> ast.AST:
    """Return the decorator that registers a class, or the class if it has no such decorator."""
    return part.node.decorator_list[0] if part.node.decorator_list and MARK in vars(part.cls) else part.node


def _undeclared_outcomes(spec: NodeSpec, part: _ParsedClass) -> Iterator[Diagnostic]:
    """Yield findings about statuses that `update` returns as literals, but that `outcomes` does not list."""
    for method in part.methods():
        for node in ast.walk(method) if spec.statuses and method.name == "update" else ():
            status = node.value if isinstance(node, ast.Return) else None
            if (
                isinstance(status, ast.Attribute)
                and isinstance(status.value, ast.Name)
                and status.value.id == "Status"
                and status.attr in ("SUCCESS", "FAILURE", "RUNNING")
                and status.attr not in spec.statuses
            ):
                message = f"<{spec.tag}>: update() returns {status.attr}, but the registration does not list this status in 'outcomes'"
                hint = f"add Status.{status.attr} to outcomes, or return another status"
                yield part.finding("undeclared-in-class", message, status, hint)


def _undeclared_keys(spec: NodeSpec, part: _ParsedClass) -> Iterator[Diagnostic]:
    """Yield findings about keys that the class writes with py_trees' client, but that `writes` does not list."""
    for node in ast.walk(part.node):
        if not (isinstance(node, ast.Call) and getattr(node.func, "attr", "") == "register_key"):
            continue
        given: dict[str, ast.expr] = dict(zip(("key", "access"), node.args, strict=False))
        given.update({each.arg: each.value for each in node.keywords if each.arg})
        key, access = given.get("key"), given.get("access")
        is_written = isinstance(access, ast.Attribute) and access.attr in ("WRITE", "EXCLUSIVE_WRITE")
        if is_written and isinstance(key, ast.Constant) and isinstance(key.value, str):
            name = key.value.lstrip("/")
            if name not in spec.writes and f"@{name}" not in spec.writes:
                message = f"<{spec.tag}>: the class writes the key '{name}', but its registration does not list this key in 'writes'"
                hint = f'add writes=["{name}"] to @register, or add an Output to the constructor'
                yield part.finding("undeclared-in-class", message, node, hint)
