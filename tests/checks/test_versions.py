"""Tests of findings that depend on the target version of BehaviorTree.CPP."""

import re
from pathlib import Path

import pytest

from sar_compiler.checks import check
from sar_compiler.cli.compile import main
from sar_compiler.loaded_tree import load
from sar_compiler.nodes.btcpp import VERSIONS
from sar_compiler.nodes.btcpp.to_btcpp import to_btcpp
from sar_compiler.nodes.registry import default_registry
from sar_compiler.tree.conversion import convert
from sar_compiler.tree.diagnostic import Form, Severity
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.xml import parse_xml
from sar_compiler.tree.yaml import parse_yaml
from tests.docs.markdown import tables
from tests.trees import document, forest_of

MAIN = '<root BTCPP_format="4" main_tree_to_execute="Main">\n<BehaviorTree ID="Main">{}</BehaviorTree>\n'
PART = '<BehaviorTree ID="{0}">{1}</BehaviorTree></root>'


def tree_with_id(tree_id):
    return MAIN.format(f'<SubTree ID="{tree_id}"/>') + PART.format(tree_id, "<Success/>")


# The releases of BehaviorTree.CPP that began to reject a construct.
RELEASES = {"4.8.4", "4.9.0", "4.9.1"}
SWITCH = '<Switch2 variable="{zone}" case_1="7" case_2="8"><Success/><Success/><Success/></Switch2>'
A_NUMBER = "a number for a port that reads a text"
# Each: a file, the versions that reject it, and line and column of their finding.
CASES = {
    "an ID with a blank": (tree_with_id("my tree"), {"4.9", "4.10"}, (3, 19)),
    "an ID with a dot": (tree_with_id("v.2"), {"4.9", "4.10"}, (3, 19)),
    "the ID Root": (tree_with_id("Root"), {"4.9", "4.10"}, (3, 19)),
    "the name of a port with a dot": (
        MAIN.format('<SubTree ID="B" a-b="5" a.b="5"/>')
        + PART.format(
            "B", '<Repeat num_cycles="{a.b}"><Repeat num_cycles="{a-b}"><Sleep msec="1"/></Repeat></Repeat>'
        ),
        {"4.9", "4.10"},
        (2, 49),
    ),
    "the name of a node with a dot, but for one that is an ID": (
        MAIN.format('<Sequence><v.Go/><Action ID="v.Go"/></Sequence>')
        + '<TreeNodesModel><Action ID="v.Go"/></TreeNodesModel></root>',
        {"4.9", "4.10"},
        (2, 35),
    ),
    "two subtrees of one name": (
        MAIN.format('<Sequence><SubTree ID="B" name="b"/><SubTree ID="B" name="b"/></Sequence>')
        + PART.format("B", "<Success/>"),
        {"4.9", "4.10"},
        (2, 83),
    ),
    "a subtree that is called as another one is by itself": (
        MAIN.format('<Sequence><SubTree ID="B" name="B::4"/><SubTree ID="B"/></Sequence>')
        + PART.format("B", "<Success/>"),
        {"4.9", "4.10"},
        (2, 64),
    ),
    A_NUMBER: (
        MAIN.format('<SubTree ID="B" zone="007"/>') + PART.format("B", SWITCH),
        {"4.9", "4.10"},
        (3, 41),
    ),
    "a text in double quotation marks": (
        MAIN.format("<ScriptCondition code=\"&quot;a&quot; == 'a'\"/>") + "</root>",
        {"4.9", "4.10"},
        (2, 48),
    ),
    "a sum that begins with a difference": (
        MAIN.format('<ScriptCondition code="1 - 2 + 3 == 2 != (1 - 2) + 3 != 1 + 2 - 3 != 1 - 2 * 3"/>')
        + "</root>",
        {"4.8"},
        (2, 50),
    ),
    "a quotient that goes on": (
        MAIN.format('<ScriptCondition code="8 / 2 * 4 == 2 * 4 / 8 == (8 / 2) / 4"/>') + "</root>",
        {"4.8"},
        (2, 50),
    ),
    "one bit or another": (
        MAIN.format('<ScriptCondition code="(1 | 2 | 4) ^ 3 == 1 | 2 ^ 3"/>') + "</root>",
        {"4.8"},
        (2, 69),
    ),
    "both after either": (
        MAIN.format(
            '<ScriptCondition code="(1 || 0 == (1 &amp;&amp; 0)) != (1 &amp;&amp; 0 || 1) ? 1 || 1 : 1 &amp;&amp; 0 || 1 &amp;&amp; 0"/>'
        )
        + "</root>",
        {"4.8"},
        (2, 133),
    ),
    "operators of bits beside those of numbers": (
        MAIN.format('<ScriptCondition code="~3 * 1 != ((3 + 1) &amp; 1) * (1 ? 2 * 3 : 1)"/>') + "</root>",
        {"4.8"},
        (2, 51),
    ),
    "a sign of a number beside operators of bits": (
        MAIN.format('<ScriptCondition code="3 &amp; -1 == 3"/>') + "</root>",
        {"4.8"},
        (2, 56),
    ),
    "a number that is worked out within a text": (
        MAIN.format("<ScriptCondition code=\"1 + 2 .. 'a' == (1 + 2) .. 'a'\"/>") + "</root>",
        {"4.8"},
        (2, 54),
    ),
    "a choice in a choice": (
        MAIN.format('<ScriptCondition code="1 ? (0 ? 0 : 1) : 0 ? 1 ? 0 : 1 : 0"/>') + "</root>",
        {"4.8"},
        (2, 68),
    ),
    "two values at once": (
        MAIN.format(
            '<Sequence><Script code="a := (b := 1); c := d := a"/><ScriptCondition code="b == c == d"/></Sequence>'
        )
        + "</root>",
        {"4.8"},
        (2, 71),
    ),
    "two statements without a semicolon": (
        MAIN.format(
            '<Sequence><Script code="a := 1; b := \';\'&#10;c := 2;"/><ScriptCondition code="a + b == c"/></Sequence>'
        )
        + "</root>",
        {"4.8"},
        (2, 70),
    ),
    "a node of a newer version": (
        MAIN.format("<TryCatch><NavigateToZone/><NavigateToBase/></TryCatch>") + "</root>",
        {"4.8"},
        (2, 25),
    ),
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("version", VERSIONS)
def test_construct_is_reported_only_for_versions_that_reject_it(name, version):
    text, refusing, place = CASES[name]
    findings = _without_constants(check(forest_of(text), default_registry(), (), VERSIONS[version]))
    severity = Severity.ERROR if name == A_NUMBER else Severity.WARNING
    assert [(f.code, f.severity, f.span.line, f.span.column) for f in findings] == (
        [("btcpp-version", severity, *place)] if version in refusing else []
    )
    releases = [re.search(r"refuses that since (.*)", f.message) for f in findings]
    assert all(each[1] in RELEASES for each in releases if each)


@pytest.mark.parametrize("name", CASES)
def test_construct_in_yaml_is_reported_for_same_versions(name):
    text, refusing, _ = CASES[name]
    yaml = convert(parse_xml(text), Form.YAML).text
    for version, known in VERSIONS.items():
        findings = check(Forest.from_file(parse_yaml(yaml, "t.yaml")), default_registry(), (), known)
        assert [f.code for f in _without_constants(findings)] == ["btcpp-version"] * (version in refusing)


def _without_constants(findings):
    """Return the findings without those about constant conditions, which some cases use to show how a script is parsed."""
    return [finding for finding in findings if finding.code != "constant-condition"]


def findings_in_script(code):
    """Return the codes, lines, columns and hints of the findings about a script that assigns `a` and `b`, by version."""
    text = document(f'<Sequence>\n<Script code="{code}"/>\n<ScriptCondition code="a == b"/>\n</Sequence>')
    return {
        name: [
            (f.code, f.span.line, f.span.column, f.hint)
            for f in check(forest_of(text), default_registry(), (), version)
        ]
        for name, version in VERSIONS.items()
    }


@pytest.mark.parametrize("sign", [":=", "=", "+=", "-=", "*=", "/="])
def test_second_assignment_in_expression_is_reported(sign):
    found = findings_in_script(f"b := 4; a := b {sign} 2")
    assert ([code for code, *_ in found["4.8"]], found["4.10"]) == (["btcpp-version"], [])


@pytest.mark.parametrize(
    ("code", "column"), [("a := 1 b := 2", 22), ("a := (1) (b := 2)", 25), ("a := 1; b := 2 (a += 1)", 31)]
)
def test_touching_statements_are_reported_for_every_version(code, column):
    found = findings_in_script(code)
    hint = "write ; between the two statements, or write the missing operator"
    assert found["4.8"] == [("btcpp-version", 4, column, "write ; between the two")]
    assert found["4.9"] == found["4.10"] == [("touching-statements", 4, column, hint)]


@pytest.mark.parametrize(
    "code", ["a := 1;b := 2", "a := (1);;(b := 2);", "a := 1\nb := 2", "a := 1 &#10; b := (2)"]
)
def test_separated_statements_are_not_reported(code):
    assert findings_in_script(code)["4.10"] == []


def test_choice_in_words_gets_hint_with_operator():
    found = findings_in_script("a := 1 if 0 else 2; b := 1")["4.10"]
    assert ("idle-statement", 4, 22, "write a choice as 'condition ? value : other value'") in found


@pytest.mark.parametrize("around", ["ReactiveSequence", 'Control ID="ReactiveSequence"'])
def test_explicit_node_in_reactive_sequence_is_reported(around):
    inner = (
        '<Condition ID="DetectSurvivor"/><Sequence><Action ID="NavigateToBase"/></Sequence><NavigateToZone/>'
    )
    text = document(f"<{around}>\n{inner}</{around.split()[0]}>")
    for version in VERSIONS.values():
        found = [
            f for f in check(forest_of(text), default_registry(), (), version) if f.code == "explicit-node"
        ]
        assert [(f.severity, f.span.line, f.span.column, f.hint) for f in found] == [
            (Severity.WARNING, 4, 1, "write <DetectSurvivor>, without ID")
        ]


@pytest.mark.parametrize(
    ("node", "refused"),
    [
        ('<ScriptCondition code="{c}"/>', False),
        ('<Precondition if="{c}" else="FAILURE"><AlwaysSuccess/></Precondition>', True),
        ('<Script code="{c}"/>', True),
    ],
)
def test_only_script_condition_accepts_number_as_script(node, refused):
    text = document('<Sequence><SubTree ID="S" c="1"/></Sequence>').replace(
        "</root>", f'<BehaviorTree ID="S">{node}</BehaviorTree></root>'
    )
    codes = {f.code for f in check(forest_of(text), default_registry())}
    assert ("btcpp-version" in codes) == refused


def test_explicit_node_in_reactive_fallback_is_not_reported():
    text = document(
        '<ReactiveFallback><Condition ID="DetectSurvivor"/><Action ID="NavigateToBase"/></ReactiveFallback>'
    )
    assert [f for f in check(forest_of(text), default_registry()) if f.code == "explicit-node"] == []


@pytest.mark.parametrize("tree_id", ["Größe", "ROOT", "a-b", "a_b", "Timer", "Success", "Condition"])
def test_id_accepted_by_every_version_has_no_findings(tree_id):
    assert check(forest_of(tree_with_id(tree_id)), default_registry()) == []


@pytest.mark.parametrize("tree_id", ["my tree", "v.2", "Root"])
@pytest.mark.parametrize(("version", "said"), [("4.8", 0), ("4.10", 1)])
def test_conversion_depends_on_version(tree_id, version, said):
    notes = to_btcpp(parse_xml(tree_with_id(tree_id)), default_registry(), (), VERSIONS[version])[1]
    assert [note.code for note in notes] == ["no-counterpart"] * said


def test_node_of_newer_version_has_no_counterpart_in_older_version():
    text, _, _ = CASES["a node of a newer version"]
    for version, said in (("4.8", ["no-counterpart"]), ("4.9", [])):
        notes = to_btcpp(parse_xml(text), default_registry(), (), VERSIONS[version])[1]
        assert [note.code for note in notes if "TryCatch" in note.message] == said


@pytest.fixture
def project(tmp_path, monkeypatch):
    """Return a function that writes the configuration of a project."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "tree.xml").write_text(tree_with_id("my tree"), encoding="utf-8")

    def write(settings, name="sar.toml"):
        (tmp_path / name).write_text(settings, encoding="utf-8")

    return write


def test_project_configuration_sets_version(project, capsys):
    assert load("tree.xml").project.configuration.btcpp is None
    assert main(["validate", "--strict", "tree.xml"]) == 1
    project('[language]\nbtcpp = "4.8"\n')
    assert load("tree.xml").project.configuration.btcpp == VERSIONS["4.8"]
    capsys.readouterr()
    assert main(["validate", "--strict", "tree.xml"]) == 0
    assert capsys.readouterr().out == "tree.xml: no findings\n"
    assert main(["convert", "--to", "btcpp", "tree.xml"]) == 0


def test_pyproject_toml_sets_version_in_project_table(project):
    project('[tool.sar.language]\nbtcpp = "4.9"\n', "pyproject.toml")
    assert load("tree.xml").project.configuration.btcpp == VERSIONS["4.9"]


@pytest.mark.parametrize("written", ['"4.7"', "4.8", '"4"'])
def test_unknown_version_is_configuration_error(project, capsys, written):
    project(f"[language]\nbtcpp = {written}\n")
    assert main(["validate", "tree.xml"]) == 1
    assert "sar.toml:2:" in capsys.readouterr().out


def test_tree_rejected_by_version_can_be_run(project):
    compiled = load("tree.xml").compile()
    compiled.root.tick_once()
    assert compiled.root.status.name == "SUCCESS"


def test_page_lists_only_releases_of_known_versions():
    rows = [
        cells[0] for heading, _, cells in tables(Path("docs/reference/btcpp.md")) if heading == "Versions"
    ]
    assert rows
    assert {re.sub(r"\.\d+$", "", row) if row.count(".") > 1 else row for row in rows} <= VERSIONS.keys()
