"""Tests that the fast form of a script gives the same value, board and error as `Program`, which is the reference."""

import enum
import functools
import math
import random
import types

import pytest

from sar_compiler.analysis.numbered_board import NumberedBoard
from sar_compiler.runtime.blackboard import Board, Scope
from sar_compiler.runtime.evaluation import EvaluationError, Program
from sar_compiler.runtime.kernel.entry_cells import EntryCells
from sar_compiler.runtime.ports import Input
from sar_compiler.runtime.script import MAX_DEPTH, parse
from sar_compiler.runtime.script_code import compile_fast_script
from sar_compiler.runtime.scripting import NodeScript, NodeScriptError, ScopeVariables
from sar_compiler.runtime.tokens import ScriptError
from sar_compiler.runtime.variables import LARGEST_EXACT, Enums
from tests.random_inputs import TIMES

PROGRAMS = 3_000 if TIMES == 1 else max(1, int(10_000 * TIMES))
"""`make soak` tries 100,000."""

ENUMS = Enums({"RED": 1, "BLUE": 3})
NAMES = ["a", "b", "c", "t", "flag", "color", "nope", "@n", "RED"]
WORDS = ["1", "0", "2", "0.5", "1e308", "1e-8", "true", str(LARGEST_EXACT + 1), str(2**63 - 1), "RED", "BLUE"]
TEXTS = ["'a'", "'5'", "'2.5e1'", "'RED'", "''", "'true'"]
BINARY = ["+", "-", "*", "/", "..", "&", "|", "^", "&&", "||", "==", "!=", "<", ">", "<=", ">="]
ASSIGNMENTS = [":=", ":=", "=", "=", "+=", "-=", "*=", "/="]


class Color(enum.Enum):
    RED = 1
    BLUE = 3


class Level(enum.IntEnum):
    LOW = 0
    HIGH = 1


NUMBERS = [0, 1, -1, 2, 7, 0.0, -0.0, 0.5, 1.0, 3.0, -2.5, 1e308, 1e-8, -1e-8, 100.5]
STRANGE = [math.nan, math.inf, -math.inf, True, False]
HUGE = [LARGEST_EXACT, -LARGEST_EXACT, LARGEST_EXACT + 1, -LARGEST_EXACT - 1, 2**63 - 1, 2**70]
OTHERS = ["a", "5", "2.5e1", "RED", "", "true", None, object(), [1], Color.RED, Color.BLUE, Level.HIGH]
KINDS = [None, None, bool, int, float, str]


def expression(chance: random.Random, depth: int) -> str:
    """Return a random expression. Most of them are meaningful."""
    form = chance.random()
    if depth == 0 or form < 0.25:
        return chance.choice([*NAMES, *NAMES, *WORDS, chance.choice(TEXTS)])
    below = [expression(chance, depth - 1) for _ in range(3)]
    if form < 0.35:
        return f"{chance.choice('-~!')}({below[0]})"
    if form < 0.42:
        return f"(({below[0]}) ? ({below[1]}) : ({below[2]}))"
    if form < 0.45:
        return f"({chance.choice(NAMES)} {chance.choice(ASSIGNMENTS)} {below[0]})"
    signs = chance.choices(BINARY, k=2)
    if form < 0.85:
        return f"({below[0]} {signs[0]} {below[1]})"
    return f"({below[0]} {signs[0]} {below[1]} {chance.choice(signs)} {below[2]})"


def statement(chance: random.Random) -> str:
    """Return a random statement."""
    value = expression(chance, chance.randrange(4))
    if chance.random() < 0.4:
        return value
    return f"{chance.choice(NAMES[:-1])} {chance.choice(ASSIGNMENTS)} {value}"


def contents(chance: random.Random) -> dict[str, tuple[bool, object, bool, type | None]]:
    """Return for each entry whether it is written, its value, whether it is declared, and its type."""
    usual = NUMBERS if chance.random() < 0.6 else [*NUMBERS, *STRANGE, *HUGE, *OTHERS]
    return {
        name: (chance.random() < 0.9, chance.choice(usual), chance.random() < 0.7, chance.choice(KINDS))
        for name in ("a", "b", "c", "t", "flag", "color", "n")
    }


class FilledBoard:
    """A board with given contents."""

    def __init__(self, held):
        self.scope = Scope(Board("place"))
        for name, (exists, value, is_declared, kind) in held.items():
            entry = self.scope.resolve(name)
            if is_declared:
                entry.declare(kind)
            if exists:
                entry.write(value)
        self.variables = ScopeVariables(self.scope, ENUMS)

    def state(self):
        board = self.scope.board
        begin = len(board.prefix)
        stamps = {name[begin:]: stamp for name, stamp in board.stamps.items()}
        kinds = {name[begin:]: kind for name, kind in board.kinds.items()}
        return repr(board.values()), stamps, kinds


def fast_script(program, place, condition=None):
    """Return the fast form of a program."""
    usual = [functools.partial(each, place.variables) for each in program.statements]
    return compile_fast_script(program.script, place.variables.entry, ENUMS.numbers, usual, condition)


def outcome(run):
    """Return the result of an evaluation: a value with its type, or the contents of an error."""
    try:
        value = run()
    except EvaluationError as error:
        return str(error), error.start, error.end, error.hint
    return repr(value), type(value)


@pytest.mark.unmeasured
@pytest.mark.parametrize("is_condition", [False, True])
def test_fast_form_of_random_scripts_matches_evaluator(is_condition):
    chance = random.Random(f"{is_condition}")  # noqa: S311 - a test that is the same every time
    done = 0
    while done < PROGRAMS // 2:
        text = "; ".join(statement(chance) for _ in range(chance.choice([1, 1, 1, 2, 3])))
        try:
            program = Program(parse(text), ENUMS.numbers)
        except ScriptError:
            continue
        done += 1
        held = contents(chance)
        here, there = FilledBoard(held), FilledBoard(held)
        compiled = fast_script(program, here, program.as_condition if is_condition else None)
        whole = functools.partial(program.holds if is_condition else program.run, there.variables)
        for _ in range(3):
            assert outcome(compiled) == outcome(whole), (text, held)
            assert here.state() == there.state(), (text, held)


def fail_on_fallback():
    """Fail, because the fast form must not fall back."""
    raise AssertionError


@pytest.mark.parametrize(
    ("text", "held", "value"),
    [
        ("a := 1", {"a": 0}, 1),
        ("a := b; c := 'x'", {"b": 2}, "x"),
        ("a = a - 0.5", {"a": 3.0}, 2.5),
        ("a += 1", {"a": 3}, 4),
        ("t += 'b'", {"t": "a"}, "ab"),
        ("a := b * 2 + c", {"a": 0.5, "b": 2, "c": True}, 5.0),
        ("a > 1 && t == 'x' || !flag", {"a": 0, "t": "y", "flag": False}, 1.0),
        ("a <= b != c", {"a": 1, "b": 2.0, "c": 3}, 1.0),
        ("t == 1", {"t": "1"}, 1.0),
        ("t < 'b'", {"t": "a"}, 1.0),
        ("flag = true", {"flag": False}, 1),
        ("flag && !c", {"flag": True, "c": False}, 1.0),
        ("a := b > 0 ? 'more' : 'less'; t := a .. 1", {"a": "", "b": -1, "t": ""}, "less1"),
        ("~a | 6 ^ 1", {"a": 0}, -2.0),
    ],
)
def test_common_values_are_evaluated_without_fallback(text, held, value):
    place = FilledBoard({name: (True, each, True, None) for name, each in held.items()})
    program = Program(parse(text), ENUMS.numbers)
    usual = [fail_on_fallback] * len(program.script.statements)
    compiled = compile_fast_script(program.script, place.variables.entry, ENUMS.numbers, usual)
    assert compiled is not None
    assert repr(compiled()) == repr(value)


def test_scripts_differing_in_names_and_constants_share_code():
    place = FilledBoard({})
    first, second = (fast_script(Program(parse(text)), place) for text in ("a := a * 2", "b := b * 0.5"))
    assert first.__code__ is second.__code__


def names_and_constants_in(code):
    """Yield all names and constants of a code object."""
    yield from (*code.co_names, *code.co_varnames, *code.co_freevars, *code.co_cellvars)
    for each in code.co_consts:
        yield from names_and_constants_in(each) if isinstance(each, types.CodeType) else [each]


def test_generated_code_contains_no_text_of_script():
    text = "__import__ := 'os'; system = 1234 + __builtins__ .. 'rm'; open > 5678 ? 'x' : eval"
    place = FilledBoard({})
    compiled = fast_script(Program(parse(text), {"eval": 9}), place, bool)
    words = {str(each) for each in names_and_constants_in(compiled.__code__)}
    assert not words & {
        "__import__",
        "os",
        "system",
        "1234",
        "__builtins__",
        "rm",
        "open",
        "5678",
        "x",
        "eval",
        "9",
    }
    assert compiled.__globals__["__builtins__"] == {}


def test_script_with_hundreds_of_operators_falls_back_to_evaluator():
    place = FilledBoard({"a": (True, 1.0, True, None)})
    program = Program(parse(" + ".join(["a"] * 300)))
    assert fast_script(program, place) is None
    assert NodeScript(Input(program.script), "node", "code", place.scope, ENUMS).run() == 300.0


@pytest.mark.parametrize(
    "form",
    [
        "a < (1 - ({}))",
        "0 < ({}) < 2",
        "!({})",
        "-({})",
        "a + ({})",
        "a ? 1 : ({})",
        "(a..'') == ({})",
        "({}) && a",
    ],
)
def test_generated_code_grows_linearly_with_nesting(form):
    text = "a"
    for _ in range(MAX_DEPTH // 5):
        text = form.format(text)
    place = FilledBoard({"a": (True, 0.5, True, None)})
    program = Program(parse(text))
    compiled = fast_script(program, place)
    assert outcome(compiled) == outcome(lambda: program.run(place.variables))
    assert len(compiled.__code__.co_code) < 100 * len(text)


@pytest.mark.parametrize("signs", ["!", "-", "!-", "-~"])
def test_deepest_allowed_script_has_fast_form(signs):
    place = FilledBoard({"a": (True, 0.5, True, None)})
    program = Program(parse(signs * ((MAX_DEPTH - 1) // len(signs)) + "a"))
    assert outcome(fast_script(program, place)) == outcome(lambda: program.run(place.variables))


def test_script_notices_removed_and_rewritten_entry_between_runs():
    place = FilledBoard({"a": (True, 1, False, None)})
    script = NodeScript(Input(parse("a = a + 1")), "node", "code", place.scope, ENUMS)
    assert script.run() == 2
    place.scope.resolve("a").remove()
    with pytest.raises(NodeScriptError, match="there is no variable 'a'"):
        script.run()
    place.scope.resolve("a").write(5)
    assert script.run() == 6


def test_script_writes_to_board_after_it_became_numbered():
    place = FilledBoard({"a": (True, 1, True, None)})
    script = NodeScript(Input(parse("a = a + 1")), "node", "code", place.scope, ENUMS)
    script.run()
    NumberedBoard.from_board(place.scope.board, EntryCells())
    assert script.run() == 3
    assert place.scope.resolve("a").read() == 3
