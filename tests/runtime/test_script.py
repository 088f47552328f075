"""How scripts are read, what is said about those that cannot be, and what is known of them without running."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sar_compiler.runtime.expressions import (
    Access,
    Assignment,
    ComparisonChain,
    Conditional,
    Literal,
    Name,
    Operation,
    OperatorTerm,
    Prefix,
    Script,
    name_uses,
)
from sar_compiler.runtime.script import MAX_DEPTH, MAX_WORDS, _ScriptParser, parse
from sar_compiler.runtime.tokens import ScriptError


def bracketed(expression):
    """Write an expression with brackets around every part, so that it shows how the text was understood."""
    match expression:
        case Literal(value):
            return f"'{value}'" if isinstance(value, str) else repr(value)
        case Name(name):
            return name
        case Prefix(operator, operand):
            return f"({operator}{bracketed(operand)})"
        case Operation(first, steps) | ComparisonChain(first, steps):
            rest = "".join(f" {step.operator} {bracketed(step.operand)}" for step in steps)
            return f"({bracketed(first)}{rest})"
        case Conditional(condition, then, otherwise):
            return f"({bracketed(condition)} ? {bracketed(then)} : {bracketed(otherwise)})"
        case Assignment(operator, target, value):
            return f"({target.name} {operator} {bracketed(value)})"
    raise AssertionError(expression)


def read(text):
    return parse(text).statements


def understood(text):
    return "; ".join(bracketed(statement) for statement in read(text))


def error_of(text, **arguments):
    with pytest.raises(ScriptError) as caught:
        parse(text, **arguments)
    return caught.value


def outcome(text):
    """Return the script of a text or its error."""
    try:
        return parse(text), None
    except ScriptError as error:
        return None, error


def marked(text):
    """Return what the error of a text points at."""
    error = error_of(text)
    return text[error.start : error.end]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("42", 42),
        ("007", 7),
        ("0xFf", 255),
        ("0X10", 16),
        ("9223372036854775807", 2**63 - 1),
        ("1.5", 1.5),
        ("1e3", 1000.0),
        ("1.5E-3", 0.0015),
        ("2e+1", 20.0),
        ("'some text'", "some text"),
        ("''", ""),
        ("'\"a\\n; == (%'", '"a\\n; == (%'),
        ("'über'", "über"),
        ('"it\'s"', "it's"),
        ("true", 1.0),
        ("false", 0.0),
    ],
)
def test_a_literal_has_the_value_that_it_says(text, value):
    (literal,) = parse(text).statements
    assert isinstance(literal, Literal)
    assert literal == Literal(value, start=0, end=len(text))
    assert type(literal.value) is type(value)


@pytest.mark.parametrize("name", ["x", "_x1", "@x", "@_1", "True", "trueish", "and", "or", "not"])
def test_a_name_is_letters_digits_and_underscores_maybe_behind_an_at_sign(name):
    assert parse(name).statements == (Name(name, start=0, end=len(name)),)


@pytest.mark.parametrize(
    ("text", "meaning"),
    [
        ("a + b * c", "(a + (b * c))"),
        ("a * b + c", "((a * b) + c)"),
        ("a - b + c .. d", "(a - b + c .. d)"),
        ("(a + b) * c", "((a + b) * c)"),
        ("a | b & c ^ d", "(a | (b & c) ^ d)"),
        ("a == b | c", "(a == (b | c))"),
        ("a && b == c", "(a && (b == c))"),
        ("a || b && c", "(a || (b && c))"),
        ("a < b <= c != d", "(a < b <= c != d)"),
        ("(a < b) < c", "((a < b) < c)"),
        ("-a * b", "((-a) * b)"),
        ("!-~a", "(!(-(~a)))"),
        ("!a == b", "((!a) == b)"),
        ("a - -b", "(a - (-b))"),
        ("a ? b : c ? d : e", "(a ? b : (c ? d : e))"),
        ("a ? b ? c : d : e", "(a ? (b ? c : d) : e)"),
        ("a || b ? c : d", "((a || b) ? c : d)"),
        ("a ? x := 1 : b", "(a ? (x := 1) : b)"),
        ("x := y = a || b", "(x := (y = (a || b)))"),
        ("x := a ? b : c", "(x := (a ? b : c))"),
        ("a + (x += 1)", "(a + (x += 1))"),
        ("(x) = 1", "(x = 1)"),
        ("65..66", "(65 .. 66)"),
        ("1.5..'m'", "(1.5 .. 'm')"),
    ],
)
def test_operators_bind_as_in_behavior_tree_cpp(text, meaning):
    assert understood(text) == meaning


@pytest.mark.parametrize("text", ["a:=1;b:=2", "a:=1 b:=2", "a:=1;;\n;b:=2;", "a:=1\tb:=2\r\n"])
def test_semicolons_may_be_left_out_and_may_be_many(text):
    assert understood(text) == "(a := 1); (b := 2)"


def test_every_expression_knows_where_it_stands_brackets_included():
    text = "x := (a + 1) * -b;  (c) ? 'd' : e < 2"
    first, second = read(text)
    assert text[first.start : first.end] == "x := (a + 1) * -b"
    assert text[first.target.start : first.target.end] == "x"
    product = first.value
    assert text[product.start : product.end] == "(a + 1) * -b"
    assert text[product.first.start : product.first.end] == "a + 1"
    (step,) = product.steps
    assert (text[step.start : step.end], text[step.operand.start : step.operand.end]) == ("*", "-b")
    assert text[second.start : second.end] == "(c) ? 'd' : e < 2"
    assert text[second.otherwise.start : second.otherwise.end] == "e < 2"


@pytest.mark.parametrize("text", ["", " \t\n"])
def test_a_script_without_expressions_is_an_error_unless_the_caller_wants_it(text):
    assert "empty" in error_of(text).message
    assert parse(text, allow_empty=True).statements == ()


@pytest.mark.parametrize(
    ("text", "mark", "suggestion"),
    [
        ("x == \u201chome\u201d", "\u201chome\u201d", "'home'"),
        ("a and b", "and", "&&"),
        ("(a or b)", "or", "||"),
        ("a ? b and c : d", "and", "&&"),
        ("not a", "not", "!"),
        ("not(a)", "not", "!"),
        ("a === b", "===", "=="),
        ("a !== b", "!==", "!="),
        ("a <> b", "<>", "!="),
        ("a ~= b", "~=", "!="),
        ("a =< b", "=<", "<="),
        ("a => b", "=>", ">="),
        ("a =+ 1", "=+", "+="),
        ("{x} == 1", "{x}", "x"),
        ("1. + x", "1.", "1.0"),
        ("x * .5", ".5", "0.5"),
    ],
)
def test_what_can_be_mended_is_shown_with_what_to_write_instead(text, mark, suggestion):
    assert (marked(text), error_of(text).suggestion) == (mark, suggestion)


@pytest.mark.parametrize(
    ("text", "mark", "said"),
    [
        ("a % 2", "%", "'%' is not allowed in a script"),
        ("a, b", ",", "';'"),
        ("x[0]", "[", "no lists"),
        ("# why", "#", "no comments"),
        ("a // why", "//", "no comments"),
        ("a ** 2", "**", "no operator '**'"),
        ("a++", "++", "x += 1"),
        ("a--", "--", "x -= 1"),
        ("a |= b", "|=", "x = x | y"),
        ("goal.x > 1", "goal.x", "cannot contain a point"),
        ("a . b", ".", "join strings with '..'"),
        ("f(x)", "f(", "cannot call 'f'"),
        ("a\xa0b", "\xa0", "ordinary space"),
        ("größe", "ö", "is not allowed in a name"),
        ("{}", "{}", "without braces"),
        ("x == 'abc", "'abc", "no closing quotation mark"),
        ("'it\\'s'", "'", "cannot contain this character"),
        ("\"it's", "\"it's", "single quotation mark"),
        ("3m", "3m", "neither a number nor a name"),
        ("1.2.3", "1.2.3", "neither a number nor a name"),
        ("2.5e-1@x", "2.5e-1@x", "neither a number nor a name"),
        ("0x1F..'a'", "0x1F.", "neither a number nor a name"),
        ("0x", "0x", "write for example 0xFF"),
        ("1e+", "1e", "write for example 1e3"),
        ("9223372036854775808", "9223372036854775808", "too large"),
        ("0x8000000000000000", "0x8000000000000000", "too large"),
        ("9" * 5000, "9" * 5000, "too large"),
        ("1e999", "1e999", "too large"),
        ("a +", "+", "missing after '+'"),
        ("x = ", "=", "missing after '='"),
        ("(a && ) b", "&&", "missing after '&&'"),
        ("a = ; b", "=", "missing after '='"),
        ("!", "!", "missing after '!'"),
        ("&& a", "&&", "missing before '&&'"),
        (";a", ";", "missing before ';'"),
        ("x == +5", "+", "without '+'"),
        ("(a", "(", "not closed"),
        ("(a b)", "b", "')' is missing before 'b'"),
        ("(a; b)", ";", "one expression"),
        ("a)", ")", "has no '('"),
        ("()", "()", "these parentheses are empty"),
        ("a ? b", "?", "has no ':'"),
        ("a : b", ":", "has no '?'"),
        ("1 = x", "1 =", "only variables"),
        ("a && b = 1", "a && b =", "'==' to compare"),
        ("(a + b) := 1", "(a + b) :=", "only variables"),
        ("-x += 1", "-x +=", "only variables"),
        ("a ? b : c := 1", ":=", "another expression in parentheses"),
        (":= 1", ":=", "only variables"),
    ],
)
def test_a_mistake_is_pointed_at_and_explained(text, mark, said):
    error = error_of(text)
    assert marked(text) == mark
    assert said in f"{error.message}; {error.hint}"


@pytest.mark.parametrize("text", ["and := 1", "a; or = 2", "a or := 2", "not := a", "x := and", "f (x)"])
def test_what_looks_like_another_language_but_is_a_script_is_read(text):
    assert parse(text).statements


@pytest.mark.parametrize("opening", ["(", "-", "a := ", "a ? b : ", "1 || 1 && 1 < 1 | 1 & 1 + 1 * ("])
def test_nesting_ends_with_a_message_that_says_how_deep_is_too_deep(opening):
    error = error_of(opening * 5_000 + "1")
    assert str(MAX_DEPTH) in error.message


def test_what_would_be_evaluated_too_deeply_is_refused_even_if_its_brackets_are_few():
    text = "a"
    for _ in range(MAX_DEPTH // 2):
        text = f"({text} * b + c | d)"
    assert str(MAX_DEPTH) in error_of(text).message


def test_nesting_up_to_the_limit_is_read():
    deep = MAX_DEPTH - 1
    assert understood("(" * deep + "a" + ")" * deep) == "a"


def test_a_sum_may_be_as_long_as_somebody_likes():
    (total,) = read("+".join(["a"] * 20_000))
    assert len(total.steps) == 19_999


def test_there_is_an_end_to_how_long_a_script_may_be():
    error = error_of("+".join(["a"] * 10_000_000))
    assert error.message == f"the script has more than {MAX_WORDS:,} numbers, strings, names and signs"
    assert error.start == MAX_WORDS


def test_a_script_may_have_thousands_of_expressions():
    assert len(parse("a := b + 1; " * 5000).statements) == 5000


def test_names_are_listed_in_the_order_in_which_a_run_comes_to_them():
    uses = [(use.access, use.name, use.start, use.end) for use in name_uses(parse("x := y + @z; x += RED"))]
    assert uses == [
        (Access.READ, "y", 5, 6),
        (Access.READ, "@z", 9, 11),
        (Access.CREATE, "x", 0, 1),
        (Access.READ, "RED", 18, 21),
        (Access.READ, "x", 13, 14),
        (Access.CHANGE, "x", 13, 14),
    ]


@pytest.mark.parametrize(
    ("text", "certain"),
    [
        ("a && b || c", "abc"),
        ("a ? b : c", "a"),
        ("a ? (b ? c : d) : e", "a"),
        ("a < b < c < d", "ab"),
        ("x = (a ? b : c)", "ax"),
        ("a ? x := b : 0", "a"),
    ],
)
def test_only_branches_and_the_ends_of_chains_are_not_certain_to_be_reached(text, certain):
    assert "".join(use.name for use in name_uses(parse(text)) if use.certain) == certain


def test_a_script_says_whether_its_value_is_that_of_an_assignment():
    closing = parse("level == 1; level = 2").closing_assignment
    assert closing is not None
    assert (closing.operator, closing.target.name) == ("=", "level")
    assert parse("level = 2; level == 1").closing_assignment is None
    assert parse("", allow_empty=True).closing_assignment is None


def literals():
    numbers = st.integers(0, 2**63 - 1) | st.floats(0, allow_nan=False, allow_infinity=False)
    return (numbers | st.text(st.characters(exclude_characters="'"))).map(
        lambda value: Literal(value, start=0, end=0)
    )


def names():
    words = st.from_regex(r"[A-Za-z_@][A-Za-z0-9_]*", fullmatch=True)
    return words.filter(lambda word: word not in {"true", "false", "not", "and", "or"}).map(
        lambda word: Name(word, start=0, end=0)
    )


NOWHERE = {"start": st.just(0), "end": st.just(0)}


def chains(kind, operators, parts):
    steps = st.lists(
        st.builds(OperatorTerm, st.sampled_from(operators), parts, **NOWHERE),
        min_size=1,
        max_size=3,
    )
    return st.builds(kind, parts, steps.map(tuple), **NOWHERE)


def larger(parts):
    ranks = [["||"], ["&&"], ["|", "^"], ["&"], ["+", "-", ".."], ["*", "/"]]
    return st.one_of(
        st.builds(Prefix, st.sampled_from("-~!"), parts, **NOWHERE),
        *(chains(Operation, rank, parts) for rank in ranks),
        chains(ComparisonChain, ["==", "!=", "<", ">", "<=", ">="], parts),
        st.builds(Conditional, parts, parts, parts, **NOWHERE),
        st.builds(
            Assignment, st.sampled_from([":=", "=", "+=", "-=", "*=", "/="]), names(), parts, **NOWHERE
        ),
    )


expressions = st.recursive(literals() | names(), larger, max_leaves=12)


@given(st.lists(expressions, min_size=1, max_size=3))
def test_what_is_written_with_all_its_brackets_is_read_as_what_it_was(statements):
    text = ";".join(bracketed(statement) for statement in statements)
    script = parse(text)
    assert script == Script("", tuple(statements))
    assert ";".join(bracketed(statement) for statement in script.statements) == text


SCRAPS = [
    "a",
    "@b",
    "1",
    "0x",
    ".5",
    "1.",
    "2e",
    "'t'",
    "'",
    '"',
    "and",
    "not",
    "true",
    " ",
    "\n",
    ";",
    "(",
    ")",
]
SIGNS = [
    "?",
    ":",
    "=",
    ":=",
    "==",
    "!=",
    "<",
    ">=",
    "+",
    "+=",
    "-",
    "*",
    "/",
    "&",
    "&&",
    "|",
    "^",
    "~",
    "!",
    ".",
    "%",
    "{",
]


@given(st.text() | st.lists(st.sampled_from(SCRAPS + SIGNS), max_size=25).map("".join))
def test_any_text_is_a_script_or_has_an_error_within_it(text):
    script, error = outcome(text)
    if error is None:
        assert script.statements
    else:
        assert 0 <= error.start <= error.end <= len(text)
        assert error.message


@given(st.lists(st.sampled_from(SCRAPS + SIGNS), max_size=25).map("".join))
def test_expressions_cover_the_text_in_order_and_apart(text):
    script, error = outcome(text)
    if error is None:
        places = [(statement.start, statement.end) for statement in script.statements]
        assert all(start < end for start, end in places)
        assert all(first[1] <= second[0] for first, second in itertools.pairwise(places))


SIMPLE = st.tuples(
    st.sampled_from(["", " ", "\n\t"]),
    st.sampled_from(["a", "@b", "true", "not", "or", "if", "x1", "1", "'t'"]),
    st.sampled_from(["", " "]),
    st.sampled_from(
        [*[":=", "==", "!=", "<=", ">=", "+=", "-=", "*=", "/=", "=", "<", ">", "+", "=-", "?", ";"], ":=="]
    ),
    st.sampled_from(["", "  "]),
    st.sampled_from(
        [
            "1",
            "007",
            "1" * 15,
            "1" * 25,
            "1.5",
            "1.",
            ".5",
            "3m",
            "0x1F",
            "''",
            "'a b'",
            '"a"',
            "a",
            "false",
            "and",
            "-1",
            "",
        ]
    ),
    st.sampled_from(["", " ", "\r\n", ";", " ; b"]),
)


def outcome_of(read, text):
    """Return what is read of a text, with all places, or what is said of its mistake."""
    try:
        return repr(read(text))
    except ScriptError as error:
        return str(error), error.start, error.end, error.suggestion, error.hint


@given(SIMPLE.map("".join))
def test_a_script_of_one_operator_is_read_as_any_other(text):
    assert outcome_of(parse, text) == outcome_of(lambda text: _ScriptParser(text).script(), text)


def test_expressions_at_other_locations_are_equal():
    one, other = parse("x := y + 1").statements, parse(" x  :=  y + 1").statements
    assert one == other
    assert hash(one) == hash(other)


def test_a_name_differs_from_a_string_of_the_same_text():
    assert Name("a", start=0, end=1) != Literal("a", start=0, end=1)
