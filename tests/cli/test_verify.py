"""Tests of `sar-compile verify`."""

import json
import re
import signal

import pytest

from sar_compiler.cli.compile import main
from sar_compiler.resources import shared_file_path
from sar_compiler.terminal import ProgressLine
from tests.terminals import Terminal
from tests.trees import document

FINE = document("<Sequence><NavigateToZone/><DetectSurvivor/><AdvanceZone/></Sequence>")

NOTE = (
    "Values of at, found_by_DetectSurvivor and navigation_lost are not distinguished, "
    "because no condition, control or property depends on these values."
)


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


def test_proved_tree_has_status_0_and_one_line_per_question(run):
    status, out, err = run(FINE)
    assert (status, err) == (0, "")
    first, tally, *questions, note = out.splitlines()
    assert first.split(", ")[0].endswith("states")
    assert tally == "4 outcomes: 4 proved"
    assert [line.rsplit(maxsplit=1)[-1] for line in questions] == ["proved"] * 4
    assert note == NOTE


def test_violated_property_has_status_1_and_counterexample(run):
    properties = "properties: {searched: {never: DetectSurvivor starts}}"
    status, out, _ = run(FINE, "--properties", "{folder}/p.yaml", p=properties)
    assert status == 1
    table, _, shown = out.partition("\n\n")
    assert table.endswith(f"  searched:                              does not hold\n{NOTE}")
    assert shown.startswith(
        "searched: does not hold\n  it is violated in the last tick:\n    1  NavigateToZone arrived"
    )


def test_verdicts_have_colours_only_if_colours_are_enabled(run, monkeypatch):
    properties = "properties: {searched: {never: DetectSurvivor starts}}"
    asked = (FINE, "--properties", "{folder}/p.yaml")
    assert "\x1b" not in run(*asked, p=properties)[1]
    monkeypatch.setenv("CLICOLOR_FORCE", "1")
    out = run(*asked, p=properties)[1]
    assert out.count(": \x1b[1;31mdoes not hold\x1b[0m\n") == 1
    assert out.count(" \x1b[32mproved\x1b[0m\n") == 4


def test_conflicting_initial_facts_have_status_2(run):
    tree, nodes = document("<Sequence><X/><W/></Sequence>"), ("--nodes", "tests.analysis.verify.leaves")
    status, out, err = run(tree, *nodes)
    assert (status, out) == (2, "")
    assert err == (
        "sar-compile: the leaf 'X' declares the initial value 0 of the fact 'f', but 'W' declares 1. Set the value with facts: {f: 0}\n"
    )
    assert run(tree, *nodes, "--set", "f=1")[2] == ""


def test_key_written_only_on_robot_is_reported_with_its_leaf(run):
    tree = document('<Sequence><M distance="{d}"/><ScriptCondition code="d &gt; 1"/></Sequence>')
    status, out, _ = run(tree, "--nodes", "tests.analysis.verify.leaves")
    assert status == 1
    advice = "because 'M' only writes it on a robot. Add to the property file or to the scenario: "
    assert advice + 'outcomes: {M: [{status: SUCCESS, then: "d := ..."}]}' in out


def test_described_control_cannot_be_verified(run):
    model = '<TreeNodesModel><Control ID="Recover"/></TreeNodesModel></root>'
    tree = document("<Recover><AlwaysSuccess/></Recover>").replace("</root>", model)
    status, out, err = run(tree)
    assert (status, out) == (1, "")
    assert (
        "error[only-described]: <Recover> is only described by a model. A model does not define when a node ticks its children\n"
        in err
    )
    assert "controls: {Recover: ...}" in err


def test_replacement_for_described_control_is_verified(run):
    model = '<TreeNodesModel><Control ID="Recover"/></TreeNodesModel></root>'
    tree = document("<Recover><NavigateToZone/><AlwaysSuccess/></Recover>").replace("</root>", model)
    arguments = ("--properties", "{folder}/p.yaml")
    outcomes = [
        run(
            tree,
            *arguments,
            p=f"controls: {{Recover: {tag}}}\nproperties: {{p: {{at_end: root == 'SUCCESS'}}}}",
        )[0]
        for tag in ("Fallback", "Sequence")
    ]
    assert outcomes == [0, 1]
    status, _, err = run(
        tree, *arguments, p="controls: {Recover: Falback}\nproperties: {p: {never: Nobody starts}}"
    )
    assert status == 1
    assert [line.split(": ")[1] for line in err.splitlines() if ": error[" in line] == [
        "error[unknown-node]", "error[unknown-leaf]",
    ]  # fmt: skip


def test_leaves_with_same_name_are_shown_with_parent(run):
    tree = document(
        '<Sequence><Inverter name="Not"><NavigateToBase/></Inverter><NavigateToBase name="NavigateToBase"/></Sequence>'
    )
    properties = "properties: {p: {at_end: root == 'SUCCESS'}}"
    out = run(tree, "--properties", "{folder}/p.yaml", p=properties)[1]
    assert "1  Not/NavigateToBase aborted, Sequence/NavigateToBase aborted" in out


def test_shipped_mission_is_verified_against_shipped_properties(capsys):
    assert main(["verify", "search_and_rescue", "--set", "zones_left=1"]) == 1
    assert "home only when no zone remains:" in capsys.readouterr().out


def test_tree_without_return_home_has_no_mission_properties(run):
    assert "home" not in run(FINE)[1]


def test_json_has_questions_with_counterexamples(run):
    properties = "properties: {searched: {never: DetectSurvivor found}, kept: {never: KeepReport kept}}"
    status, out, _ = run(FINE, "--properties", "{folder}/p.yaml", "--format", "json", p=properties)
    told = json.loads(out)
    assert (status, told["proved"], told["complete"]) == (1, False, True)
    assert told["left_out"] == [{"property": "kept", "missing": ["KeepReport"]}]
    searched = told["questions"][-1]
    assert (searched["question"], searched["verdict"]) == ("searched", "does not hold")
    (tick,) = searched["trace"]["ticks"]
    last = [event for event in tick["events"] if event["what"] == "returned"][1]
    assert last == {
        "leaf": "DetectSurvivor",
        "path": "Sequence/DetectSurvivor",
        "what": "returned",
        "status": "SUCCESS",
        "label": "found",
    }
    assert tick["changes"]["zones_left"] == [3, 2]


def test_property_about_missing_leaf_is_left_out(run):
    properties = "properties: {kept: {never: KeepReport kept}}"
    status, out, _ = run(FINE, "--properties", "{folder}/p.yaml", p=properties)
    assert status == 0
    assert "\n5 outcomes: 4 proved, 1 left out\n" in out
    assert out.splitlines()[-2].split(":")[1].strip() == "left out"
    assert out.endswith(f"this tree has no KeepReport\n{NOTE}\n")


def test_reached_state_limit_is_reported_with_status_1(run):
    status, out, _ = run(FINE, "--max-states", "10")
    assert status == 1
    assert re.search("not decided: no violation was found in the first .*tick.* of every run", out)
    assert "Not proved beyond 10 states" in out


def test_facts_can_be_set_on_command_line(run):
    states = [run(FINE, "--set", f"zones_left={zones}")[1].split()[0] for zones in (1, 6)]
    assert int(states[0]) < int(states[1])


def test_parameter_file_sets_number_of_zones(run):
    zones = "".join(f", {zone}: {{x: 0, y: 0, yaw: 0}}" for zone in "abcd")[2:]
    params = f"/**: {{ros__parameters: {{zone_order: [a, b, c, d], zones: {{{zones}}}, goal: 2}}}}"
    arguments = ("--params", "{folder}/params.yaml", "--format", "json")

    def states(*more, **files):
        status, out, err = run(FINE, *more, **files)
        assert (status, err) == (0, "")
        return json.loads(out)["states"]

    with_params = states(*arguments, params=params)
    assert with_params == states("--set", "zones_left=4", "--format", "json")
    assert with_params != states("--format", "json")
    file = {"params": params, "p": "facts: {zones_left: 2}\nproperties: {}"}
    properties = (*arguments, "--properties", "{folder}/p.yaml")
    assert states(*properties, **file) == states("--set", "zones_left=2", "--format", "json")
    assert states(*properties, "--set", "zones_left=4", **file) == with_params


def test_tree_without_mission_reads_parameters_as_keys(run):
    tree = document('<Sequence><ScriptCondition code="@goal == 2"/><AlwaysSuccess/></Sequence>')
    params = "sar_run: {ros__parameters: {goal: 2, tick_rat_hz: 1.0}}"
    status, _, err = run(tree, "--params", "{folder}/params.yaml", params=params)
    assert status == 0
    assert err.endswith(
        "params.yaml:1:38: parameter 'tick_rat_hz' is not used: did you mean 'tick_rate_hz'?\n"
    )
    status, _, err = run(tree, "--params", "{folder}/params.yaml", params=params.replace("sar_run", "other"))
    elsewhere = (
        "the file's sections are for /other, but this node is /sar_run. Write '/**:' above the section"
    )
    assert f"no parameter of the file is used: {elsewhere}\n" in err


def test_command_line_overrides_property_file(run):
    properties = "facts: {zones_left: 0}\nproperties: {none: {never: AdvanceZone advanced}}"
    arguments = ("--properties", "{folder}/p.yaml")
    assert run(FINE, *arguments, p=properties)[0] == 1  # some leaves are never ticked
    out = run(FINE, *arguments, "--set", "zones_left=1", p=properties)[1]
    assert "none: does not hold" in out


def test_fact_declared_only_in_property_file_can_be_set(run):
    properties = """
facts: {battery: 3}
outcomes: {NavigateToZone: [{status: SUCCESS, when: battery > 0, then: battery -= 1}, {status: FAILURE, when: battery == 0}]}
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
        (["--set", "zones_left=many"], "the fact 'zones_left' must be an integer"),
        (["--set", "zones_left"], "'zones_left' is not FACT=VALUE"),
        (["--max-states", "none"], "'none' is not an integer above 0"),
        (["--properties", "nowhere.yaml"], "cannot read nowhere.yaml"),
        (["--tree", "Other"], "sar-compile: there is no tree 'Other' (known:"),
    ],
)
def test_wrong_usage_has_status_2(run, arguments, said):
    status, out, err = run(FINE, *arguments)
    assert (status, out) == (2, "")
    assert said in err


@pytest.mark.parametrize(
    ("properties", "said"),
    [
        ("proprties: {}", "p.yaml:1:1: error[unknown-key]"),
        ("properties: {p: {never: AdvanceZone strts}}", "did you mean 'starts'?"),
    ],
)
def test_error_in_properties_has_status_1(run, properties, said):
    status, out, err = run(FINE, "--properties", "{folder}/p.yaml", p=properties)
    assert (status, out) == (1, "")
    assert said in err


def test_invalid_tree_has_status_1_and_findings(run):
    status, out, err = run(FINE.replace("AdvanceZone", "AdvnceZone"))
    assert (status, out) == (1, "")
    assert "error[unknown-node]" in err


def test_custom_control_is_verified_or_rejected_with_reason(run):
    nodes = ("--nodes", "tests.analysis.verify.own_controls")
    status, out, err = run(document("<OwnSequence><AdvanceZone/></OwnSequence>"), *nodes)
    assert (status, err.count("info[needless-node]"), len(err.splitlines())) == (0, 1, 3)
    assert "5 outcomes: 5 proved" in out
    status, out, err = run(document("<TickingMystery><AdvanceZone/></TickingMystery>"), *nodes)
    assert (status, out) == (1, "")
    assert "error[only-described]: <TickingMystery> has its own methods" in err


def test_property_file_sets_replacement_for_class_with_own_methods(run):
    nodes = ("--nodes", "tests.analysis.verify.own_controls", "--properties", "{folder}/p.yaml")
    tree = document("<TickingMystery><AdvanceZone/></TickingMystery>")
    status, out, err = run(tree, *nodes, p="controls: {TickingMystery: Sequence}")
    assert (status, err) == (0, "")
    assert "4 outcomes: 4 proved" in out


def test_condition_that_cannot_be_evaluated_in_every_state_is_reported(run):
    tree = document('<Sequence><AdvanceZone/><Script code="n := 1"/></Sequence>')
    properties = "properties: {counted: {never: AdvanceZone starts, while: n == 1}}"
    status, _, err = run(tree, "--properties", "{folder}/p.yaml", p=properties)
    assert status == 1
    assert "counted: 'n == 1' cannot be evaluated in every state: there is no variable 'n'" in err


SEARCHED = "properties: {searched on: {never: DetectSurvivor halted}, kept: {never: KeepReport starts}}"
AGAINST = ("--against", "{folder}/before.xml", "--properties", "{folder}/p.yaml")


def as_reactive(tree):
    return tree.replace("Sequence>", "ReactiveSequence>")


def test_worse_verdict_than_before_has_status_1_and_counterexample(run, tmp_path):
    status, out, err = run(as_reactive(FINE), *AGAINST, before=FINE, p=SEARCHED)
    assert (status, err.count("warning[endless-restart]"), len(err.splitlines())) == (1, 1, 3)
    assert (
        "searched on: does not hold\n  it is violated in the last tick:\n    1  NavigateToZone arrived" in out
    )
    table = out.splitlines()[:8]
    assert table[0].startswith(f"before: {tmp_path}/before.xml  ")
    assert table[1].startswith(f"now:    {tmp_path}/tree.xml    ")
    assert [line.split(":")[1].strip() for line in table[3:]] == [
        *("proved", "proved", "proved", "does not hold; before", "does not hold; before")
    ]
    assert table[2].startswith("5 outcomes: 2 worse, 3 the same; ")


def test_better_verdict_than_before_has_status_0(run):
    status, out, _ = run(FINE, *AGAINST, before=as_reactive(FINE), p=SEARCHED)
    assert status == 0
    assert out.startswith("before: ")
    assert "  searched on:                           proved; before: does not hold\n" in out


def test_property_violated_by_both_trees_has_status_0(run):
    status, out, _ = run(FINE, *AGAINST, before=FINE, p="properties: {p: {never: DetectSurvivor starts}}")
    assert status == 0
    assert "\n5 outcomes: 5 the same; " in out
    assert "\n  p:                                     does not hold\n" in out
    assert "\n\n" not in out  # no counterexample is shown


def test_mission_properties_of_either_tree_apply_to_both(run):
    mission = shared_file_path("trees", "search_and_rescue.xml").read_text(encoding="utf-8")
    arguments = ("--against", "{folder}/before.xml", "--set", "zones_left=1")
    for tree, before in ((FINE, mission), (mission, FINE)):
        out = run(tree, *arguments, before=before)[1]
        assert "home only when no zone remains:" in out
        assert "left out" in out


def test_json_has_both_verdicts_of_every_question(run):
    status, out, _ = run(as_reactive(FINE), *AGAINST, "--format", "json", before=FINE, p=SEARCHED)
    told = json.loads(out)
    assert (status, told["worse"], told["before"]["complete"]) == (1, True, True)
    assert told["now"]["file"].endswith("tree.xml")
    last = told["questions"][-1]
    assert (last["question"], last["change"], last["before"]["verdict"]) == ("searched on", "worse", "proved")
    assert last["now"]["trace"]["ticks"][-1]["events"][-1]["what"] == "halted"


def test_limits_of_both_searches_are_reported(run):
    status, out, _ = run(as_reactive(FINE), *AGAINST, "--max-states", "10", before=FINE, p=SEARCHED)
    assert status == 1  # a short counterexample is found, and the other tree may or may not have one
    assert out.count(".xml: Not proved beyond 10 states: there are more states (") == 2


def test_tree_that_cannot_be_verified_is_named(run):
    only_before = "properties: {p: {never: Again starts}}"
    named = FINE.replace("<DetectSurvivor/>", '<DetectSurvivor name="Again"/>')
    status, out, err = run(named, *AGAINST, before=FINE, p=only_before)
    assert (status, out) == (1, "")
    assert "before.xml cannot be verified with these options\n" in err
    model = '<TreeNodesModel><Control ID="Recover"/></TreeNodesModel></root>'
    described = document("<Recover><AlwaysSuccess/></Recover>").replace("</root>", model)
    status, _, err = run(FINE, *AGAINST, before=described, p="properties: {}")
    assert status == 1
    assert "before.xml:3:1: error[only-described]: <Recover> is only described" in err


class Screen:
    """Standard error that is a terminal."""

    def __init__(self) -> None:
        self.text = ""

    def isatty(self):
        return True

    def write(self, text):
        self.text += text

    def flush(self):
        """Do nothing, because nothing is buffered."""


@pytest.mark.parametrize("terminal", [True, False])
def test_progress_is_shown_only_if_standard_error_is_terminal(run, monkeypatch, terminal):
    monkeypatch.setenv("TERM", "xterm")
    shown = Screen()
    monkeypatch.setattr(shown, "isatty", lambda: terminal)
    monkeypatch.setattr("sys.stderr", shown)
    monkeypatch.setattr(ProgressLine, "_PATIENCE_SEC", 0.0)
    monkeypatch.setattr(ProgressLine, "_EVERY_SEC", 0.0)
    assert run(FINE, "--set", "zones_left=60")[0] == 0
    assert ("states/s" in shown.text) == terminal
    assert shown.text.startswith("\r\x1b[K" if terminal else "")
    assert shown.text.endswith("\r\x1b[K" if terminal else "")
    assert bool(shown.text) == terminal


@pytest.mark.parametrize("more", [[], ["--against", "search_and_rescue"]])
def test_violation_is_reported_at_once_and_ctrl_c_shows_counterexample(tmp_path, more):
    properties = tmp_path / "p.yaml"
    properties.write_text("properties: {stays at home: {never: NavigateToZone starts}}", encoding="utf-8")
    tree = shared_file_path("trees", "search_and_rescue_resilient.xml")
    words = ["verify", str(tree), "--properties", str(properties), "--set", "zones_left=9", *more]
    terminal = Terminal("sar-compile", *words, columns=200, env={"NO_COLOR": "1"})
    try:
        terminal.wait_for(
            "stays at home: does not hold (press Ctrl-C to stop the search and see a counterexample)"
        )
        terminal.send(signal.SIGINT)
        assert terminal.end() == 130
        output = "\n".join(terminal.history)
    finally:
        terminal.kill()
    assert "stays at home: does not hold\n  it is violated in the last tick:\n    1  " in output
    assert "there are more states (the search was stopped)." in output
