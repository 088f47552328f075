"""Tests of errors in scenarios: each has one finding, at its location, with a suggestion."""

import pytest

from sar_compiler.analysis.simulate.scenario_files import read_scenario
from sar_compiler.opener import UnreadableFileError
from sar_compiler.tree.diagnostic import TreeError
from tests.analysis.simulate.stage import read, stage


def findings_of(text):
    with pytest.raises(TreeError) as error:
        read(text)
    return [(f.code, f.span.line, f.span.column, f.suggestion) for f in error.value.findings]


# Each entry: the scenario, then code, line, column and suggestion.
MISTAKES = {
    "a list": ("- leaves", "wrong-shape", 1, 1, None),
    "a word": ("leaves", "wrong-shape", 1, 1, None),
    "an unknown key": ("leafs: {}", "unknown-key", 1, 1, "leaves"),
    "a key twice": ("ticks: 1\nticks: 2", "duplicate-key", 2, 1, None),
    "a key that is a list": ("? [a]\n: 1", "wrong-shape", 1, 3, None),
    "a name that is a list": ("name: [a]", "wrong-shape", 1, 7, None),
    "an unknown tree": ("tree: Mian", "wrong-value", 1, 7, "Main"),
    "a period that is none": ("period: soon", "wrong-value", 1, 9, None),
    "a period of nothing": ("period: 0s", "wrong-value", 1, 9, None),
    "no ticks at all": ("ticks: 0", "wrong-value", 1, 8, None),
    "ticks in quotes": ("ticks: '5'", "wrong-value", 1, 9, None),
    "an end that is no script": ("until: root === 1", "script-error", 1, 13, "=="),
    "a parameter that is a list": ("parameters: {patience: [1]}", "wrong-shape", 1, 24, None),
    "an unknown fact": ("facts: {zone_left: 1}", "unknown-fact", 1, 9, "zones_left"),
    "a fact of another type": ("facts: {zones_left: many}", "wrong-value", 1, 21, None),
    "a fact without a value": ("facts: {zones_left: }", "missing-value", 1, 21, None),
    "a fact that can be none": ("facts: {zones left: 1}", "wrong-name", 1, 9, None),
    "answers of an unknown leaf": ("outcomes: {Fly: SUCCESS}", "unknown-leaf", 1, 12, None),
    "an unknown status": ("outcomes: {AdvanceZone: [SUCESS]}", "wrong-value", 1, 26, "SUCCESS"),
    "a status that the leaf never has": ("outcomes: {AdvanceZone: FAILURE}", "wrong-value", 1, 25, None),
    "no answer at all": ("outcomes: {AdvanceZone: []}", "missing-value", 1, 25, None),
    "an answer without a status": ("outcomes: {AdvanceZone: {label: x}}", "missing-key", 1, 12, None),
    "an unknown part of an answer": (
        "outcomes: {AdvanceZone: {status: SUCCESS, wehn: x}}",
        "unknown-key",
        1,
        43,
        "when",
    ),
    "an answer with a script that is none": (
        'outcomes: {AdvanceZone: {status: SUCCESS, when: "1 >"}}',
        "script-error",
        1,
        52,
        None,
    ),
    "an unknown leaf": ("leaves: {NavigateToZoen: arrived}", "unknown-leaf", 1, 10, "NavigateToZone"),
    "a leaf of the language": ("leaves: {Success: SUCCESS}", "unknown-leaf", 1, 10, None),
    "an unknown answer": ("leaves: {NavigateToZone: arived}", "unknown-outcome", 1, 26, "arrived"),
    "an unknown answer in a list": (
        "leaves:\n  AdvanceZone:\n    - advancd",
        "unknown-outcome",
        3,
        7,
        "advanced",
    ),
    "a probability above 1": (
        "leaves: {NavigateToZone: {outcome: aborted, probability: 5}}",
        "wrong-value",
        1,
        58,
        None,
    ),
    "a probability of nothing": (
        "leaves: {NavigateToZone: {outcome: aborted, probability: 0}}",
        "wrong-value",
        1,
        58,
        None,
    ),
    "half of two durations": (
        "leaves: {NavigateToZone: {outcome: aborted, after: 4s to}}",
        "wrong-value",
        1,
        52,
        None,
    ),
    "a step without an answer": ("leaves: {AdvanceZone: {after: 1s}}", "missing-key", 1, 10, None),
    "an unknown part of a step": (
        "leaves: {NavigateToZone: {outcome: arrived, aftr: 1s}}",
        "unknown-key",
        1,
        45,
        "after",
    ),
    "a time for a leaf that never runs": (
        "leaves: {AdvanceZone: {outcome: advanced, after: 1s}}",
        "wrong-value",
        1,
        50,
        None,
    ),
    "a time that is none": (
        "leaves: {NavigateToZone: {outcome: arrived, after: 1h}}",
        "wrong-value",
        1,
        52,
        "60min",
    ),
    "times that are no number": (
        "leaves: {NavigateToZone: {outcome: arrived, times: often}}",
        "wrong-value",
        1,
        52,
        None,
    ),
    "every 0th time": ("leaves: {NavigateToZone: {outcome: arrived, every: 0}}", "wrong-value", 1, 52, None),
    "a misspelt fact in a condition": (
        'leaves: {NavigateToZone: {outcome: aborted, when: "tick > 2 && zones_lft == 2"}}',
        "unknown-fact",
        1,
        64,
        "zones_left",
    ),
    "a misspelt fact in an answer": (
        'facts: {power: 3}\noutcomes: {AdvanceZone: {status: SUCCESS, when: "powr > 0", then: "power -= 1"}}',
        "unknown-fact",
        2,
        50,
        "power",
    ),
    "a misspelt fact that an answer changes": (
        'facts: {power: 3}\noutcomes: {AdvanceZone: {status: SUCCESS, when: "power > 0", then: "powr -= 1"}}',
        "unknown-fact",
        2,
        69,
        "power",
    ),
    "a misspelt fact at the end of a run": ('until: "zones_lft == 0"', "unknown-fact", 1, 9, "zones_left"),
    "an end that gives a fact a value": ('until: "zones_left = 0"', "wrong-condition", 1, 9, None),
    "a condition that is none": (
        "leaves: {NavigateToZone: {outcome: arrived, when: ')'}}",
        "script-error",
        1,
        52,
        None,
    ),
    "an unknown expectation": ("expect: {roots: SUCCESS}", "unknown-key", 1, 10, "root"),
    "a root that cannot be": ("expect: {root: SUCESS}", "wrong-value", 1, 16, "SUCCESS"),
    "an end that is neither": ("expect: {ends: maybe}", "wrong-value", 1, 16, None),
    "a limit that is none": ("expect: {within: soon}", "wrong-value", 1, 18, None),
    "an unknown fact at the end": ("expect: {facts: {att: base}}", "unknown-fact", 1, 18, "at"),
    "an event of an unknown leaf": ("expect: {never: [Fly arrived]}", "unknown-leaf", 1, 18, None),
    "an event that the leaf never does": (
        "expect: {order: [NavigateToZone arived]}",
        "unknown-outcome",
        1,
        33,
        "arrived",
    ),
    "an event that is a leaf alone": ("expect: {order: [NavigateToZone]}", "wrong-value", 1, 18, None),
    "an event that is a mapping": ("expect: {order: [{a: b}]}", "wrong-shape", 1, 18, None),
    "a count that is none": ("expect: {count: {NavigateToZone arrived: few}}", "wrong-value", 1, 42, None),
    "a second document": ("ticks: 1\n---\nticks: 2", "second-document", 2, 1, None),
    "an anchor": ("ticks: &a 1", "yaml-anchor", 1, 8, None),
    "no YAML": ("ticks: [", "malformed-yaml", 1, 9, None),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_error_in_scenario_is_reported_at_its_location(mistake):
    text, *finding = MISTAKES[mistake]
    assert findings_of(text) == [tuple(finding)]


def test_all_errors_are_reported_in_file_order():
    text = "expect: {root: SUCESS}\nfacts: {zone_left: 1}\nleaves: {AdvanceZne: advanced}"
    assert [code for code, *_ in findings_of(text)] == ["wrong-value", "unknown-fact", "unknown-leaf"]


def test_invalid_parameter_is_not_reported_as_missing():
    text = "parameters: {patience: [1]}\nleaves: {}"
    body = '<Timeout duration="{@patience}"><NavigateToZone/></Timeout>'
    with pytest.raises(TreeError) as error:
        read(text, body)
    assert [(f.code, f.span.line, f.span.column) for f in error.value.findings] == [("wrong-shape", 1, 24)]


def test_empty_scenario_is_reported():
    with pytest.raises(TreeError, match="the file is empty"):
        read("# nothing\n")


def test_missing_scenario_file_raises_error(tmp_path):
    with pytest.raises(UnreadableFileError, match="cannot read"):
        read_scenario(tmp_path / "nowhere.yaml", stage())


def test_fact_used_only_by_outcome_of_scenario_can_be_set():
    text = """
    facts: {battery: 20}
    outcomes: {AdvanceZone: {status: SUCCESS, when: "battery > 10"}}
    """
    assert read(text).simulated.fact_values()["battery"] == 20


def test_scalars_keep_their_written_form():
    text = """
    facts: {at: no, zones_left: 2}
    parameters: {a: 1.5, b: true, c: "1", d: 12:30}
    """
    play = read(text)
    assert play.simulated.fact_values()["at"] == "no"
    scope = play.simulated.compiled.instance.scope
    assert [scope.resolve(key).read() for key in "abcd"] == [1.5, True, "1", "12:30"]


def test_malformed_script_has_hint():
    with pytest.raises(TreeError) as error:
        read("until: root == 0x")
    (finding,) = error.value.findings
    assert (finding.code, finding.hint) == ("script-error", "write for example 0xFF")


@pytest.mark.parametrize(
    ("until", "body"),
    [
        ("battery > 3", '<SetBlackboard value="5" output_key="battery"/>'),
        ("battery > 3", '<Script code="battery := 5"/>'),
        ("@battery > 3", '<SubTree ID="Main2" level="{battery}"/>'),
        ("level == 5", '<Script code="{program}"/>'),
    ],
)
def test_condition_can_use_any_key_of_tree(until, body):
    tree = f"<Sequence>{body}<AdvanceZone/></Sequence>"
    if "SubTree" in body:
        tree += '</BehaviorTree><BehaviorTree ID="Main2"><Script code="level := 5"/>'
    assert read(f'tree: Main\nuntil: "{until}"', tree).scenario.until is not None


def test_condition_can_use_key_of_outcome_or_parameter():
    answers = 'outcomes: {AdvanceZone: {status: SUCCESS, then: "gone := 1"}}'
    assert read(f'{answers}\nuntil: "gone == 1"').scenario.until is not None
    assert read("parameters: {speed: 2}\nuntil: speed > 1").scenario.until is not None
