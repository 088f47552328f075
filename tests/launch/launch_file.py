"""The content of a launch file, read from its source because `launch` is not on PyPI."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent

# Launch's actions that start a process.
STARTERS = ("Node", "ExecuteProcess", "ExecuteLocal", "LifecycleNode", "ComposableNodeContainer")


class LaunchFile:
    """One launch file.

    Args:
        path: The file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.text = path.read_text(encoding="utf-8")
        self.tree = ast.parse(self.text)
        self._values: dict[str, ast.expr] = {}
        for node in ast.walk(self.tree):
            if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
                self._values[node.targets[0].id] = node.value

    def calls(self, *names: str) -> list[ast.Call]:
        """Return the calls of functions or classes, including calls by another name."""
        return [
            node
            for node in ast.walk(self.tree)
            if isinstance(node, ast.Call) and self._name(node.func) in names
        ]

    def _name(self, called: ast.expr) -> str:
        if isinstance(called, ast.Name):
            other = self._values.get(called.id)
            return other.id if isinstance(other, ast.Name) else called.id
        return called.attr if isinstance(called, ast.Attribute) else ""

    def declared(self) -> set[str]:
        """Return the declared arguments; a computed name is given as its expression."""
        return {_text(call.args[0]) for call in self.calls("DeclareLaunchArgument")}

    def used(self) -> set[str]:
        """Return the used arguments; a computed name is given as its expression."""
        return {_text(call.args[0]) for call in self.calls("LaunchConfiguration")}

    def default(self, name: str) -> ast.expr:
        """Return the default of an argument."""
        return next(
            keyword(call, "default_value")
            for call in self.calls("DeclareLaunchArgument")
            if _text(call.args[0]) == name
        )

    def starters(self) -> list[ast.Call]:
        """Return the actions that start processes."""
        return self.calls(*STARTERS)

    def node(self, executable: str) -> ast.Call:
        """Return the node that runs an executable."""
        return next(call for call in self.calls("Node") if _text(keyword(call, "executable")) == executable)

    def constant(self, name: str) -> object:
        """Return the value of a constant of the module."""
        return ast.literal_eval(self._values[name])

    def paths(self) -> Iterator[str]:
        """Return the named shipped files, as glob patterns of absolute paths.

        A computed part is a `*`. Files in the folders of other packages are left out.
        """
        inner = {id(node.left) for node in ast.walk(self.tree) if isinstance(node, ast.BinOp)}
        for node in ast.walk(self.tree):
            if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div) and id(node) not in inner:
                path = self._path(node)
                if path is not None:
                    yield path

    def _path(self, value: ast.expr) -> str | None:
        """Return the pattern of a path that is composed with `/`, `.parent` and variables."""
        if isinstance(value, ast.Name):
            known = str(self.path) if value.id == "__file__" else None
            return self._path(self._values[value.id]) if value.id in self._values else known
        if isinstance(value, ast.BinOp):
            left = self._path(value.left)
            return None if left is None else f"{left}/{pattern(value.right)}"
        if isinstance(value, ast.Attribute) and value.attr == "parent":
            inside = self._path(value.value)
            return None if inside is None else str(Path(inside).parent)
        return self._path_of_call(value) if isinstance(value, ast.Call) else None

    def _path_of_call(self, call: ast.Call) -> str | None:
        if self._name(call.func) == "get_package_share_directory":
            return str(ROOT) if _text(call.args[0]) == "sar_compiler" else None
        if isinstance(call.func, ast.Attribute):  # .resolve()
            return self._path(call.func.value)
        return self._path(call.args[0]) if call.args else None  # str(…), Path(…)


def keyword(call: ast.Call, name: str) -> ast.expr:
    """Return a call's keyword argument; a `None` if it has none."""
    return next((each.value for each in call.keywords if each.arg == name), ast.Constant(None))


def pattern(value: ast.expr) -> str:
    """Return a string as a glob pattern, in which a computed part is a `*`."""
    if isinstance(value, ast.Constant):
        return str(value.value)
    parts = value.values if isinstance(value, ast.JoinedStr) else []
    return "".join(pattern(part) for part in parts) or "*"


def texts(value: ast.AST) -> list[str]:
    """Return every string in an expression."""
    return [
        node.value
        for node in ast.walk(value)
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    ]


def matches(value: ast.expr, name: str) -> bool:
    """Return whether an expression can evaluate to a name."""
    return re.fullmatch(re.escape(pattern(value)).replace(r"\*", ".*"), name) is not None


def _text(value: ast.expr) -> str:
    return str(value.value) if isinstance(value, ast.Constant) else ast.unparse(value)
