"""Tests that the effort for large files grows linearly with their size. Effort is the number of calls, not the time."""

import itertools
import sys
from collections.abc import Callable, Iterable

import pytest

from sar_compiler import checks
from sar_compiler.checks import check
from sar_compiler.checks.fixing import apply_fixes, fixes
from sar_compiler.compiler import bind_main, preview_tree
from sar_compiler.nodes import values
from sar_compiler.nodes.registry import default_registry
from sar_compiler.tree import guessing
from sar_compiler.tree.diagnostic import Severity
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.xml import parse_xml
from sar_compiler.tree.xml_writer import write_xml
from sar_compiler.tree.yaml import parse_yaml
from sar_compiler.tree.yaml_writer import write_yaml
from tests.trees import forest_of

SIZE = 100
MOST_GROWTH = 2.3
"""The allowed ratio of calls for twice the size. Quadratic effort would have a ratio of up to four."""


@pytest.mark.parametrize(
    "value",
    ["x" * 3_000_000, "{" * 3_000_000, "${" + "x" * 3_000_000, "1" * 3_000_000, "1 " * 1_000_000],
    ids=["letters", "braces", "a key", "digits", "numbers"],
)
def test_very_long_value_has_short_message(value):
    (finding,) = check(forest_of(document(f'<Sleep msec="{value}"/>')), default_registry())
    assert finding.code == "wrong-value"
    assert len(finding.message) < 1000
    assert len(finding.render()) < 2000


def sequence(nodes: Iterable[str], tag: str = "Sequence") -> str:
    return "\n".join([f"<{tag}>", *nodes, f"</{tag}>"])


def balanced(nodes: Iterable[str]) -> str:
    level = list(nodes)
    while len(level) > 1:
        level = [sequence(level[start : start + 5]) for start in range(0, len(level), 5)]
    return level[0]


def attributes(count: int, form: str) -> str:
    return " ".join(form.format(number) for number in range(count))


def each(form: str) -> Callable[[int], str]:
    """Return a function that makes a sequence of numbered nodes."""
    return lambda count: sequence(form.format(number) for number in range(count))


def alternating(*forms: str) -> Callable[[int], str]:
    return lambda count: sequence(
        form.format(number // len(forms)) for number, form in zip(range(count), itertools.cycle(forms))
    )


def subtrees(use: str, tree: str, tree_id: str = "T{0}") -> Callable[[int], str]:
    """Return a function that makes a sequence of subtrees, each with its own tree."""

    def text(count: int) -> str:
        trees = [another_tree(tree.format(number), tree_id.format(number)) for number in range(count)]
        return "\n".join([each(use)(count), *trees])

    return text


def another_tree(body: str, tree_id: str) -> str:
    """Return the end of a tree, and another tree up to its end."""
    return f'</BehaviorTree>\n<BehaviorTree ID="{tree_id}">\n{body}'


def one_subtree(argument: str, read: str) -> Callable[[int], str]:
    """Return a function that makes a subtree with a number of arguments and a number of reads."""
    return lambda count: (
        f'<SubTree ID="T" {attributes(count, argument)}/>' + another_tree(each(read)(count), "T")
    )


def one_script(statement: str) -> Callable[[int], str]:
    """Return a function that makes a script with a number of statements."""
    return lambda count: f'<Script code="{"; ".join(map(statement.format, range(count)))}"/>'


def one_element(tag: str, attribute: str) -> Callable[[int], str]:
    """Return a function that makes an element with a number of attributes."""
    return lambda count: f"<{tag} {attributes(count, attribute)}/>"


WRITES = '<Script code="k{0} := 1"/>'
READS = '<ScriptCondition code="k{0} == 1"/>'
KINDS: dict[str, Callable[[int], str]] = {
    "leaves": each('<AlwaysSuccess name="n{0}"/>'),
    "unknown attributes in one element": one_element("AlwaysSuccess", 'foo{0}="1"'),
    "unknown attributes of a tag with several meanings": one_element("SetBlackboard", 'foo{0}="1"'),
    "unknown attributes of a subtree": one_element("SubTree", '_foo{0}="1"'),
    "keys of one subtree": one_subtree('x{0}="{0}"', '<ScriptCondition code="x{0} == 1"/>'),
    "keys that one subtree does not use": one_subtree('x{0}="{0}"', '<ScriptCondition code="y{0} == 1"/>'),
    "mistakes of two kinds": alternating("<Foo/>", '<Delay delay_msec="x"><AlwaysSuccess/></Delay>'),
    "mistakes in one line": lambda count: "<Sequence>" + '<AlwaysSuccess x="1"/>' * count + "</Sequence>",
    "unknown tags": each("<Foo{0}/>"),
    "missing attributes": each("<SetBlackboard/>"),
    "slips": each('<AlwaysSuccess NAME="a{0}"/>'),
    "missing subtrees": each('<SubTree ID="Nope{0}"/>'),
    "trees of one ID": subtrees("<AlwaysSuccess/>", "<AlwaysSuccess/>", "T"),
    "subtrees": subtrees('<SubTree ID="T{0}" x="{{k{0}}}"/>', '<SetBlackboard output_key="x" value="1"/>'),
    "postconditions that nobody reads": each('<AlwaysSuccess _onSuccess="k{0} := 1"/>'),
    "postconditions that are read": alternating('<AlwaysSuccess _onSuccess="k{0} := 1"/>', READS),
    "keys": alternating(WRITES, READS),
    "keys in a deep tree": lambda count: balanced(
        (WRITES, READS)[number % 2].format(number // 2) for number in range(count)
    ),
    "keys that are not written": each(READS),
    "keys that are misspelt": alternating(
        '<Script code="key{0} := 1"/>', '<ScriptCondition code="kye{0} == 1"/>'
    ),
    "one key, written and read in turn": alternating(
        '<Script code="k := 1"/>', '<ScriptCondition code="k == 1"/>'
    ),
    "one key, written again and again, then read": lambda count: sequence(
        ['<Script code="k := 1"/>'] * (count // 2) + ['<ScriptCondition code="k == 1"/>'] * (count // 2)
    ),
    "one key, read again and again, then written": lambda count: sequence(
        ['<ScriptCondition code="k == 1"/>'] * (count // 2) + ['<Script code="k := 1"/>'] * (count // 2)
    ),
    "one key, written side by side": lambda count: sequence(
        ['<Script code="k := 1"/>'] * count, "ParallelAll"
    ),
    "statements of one script": one_script("k{0} := 1"),
    "statements of one script that read": one_script("k{0} := j{0} > 1"),
    "statements of one script that do nothing": one_script("k{0}"),
    "texts of one script for ports": lambda count: sequence(
        [one_script("k{0} := 'soon'")(count), each('<Sleep msec="{{k{0}}}"/>')(count)]
    ),
    "texts for subtrees": lambda count: (
        sequence([each(WRITES)(count), each('<SubTree ID="T" name="{0}" x="a{0}"/>')(count)])
        + another_tree('<Sleep msec="{x}"/>', "T")
    ),
    "references": alternating('<DetectSurvivor name="d{0}"/>', '<NotifyBase detect_node="d{0}"/>'),
    "references to nothing": alternating('<DetectSurvivor name="d{0}"/>', '<NotifyBase detect_node="e{0}"/>'),
    "references that are not clear": alternating("<DetectSurvivor/>", "<NotifyBase/>"),
    "leaves that depend on each other": alternating(
        "<ZonesRemaining/>", "<NavigateToZone/>", "<AdvanceZone/>", "<MissionComplete/>", "<DeliverReports/>"
    ),
    "questions before work, looked at again": lambda count: sequence(
        ["<ZonesRemaining/>"] * count + ["<NavigateToZone/>"], "ReactiveSequence"
    ),
    "work that is looked at again": lambda count: sequence(["<NavigateToZone/>"] * count, "ReactiveFallback"),
    "work side by side": lambda count: sequence(["<NavigateToZone/>"] * count, "ParallelAll"),
    "comments": each("<!-- about {0} -->\n\n<AlwaysSuccess/>"),
    "comments in one line": lambda count: "<Sequence>" + "<AlwaysSuccess/><!-- c -->" * count + "</Sequence>",
    "suppressions": each('<!-- sar: allow same-name: so be it -->\n<AlwaysSuccess name="a"/>'),
    "suppressions of unknown findings": each("<!-- sar: allow nothing{0}: so be it -->\n<AlwaysSuccess/>"),
}


def count_calls(action: Callable[[], object]) -> int:
    """Return the number of function calls of an action, including built-in functions."""
    count = 0

    def note(_frame: object, event: str, _argument: object) -> None:
        nonlocal count
        count += event in {"call", "c_call"}

    before = sys.getprofile()
    sys.setprofile(note)
    try:
        action()
    finally:
        sys.setprofile(before)
    return count


def document(body: str) -> str:
    return (
        '<root BTCPP_format="4" main_tree_to_execute="Main">\n<BehaviorTree ID="Main">\n'
        f"{body}\n</BehaviorTree>\n</root>\n"
    )


def all_steps(text: str, *, yaml: bool) -> Callable[[], None]:
    """Return an action that reads, checks, fixes, writes, binds and compiles a file."""
    read, write = (parse_yaml, write_yaml) if yaml else (parse_xml, write_xml)
    written = write(parse_xml(document(text)))

    def action() -> None:
        tree_file = read(written)
        forest = Forest.from_file(tree_file)
        findings = check(forest, default_registry())
        fixes(tree_file.source, tree_file, findings)
        write(tree_file)
        if all(finding.severity is not Severity.ERROR for finding in findings):
            preview_tree(bind_main(forest, default_registry()))

    return action


@pytest.fixture(autouse=True)
def _few_guesses(monkeypatch):
    """Reduce the limit of word comparisons, which files of this size would not reach otherwise."""
    monkeypatch.setattr(guessing, "MOST_COMPARED", SIZE)


@pytest.mark.unmeasured
@pytest.mark.parametrize("yaml", [False, True], ids=["xml", "yaml"])
@pytest.mark.parametrize("kind", KINDS)
def test_effort_grows_linearly_with_file_size(kind, yaml):
    once, twice = (all_steps(KINDS[kind](count), yaml=yaml) for count in (SIZE, 2 * SIZE))
    twice(), once()  # fill the caches, which do not count
    assert count_calls(twice) < MOST_GROWTH * count_calls(once)


@pytest.mark.parametrize("yaml", [False, True], ids=["xml", "yaml"])
def test_each_of_many_attributes_has_its_own_location(yaml):
    # Each value looks like the next attribute.
    said = [f"a{number}=\"a{number + 1}='{number}'\"" for number in range(30)]
    text = f"<AlwaysSuccess {' '.join(said)}/>"
    read, write = (parse_yaml, write_yaml) if yaml else (parse_xml, write_xml)
    (element,) = read(write(parse_xml(document(text)))).trees[0].children
    for number in range(30):
        name, value = element.name_span(f"a{number}"), element.value_span(f"a{number}")
        line = element.source.line(name.line)
        assert line[name.column - 1 : name.end_column - 1] == f"a{number}"
        assert line[value.column - 1 : value.end_column - 1].replace("''", "'") == f"a{number + 1}='{number}'"


def codes(body: str) -> list[str]:
    findings = check(Forest.from_file(parse_xml(document(body))), default_registry())
    return [finding.code for finding in checks.limit_findings(findings)]


def test_schema_adds_no_finding_if_rules_find_more_errors_than_shown(monkeypatch):
    monkeypatch.setattr(checks, "MOST", 3)
    assert codes(each('<Delay delay_msec="x{0}"><AlwaysSuccess/></Delay>')(5)) == [
        *["wrong-value"] * 3,
        "more-findings",
    ]


def test_schema_is_used_despite_many_warnings(monkeypatch):
    monkeypatch.setattr(checks, "MOST", 2)
    found = codes("a stray text" + each("<Sequence><AlwaysSuccess/></Sequence>")(5))
    assert sorted(found) == ["more-findings", "needless-node", "needless-node", "stray-text"]


def test_number_of_hidden_findings_is_reported(monkeypatch):
    monkeypatch.setattr(checks, "MOST", 2)
    body = f'<Sequence>{"<Sucess/>" * 4}<Delay delay_msec="x"><AlwaysSuccess/></Delay></Sequence>'
    findings = checks.limit_findings(check(Forest.from_file(parse_xml(document(body))), default_registry()))
    assert [(each.code, each.severity.value) for each in findings] == [
        ("unknown-node", "error"),
        ("unknown-node", "error"),
        ("more-findings", "info"),
        ("wrong-value", "error"),
    ]
    assert findings[2].message == "2 more unknown-node findings are not shown"


def test_message_lists_first_of_many_names():
    assert values.join_with_commas(["a", "b"]) == "a, b"
    assert values.join_with_commas(list("abcdefghij")) == "a, b, c, d, e, f, g, h, i, j"
    assert values.join_with_commas(list("abcdefghijkl")) == "a, b, c, d, e, f, g, h, i, j and 2 more"
    assert values.join_with_commas(list("abcdefghij"), 14) == "a, b, c, d, e, f, g, h, i, j and 4 more"


def test_guesses_stop_after_too_many_comparisons(monkeypatch):
    monkeypatch.setattr(guessing, "MOST_COMPARED", 5)
    guesses = guessing.Guesses()
    assert guesses.nearest("speed", ["sped", "zone", "base"]) == "sped"
    assert guesses.nearest("speed", ["sped", "zone", "base"]) is None
    assert guesses.nearest("speed", ["sped", "zone"]) == "sped"
    assert guesses.nearest("speed", ["sped"]) is None


def test_several_typos_in_one_element_are_fixed():
    text = document('<Sequence Name="s" MEMORY="True "><AlwaysSuccess/></Sequence>')
    tree_file = parse_xml(text)
    findings = check(Forest.from_file(tree_file), default_registry())
    mended = apply_fixes(text, fixes(tree_file.source, tree_file, findings))
    assert '<Sequence name="s" memory="True ">' in mended
