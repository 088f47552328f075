"""Tests of the parser of scripts: syntax, errors, and the static use of names."""

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


def with_parentheses(expression):
    """Return the text of an expression with parentheses around every part, to show how it was parsed."""
    match expression:
        case Literal(value):
            return f"'{value}'" if isinstance(value, str) else repr(value)
        case Name(name):
            return name
        case Prefix(operator, operand):
            return f"({operator}{with_parentheses(operand)})"
        case Operation(first, steps) | ComparisonChain(first, steps):
            rest = "".join(f" {step.operator} {with_parentheses(step.operand)}" for step in steps)
            return f"({with_parentheses(first)}{rest})"
        case Conditional(condition, then, otherwise):
            return (
                f"({with_parentheses(condition)} ? {with_parentheses(then)} : {with_parentheses(otherwise)})"
            )
        case Assignment(operator, target, value):
            return f"({target.name} {operator} {with_parentheses(value)})"
    raise AssertionError(expression)


def read(text):
    return parse(text).statements


def parsed_text(text):
    return "; ".join(with_parentheses(statement) for statement in read(text))


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


def marked_text(text):
    """Return the part of a text that its error marks."""
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
def test_literal_is_parsed_as_value(text, value):
    (literal,) = parse(text).statements
    assert isinstance(literal, Literal)
    assert literal == Literal(value, start=0, end=len(text))
    assert type(literal.value) is type(value)


@pytest.mark.parametrize("name", ["x", "_x1", "@x", "@_1", "True", "trueish", "and", "or", "not"])
def test_name_is_optional_at_sign_with_letters_digits_and_underscores(name):
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
def test_operator_precedence_is_that_of_behaviortree_cpp(text, meaning):
    assert parsed_text(text) == meaning


@pytest.mark.parametrize("text", ["a:=1;b:=2", "a:=1 b:=2", "a:=1;;\n;b:=2;", "a:=1\tb:=2\r\n"])
def test_semicolons_may_be_omitted_or_repeated(text):
    assert parsed_text(text) == "(a := 1); (b := 2)"


def test_every_expression_has_location_including_parentheses():
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
def test_empty_script_raises_error_unless_allowed(text):
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
def test_fixable_error_is_marked_with_suggestion(text, mark, suggestion):
    assert (marked_text(text), error_of(text).suggestion) == (mark, suggestion)


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
def test_error_is_marked_and_explained(text, mark, said):
    error = error_of(text)
    assert marked_text(text) == mark
    assert said in f"{error.message}; {error.hint}"


@pytest.mark.parametrize("text", ["and := 1", "a; or = 2", "a or := 2", "not := a", "x := and", "f (x)"])
def test_valid_script_resembling_other_language_is_parsed(text):
    assert parse(text).statements


@pytest.mark.parametrize("opening", ["(", "-", "a := ", "a ? b : ", "1 || 1 && 1 < 1 | 1 & 1 + 1 * ("])
def test_too_deep_nesting_raises_error_with_limit(opening):
    error = error_of(opening * 5_000 + "1")
    assert str(MAX_DEPTH) in error.message


def test_too_deep_evaluation_is_rejected_despite_few_parentheses():
    text = "a"
    for _ in range(MAX_DEPTH // 2):
        text = f"({text} * b + c | d)"
    assert str(MAX_DEPTH) in error_of(text).message


def test_nesting_up_to_limit_is_parsed():
    deep = MAX_DEPTH - 1
    assert parsed_text("(" * deep + "a" + ")" * deep) == "a"


def test_sum_of_20000_terms_is_parsed():
    (total,) = read("+".join(["a"] * 20_000))
    assert len(total.steps) == 19_999


def test_number_of_tokens_is_limited():
    error = error_of("+".join(["a"] * 10_000_000))
    assert error.message == f"the script has more than {MAX_WORDS:,} numbers, strings, names and signs"
    assert error.start == MAX_WORDS


def test_script_may_have_thousands_of_statements():
    assert len(parse("a := b + 1; " * 5000).statements) == 5000


def test_name_uses_are_listed_in_order_of_evaluation():
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
def test_name_uses_in_branches_and_chain_ends_are_not_certain(text, certain):
    assert "".join(use.name for use in name_uses(parse(text)) if use.certain) == certain


def test_closing_assignment_is_last_statement_if_it_assigns():
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


def compound_expressions(parts):
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


expressions = st.recursive(literals() | names(), compound_expressions, max_leaves=12)


@given(st.lists(expressions, min_size=1, max_size=3))
def test_fully_parenthesized_script_round_trips(statements):
    text = ";".join(with_parentheses(statement) for statement in statements)
    script = parse(text)
    assert script == Script("", tuple(statements))
    assert ";".join(with_parentheses(statement) for statement in script.statements) == text


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
def test_any_text_is_parsed_or_has_error_within_it(text):
    script, error = outcome(text)
    if error is None:
        assert script.statements
    else:
        assert 0 <= error.start <= error.end <= len(text)
        assert error.message


@given(st.lists(st.sampled_from(SCRAPS + SIGNS), max_size=25).map("".join))
def test_statements_are_in_order_and_do_not_overlap(text):
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
    """Return what `read` returns for a text, with all locations, or the contents of its error."""
    try:
        return repr(read(text))
    except ScriptError as error:
        return str(error), error.start, error.end, error.suggestion, error.hint


@given(SIMPLE.map("".join))
def test_fast_path_for_one_operator_matches_general_parser(text):
    assert outcome_of(parse, text) == outcome_of(lambda text: _ScriptParser(text).script(), text)


def test_expressions_at_different_locations_are_equal():
    one, other = parse("x := y + 1").statements, parse(" x  :=  y + 1").statements
    assert one == other
    assert hash(one) == hash(other)


def test_name_differs_from_string_with_same_text():
    assert Name("a", start=0, end=1) != Literal("a", start=0, end=1)
