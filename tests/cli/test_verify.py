"""`sar-compile verify`, as its users see it."""

import json
import signal

import pytest

from sar_compiler.cli import verify as command
from sar_compiler.cli.compile import main
from sar_compiler.resources import shipped
from tests.processes import Command
from tests.trees import document

FINE = document("<Sequence><NavigateToZone/><DetectSurvivor/><AdvanceZone/></Sequence>")


@pytest.fixture
def run(tmp_path, capsys):
    def run(tree, *arguments, **files):
        for name, text in {"tree": tree, **files}.items():
            suffix = "xml" if text.startswith("<") else "yaml"
            (tmp_path / f"{name}.{suffix}").write_text(text, encoding="utf-8")
        words = [word.format(folder=tmp_path) for word in arguments]
        status: object
        try:
            status = main(["verify", str(tmp_path / "tree.xml"), *words])
        except SystemExit as end:
            status = end.code
        captured = capsys.readouterr()
        return status, captured.out, captured.err

    return run


def test_a_tree_that_is_proved_has_status_0_and_a_line_for_each_question(run):
    status, out, err = run(FINE)
    assert (status, err) == (0, "")
    first, *questions = out.splitlines()
    assert first.split(", ")[0].endswith("states")
    assert [line.rsplit(maxsplit=1)[-1] for line in questions] == ["proved"] * 4


def test_a_property_that_does_not_hold_has_status_1_and_its_run(run):
    properties = "properties: {searched: {never: DetectSurvivor starts}}"
    status, out, _ = run(FINE, "--properties", "{folder}/p.yaml", p=properties)
    assert status == 1
    assert out.startswith(
        "searched: does not hold\n  it is broken in the last tick:\n    1  NavigateToZone arrived"
    )
    assert out.endswith("does not hold\n")


def test_leaves_that_do_not_agree_on_a_fact_are_nothing_to_prove_anything_with(run):
    tree, nodes = document("<Sequence><X/><W/></Sequence>"), ("--nodes", "tests.checks.verify.leaves")
    status, out, err = run(tree, *nodes)
    assert (status, out) == (2, "")
    assert err == (
        "sar-compile: the fact 'f' is 0 at the start for 'X', and 1 for 'W'; say which: facts: {f: 0}\n"
    )
    assert run(tree, *nodes, "--set", "f=1")[2] == ""


def test_a_key_that_only_the_robot_would_write_is_named_with_the_leaf_that_writes_it(run):
    tree = document('<Sequence><M distance="{d}"/><ScriptCondition code="d &gt; 1"/></Sequence>')
    status, out, _ = run(tree, "--nodes", "tests.checks.verify.leaves")
    assert status == 1
    advice = "'M' writes 'd' when it runs, and nothing says what it writes here: "
    assert advice + 'answers: {M: [{status: SUCCESS, then: "d := ..."}]}' in out


def test_a_control_that_is_only_described_is_nothing_to_prove_anything_with(run):
    model = '<TreeNodesModel><Control ID="Recover"/></TreeNodesModel></root>'
    tree = document("<Recover><AlwaysSuccess/></Recover>").replace("</root>", model)
    status, out, err = run(tree)
    assert (status, out) == (1, "")
    assert "<Recover> is only described by a model, and when it ticks its children is not known; load" in err


def test_leaves_of_one_name_are_told_apart_by_what_is_around_them(run):
    tree = document(
        '<Sequence><Inverter name="Not"><NavigateToBase/></Inverter><NavigateToBase name="NavigateToBase"/></Sequence>'
    )
    properties = "properties: {p: {at_end: root == 'SUCCESS'}}"
    out = run(tree, "--properties", "{folder}/p.yaml", p=properties)[1]
    assert "1  Not/NavigateToBase aborted, Sequence/NavigateToBase aborted" in out


def test_the_shipped_mission_is_held_against_the_shipped_properties(capsys):
    assert main(["verify", "search_and_rescue", "--set", "zones_left=1"]) == 1
    assert "home only when no zone remains:" in capsys.readouterr().out


def test_a_tree_without_a_way_home_is_no_mission_and_has_no_properties_unless_one_names_them(run):
    assert "home" not in run(FINE)[1]


def test_json_has_the_questions_with_their_runs(run):
    properties = "properties: {searched: {never: DetectSurvivor found}, kept: {never: KeepReport kept}}"
    status, out, _ = run(FINE, "--properties", "{folder}/p.yaml", "--format", "json", p=properties)
    told = json.loads(out)
    assert (status, told["proved"], told["complete"]) == (1, False, True)
    assert told["left_out"] == [{"property": "kept", "missing": ["KeepReport"]}]
    searched = told["questions"][-1]
    assert (searched["question"], searched["verdict"]) == ("searched", "does not hold")
    (tick,) = searched["trace"]["ticks"]
    last = [event for event in tick["events"] if event["what"] == "answered"][1]
    assert last == {
        "leaf": "DetectSurvivor",
        "path": "Sequence/DetectSurvivor",
        "what": "answered",
        "status": "SUCCESS",
        "label": "found",
    }
    assert tick["changes"]["zones_left"] == [3, 2]


def test_a_property_about_leaves_that_are_not_there_is_said_to_be_left_out(run):
    properties = "properties: {kept: {never: KeepReport kept}}"
    status, out, _ = run(FINE, "--properties", "{folder}/p.yaml", p=properties)
    assert status == 0
    assert out.splitlines()[-1].split(":")[1].strip() == "left out"
    assert out.endswith("this tree has no KeepReport\n")


def test_a_bound_that_is_reached_is_said_and_has_status_1(run):
    status, out, _ = run(FINE, "--max-states", "20")
    assert status == 1
    assert "not decided: nothing speaks against it in the first 2 ticks of every run" in out
    assert "Not proved beyond 20 states" in out


def test_facts_are_set_on_the_command_line(run):
    states = [run(FINE, "--set", f"zones_left={zones}")[1].split()[0] for zones in (1, 6)]
    assert int(states[0]) < int(states[1])


def test_the_command_line_wins_over_the_file(run):
    properties = "facts: {zones_left: 0}\nproperties: {none: {never: AdvanceZone advanced}}"
    arguments = ("--properties", "{folder}/p.yaml")
    assert run(FINE, *arguments, p=properties)[0] == 1  # some leaves never have their turn
    out = run(FINE, *arguments, "--set", "zones_left=1", p=properties)[1]
    assert "none: does not hold" in out


def test_a_fact_that_only_the_file_knows_can_be_set(run):
    properties = """
facts: {battery: 3}
answers: {NavigateToZone: [{status: SUCCESS, when: battery > 0, then: battery -= 1}, {status: FAILURE, when: battery == 0}]}
"""
    arguments = ("--properties", "{folder}/p.yaml")
    states = [
        int(run(FINE, *arguments, *more, p=properties)[1].split()[0]) for more in ((), ("--set", "battery=9"))
    ]
    assert states[0] < states[1]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--set", "zones_lef=1"], "did you mean 'zones_left'?"),
        (["--set", "zones_left=many"], "the fact 'zones_left' is a whole number"),
        (["--set", "zones_left"], "'zones_left' is not FACT=VALUE"),
        (["--max-states", "none"], "'none' is not a whole number above 0"),
        (["--properties", "nowhere.yaml"], "cannot read nowhere.yaml"),
        (["--properties", "{folder}/wrong.yaml"], "wrong.yaml:1:1: error[unknown-key]"),
        (["--properties", "{folder}/slip.yaml"], "did you mean 'starts'?"),
        (["--tree", "Other"], "Other"),
    ],
)
def test_wrong_usage_and_wrong_files_have_status_2(run, arguments, said):
    files = {"wrong": "proprties: {}", "slip": "properties: {p: {never: AdvanceZone strts}}"}
    status, out, err = run(FINE, *arguments, **files)
    assert (status, out) == (2, "")
    assert said in err


def test_an_invalid_tree_has_status_2_and_its_findings(run):
    status, out, err = run(FINE.replace("AdvanceZone", "AdvnceZone"))
    assert (status, out) == (2, "")
    assert "error[unknown-node]" in err


def test_a_control_of_ones_own_cannot_be_gone_through_and_that_is_said(run, tmp_path, monkeypatch):
    (tmp_path / "own_control.py").write_text(
        "from py_trees.composites import Sequence\n"
        "from py_trees.behaviour import Behaviour\n"
        "from sar_compiler import Kind, register\n"
        "@register('Own', kind=Kind.CONTROL)\n"
        "class Own(Sequence):\n"
        "    '''A control.'''\n"
        "    def __init__(self, name: str, children: list[Behaviour]) -> None:\n"
        "        super().__init__(name, memory=True, children=children)\n",
        encoding="utf-8",
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    status, out, err = run(document("<Own><AdvanceZone/></Own>"), "--nodes", "own_control")
    assert (status, out) == (1, "")
    assert "nothing can be decided: 'Own' is a own_control.Own" in err


def test_a_condition_that_cannot_be_evaluated_everywhere_is_named(run):
    tree = document('<Sequence><AdvanceZone/><Script code="n := 1"/></Sequence>')
    properties = "properties: {counted: {never: AdvanceZone starts, while: n == 1}}"
    status, _, err = run(tree, "--properties", "{folder}/p.yaml", p=properties)
    assert status == 1
    assert "counted: 'n == 1' cannot be evaluated in every state: there is no variable 'n'" in err


class Terminal:
    """Standard error as a terminal is."""

    def __init__(self) -> None:
        self.text = ""

    def isatty(self):
        return True

    def write(self, text):
        self.text += text

    def flush(self):
        """Nothing is held back."""


@pytest.mark.parametrize(("terminal", "said"), [(True, "\r\x1b[K"), (False, "sar-compile: ")])
def test_progress_goes_to_standard_error(run, monkeypatch, terminal, said):
    shown = Terminal()
    monkeypatch.setattr(shown, "isatty", lambda: terminal)
    monkeypatch.setattr("sys.stderr", shown)
    monkeypatch.setattr(command._Shown, "_EVERY_SEC", 0.0)
    monkeypatch.setattr(command._Shown, "_EVERY_SEC_IN_A_LOG", 0.0)
    assert run(FINE, "--set", "zones_left=60")[0] == 0
    assert shown.text.startswith(said)
    assert "states/s" in shown.text
    assert shown.text.endswith("\r\x1b[K") == terminal


def test_what_is_broken_is_told_when_it_is_found_and_ctrl_c_shows_what_was_found_so_far(tmp_path):
    properties = tmp_path / "p.yaml"
    properties.write_text("properties: {stays at home: {never: NavigateToZone starts}}", encoding="utf-8")
    tree = shipped("trees", "search_and_rescue_resilient.xml")
    words = ["verify", str(tree), "--properties", str(properties), "--set", "zones_left=9"]
    process = Command("sar-compile", *words)
    try:
        process.wait_for("stays at home: does not hold (Ctrl-C stops and shows a run)")
        process.send(signal.SIGINT)
        assert process.end() == 130
    finally:
        process.kill()
    assert "stays at home: does not hold\n  it is broken in the last tick:\n    1  " in process.output
    assert "there are more; it was stopped there." in process.output
