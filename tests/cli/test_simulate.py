"""Tests of `sar-compile simulate`."""

import json
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from sar_compiler.checks.golden import RENEW
from sar_compiler.cli.compile import main
from tests.cli import command_runner
from tests.trees import document

TREE = "trees/search_and_rescue.xml"
SCENARIOS = Path("examples/scenarios")


def run(capsys, *arguments):
    return command_runner.run(capsys, "simulate", *arguments)


@pytest.fixture
def scenario(tmp_path):
    """Return a function that writes a scenario file."""

    def write(text, name="scenario.yaml"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return write


@pytest.fixture
def tree(tmp_path):
    path = tmp_path / "tree.xml"
    path.write_text(document("<Selector><NavigateToZone/><NavigateToBase/></Selector>"), encoding="utf-8")
    return path


@pytest.mark.parametrize("path", sorted(SCENARIOS.glob("*.yaml")), ids=lambda path: path.stem)
def test_shipped_scenario_holds(capsys, path):
    status, out, err = run(capsys, TREE, "--scenario", path)
    assert (status, err) == (0, "")
    assert out.endswith(" holds.\n\n")


def test_folder_runs_all_its_scenarios(capsys):
    status, out, _ = run(capsys, TREE, "--scenario", SCENARIOS, "--coverage")
    assert status == 0
    assert "3 of 3 scenarios passed.\ncoverage: 13 of 13 nodes ticked, " in out


def test_folder_without_scenarios_has_status_2(capsys, tmp_path, tree):
    status, _, err = run(capsys, tree, "--scenario", tmp_path)
    assert (status, err) == (
        2,
        f"sar-compile: {tmp_path} contains no scenario file, such as scenario.yaml\n",
    )


def test_leaves_return_default_outcome_without_scenario(capsys, tree):
    status, out, _ = run(capsys, tree)
    assert status == 0
    assert "  NavigateToZone  arrived (SUCCESS)\n" in out
    assert out.endswith(
        "\nEvery leaf returned its default outcome. A run ends when the root succeeds or fails. Set another end with --until.\n\n"
    )


def test_conflicting_initial_facts_without_scenario_have_status_2(capsys, tmp_path):
    path = tmp_path / "tree.xml"
    path.write_text(document("<Sequence><X/><W/></Sequence>"), encoding="utf-8")
    status, out, err = run(capsys, path, "--nodes", "tests.analysis.verify.leaves")
    assert (status, out.strip()) == (2, "")
    assert err.startswith(
        "sar-compile: the leaf 'X' declares the initial value 0 of the fact 'f', but 'W' declares 1. Set the value with"
    )


def test_aborted_tick_is_shown_as_not_finished(capsys, tmp_path):
    path = tmp_path / "tree.xml"
    tree = '<Sequence><M distance="{d}"/><ScriptCondition code="d &gt; 1"/></Sequence>'
    path.write_text(document(tree), encoding="utf-8")
    status, out, _ = run(capsys, path, "--nodes", "tests.analysis.verify.leaves")
    assert status == 1
    assert out.startswith(
        "tick 1, 0 s: not finished\n  M  SUCCESS\n  keys: d = unknown\naborted in tick 1 (0 s): "
    )
    assert "because 'M' only writes it on a robot" in out


def test_end_of_run_is_not_explained_with_until_option(capsys, tree):
    _, out, _ = run(capsys, tree, "--until", "tick == 2")
    assert out.endswith("\nEvery leaf returned its default outcome.\n\n")


def test_unmet_expectation_has_status_1(capsys, tree, scenario):
    status, out, err = run(capsys, tree, "--scenario", scenario("expect: {root: FAILURE}"))
    assert (status, err) == (1, "")
    assert ":1: root: the status of the root is SUCCESS in the last tick, but FAILURE was expected\n" in out


def test_error_in_scenario_has_status_1_and_others_are_run(capsys, tree, scenario):
    wrong, right = scenario("leaves: {NavigateToZoen: arrived}"), scenario("name: right", "right.yaml")
    status, out, err = run(capsys, tree, "--scenario", wrong, "--scenario", right)
    assert status == 1
    assert err.startswith(f"{wrong}:1:10: error[unknown-leaf]: ")
    assert "'right' holds." in out
    assert out.endswith("1 of 2 scenarios passed.\n")


def test_missing_scenario_has_status_2(capsys, tree):
    status, _, err = run(capsys, tree, "--scenario", "nowhere.yaml")
    assert (status, err) == (2, "sar-compile: cannot read nowhere.yaml: No such file or directory\n")


@pytest.mark.parametrize(
    ("text", "expected", "said"),
    [(None, 2, "cannot read"), ("<root", 1, "malformed-xml"), ("<root/>", 1, "no-tree")],
)
def test_invalid_tree_has_status_1_and_missing_tree_status_2(capsys, tmp_path, text, expected, said):
    path = tmp_path / "tree.xml"
    if text is not None:
        path.write_text(text, encoding="utf-8")
    status, out, err = run(capsys, path)
    assert (status, out) == (expected, "")
    assert said in err


@pytest.mark.parametrize(
    ("option", "said"),
    [
        (("--ticks", "0"), "'0' is not an integer above 0"),
        (("--until", "at == 'base"), "is not a valid condition"),
        (("--until", "root === 1"), "did you mean '=='?"),
    ],
)
def test_invalid_option_value_is_rejected(capsys, tree, option, said):
    with pytest.raises(SystemExit) as end:
        run(capsys, tree, *option)
    assert end.value.code == 2
    assert said in capsys.readouterr().err


@pytest.mark.parametrize(
    ("until", "said"),
    [
        ("att == 'base'", "--until: 'att' is neither a fact nor a key of this tree (known: "),
        (
            "at = 'base'",
            "--until: a condition must not change 'at'; write == to compare",
        ),
    ],
)
def test_run_does_not_start_with_invalid_until_condition(capsys, until, said):
    status, out, err = run(capsys, TREE, "--until", until)
    assert (status, out) == (2, "")
    assert said in err


def test_requested_number_of_ticks_is_no_failure(capsys, tree, scenario):
    path = scenario("leaves: {NavigateToZone: RUNNING}")
    status, out, _ = run(capsys, tree, "--scenario", path, "--ticks", 3)
    assert status == 0
    assert "aborted without an end after tick 3 (1 s): root RUNNING" in out


def test_until_condition_ends_run(capsys):
    status, out, _ = run(capsys, TREE, "--until", "zones_left == 0 && at == 'base'")
    assert status == 0
    assert "ended after tick 4 (1.5 s): root SUCCESS" in out


def test_tree_is_chosen_by_option_or_scenario(capsys, tmp_path, scenario):
    path = tmp_path / "two.xml"
    trees = '<BehaviorTree ID="A"><Success/></BehaviorTree><BehaviorTree ID="B"><Failure/></BehaviorTree>'
    path.write_text(f'<root BTCPP_format="4" main_tree_to_execute="A">{trees}</root>', encoding="utf-8")
    assert "root SUCCESS" in run(capsys, path)[1]
    assert "root FAILURE" in run(capsys, path, "--tree", "B")[1]
    assert "root FAILURE" in run(capsys, path, "--scenario", scenario("tree: B"))[1]


@pytest.fixture
def described_tree(tmp_path):
    """Return the arguments for a tree of nodes that only a palette describes."""
    nodes = '<Action ID="Grab"/><Decorator ID="Twice"/><Control ID="RecoveryNode"/>'
    palette = tmp_path / "palette.xml"
    palette.write_text(
        f'<root BTCPP_format="4"><TreeNodesModel>{nodes}</TreeNodesModel></root>', encoding="utf-8"
    )
    path = tmp_path / "grab.xml"
    body = "<RecoveryNode><Twice><Grab/></Twice><Success/></RecoveryNode>"
    path.write_text(document(body), encoding="utf-8")
    return path, "--model", palette


def test_replacements_for_described_nodes_are_simulated(capsys, described_tree, scenario):
    script = scenario(
        "controls: {RecoveryNode: Fallback, Twice: Inverter}\n"
        "leaves: {Grab: [RUNNING, FAILURE]}\nexpect: {root: SUCCESS, within: 2 ticks}"
    )
    status, out, err = run(capsys, *described_tree, "--scenario", script)
    assert (status, err) == (0, "")
    assert "  Grab  FAILURE\n" in out


def test_replacement_applies_to_tree_named_by_scenario(capsys, described_tree, scenario):
    path, *options = described_tree
    text = path.read_text(encoding="utf-8")
    other = '<BehaviorTree ID="Other"><Twice><Success/></Twice></BehaviorTree></root>'
    path.write_text(text.replace("<root ", '<root main_tree_to_execute="Main" ').replace("</root>", other))
    script = scenario("tree: Other\ncontrols: {Twice: Inverter}\nexpect: {root: FAILURE}")
    status, out, err = run(capsys, path, *options, "--scenario", script)
    assert (status, err.count("[unused-tree]"), len(err.splitlines())) == (0, 1, 3)
    assert "Grab" not in out


def test_described_nodes_without_replacement_have_status_1(capsys, described_tree, scenario):
    status, out, err = run(capsys, *described_tree)
    assert status == 1
    assert "root" not in out
    places = [line for line in err.splitlines() if "error[only-described]" in line]
    assert [line.split(": ")[2] for line in places] == [
        f"<{tag}> is only described by a model. A model does not define when a node ticks its children"
        for tag in ("RecoveryNode", "Twice")
    ]
    assert (
        "or the palette that describes it (--model nav2:jazzy or nav2:kilted or nav2:main), or name a replacement for <RecoveryNode> in the scenario"
        in err
    )
    partly = scenario("controls: {RecoveryNode: Fallback}", "partly.yaml")
    wholly = scenario("controls: {RecoveryNode: Fallback, Twice: PassThrough}", "wholly.yaml")
    status, out, err = run(capsys, *described_tree, "--scenario", partly, "--scenario", wholly)
    assert (status, err.count("error[only-described]")) == (1, 1)
    assert "1 of 2 scenarios passed." in out


def test_custom_decorator_that_returns_no_status_is_reported(capsys, tmp_path):
    path = tmp_path / "tree.xml"
    path.write_text(document("<OwnForgetful><AdvanceZone/></OwnForgetful>"), encoding="utf-8")
    status, out, err = run(capsys, path, "--nodes", "tests.analysis.verify.own_controls")
    assert (status, err) == (1, "")
    said = "'OwnForgetful' (OwnForgetful) failed: update() returned None, which is not a status. Return Status.SUCCESS"
    assert f"an error occurred in tick 1: {said}" in out


def test_json_output_has_scenarios_and_coverage(capsys):
    status, out, _ = run(capsys, TREE, "--scenario", SCENARIOS, "--format", "json", "--coverage")
    data = json.loads(out)
    assert (status, data["file"], len(data["scenarios"])) == (0, TREE, 3)
    assert data["coverage"]["never_ticked"] == []


def test_junit_output_has_failures_and_errors(capsys, tree, scenario):
    paths = [scenario("expect: {root: FAILURE}", "bad.yaml"), scenario("leaf: x", "worse.yaml")]
    arguments = [word for path in paths for word in ("--scenario", path)]
    status, out, _ = run(capsys, tree, *arguments, "--format", "junit")
    assert status == 1
    assert [case[0].tag for case in ET.fromstring(out)[0]] == ["failure", "error"]  # noqa: S314 - it is ours


def test_trace_is_compared_with_golden_file(capsys, tree, scenario, monkeypatch):
    path = scenario("expect: {trace: golden/trace.txt}")
    monkeypatch.delenv(RENEW, raising=False)
    status, out, _ = run(capsys, tree, "--scenario", path)
    assert status == 1
    assert (
        f"trace: the golden file {path.parent / 'golden/trace.txt'} does not exist. Run with {RENEW}=1" in out
    )
    monkeypatch.setenv(RENEW, "1")
    assert run(capsys, tree, "--scenario", path)[0] == 0
    monkeypatch.delenv(RENEW)
    assert run(capsys, tree, "--scenario", path)[0] == 0
    scenario("expect: {trace: golden/trace.txt}\nleaves: {NavigateToZone: aborted}")
    status, out, _ = run(capsys, tree, "--scenario", path)
    assert status == 1
    assert "-  NavigateToZone  arrived (SUCCESS)\n" in out
    assert "+  NavigateToZone  aborted (FAILURE)\n" in out


@pytest.mark.parametrize("renew", ["", "1"])
@pytest.mark.parametrize("path", ["../{}.txt", "/etc/hostname", "link.txt", '"a\\0b"'])
def test_trace_outside_repository_is_neither_shown_nor_written(
    capsys, tree, scenario, monkeypatch, path, renew
):
    secret = tree.parent.parent / f"{tree.parent.name}.txt"
    secret.write_text("secret", encoding="utf-8")
    (tree.parent / "link.txt").symlink_to(secret)
    monkeypatch.setenv(RENEW, renew)
    status, out, err = run(
        capsys, tree, "--scenario", scenario(f"expect: {{trace: {path}}}".replace("{}", tree.parent.name))
    )
    assert status == 1
    assert ": error[setting-outside]: trace: " in out + err
    assert "secret\n" not in out + err
    assert secret.read_text("utf-8") == "secret"


def test_trace_may_be_anywhere_in_repository(capsys, tree, scenario, monkeypatch):
    (tree.parent / ".git").mkdir()
    (tree.parent / "scenarios").mkdir()
    path = scenario("expect: {trace: ../golden/trace.txt}", "scenarios/s.yaml")
    monkeypatch.setenv(RENEW, "1")
    assert run(capsys, tree, "--scenario", path)[0] == 0
    assert "NavigateToZone" in (tree.parent / "golden/trace.txt").read_text("utf-8")


def test_golden_file_that_is_no_text_differs(capsys, tree, scenario, monkeypatch):
    monkeypatch.delenv(RENEW, raising=False)
    (tree.parent / "trace.txt").write_bytes(b"\xff\n")
    status, out, _ = run(capsys, tree, "--scenario", scenario("expect: {trace: trace.txt}"))
    assert status == 1
    assert "-\N{REPLACEMENT CHARACTER}\n" in out


def test_trace_that_cannot_be_written_is_reported(capsys, tree, scenario, monkeypatch):
    (tree.parent / "golden").mkdir()
    monkeypatch.setenv(RENEW, "1")
    status, _, err = run(capsys, tree, "--scenario", scenario("expect: {trace: golden}"))
    assert status == 2
    assert f"cannot write {tree.parent / 'golden'}: Is a directory" in err


def test_nodes_shows_outcomes_and_facts_of_leaf(capsys):
    assert main(["nodes", "NavigateToZone"]) == 0
    out = capsys.readouterr().out
    assert (
        "outcomes: SUCCESS 'arrived' when zones_left > 0, then at = 'zone'; navigation_lost = false\n          FAILURE 'aborted'"
        in out
    )
    assert "facts:    zones_left = 3, at = '', navigation_lost = false\n" in out


def test_nodes_json_has_outcomes_and_facts_of_leaf(capsys):
    assert main(["nodes", "AdvanceZone", "--format", "json"]) == 0
    (leaf,) = json.loads(capsys.readouterr().out)
    assert leaf["outcomes"][0] == {
        "status": "SUCCESS",
        "label": "advanced",
        "when": "zones_left > 0",
        "then": "zones_left -= 1",
        "writes": None,
    }
    assert leaf["facts"] == {"zones_left": 3}
    assert {"reads", "writes"} <= leaf.keys()


PARAMS = """
/**:
  ros__parameters: {zone_order: [a, b], tick_rate_hz: 4.0, patience: 0.6}
search_and_rescue:
  ros__parameters:
    zones: {a: {x: 0, y: 0, yaw: 0}, b: {x: 1, y: 0, yaw: 0}}
"""
PATIENT = '<Timeout duration="{@patience}"><NavigateToZone/></Timeout>'


@pytest.fixture
def patient_tree(tmp_path, scenario):
    path = tmp_path / "patient.xml"
    path.write_text(document(PATIENT), encoding="utf-8")
    return [path, "--params", scenario(PARAMS, "params.yaml")]


def test_parameter_file_sets_initial_facts_tick_rate_and_tree_parameters(capsys, patient_tree, scenario):
    waiting = scenario("leaves: {NavigateToZone: RUNNING}\nexpect: {root: FAILURE}")
    status, out, err = run(capsys, *patient_tree, "--scenario", waiting)
    assert (status, err) == (0, "")
    assert "ended after tick 4 (0.75 s): root FAILURE\nfacts at the end: zones_left = 2, at = ''" in out


def test_parameter_file_applies_without_scenario(capsys, patient_tree):
    assert "facts at the end: zones_left = 2" in run(capsys, *patient_tree)[1]


def test_scenario_overrides_parameter_file(capsys, patient_tree, scenario):
    own = "facts: {zones_left: 7}\nparameters: {patience: 2.0}\nperiod: 1s\nleaves: {NavigateToZone: RUNNING}"
    out = run(capsys, *patient_tree, "--scenario", scenario(own))[1]
    assert "ended after tick 3 (2 s): root FAILURE\nfacts at the end: zones_left = 7" in out


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("/**: {ros__parameters: {x: [1, a]}}", "params.yaml:1:32: 'x' mixes an integer with text"),
        ("/**: {ros__parameters: {patience: long}}", "params.yaml:1:25: parameter zone_order: is missing"),
        (PARAMS.replace("b]", "c]"), "params.yaml:3:21: parameter zone_order: names 'c', which has no pose"),
        (PARAMS.replace("y: 0", "z: 0"), "\n  {path}:6:17: zones.a.y: is missing"),
        ("/robot1/search_and_rescue: {ros__parameters: {x: 1}}", "this node is /search_and_rescue"),
        (None, "No such file or directory"),
    ],
)
def test_wrong_parameter_file_has_status_2_and_reports_errors(capsys, patient_tree, scenario, text, said):
    path = scenario(text or "", "params.yaml")
    if text is None:
        path.unlink()
    status, out, err = run(capsys, *patient_tree)
    assert (status, out) == (2, "")
    assert said.format(path=path) in err


def test_parameter_of_wrong_type_has_status_1(capsys, patient_tree, scenario):
    scenario(PARAMS.replace("0.6", "long"), "params.yaml")
    status, out, err = run(capsys, *patient_tree)
    assert (status, out) == (1, "")
    assert "error[wrong-value]: duration" in err


def test_misspelt_parameter_is_reported_with_location(capsys, patient_tree, scenario):
    path = scenario(PARAMS.replace("tick_rate_hz", "tick_rate"), "params.yaml")
    assert run(capsys, *patient_tree)[2] == (
        f"note: {path}:3:41: parameter 'tick_rate' is not used: did you mean 'tick_rate_hz'?\n"
    )
