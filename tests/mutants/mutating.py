"""Finds the mutants of a module. Each changes one comparison, constant, table entry or keyword of a registration."""

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

_COMPARISONS = {"==": "!=", "!=": "==", "<": "<=", "<=": "<", ">": ">=", ">=": ">"} | {
    "is": "is not",
    "is not": "is",
    "in": "not in",
    "not in": "in",
}
_JUNCTIONS = {"and": "or", "or": "and"}
_BITS = {"|": "&", "&": "|"}
_OPERATOR = re.compile(rb"is\s+not|not\s+in|\bis\b|\bin\b|[=!<>]=|[<>]|\band\b|\bor\b|[|&]")
# Any other string is text for people.
_WORD = re.compile(r"[^\s.]+([.][^\s.]+)*")
_TYPES = {"cast", "TypeVar", "NewType"}
_ONE_LETTER = re.compile("[A-Z]")
_CONSTANT_NAME = re.compile("[A-Z][A-Z_0-9]*")


@dataclass(frozen=True)
class Mutant:
    """A change at one location of a module.

    Attributes:
        path: The module, from the root of the checkout.
        line: Its line, counted from 1.
        text: That line, stripped.
        lines: The lines of the statement up to the change.
        start: The start of the change, in bytes.
        end: The end of the change, in bytes.
        before: The replaced text.
        after: The new text.
    """

    path: str
    line: int
    text: str
    lines: range
    start: int
    end: int
    before: str
    after: str

    @property
    def change(self) -> str:
        """The change in one line."""
        return " ".join(f"{self.before or '(nothing)'} -> {self.after or '(nothing)'}".split())

    def applied(self, source: bytes) -> bytes:
        """Return the module with the change applied."""
        return source[: self.start] + self.after.encode() + source[self.end :]

    def is_python(self, source: bytes) -> bool:
        """Return whether the changed module can be parsed. This takes longer than finding the mutant."""
        try:
            ast.parse(self.applied(source))
        except SyntaxError:
            return False
        return True


def mutants_of(path: str, source: bytes) -> list[Mutant]:
    """Return all changes of a module, ordered by location; a few of them are not valid Python."""
    return sorted(_Finder(path, source).found, key=lambda mutant: (mutant.start, mutant.end, mutant.after))


class _Finder(ast.NodeVisitor):
    def __init__(self, path: str, source: bytes) -> None:
        self.found: list[Mutant] = []
        self._path, self._source = path, source
        self._lines = source.splitlines(keepends=True)
        starts = [0]
        for line in self._lines:
            starts.append(starts[-1] + len(line))
        self._starts = starts
        self._statement: ast.stmt | None = None
        tree = ast.parse(source)
        self._names = sorted(set(_names(tree)))
        # Functions that the module calls on import create its tables.
        self._makers = {call.func.id for call in _calls_at_import(tree) if isinstance(call.func, ast.Name)}
        self._in_table = True
        self.visit(tree)

    def visit(self, node: ast.AST) -> None:
        if isinstance(node, ast.stmt):
            outer, self._statement = self._statement, node
            super().visit(node)
            self._statement = outer
        else:
            super().visit(node)

    def visit_If(self, node: ast.If) -> None:
        if "TYPE_CHECKING" not in ast.dump(node.test):
            self.generic_visit(node)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        outer, self._in_table = self._in_table, node.name in self._makers
        for child in [*node.args.defaults, *filter(None, node.args.kw_defaults), *node.body]:
            self.visit(child)
        self._in_table = outer

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        # Members of an Enum are compared by name, so their values do not matter.
        is_enum = [ast.unparse(base) for base in node.bases] == ["Enum"]
        for child in node.body:
            if not (is_enum and isinstance(child, ast.Assign)):
                self.visit(child)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None and "TypeAlias" not in ast.dump(node.annotation):
            self.visit(node.value)

    def visit_Assign(self, node: ast.Assign) -> None:
        if not any(isinstance(target, ast.Name) and target.id == "__all__" for target in node.targets):
            self.visit(node.value)

    def visit_Expr(self, node: ast.Expr) -> None:
        if not isinstance(node.value, ast.Constant):
            self.generic_visit(node)

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        """Leave messages alone."""

    def visit_Call(self, node: ast.Call) -> None:
        self.visit(node.func)
        named = isinstance(node.func, ast.Name) and node.func.id in _TYPES
        for child in [*node.args[named:], *node.keywords]:
            self.visit(child)
        if self._in_table:
            for keyword in node.keywords:
                if not _is_for_people(keyword.value):
                    self._remove(self._place(keyword))

    def visit_Compare(self, node: ast.Compare) -> None:
        for left, right in pairwise([node.left, *node.comparators]):
            self._between(left, right, _COMPARISONS)
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        for left, right in pairwise(node.values):
            self._between(left, right, _JUNCTIONS)
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        if isinstance(node.op, (ast.BitAnd, ast.BitOr)):
            self._between(node.left, node.right, _BITS)
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        if isinstance(node.op, ast.Not):
            start = self._place(node)[0]
            self._add(start, start + len("not "), "")
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        value = node.value
        if isinstance(value, bool):
            self._add(*self._place(node), repr(not value))
        elif isinstance(value, (int, float)):
            self._add(*self._place(node), repr(value + 1))
        elif isinstance(value, str) and _WORD.fullmatch(value):
            self._add(*self._place(node), repr(f"{value}x"))

    def visit_Name(self, node: ast.Name) -> None:
        if _ONE_LETTER.fullmatch(node.id):
            self._swap(node, node.id, [name for name in self._names if _ONE_LETTER.fullmatch(name)])

    def visit_Attribute(self, node: ast.Attribute) -> None:
        if name := _constant_of_class(node):
            owner = name.partition(".")[0]
            self._swap(node, name, [other for other in self._names if other.startswith(f"{owner}.")])
        self.generic_visit(node)

    def visit_Subscript(self, node: ast.Subscript) -> None:
        self.visit(node.value)
        if isinstance(node.slice, ast.Tuple):
            for child in node.slice.elts:
                self.visit(child)
        else:
            self.visit(node.slice)

    def visit_Dict(self, node: ast.Dict) -> None:
        for key, value in zip(node.keys, node.values, strict=True):
            if key is not None:
                self._remove((self._place(key)[0], self._place(value)[1]))
        self.generic_visit(node)

    def _members(self, node: ast.List | ast.Set | ast.Tuple) -> None:
        if isinstance(node, ast.Set) or isinstance(node.ctx, ast.Load):
            for number, member in enumerate(node.elts):
                if isinstance(node, ast.Tuple) and len(node.elts) == 2:
                    rest = self._place(node.elts[1 - number])
                    kept = self._source[slice(*rest)].decode() + ","
                    self._add(self._place(node.elts[0])[0], self._place(node.elts[1])[1], kept)
                else:
                    self._remove(self._place(member))
        self.generic_visit(node)

    def visit_List(self, node: ast.List) -> None:
        self._members(node)

    def visit_Set(self, node: ast.Set) -> None:
        self._members(node)

    def visit_Tuple(self, node: ast.Tuple) -> None:
        # A tuple that is returned or unpacked is not a table.
        if self._source[self._place(node)[0] :][:1] == b"(":
            self._members(node)
        else:
            self.generic_visit(node)

    def _place(self, node: ast.expr | ast.keyword) -> tuple[int, int]:
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        return self._starts[node.lineno - 1] + node.col_offset, self._starts[
            node.end_lineno - 1
        ] + node.end_col_offset

    def _between(self, left: ast.expr, right: ast.expr, others: dict[str, str]) -> None:
        start, end = self._place(left)[1], self._place(right)[0]
        operator = _OPERATOR.search(self._source, start, end)
        if operator is not None:
            after = others[" ".join(operator[0].decode().split())]
            self._add(operator.start(), operator.end(), after)

    def _swap(self, node: ast.expr, name: str, names: list[str]) -> None:
        if len(names) > 1:
            self._add(*self._place(node), names[(names.index(name) + 1) % len(names)])

    def _remove(self, place: tuple[int, int]) -> None:
        start, end = place
        comma = re.compile(rb"\s*,\s*").match(self._source, end)
        before = re.search(rb",\s*$", self._source[:start])
        if comma is not None:
            end = comma.end()
        elif before is not None:
            start = before.start()
        self._add(start, end, "")

    def _add(self, start: int, end: int, after: str) -> None:
        line = self._source.count(b"\n", 0, start) + 1
        first = self._statement.lineno if self._statement is not None else line
        text = self._lines[line - 1].decode().strip()
        lines = range(first, self._source.count(b"\n", 0, end) + 2)
        before = self._source[start:end].decode()
        self.found.append(Mutant(self._path, line, text, lines, start, end, before, after))


def _is_for_people(node: ast.expr) -> bool:
    is_text = isinstance(node, ast.Constant) and isinstance(node.value, str)
    return isinstance(node, ast.JoinedStr) or (is_text and not _WORD.fullmatch(ast.literal_eval(node)))


def _names(tree: ast.AST) -> Iterator[str]:
    """Yield the one-letter names and the class constants that a module uses."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and _ONE_LETTER.fullmatch(node.id):
            yield node.id
        elif isinstance(node, ast.Attribute) and (name := _constant_of_class(node)):
            yield name


def _constant_of_class(node: ast.Attribute) -> str:
    """Return `Class.CONSTANT`; empty for anything else."""
    owner = node.value.id if isinstance(node.value, ast.Name) else ""
    return f"{owner}.{node.attr}" if owner[:1].isupper() and _CONSTANT_NAME.fullmatch(node.attr) else ""


def _calls_at_import(tree: ast.Module) -> Iterator[ast.Call]:
    for statement in tree.body:
        if not isinstance(statement, (ast.FunctionDef, ast.ClassDef)):
            yield from (node for node in ast.walk(statement) if isinstance(node, ast.Call))
