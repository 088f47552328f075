"""Tests of keys that leaves write with unknown values: all analyses treat them in the same way."""

import json

import pytest

from sar_compiler.analysis.verify.recorded_runs import TreeRuns
from sar_compiler.analysis.verify.verdicts import AN_END, EVERY_LEAF, NO_ERROR, NO_LIVELOCK, ProofStatus
from sar_compiler.errors import UndecidableError
from sar_compiler.runtime.events import RETURNED, Event, append_end
from tests.analysis.verify.stage import bound, outcome, simulated_tree, told, verdict, verified
from tests.analysis.verify.test_independent_branches import Case, guarded
from tests.cli.command_runner import run
from tests.trees import document

PROVED, BROKEN, UNDECIDED = ProofStatus
MEASURES = '<M distance="{d}"/>'
HINT = 'outcomes: {M: [{status: SUCCESS, then: "d := ..."}]}'


def test_needed_unknown_value_leaves_dependent_questions_undecided():
    found = verified(f'<Sequence>{MEASURES}<ScriptCondition code="d &gt; 1"/><A/></Sequence>')
    assert {each.outcome for each in found.verdicts} == {UNDECIDED}
    raised = verdict(found, NO_ERROR)
    assert raised.reason.endswith(HINT)
    assert told(raised.trace) == ["M:SUCCESS"]
    assert {verdict(found, each).reason for each in (EVERY_LEAF, AN_END, NO_LIVELOCK)} == {
        "the result depends on the value that 'M' writes to 'd'"
    }


def test_suggested_outcome_makes_tree_decidable():
    properties = 'outcomes: {M: [{status: SUCCESS, then: "d := 2.5"}, FAILURE]}'
    found = verified(f'<Sequence>{MEASURES}<ScriptCondition code="d &gt; 1"/><A/></Sequence>', properties)
    assert found.is_proved


def test_value_passed_between_leaves_leaves_nothing_undecided():
    copied = '<SetBlackboard value="{d}" output_key="e"/>'
    assert verified(f"<Sequence>{MEASURES}{copied}<A/></Sequence>").is_proved


@pytest.mark.parametrize(
    "reads",
    [
        '<Script code="d += 1"/>',
        '<Script code="e := 1 + d"/>',
        '<A _skipIf="d == 2"/>',
        '<CheckBlackboardVariableValue variable="d" operator="eq" value="2"/>',
        '<SetBlackboard value="{d}" output_key="e"/><ScriptCondition code="e == 2"/>',
    ],
)
def test_any_use_of_unknown_value_is_undecided(reads):
    found = verified(f"<Sequence>{MEASURES}{reads}</Sequence>")
    assert outcome(found, NO_ERROR) is UNDECIDED
    assert HINT in verdict(found, NO_ERROR).reason


def test_leaf_overwrites_earlier_value_with_unknown_one():
    before = '<Script code="d := 5"/>'
    found = verified(f'<Sequence>{before}{MEASURES}<ScriptCondition code="d == 5"/></Sequence>')
    assert outcome(found, NO_ERROR) is UNDECIDED


def test_value_written_later_is_known():
    after = '<Script code="d := 2"/><ScriptCondition code="d == 2"/>'
    assert verified(f"<Sequence><ForceSuccess>{MEASURES}</ForceSuccess>{after}</Sequence>").is_proved


def test_key_read_before_its_leaf_has_run_is_error():
    found = verified(f'<Sequence><ScriptCondition code="d == 5"/>{MEASURES}</Sequence>')
    assert outcome(found, NO_ERROR) is BROKEN


@pytest.mark.parametrize("first", ["", "<A/>"])
def test_error_without_unknown_value_takes_precedence(first):
    # The unknown value is needed one tick earlier.
    unknown = f'<Sequence>{MEASURES}<ScriptCondition code="d == 5"/></Sequence>'
    error = f'<Sequence>{first}<Script code="a = b"/></Sequence>'
    found = verified(f"<Fallback><Sequence><P/>{unknown}</Sequence>{error}</Fallback>")
    assert outcome(found, NO_ERROR) is BROKEN
    assert "outcomes: {M:" not in verdict(found, NO_ERROR).reason


def test_endless_run_without_unknown_value_is_shown():
    endless = "<RetryUntilSuccessful num_attempts='-1'><A/></RetryUntilSuccessful>"
    found = verified(f'<Sequence>{endless}{MEASURES}<ScriptCondition code="d == 5"/></Sequence>')
    assert outcome(found, NO_LIVELOCK) is BROKEN
    assert outcome(found, AN_END) is UNDECIDED


def test_end_that_depends_on_unknown_value_is_undecided():
    body = f'<KeepRunningUntilFailure><Sequence>{MEASURES}<ScriptCondition code="d == 5"/></Sequence></KeepRunningUntilFailure>'
    found = verified(body, "outcomes: {M: [{status: SUCCESS}]}")
    assert outcome(found, AN_END) is UNDECIDED


def test_property_violated_without_unknown_value_is_violated():
    body = f'<Sequence><A/>{MEASURES}<ScriptCondition code="d == 5"/><B/></Sequence>'
    found = verified(body, "properties: {no A: {never: A starts}, no B: {never: B starts}}")
    assert outcome(found, "no A") is BROKEN
    assert outcome(found, "no B") is UNDECIDED


CONDITIONED = {
    "while": {"open": "{never: A starts, while: d > 1}"},
    "at_end": {"open": "{at_end: d < 5}"},
    "both": {"open": "{never: A starts, while: d > 1}", "open too": "{at_end: d < 5}"},
}


@pytest.mark.parametrize("first", [True, False])
@pytest.mark.parametrize("kind", CONDITIONED)
def test_only_property_with_unknown_value_in_condition_is_undecided(kind, first):
    known = {"kept": "{before: A starts, comes: M SUCCESS}", "violated": "{never: A FAILURE}"}
    texts = {**CONDITIONED[kind], **known} if first else {**known, **CONDITIONED[kind]}
    lines = "".join(f"\n  {name}: {text}" for name, text in texts.items())
    found = verified(f"<Sequence>{MEASURES}<A/></Sequence>", f"properties:{lines}")
    assert [each.question for each in found.verdicts[:4]] == [NO_ERROR, EVERY_LEAF, AN_END, NO_LIVELOCK]
    assert {each.outcome for each in found.verdicts[:4]} == {PROVED}
    assert (outcome(found, "kept"), outcome(found, "violated")) == (PROVED, BROKEN)
    for name in CONDITIONED[kind]:
        assert outcome(found, name) is UNDECIDED
        assert verdict(found, name).reason.endswith(HINT)
    # Properties of events come first, as when all are decided.
    events = [name for name in texts if "at_end" not in texts[name]]
    ends = [name for name in texts if "at_end" in texts[name]]
    assert [each.question for each in found.verdicts[4:]] == [*events, *ends]


def test_property_condition_with_other_error_ends_search():
    body = f'<Sequence>{MEASURES}<Fallback><A/><Script code="e := 1"/></Fallback></Sequence>'
    with pytest.raises(UndecidableError, match=r"^open: "):
        verified(body, "properties: {open: {at_end: e == 1}, kept: {never: A FAILURE}}")


def test_end_with_unknown_value_leaves_only_dependent_properties_undecided():
    texts = {
        "violated": "{never: A FAILURE}",
        "kept": "{before: A starts, comes: M SUCCESS}",
        "owed": "{after: M SUCCESS, eventually: A SUCCESS}",
        "open": "{never: A starts, while: d > 2}",
        "at the end": "{at_end: root == 'SUCCESS'}",
    }
    lines = "".join(f"\n  {name}: {text}" for name, text in texts.items())
    found = verified(f"<Sequence>{MEASURES}<A/></Sequence>", f"end: d > 1\nproperties:{lines}")
    assert [each.question for each in found.verdicts] == [NO_ERROR, EVERY_LEAF, AN_END, NO_LIVELOCK, *texts]
    decided = {NO_ERROR: PROVED, EVERY_LEAF: PROVED, "violated": BROKEN, "kept": PROVED}
    for each in found.verdicts:
        assert each.outcome is decided.get(each.question, UNDECIDED), each.question
        assert each.question in decided or each.reason.endswith(HINT)
    assert verdict(found, "at the end").reason.startswith("'d > 1' cannot be evaluated")
    assert verdict(found, "open").reason.startswith("'d > 2' cannot be evaluated")


def test_end_condition_with_other_error_ends_search():
    body = f'<Sequence>{MEASURES}<Fallback><A/><Script code="e := 1"/></Fallback></Sequence>'
    with pytest.raises(UndecidableError, match=r"^end: 'e == 1' cannot be evaluated"):
        verified(body, "{end: e == 1, properties: {kept: {never: A FAILURE}}}")


def test_file_can_declare_value_unknown():
    body = '<Sequence><A/><ScriptCondition code="n == 1"/></Sequence>'
    found = verified(body, 'outcomes: {A: [{status: SUCCESS, then: "n := unknown"}]}')
    assert outcome(found, NO_ERROR) is UNDECIDED
    assert "because 'A' only writes it on a robot" in verdict(found, NO_ERROR).reason


def test_branches_that_write_unknown_values_are_searched_separately():
    branch = "<Sequence><A name='a{0}'/><M name='m{0}' distance='{{d{0}}}'/></Sequence>"
    found = Case(guarded(3, branch), "properties: {p: {never: a1 FAILURE}}").verified(10, 100_000)
    assert (found.branches, found.complete) == (3, True)
    assert outcome(found, NO_ERROR) is PROVED


@pytest.fixture
def run_command(capsys, tmp_path):
    """Return a function that runs a command on a tree that needs the value that M writes to d."""
    tree, scenario = tmp_path / "tree.xml", tmp_path / "s.yaml"
    tree.write_text(
        document(f'<Sequence><A/>{MEASURES}<ScriptCondition code="d &gt; 1"/></Sequence>'), "utf-8"
    )
    scenario.write_text("name: s\nexpect: {root: SUCCESS}\n", encoding="utf-8")

    def run_command(name, *options):
        more = [scenario if each == "SCENARIO" else each for each in options]
        return run(capsys, name, tree, "--nodes", "tests.analysis.verify.leaves", *more)

    return run_command


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["verify"], "no tick raises an error: not decided"),
        (["simulate", "--scenario", "SCENARIO"], "s.yaml: 's' is not decided:"),
        (
            ["sweep", "--unusual", "0.1", "--runs", "20", "--jobs", "1"],
            "the success rate is unknown, because the run with seed",
        ),
        (["predict"], "Some runs are undecided, so some numbers have two bounds: "),
    ],
    ids=lambda words: words[0] if isinstance(words, list) else "",
)
def test_every_command_reports_undecided_result_and_remedy(run_command, words, said):
    status, out, err = run_command(*words)
    assert status == 1
    assert said in out + err
    assert HINT in out + err


def test_undecided_scenario_neither_holds_nor_fails_in_json(run_command):
    status, out, _ = run_command("simulate", "--format", "json", "--scenario", "SCENARIO")
    (scenario,) = json.loads(out)["scenarios"]
    assert (status, scenario["holds"]) == (1, None)
    assert HINT in scenario["failures"][0]["message"]


def test_recorded_run_that_depends_on_unknown_value_is_undecided():
    tree = simulated_tree(bound(f'<Sequence>{MEASURES}<ScriptCondition code="d &gt; 1"/><A/></Sequence>'))
    runs = TreeRuns(tree, ["Sequence", "M", "ScriptCondition", "A"])
    measured, acted = (
        Event(("Sequence", name), number, RETURNED, "SUCCESS") for number, name in ((1, "M"), (3, "A"))
    )
    with pytest.raises(UndecidableError, match="tick 1: ") as caught:
        runs.locate(append_end([measured, acted], "Sequence", "SUCCESS", 1, 0.0))
    assert HINT in str(caught.value)
