"""`validate` tries the runs of a tree in which a tick can raise, and tells what is raised, and where."""

import subprocess
import sys

import pytest

from sar_compiler import load
from sar_compiler.checks.verify.trying import TrialBudget
from sar_compiler.cli.compile import main
from tests.trees import document

TICKS = 8192
PALETTE = (
    '<root BTCPP_format="4"><TreeNodesModel><Action ID="Drive"><input_port name="gear"/></Action>'
    '<Action ID="Look"><output_port name="seen"/></Action></TreeNodesModel></root>'
)
AFTER_A_FAILURE = (
    '<Fallback><Sequence><Drive gear="3"/><Script code="x := 1"/></Sequence><AlwaysSuccess/></Fallback>\n'
)


def tried(folder, body, budget=None):
    """Return what a tick of some run of a sequence raises."""
    (folder / "palette.xml").write_text(PALETTE)
    (folder / "tree.xml").write_text(document(f"<Sequence>\n{body}\n</Sequence>"))
    tree = load(folder / "tree.xml", models=[folder / "palette.xml"])
    return tree.try_runs(lambda: budget or TrialBudget(TICKS))


def found(folder, body):
    return [(each.code, each.severity.value, *each.span[:2]) for each in tried(folder, body)]


@pytest.mark.parametrize(
    ("body", "line", "column"),
    [
        ("<Script code=\"x := 'goal' * 2\"/>", 4, 20),
        ('<Script code="x := 1"/>\n<Script code="y := x + \'a\' * 2"/>', 5, 24),
        ('<Script code="x := \'goal\'"/>\n<Sleep msec="{x}"/>', 4, 15),
        ("<AlwaysSuccess _skipIf=\"'a' * 2 > 2\"/>", 4, 25),
    ],
)
def test_what_every_run_raises_is_an_error_at_its_place(tmp_path, body, line, column):
    assert found(tmp_path, body) == [("failing-tick", "error", line, column)]


def test_what_a_run_raises_only_after_an_answer_of_a_palettes_leaf_is_a_warning(tmp_path):
    body = f'{AFTER_A_FAILURE}<Script code="x += 1"/>'
    assert found(tmp_path, body) == [("failing-tick", "warning", 5, 15)]
    (finding,) = tried(tmp_path, body)
    assert finding.message.endswith("(in tick 1; 'Drive' FAILURE)")


def test_two_nodes_of_one_name_are_told_apart(tmp_path):
    body = '<Script code="x := \'a\'"/>\n<Script code="x := \'b\'"/>\n<Script code="x * 2"/>'
    assert [each[2] for each in found(tmp_path, body)] == [6]


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
def test_what_others_may_write_and_what_is_written_in_time_is_no_finding(tmp_path, body):
    assert found(tmp_path, body) == []


def test_nothing_is_said_where_the_ticks_end_before_the_error(tmp_path):
    body = f'{AFTER_A_FAILURE}<Script code="x += 1"/>'
    assert tried(tmp_path, body, TrialBudget(1)) == []


def test_a_tree_without_keys_and_scripts_is_not_tried(tmp_path):
    def none():
        raise AssertionError

    (tmp_path / "tree.xml").write_text(
        document('<Sequence><AlwaysSuccess name="a"/><AlwaysFailure/></Sequence>')
    )
    assert load(tmp_path / "tree.xml").try_runs(none) == []


def test_validate_tells_it_and_no_deep_leaves_it_out(tmp_path, capsys):
    file = tmp_path / "tree.xml"
    file.write_text(document("<Script code=\"x := 'goal' * 2\"/>"))
    assert main(["validate", str(file)]) == 1
    assert "error[failing-tick]" in capsys.readouterr().out
    assert main(["validate", str(file), "--deep", "1"]) == 1
    assert main(["validate", str(file), "--no-deep"]) == 0


def test_checking_alone_tries_no_runs(tmp_path):
    file = tmp_path / "tree.xml"
    file.write_text(document("<Script code=\"x := 'goal' * 2\"/>"))
    program = f"import sys; from sar_compiler import load; load({str(file)!r}).check(); print('py_trees' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"
