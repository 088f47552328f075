"""Tests of trying runs: `validate` tries the runs of a tree, and reports the errors that ticks raise."""

import subprocess
import sys

import pytest

from sar_compiler import load
from sar_compiler.analysis.bounded_search import SearchBudget
from sar_compiler.analysis.trial import try_tree
from sar_compiler.budget import WORK
from sar_compiler.cli.compile import main
from tests.trees import document

PALETTE = (
    '<root BTCPP_format="4"><TreeNodesModel><Action ID="Drive"><input_port name="gear"/></Action>'
    '<Action ID="Look"><output_port name="seen"/></Action></TreeNodesModel></root>'
)
AFTER_A_FAILURE = (
    '<Fallback><Sequence><Drive gear="3"/><Script code="x := 1"/></Sequence><AlwaysSuccess/></Fallback>\n'
)
ALWAYS = "<Script code=\"x := 'goal'; x *= 2\"/>"


def findings_of_runs(folder, body, budget=None):
    """Return the findings about errors that a tick of a sequence can raise."""
    (folder / "palette.xml").write_text(PALETTE)
    (folder / "tree.xml").write_text(document(f"<Sequence>\n{body}\n</Sequence>"))
    tree = load(folder / "tree.xml", models=[folder / "palette.xml"])
    return try_tree(tree, lambda: budget or SearchBudget(WORK))


def finding_locations(folder, body):
    return [(each.code, each.severity.value, *each.span[:2]) for each in findings_of_runs(folder, body)]


@pytest.mark.parametrize(
    ("body", "line", "column"),
    [
        ("<Script code=\"x := 'goal'; y := x * 2\"/>", 4, 33),
        ('<Script code="x := 1"/>\n<Script code="y := x + \'a\'"/>', 5, 20),
        ("<AlwaysSuccess _skipIf=\"x := 'a'; x * 2 > 2\"/>", 4, 35),
    ],
)
def test_error_in_every_run_is_reported_at_its_location(tmp_path, body, line, column):
    assert finding_locations(tmp_path, body) == [("failing-tick", "error", line, column)]


@pytest.mark.parametrize(
    "node",
    [
        '<CheckBlackboardVariableValue variable="x" operator="gt" value="3"/>',
        '<SetBlackboard value="1" output_key="{n}"/>',
        '<Parallel success_count="{many}"><AlwaysSuccess/></Parallel>',
    ],
)
def test_error_raised_by_node_is_reported_at_node(tmp_path, node):
    body = f"<Script code=\"x := 'a'; n := 0; many := n + 7\"/>\n{node}"
    assert [each[0] for each in finding_locations(tmp_path, body)] == ["failing-tick"]
    assert [each[2] for each in finding_locations(tmp_path, body)] == [5]


GIVEN = (
    '<root BTCPP_format="4" main_tree_to_execute="Main"><BehaviorTree ID="Main"><Sequence><Script code="soon := 1"/>'
    '<ScriptCondition code="soon &lt; 2"/><SubTree ID="Outer" time="{}"/></Sequence></BehaviorTree>'
    '<BehaviorTree ID="Outer"><SubTree ID="Inner" msec="{{time}}" _skipIf="time == \'\'"/></BehaviorTree>'
    '<BehaviorTree ID="Inner"><ScriptCondition code="msec * 2 &lt; 3"/></BehaviorTree></root>'
)


@pytest.mark.parametrize(
    ("text", "code"),
    [
        (
            document('<Sequence><Script code="x := 1"/><ScriptCondition code="x = \'a\'"/></Sequence>'),
            "assign",
        ),
        (GIVEN.format("soon"), "key-as-text"),
        (GIVEN.format("later"), "failing-tick"),
    ],
)
def test_error_with_known_cause_is_not_reported_again(tmp_path, text, code):
    (tmp_path / "tree.xml").write_text(text)
    tree = load(tmp_path / "tree.xml")
    (finding,) = [*tree.check(), *try_tree(tree, lambda: SearchBudget(WORK))]
    assert finding.code.startswith(code)


def test_error_after_outcome_of_described_leaf_is_warning(tmp_path):
    body = f'{AFTER_A_FAILURE}<Script code="x += 1"/>'
    assert finding_locations(tmp_path, body) == [("failing-tick", "warning", 5, 15)]
    (finding,) = findings_of_runs(tmp_path, body)
    assert finding.message.endswith("(in tick 1: 'Drive' FAILURE)")


def test_nodes_of_same_name_are_distinguished(tmp_path):
    body = '<Script code="x := \'a\'"/>\n<Script code="x := \'b\'"/>\n<Script code="y := x * 2"/>'
    assert [each[2] for each in finding_locations(tmp_path, body)] == [6]


@pytest.mark.parametrize(
    "body",
    [
        '<Script code="x := 1"/>\n<Script code="x += 1"/>',
        '<Look seen="{x}"/>\n<Script code="y := x + 1"/>',
        '<Script code="y := @speed + 1"/>',
        '<Drive gear="{goal}"/>',
        '<ScriptCondition code="goal == 1"/>',
    ],
)
def test_external_or_earlier_writes_are_not_reported(tmp_path, body):
    assert finding_locations(tmp_path, body) == []


SET = '<SetBlackboardVariable variable_name="x" variable_value="{}"/>'
NUMBER = '<Script code="x := 3"/>'
EXISTS = '<CheckBlackboardVariableExists variable_name="x"/>'


@pytest.mark.parametrize(
    "body",
    [
        f'{SET.format(3)}<Script code="x += 1"/><ScriptCondition code="x == 4"/>',
        f'{SET.format(3)}<CheckBlackboardVariableValue variable="x" operator="eq" value="3"/>',
        f'{NUMBER}<CheckBlackboardVariableValue variable="x" operator="eq" value="3"/>',
        f'{NUMBER}<CheckBlackboardVariableValues checks="x ne 1;x ne 2" operator="and" namespace="r"/>',
        f"{NUMBER}{EXISTS}",
        f'{NUMBER}<UnsetBlackboardVariable key="x"/><Inverter>{EXISTS}</Inverter>',
        f'{SET.format("json:[1,2]")}<ForEach source_key="x" target_key="y"><ScriptCondition code="y > 0"/></ForEach>',
        '<StatusToBlackboard variable_name="x"><Success/></StatusToBlackboard><BlackboardToStatus variable_name="x"/>',
    ],
)
def test_py_trees_nodes_share_keys_with_all_others(tmp_path, body):
    raising = ALWAYS.replace("x", "z")
    assert finding_locations(tmp_path, f"<Fallback><Sequence>{body}</Sequence>{raising}</Fallback>") == []


def test_finding_needs_sufficient_work_and_stays_with_more(tmp_path):
    body = f'{AFTER_A_FAILURE}<Script code="x += 1"/>'
    enough = SearchBudget(WORK)
    (finding,) = findings_of_runs(tmp_path, body, enough)
    is_found = [
        findings_of_runs(tmp_path, body, SearchBudget(work)) == [finding]
        for work in range(0, enough.spent + 1, 400)
    ]
    assert is_found == sorted(is_found)
    assert (is_found[0], is_found[-1]) == (False, True)


def test_each_location_is_reported_once(tmp_path):
    body = (
        '<Script code="x := \'a\'"/>\n<Fallback><Drive/><Script code="x += 1"/></Fallback>\n'
        '<Drive/><Script code="y := x - 1"/>'
    )
    assert [each[2:] for each in finding_locations(tmp_path, body)] == [(5, 33), (6, 28)]


TWO_TREES = (
    '<root BTCPP_format="4"{more}>\n<BehaviorTree ID="One">{one}</BehaviorTree>\n'
    '<BehaviorTree ID="Two">{two}</BehaviorTree>\n</root>'
)
ENDLESS = (
    '<Sequence><Script code="x := 0"/><Repeat num_cycles="-1"><Script code="x += 1"/></Repeat></Sequence>'
)


# Enough for a tree that ends; an endless one uses all of it.
LITTLE_WORK = WORK // 16


def findings_in_two_trees(folder, one, two, more=""):
    (folder / "two.xml").write_text(TWO_TREES.format(one=one, two=two, more=more))
    return try_tree(load(folder / "two.xml"), lambda: SearchBudget(LITTLE_WORK))


def test_every_possible_main_tree_is_tried_with_its_share_of_work(tmp_path):
    (finding,) = findings_in_two_trees(tmp_path, ENDLESS, ALWAYS)
    assert finding.span.line == 3
    assert finding.hint == "sar-compile verify --tree Two shows the run tick by tick"


def test_suggested_command_is_quoted_for_shell(tmp_path):
    text = TWO_TREES.format(one=ENDLESS, two=ALWAYS, more="").replace('"Two"', '"To go home"')
    (tmp_path / "two.xml").write_text(text)
    (finding,) = try_tree(load(tmp_path / "two.xml"), lambda: SearchBudget(LITTLE_WORK))
    assert finding.hint == "sar-compile verify --tree 'To go home' shows the run tick by tick"


def test_only_main_tree_is_tried_if_there_is_one(tmp_path):
    assert findings_in_two_trees(tmp_path, ENDLESS, ALWAYS, ' main_tree_to_execute="One"') == []


def test_subtree_is_tried_through_tree_that_uses_it(tmp_path):
    (finding,) = findings_in_two_trees(tmp_path, '<SubTree ID="Two"/>', ALWAYS)
    assert finding.hint == "sar-compile verify --tree One shows the run tick by tick"


def test_too_large_tree_is_not_tried(tmp_path):
    budget = SearchBudget(WORK)
    assert findings_of_runs(tmp_path, '<Script code="x := 1"/>' * 5000 + ALWAYS, budget) == []
    assert budget.spent == 0


def test_error_found_through_several_files_is_reported_once(tmp_path, capsys):
    (tmp_path / "inner.xml").write_text(document("<Script code=\"x := 'a'; x *= 2\"/>", main="Inner"))
    body = '<Sequence><AlwaysSuccess/><Sleep msec="1"/><SubTree ID="Inner"/></Sequence>'
    outer = document(body).replace("<BehaviorTree", '<include path="inner.xml"/><BehaviorTree', 1)
    (tmp_path / "outer.xml").write_text(outer)
    assert main(["validate", *(str(tmp_path / name) for name in ("outer.xml", "inner.xml"))]) == 1
    assert capsys.readouterr().out.count("failing-tick") == 1


LEAVES = """
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from sar_compiler.leaves import Kind, register


@register("Ask{name}", kind=Kind.ACTION)
class Ask(Behaviour):
    def update(self):
        return Status.SUCCESS
"""


def test_leaves_of_each_configuration_are_used(tmp_path, capsys):
    for name in ("One", "Two"):
        folder = tmp_path / name
        folder.mkdir()
        (folder / f"asking_{name}.py").write_text(LEAVES.replace("{name}", name))
        (folder / "sar.toml").write_text(f'nodes = ["asking_{name}"]')
        body = f"<Sequence>\n<Script code=\"x := 'a'\"/>\n<Ask{name}/>\n<Script code='x *= 2'/>\n</Sequence>"
        (folder / "tree.xml").write_text(document(body))
    folders = [str(tmp_path / name) for name in ("One", "Two")]
    assert main(["validate", "--trust", "--all", *folders]) == 1
    assert capsys.readouterr().out.count("(in tick 1: 'Ask") == 2


def test_tree_without_keys_and_scripts_is_not_tried(tmp_path):
    def unexpected_budget():
        raise AssertionError

    (tmp_path / "tree.xml").write_text(
        document('<Sequence><AlwaysSuccess name="a"/><AlwaysFailure/></Sequence>')
    )
    assert try_tree(load(tmp_path / "tree.xml"), unexpected_budget) == []


def test_validate_reports_errors_of_runs_unless_no_deep(tmp_path, capsys):
    file = tmp_path / "tree.xml"
    file.write_text(document(ALWAYS))
    assert main(["validate", str(file)]) == 1
    assert "error[failing-tick]" in capsys.readouterr().out
    assert main(["validate", str(file), "--deep", "1"]) == 1
    assert main(["validate", str(file), "--no-deep"]) == 0


def test_check_alone_tries_no_runs(tmp_path):
    file = tmp_path / "tree.xml"
    file.write_text(document(ALWAYS))
    program = (
        f"import sys; from sar_compiler import load; from sar_compiler.analysis.trial import try_tree; tree = load({str(file)!r}); trying = 'sar_compiler.analysis.bounded_search'\n"
        "tree.check(); print(trying in sys.modules)\n"
        "def budget(): from sar_compiler.analysis.bounded_search import SearchBudget; return SearchBudget(1)\n"
        "try_tree(tree, budget); print(trying in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "False\nTrue\n"
