"""Tests of enumerators of a C++ program, which `sar.toml`, palettes and scenarios can declare."""

from pathlib import Path

import pytest

from sar_compiler import load
from sar_compiler.analysis.simulated import play_scenario
from sar_compiler.nodes.collector import FindingCollector
from sar_compiler.nodes.models import read_models
from sar_compiler.nodes.models.from_use import UndescribedNodes
from sar_compiler.nodes.registry import default_registry
from sar_compiler.project.project import Project
from sar_compiler.tree.diagnostic import Severity, TreeError
from sar_compiler.tree.xml import parse_xml
from tests.trees import document

TREE = """<Sequence>
<Script code="color := RED"/>
<Switch2 variable="{color}" case_1="BLUE" case_2="RED"><AlwaysFailure/><AlwaysSuccess/><AlwaysFailure/></Switch2>
<ScriptCondition code="color == RED"/>
<ScriptCondition code="color != BLUE"/>
</Sequence>"""
SETTINGS = "[language.enums]\nRED = 1\nBLUE = 2\n"


def palette(*enums: str) -> str:
    return f'<root BTCPP_format="4"><TreeNodesModel>{"".join(enums)}</TreeNodesModel></root>'


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    path = tmp_path / "tree.xml"
    path.write_text(document(TREE), encoding="utf-8")
    return path


def declare_in_settings(folder: Path) -> None:
    (folder / "sar.toml").write_text(SETTINGS, encoding="utf-8")


def declare_in_palette(folder: Path) -> None:
    text = palette('<Enum ID="RED" value="1"/>', '<Enum ID="BLUE" value="2"/>')
    (folder / "nodes.xml").write_text(text, encoding="utf-8")
    (folder / "sar.toml").write_text('models = ["nodes.xml"]\n', encoding="utf-8")


def declare_in_palette_around(folder: Path) -> None:
    (folder / ".git").mkdir()
    text = palette('<Enum ID="RED" value="1"/>', '<Enum ID="BLUE" value="2"/>')
    (folder / "enums.xml").write_text(text, encoding="utf-8")


every_declaration = pytest.mark.parametrize(
    "declare", [declare_in_settings, declare_in_palette, declare_in_palette_around]
)


def status_of_a_run(tree: Path) -> str:
    compiled = load(tree).compile()
    compiled.root.tick_once()
    return str(compiled.root.status.name)


@every_declaration
def test_run_uses_numbers_of_declared_enumerators(tree: Path, declare) -> None:
    declare(tree.parent)
    assert status_of_a_run(tree) == "SUCCESS"


@every_declaration
def test_simulation_selects_switch_branch_by_numbers_of_enumerators(tree: Path, declare) -> None:
    declare(tree.parent)
    assert load(tree).simulate().run_to_end().root == "SUCCESS"


@every_declaration
def test_verify_proves_that_no_tick_raises_with_declared_enumerators(tree: Path, declare) -> None:
    declare(tree.parent)
    proof = load(tree).verify()
    assert {each.question: each.outcome.value for each in proof.verdicts}[
        "no tick raises an error"
    ] == "proved"


@every_declaration
def test_check_reports_nothing_for_declared_enumerators(tree: Path, declare) -> None:
    declare(tree.parent)
    assert load(tree).check() == []


@pytest.mark.parametrize("case", ["red", "Red"])
def test_palette_in_repository_may_declare_lower_case_enumerators(tree: Path, case: str) -> None:
    declare_in_palette_around(tree.parent)
    for path in (tree, tree.parent / "enums.xml"):
        text = path.read_text(encoding="utf-8").replace("RED", case).replace("BLUE", "blue")
        path.write_text(text, encoding="utf-8")
    assert load(tree).check() == []
    assert load(tree).simulate().run_to_end().root == "SUCCESS"


def test_palettes_in_repository_are_not_read_if_all_names_are_keys(tree: Path, monkeypatch) -> None:
    declare_in_palette_around(tree.parent)
    script = "a := 1; b += a; 'red' == c"
    nodes = f'<Sequence><Script code="{script}"/><SetBlackboard output_key="c" value="red"/><SubTree ID="S" d="1"/></Sequence>'
    inner = '<BehaviorTree ID="S"><ScriptCondition code="d == 1 &amp;&amp; true" _description="some words"/></BehaviorTree>'
    tree.write_text(document(nodes).replace("</root>", f"{inner}</root>"), encoding="utf-8")
    monkeypatch.setattr(Project, "_palettes_around", property(lambda _: pytest.fail("read")))
    load(tree).check()


def test_palette_with_other_enumerators_in_repository_is_not_used(tree: Path, tmp_path: Path) -> None:
    (tmp_path / ".git").mkdir()
    (tmp_path / "enums.xml").write_text(palette('<Enum ID="GREEN" value="3"/>'), encoding="utf-8")
    assert load(tree).palettes == ()


def test_typo_in_enumerator_is_reported_with_declared_one(tree: Path) -> None:
    declare_in_settings(tree.parent)
    tree.write_text(document(TREE.replace("!= BLUE", "!= BLEU")), encoding="utf-8")
    [finding] = load(tree).check()
    assert (finding.code, finding.span.line, finding.suggestion) == ("unwritten-key", 7, "BLUE")


def test_undeclared_upper_case_name_is_unwritten_key_if_others_are_declared(tree: Path) -> None:
    declare_in_settings(tree.parent)
    tree.write_text(document(TREE.replace("!= BLUE", "!= SQUARE")), encoding="utf-8")
    assert [each.code for each in load(tree).check()] == ["unwritten-key"]


def test_upper_case_name_may_be_enumerator_if_none_is_declared(tree: Path) -> None:
    assert [each for each in load(tree).check() if each.severity is not Severity.ERROR] == []


def test_tick_with_undeclared_enumerator_raises_error_with_remedy(tree: Path) -> None:
    with pytest.raises(
        Exception, match=r"add an enumerator of the C\+\+ program to \[language\.enums\] in sar\.toml"
    ):
        status_of_a_run(tree)


def test_scenario_may_declare_enumerators(tree: Path, tmp_path: Path) -> None:
    scenario = tmp_path / "run.yaml"
    scenario.write_text(
        "enums: {RED: 1, BLUE: 2}\nuntil: color == RED\nexpect: {root: SUCCESS}\n", encoding="utf-8"
    )
    play_scenario(load(tree), scenario)


def test_property_may_use_enumerators(tree: Path, tmp_path: Path) -> None:
    declare_in_settings(tree.parent)
    properties = tmp_path / "properties.yaml"
    properties.write_text(
        "properties:\n  red: {at_end: color == RED}\n  blue: {at_end: color == BLUE}\n", encoding="utf-8"
    )
    proof = load(tree).verify(properties)
    assert {
        each.question: each.outcome.value for each in proof.verdicts if each.question in ("red", "blue")
    } == {"red": "proved", "blue": "does not hold"}


@pytest.mark.parametrize("text", ['RED = "1"', "RED = 1.5", "RED = 3000000000", "RED = true"])
def test_invalid_number_of_enumerator_is_located_error(tree: Path, text: str) -> None:
    (tree.parent / "sar.toml").write_text(f"[language.enums]\n{text}\n", encoding="utf-8")
    with pytest.raises(TreeError) as caught:
        load(tree)
    assert [each.span.line for each in caught.value.findings] == [2]


WRONG_ENUMS = {
    "without a name": ('<Enum value="1"/>', "needs an ID"),
    "with a name that scripts cannot use": ('<Enum ID="a-b" value="1"/>', "needs an ID"),
    "with a text for a number": ('<Enum ID="A" value="x"/>', "'x' is not an integer"),
    "with two numbers": (
        '<Enum ID="A" value="1"/><Enum ID="A" value="2"/>',
        "'A' is already defined as 1, but is 2 here",
    ),
}


@pytest.mark.parametrize("case", WRONG_ENUMS)
def test_invalid_enumerator_in_palette_is_warning(case: str) -> None:
    text, message = WRONG_ENUMS[case]
    collector = FindingCollector()
    read_models([parse_xml(palette(text))], collector)
    [finding] = collector.findings
    assert (finding.code, finding.severity) == ("wrong-model", Severity.WARNING)
    assert message in finding.message


def test_enumerator_in_palette_may_lack_number(tree: Path) -> None:
    models = read_models(
        [parse_xml(palette('<Enum ID="RED"/>', '<Enum ID="RED" value="4"/>', '<Enum ID="GO"/>'))],
        FindingCollector(),
    )
    assert models.enums == {"RED": 4, "GO": None}


def test_palette_from_use_lists_upper_case_names_that_no_tree_writes() -> None:
    body = """<Sequence>
    <Script code="color := RED; LEVEL := 2; text := 'HELLO YOU'"/>
    <ScriptCondition code="color == BLUE &amp;&amp; LEVEL &lt; MAX_LEVEL" _skipIf="Mixed"/>
    <SubTree ID="Inner" GIVEN="3"/>
    </Sequence>"""
    uses = UndescribedNodes()
    uses.add(parse_xml(document(body)), (), default_registry())
    names = [each.attributes["ID"] for each in uses.models().children if each.tag == "Enum"]
    assert names == ["BLUE", "MAX_LEVEL", "RED"]


PAINT = '<Action ID="Paint"><input_port name="color" type="Color"/></Action>'


@pytest.mark.parametrize(
    ("text", "told"),
    [("RED", []), ("REDD", [("warning", "RED")]), ("x;y", [("info", None)]), ("3", [("info", None)])],
)
@pytest.mark.parametrize("way", ["literal", "constant"])
def test_string_for_cpp_type_is_reported_unless_it_is_declared_enumerator(
    tree: Path, text: str, told: list[tuple[str, str | None]], way: str
) -> None:
    declare_in_settings(tree.parent)
    (tree.parent / "nodes.xml").write_text(palette(PAINT), encoding="utf-8")
    nodes = f'<Paint color="{text}"/>'
    if way == "constant":
        nodes = f'<Sequence><SetBlackboard value="{text}" output_key="c"/><Paint color="{{c}}"/></Sequence>'
        told = [("info", None)] if told else []
    tree.write_text(document(nodes), encoding="utf-8")
    (tree.parent / ".git").mkdir()
    found = [each for each in load(tree).check() if each.code == "cpp-type-mismatch"]
    assert [(each.severity.value, each.suggestion) for each in found] == told
