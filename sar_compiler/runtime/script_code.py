"""Generate fast Python functions from scripts. They handle the common cases: numbers and strings in existing entries.

`evaluation` defines the meaning of scripts and reports their errors. The generated functions are faster, because they
make no calls for most operators and entries. In uncommon cases, the fast path of a statement raises one of
`FALLBACK_ERRORS` before it has written anything, and `evaluation` then evaluates the statement from the start.

No other module generates code, and no text of a file becomes part of the code. A skeleton contains only numbers and operators from a fixed
list. The names of entries and the constants are passed as arguments. The code can access only the functions and types in `_REACHED`.
"""

import ast
import functools
import types
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from sar_compiler.runtime import operators
from sar_compiler.runtime.blackboard import Board, Entry
from sar_compiler.runtime.entry_types import value_of, value_to_assign
from sar_compiler.runtime.expressions import Script
from sar_compiler.runtime.script_skeletons import (
    Applied,
    Chain,
    ConstantSlot,
    Skeleton,
    SkeletonPart,
    VariableSlot,
)
from sar_compiler.runtime.variables import (
    LARGEST_EXACT,
    RefusedValueError,
    ScriptValue,
    VariableError,
    as_real,
)

FALLBACK_ERRORS = (KeyError, ArithmeticError, VariableError)
"""If the fast path of a statement raises one of these errors, `evaluation` evaluates the statement."""

_LONGEST = 1_000
"""Code is generated only for scripts with at most this number of characters."""

_ARITHMETIC: Mapping[str, Callable[[], ast.operator]] = {
    "+": ast.Add,
    "-": ast.Sub,
    "*": ast.Mult,
    "/": ast.Div,
}
_JUNCTIONS: Mapping[str, Callable[[], ast.operator]] = {"&&": ast.BitAnd, "||": ast.BitOr}
# Each order comparison is the negation of the opposite one, so it is true for NaN, as in `operators.compare`.
_DENIED: Mapping[str, Callable[[], ast.cmpop]] = {"<": ast.GtE, ">": ast.LtE, "<=": ast.Gt, ">=": ast.Lt}
_COMPARISONS = frozenset(("==", "!=", *_DENIED))
# For each operator, the name that the generated code uses for the function that accepts any values.
_CALCULATE = {"+": "add", "..": "join", "&": "bits_of_both", "|": "bits_of_any", "^": "bits_of_one"}


def compile_fast_script(
    script: Script,
    entry: Callable[[str], Entry],
    enums: Mapping[str, int],
    usual: Sequence[Callable[[], ScriptValue]],
    condition: Callable[[ScriptValue], bool] | None = None,
    answers: tuple[object, object] | None = None,
) -> Callable[[], Any] | None:
    """Return a function that evaluates a script, or None if the script is too long.

    Args:
        script: The script.
        entry: Function that returns the entry to which a name refers.
        enums: The named constants.
        usual: The functions of `evaluation` for the script's statements.
        condition: Function that converts the value of a condition to a bool; None if the script is not a condition.
        answers: The results to return for true and for false. A script that is not a condition always returns the first result.
    """
    if len(script.text) > _LONGEST:
        return None
    skeleton = Skeleton(script, enums)
    entries = [entry(name) for name in skeleton.names]
    board = entries[0].board if entries else Board("")
    ending = _Return(condition is not None, answers is not None)
    make = _function_of(skeleton.statements, len(entries), len(skeleton.constants), ending)
    tables = board.storage, board.stamps, board.kinds, enums, condition, *(answers or (None, None))
    names = (each.name for each in entries)
    made: Callable[[], Any] = make(*tables, *usual, *names, *skeleton.constants, *skeleton.reals)
    return made


class _Return(NamedTuple):
    """How the generated function of a script returns the result."""

    is_condition: bool
    has_answers: bool

    def from_condition(self, holds: ast.expr) -> ast.expr:
        """Return the code for the result, given the code for a bool."""
        return ast.IfExp(holds, _load("then"), _load("otherwise")) if self.has_answers else holds

    def from_given(self) -> ast.expr:
        """Return the code that converts the variable `given` to the result."""
        given = _load("given")
        if self.is_condition:
            return self.from_condition(_call("condition", given))
        return _load("then") if self.has_answers else given


@functools.lru_cache(maxsize=1024)
def _function_of(
    statements: Sequence[SkeletonPart | None], names: int, constants: int, ending: _Return
) -> types.FunctionType:
    """Return a factory function, which creates the function of each script with this skeleton.

    The factory's arguments are the dictionaries of the board, the named constants, the function that converts a value to a bool, the
    results for true and for false, the fallback of each statement, the names of the entries, the constants, and the constants converted to
    real numbers.
    """
    numbers = {"usual": len(statements), "name": names, "constant": constants, "real": constants}
    taken = [f"{name}{at}" for name, count in numbers.items() for at in range(count)]
    run = _define("run", [], _body(statements, ending))
    tables = ["storage", "stamps", "kinds", "enums", "condition", "then", "otherwise"]
    make = _define("make", [*tables, *taken], [run, ast.Return(_load("run"))])
    code = compile(ast.fix_missing_locations(ast.Module([make], [])), "<script>", "exec")
    return types.FunctionType(
        next(each for each in code.co_consts if isinstance(each, types.CodeType)), _REACHED
    )


def _body(statements: Sequence[SkeletonPart | None], ending: _Return) -> list[ast.stmt]:
    body: list[ast.stmt] = [] if statements else [_assignment("given", ast.Constant(0.0))]
    for at, statement in enumerate(statements):
        usual = _assignment("given", _call(f"usual{at}"))
        if statement is None:
            body.append(usual)
            continue
        is_answer = ending.is_condition and at == len(statements) - 1 and not _is_assignment(statement)
        quick = (
            _FastPath().condition_code(statement, ending) if is_answer else _FastPath().statement(statement)
        )
        body.append(ast.Try(quick, [ast.ExceptHandler(_load("MISSED"), None, [usual])], [], []))
    return [*body, ast.Return(ending.from_given())]


class _FastPath:
    """Generates the code for one statement.

    Attributes:
        reads: The code that precedes the other code: it reads the entries and precomputes values.
    """

    def __init__(self) -> None:
        self.reads: list[ast.stmt] = []
        self._names: set[str] = set()

    def condition_code(self, part: SkeletonPart, ending: _Return) -> list[ast.stmt]:
        """Return the code that evaluates a condition and returns the result."""
        answer = ast.Return(ending.from_condition(self.truth_code(part)))
        return [*self.reads, answer]

    def statement(self, part: SkeletonPart) -> list[ast.stmt]:
        """Return the code that evaluates a statement, and stores its value in the variable `given`."""
        if not isinstance(part, Applied) or not _is_assignment(part):
            given = _assignment("given", self.value_code(part))
            return [*self.reads, given]
        target, value = part.operands
        assert isinstance(target, VariableSlot)  # noqa: S101 - guaranteed by the skeleton
        if part.sign not in {":=", "="}:
            value = Chain((part.sign[0],), (target, value))
        given = _assignment("given", self.value_code(value))
        is_real = _is_number(value) and not isinstance(value, ConstantSlot)
        kind = _load("float") if is_real else _call("type", _load("given"))
        return [*self.reads, given, *_write(f"name{target.number}", kind, creates=part.sign == ":=")]

    def value_code(self, part: SkeletonPart) -> ast.expr:
        """Return the code for the value of a part of a script."""
        if isinstance(part, VariableSlot):
            return self._read(part, "value", (float, int, str), "seen")
        if isinstance(part, ConstantSlot):
            return _load(f"constant{part.number}")
        if _is_truth(part):
            return ast.IfExp(self.truth_code(part), ast.Constant(1.0), ast.Constant(0.0))
        if isinstance(part, Applied) and part.sign == "?":
            condition, then, otherwise = part.operands
            return ast.IfExp(self._choice(condition), self.value_code(then), self.value_code(otherwise))
        return self.real(part) if _is_number(part) else self._operator_code(part)

    def real(self, part: SkeletonPart) -> ast.expr:
        """Return the code for the value of a part of a script that must be a number."""
        if isinstance(part, VariableSlot):
            return self._read(part, "number", (float,), "number_seen")
        if isinstance(part, ConstantSlot) and part.kind is float:
            return _load(f"real{part.number}")
        if isinstance(part, Applied) and part.sign == "-":
            return ast.UnaryOp(ast.USub(), self.real(part.operands[0]))
        if isinstance(part, Chain) and _ARITHMETIC.keys() >= set(part.signs):
            return self._fold(
                part, self.real, lambda sign, *two: ast.BinOp(two[0], _ARITHMETIC[sign](), two[1])
            )
        return _call("as_real", self.value_code(part))

    def truth_code(self, part: SkeletonPart) -> ast.expr:
        """Return the code for the truth value of a part of a script."""
        if isinstance(part, Chain) and part.signs[0] in _JUNCTIONS:
            return self._fold(
                part, self.truth_code, lambda sign, *two: ast.BinOp(two[0], _JUNCTIONS[sign](), two[1])
            )
        if isinstance(part, Chain) and part.signs[0] in _COMPARISONS:
            return self._comparisons(part)
        if isinstance(part, Applied) and part.sign == "!":
            return self._negation(*part.operands)
        if isinstance(part, VariableSlot):
            return self._flag(part, lambda flag: flag, _call("as_condition", _call("seen", self._raw(part))))
        return _call("as_condition", self.value_code(part))

    def _negation(self, part: SkeletonPart) -> ast.expr:
        if _is_truth(part):
            return _negation(self.truth_code(part))
        if isinstance(part, VariableSlot):
            number = _call("number_seen", self._raw(part))
            return self._flag(part, _negation, _compare(number, ast.Eq(), ast.Constant(0.0)))
        return _compare(self.real(part), ast.Eq(), ast.Constant(0.0))

    def _flag(
        self, part: VariableSlot, quick: Callable[[ast.expr], ast.expr], otherwise: ast.expr
    ) -> ast.expr:
        """Return the code for a variable that is probably a bool. It uses *quick* for a bool, and else *otherwise*."""
        raw = self._raw(part)
        return ast.IfExp(_is_of_type(raw, bool), quick(raw), otherwise)

    def _raw(self, part: VariableSlot) -> ast.expr:
        """Return the code for the unconverted blackboard value of a variable."""
        return self._read(part, "raw", ())

    def _choice(self, part: SkeletonPart) -> ast.expr:
        return self.truth_code(part) if _is_truth(part) else _call("is_chosen", self.value_code(part))

    def _fold(
        self, part: Chain, code: Callable[[SkeletonPart], ast.expr], calculate: Callable[..., ast.expr]
    ) -> ast.expr:
        folded = code(part.operands[0])
        for sign, operand in zip(part.signs, part.operands[1:], strict=True):
            folded = calculate(sign, folded, code(operand))
        return folded

    def _operator_code(self, part: Applied | Chain) -> ast.expr:
        """Return the code for operators that have no fast path, because they accept bits or strings."""
        if isinstance(part, Applied):
            return _call("complement", self.value_code(part.operands[0]))
        folded = self.value_code(part.operands[0])
        for sign, operand in zip(part.signs, part.operands[1:], strict=True):
            if sign in _CALCULATE:
                folded = _call(_CALCULATE[sign], folded, self.value_code(operand))
            else:
                folded = ast.BinOp(_call("as_real", folded), _ARITHMETIC[sign](), self.real(operand))
        return folded

    def _comparisons(self, part: Chain) -> ast.expr:
        """Return the code for a chain of comparisons."""
        if len(part.signs) == 1 or all(
            isinstance(each, (VariableSlot, ConstantSlot)) for each in part.operands
        ):
            pairs = zip(part.signs, part.operands, part.operands[1:], strict=False)
            return _conjunction([self._comparison(*each) for each in pairs])
        values = [self._precompute(self.value_code(each)) for each in part.operands]
        compared = zip(part.signs, values, values[1:], strict=False)
        return _conjunction([_usual_comparison(*each) for each in compared])

    def _comparison(self, sign: str, left: SkeletonPart, right: SkeletonPart) -> ast.expr:
        """Return the code for a comparison, with fast paths for comparing numbers and for comparing strings."""
        parts, kind = (left, right), str if _is_text(left) or _is_text(right) else float
        is_known = _is_text if kind is str else _is_number
        if not all(isinstance(each, VariableSlot) or is_known(each) for each in parts):
            return _usual_comparison(sign, self.value_code(left), self.value_code(right))
        if is_known(left) and is_known(right):
            return _comparison_code(kind, sign, self._constant_code(left), self._constant_code(right))
        first, second = map(self._side, parts)
        sides = [
            (side, isinstance(each, VariableSlot)) for side, each in zip((first, second), parts, strict=True)
        ]
        guards = [
            _is_of_type(side, str) if kind is str else _is_exact(side) for side, is_read in sides if is_read
        ]
        seen = (_call("seen", side) if is_read else side for side, is_read in sides)
        return ast.IfExp(
            _conjunction(guards), _comparison_code(kind, sign, first, second), _usual_comparison(sign, *seen)
        )

    def _side(self, part: SkeletonPart) -> ast.expr:
        """Return the code for one side of a comparison. The caller may use this code more than once."""
        if isinstance(part, VariableSlot):
            return self._raw(part)
        return (
            self._constant_code(part)
            if isinstance(part, ConstantSlot)
            else self._precompute(self._constant_code(part))
        )

    def _precompute(self, code: ast.expr) -> ast.expr:
        """Add code that precomputes an expression without side effects, and return the code for the result."""
        name = f"part{len(self.reads)}"
        self.reads.append(_assignment(name, code))
        return _load(name)

    def _constant_code(self, part: SkeletonPart) -> ast.expr:
        return self.value_code(part) if _is_text(part) else self.real(part)

    def _read(self, part: VariableSlot, name: str, kinds: Sequence[type], otherwise: str = "") -> ast.expr:
        """Add the code that reads a variable, and return the code for the value of the variable.

        Args:
            part: The variable.
            name: The prefix of the value's name in the code. The variable's number follows the prefix.
            kinds: The types whose values are used unchanged; empty if no value is converted.
            otherwise: The name of the function that converts values of other types.
        """
        name = f"{name}{part.number}"
        if name not in self._names:
            self._names.add(name)
            self.reads.append(_assignment(name, _item("storage", f"name{part.number}")))
            if kinds:
                others = _conjunction([_is_of_type(_load(name), kind, ast.IsNot()) for kind in kinds])
                self.reads.append(ast.If(others, [_assignment(name, _call(otherwise, _load(name)))], []))
        return _load(name)


def _write(target: str, kind: ast.expr, *, creates: bool) -> list[ast.stmt]:
    """Return the code that writes the variable `given`, whose type is *kind*, to a blackboard entry."""
    held, name = _load("held"), _load(target)
    is_like = _compare(_call("type", held), ast.Is(), kind)
    fitted = _call("fitted", held, _load("kinds"), name, _load("given"), _load("enums"))
    seen = ast.IfExp(_is_of_type(held, int), held, _call("seen", held))
    unlike = [
        _assignment("held", fitted),
        _assignment("given", seen),
        ast.Assign([_item_to("storage", target)], held),
    ]
    found: list[ast.stmt] = [
        _assignment("held", _item("storage", target)),
        _assignment("count", ast.BinOp(_item("stamps", target), ast.Add(), ast.Constant(1))),
    ]
    if creates:
        made = _call("created", *map(_load, ("storage", "stamps", "kinds", target)))
        pair = ast.Tuple([ast.Name("held", ast.Store()), ast.Name("count", ast.Store())], ast.Store())
        handler = ast.ExceptHandler(_load("KeyError"), None, [ast.Assign([pair], made)])
        found = [ast.Try([*found, ast.Expr(_item("kinds", target))], [handler], [], [])]
    return [
        *found,
        ast.If(is_like, [ast.Assign([_item_to("storage", target)], _load("given"))], unlike),
        ast.Assign([_item_to("stamps", target)], _load("count")),
    ]


def _is_assignment(part: SkeletonPart) -> bool:
    return isinstance(part, Applied) and part.sign.endswith("=")


def _is_text(part: SkeletonPart) -> bool:
    return isinstance(part, ConstantSlot) and part.kind is str


def _is_truth(part: SkeletonPart) -> bool:
    """Return whether a part of a script always has one of the values true (1.0) and false (0.0)."""
    if isinstance(part, Chain):
        return part.signs[0] in _JUNCTIONS or part.signs[0] in _COMPARISONS
    return isinstance(part, Applied) and part.sign == "!"


def _is_number(part: SkeletonPart) -> bool:
    """Return whether a part of a script always has a real number as its value, unless it raises an error."""
    if isinstance(part, Chain):
        is_sum = part.signs[0] == "+" and not any(_is_real(each) for each in part.operands[:2])
        return _ARITHMETIC.keys() >= set(part.signs) and not is_sum
    return _is_real(part)


def _is_real(part: SkeletonPart) -> bool:
    return (isinstance(part, ConstantSlot) and part.kind is float) or (
        isinstance(part, Applied) and part.sign == "-"
    )


def _comparison_code(kind: type, sign: str, left: ast.expr, right: ast.expr) -> ast.expr:
    """Return the code for a comparison of two strings, or of two numbers."""
    if sign in _DENIED:
        return _negation(_compare(left, _DENIED[sign](), right))
    if kind is str:
        equal = _compare(left, ast.Eq(), right)
    else:
        equal = _is_within(ast.BinOp(left, ast.Sub(), right), operators.EPSILON)
    return equal if sign == "==" else _negation(equal)


def _usual_comparison(sign: str, left: ast.expr, right: ast.expr) -> ast.expr:
    return _call("compare", ast.Constant(sign), left, right, _load("enums"))


def _is_exact(value: ast.expr) -> ast.expr:
    """Return the code that tests whether a value is a real number, or an integer within `LARGEST_EXACT`."""
    exact = _conjunction([_is_of_type(value, int), _is_within(value, LARGEST_EXACT)])
    return ast.BoolOp(ast.Or(), [_is_of_type(value, float), exact])


def _is_within(value: ast.expr, limit: float) -> ast.expr:
    """Return the code that tests whether the absolute value of a number is at most a limit."""
    return ast.Compare(ast.Constant(-limit), [ast.LtE(), ast.LtE()], [value, ast.Constant(limit)])


def _is_of_type(value: ast.expr, kind: type, operator: ast.cmpop | None = None) -> ast.expr:
    return _compare(_call("type", value), operator or ast.Is(), _load(kind.__name__))


def _conjunction(conditions: list[ast.expr]) -> ast.expr:
    return conditions[0] if len(conditions) == 1 else ast.BoolOp(ast.And(), conditions)


def _negation(condition: ast.expr) -> ast.expr:
    return ast.UnaryOp(ast.Not(), condition)


def _compare(left: ast.expr, operator: ast.cmpop, right: ast.expr) -> ast.expr:
    return ast.Compare(left, [operator], [right])


def _call(function: str, *arguments: ast.expr) -> ast.expr:
    return ast.Call(_load(function), list(arguments), [])


def _load(name: str) -> ast.expr:
    return ast.Name(name, ast.Load())


def _assignment(name: str, value: ast.expr) -> ast.stmt:
    return ast.Assign([ast.Name(name, ast.Store())], value)


def _item(table: str, key: str) -> ast.expr:
    return ast.Subscript(_load(table), _load(key), ast.Load())


def _item_to(table: str, key: str) -> ast.expr:
    return ast.Subscript(_load(table), _load(key), ast.Store())


def _define(name: str, arguments: list[str], body: list[ast.stmt]) -> ast.stmt:
    taken = ast.arguments([], [ast.arg(each) for each in arguments], None, [], [], None, [])
    return ast.FunctionDef(name, taken, body, [])


def _read_value(content: object) -> ScriptValue:
    """Convert the content of an entry to the value that a script reads."""
    if type(content) is bool:
        return int(content)
    value = value_of(content)
    if value is None:
        raise RefusedValueError("scripts cannot calculate with this value")
    return value


def _read_number(content: object) -> float:
    if type(content) is int and -LARGEST_EXACT <= content <= LARGEST_EXACT:
        return float(content)
    return as_real(_read_value(content))


def _declare_entry(
    storage: Mapping[str, object], stamps: Mapping[str, int], kinds: dict[str, type | None], name: str
) -> tuple[object, int]:
    """Declare a missing entry. Return its value, and the number of writes including the next one."""
    kinds.setdefault(name, None)
    return storage.get(name), stamps.get(name, 0) + 1


def _fit_value(
    current: object, kinds: Mapping[str, type | None], name: str, given: ScriptValue, enums: Mapping[str, int]
) -> object:
    """Convert an assigned value if its type differs from the type of the current value."""
    if type(current) is int and type(given) is float and given.is_integer() and abs(given) <= LARGEST_EXACT:
        return int(given)
    if type(current) is bool and given in {0, 1}:
        return bool(given)
    return value_to_assign(current, kinds.get(name), given, enums)


_REACHED: dict[str, Any] = {
    "__builtins__": {},
    "MISSED": FALLBACK_ERRORS,
    "KeyError": KeyError,
    "type": type,
    "bool": bool,
    "float": float,
    "int": int,
    "str": str,
    **{name: operators.BINARY[sign] for sign, name in _CALCULATE.items()},
    "complement": operators.complement,
    "compare": operators.compare,
    "is_chosen": operators.is_chosen,
    "as_condition": operators.as_condition,
    "as_real": as_real,
    "seen": _read_value,
    "number_seen": _read_number,
    "fitted": _fit_value,
    "created": _declare_entry,
}
"""All functions and types that the generated code can access."""
