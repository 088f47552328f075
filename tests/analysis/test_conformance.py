"""Tests of conformance: recorded runs of small trees are compared with all possible runs."""

import itertools

import pytest

from sar_compiler.analysis.conformance import PropertyResult, conform
from sar_compiler.analysis.verify.properties import parse_property_file
from sar_compiler.analysis.verify.recorded_runs import OtherTreeError
from sar_compiler.runtime.events import HALTED, RETURNED, Event, append_end
from sar_compiler.runtime.walking import pre_order
from tests.analysis.verify.stage import TAGS, bound, simulated_tree

KEPT, BROKEN, IN_DOUBT, OPEN = PropertyResult


class RecordedRuns:
    """Recorded runs of a tree whose leaves have names, tick by tick.

    Args:
        body: The tree.
        properties: The text of a properties file.
    """

    def __init__(self, body, properties=""):
        self._binding = bound(body)
        self._text = properties
        self.names = [each.name for each in pre_order(self._simulated().root)]

    def _file(self):
        return parse_property_file(self._text, "props.yaml") if self._text else None

    def _simulated(self):
        return simulated_tree(self._binding, self._file())

    def event(self, said):
        """Return an event: `one RUNNING`, `two SUCCESS counted` or `one halted`."""
        leaf, what, *label = said.split(maxsplit=2)
        number = self.names.index(leaf)
        if what == HALTED:
            return Event(("all", leaf), number, HALTED)
        return Event(("all", leaf), number, RETURNED, what, "".join(label))

    def record(self, *ticks):
        """Return the events of ticks, each given as the root's status and the events of leaves."""
        return [
            event
            for number, (root, *said) in enumerate(ticks, 1)
            for event in append_end(map(self.event, said), self.names[0], root, number, number / 2)
        ]

    def compared(self, *ticks, is_over=True):
        simulated, file = self._simulated(), self._file()
        return conform(simulated, file, TAGS, self.record(*ticks), self.names, is_over=is_over)

    def fates(self, *ticks, is_over=True):
        return {each.name: each.fate for each in self.compared(*ticks, is_over=is_over).properties}

    def misfit(self, *ticks, is_over=True):
        return self.compared(*ticks, is_over=is_over).misfit


TWO = '<Sequence name="all"><A name="one"/><A name="two"/></Sequence>'
RUNS = ("RUNNING", "one RUNNING")
FINE = ("SUCCESS", "one SUCCESS", "two SUCCESS")


def test_possible_run_conforms():
    found = RecordedRuns(TWO).compared(RUNS, ("RUNNING",), FINE)
    assert (found.misfit, found.ticks, found.is_fine) == (None, 3, True)
    assert RecordedRuns(TWO).compared(RUNS, ("RUNNING",), is_over=False).ticks == 2


def test_run_without_ticks_violates_nothing():
    found = RecordedRuns(TWO, "properties: {p: {never: one SUCCESS}}").compared()
    assert (found.is_fine, found.ticks, found.properties[0].fate) == (True, 0, KEPT)


def test_run_of_different_nodes_is_rejected():
    runs = RecordedRuns(TWO)
    runs.names = ["all", "one", "three"]
    with pytest.raises(OtherTreeError):
        runs.compared(RUNS)


def test_violating_event_is_reported_with_location_and_preceding_events():
    found = RecordedRuns(TWO, "properties: {p: {never: two SUCCESS}}").compared(
        RUNS, ("RUNNING", "one RUNNING"), FINE
    )
    (broken,) = found.properties
    assert (broken.fate, broken.tick, broken.time_sec, broken.event) == (BROKEN, 3, 1.5, "two SUCCESS")
    assert broken.place.rpartition(":")[0].endswith(":3")
    # An outcome that stays RUNNING is reported once.
    assert [each.action for each in broken.run] == ["RUNNING", "SUCCESS", "SUCCESS"]
    assert not found.is_fine


def test_events_after_violation_are_not_reported_as_its_cause():
    found = RecordedRuns(TWO, "properties: {p: {never: one SUCCESS}}").compared(RUNS, FINE)
    assert [each.leaf for each in found.properties[0].run] == ["one", "one"]


def test_while_condition_is_evaluated_at_event():
    properties = (
        "properties: {early: {never: Z SUCCESS, while: f == 0}, late: {never: Z SUCCESS, while: f == 1}}"
    )
    runs = RecordedRuns('<Sequence name="all"><X/><Z/></Sequence>', properties)
    ticks = [("RUNNING", "X RUNNING"), ("SUCCESS", "X SUCCESS", "Z SUCCESS")]
    assert runs.fates(*ticks) == {"early": KEPT, "late": BROKEN}


def test_pending_property_is_violated_at_end_and_open_if_run_was_stopped():
    runs = RecordedRuns(TWO, "properties: {p: {after: one RUNNING, eventually: two FAILURE}}")
    assert runs.fates(RUNS, is_over=False) == {"p": OPEN}
    found = runs.compared(RUNS, FINE)
    assert [(each.fate, each.tick, each.event) for each in found.properties] == [(BROKEN, 2, "")]
    assert runs.fates(RUNS, ("FAILURE", "one SUCCESS", "two FAILURE")) == {"p": KEPT}


def test_at_end_property_is_evaluated_only_at_end():
    runs = RecordedRuns(TWO, "properties: {p: {at_end: root == 'FAILURE'}}")
    assert runs.fates(RUNS, is_over=False) == {"p": OPEN}
    assert runs.fates(RUNS, FINE) == {"p": BROKEN}
    assert runs.fates(("FAILURE", "one FAILURE")) == {"p": KEPT}


def test_idle_end_is_reached_when_run_is_over_or_every_tick_leaves_state_unchanged():
    over = "end: idle\nproperties: {p: {at_end: root == 'FAILURE'}}"
    assert RecordedRuns(TWO, over).fates(RUNS, FINE) == {"p": BROKEN}
    assert RecordedRuns(TWO, over).fates(RUNS, FINE, is_over=False) == {"p": OPEN}
    idle = RecordedRuns(
        '<Sequence name="all"><RunOnce><A name="one"/></RunOnce><AlwaysSuccess/></Sequence>', over
    )
    assert idle.fates(("SUCCESS", "one SUCCESS"), ("SUCCESS",), is_over=False) == {"p": BROKEN}


def test_property_is_in_doubt_if_record_fits_violating_and_other_runs():
    answers = "outcomes: {one: [RUNNING, {status: SUCCESS, label: far}, {status: SUCCESS, label: near}]}\n"
    runs = RecordedRuns(TWO, f"{answers}properties: {{p: {{never: one far}}, q: {{never: two SUCCESS}}}}")
    found = runs.compared(RUNS, FINE)
    assert [each.fate for each in found.properties] == [IN_DOUBT, BROKEN]
    assert (found.properties[0].tick, found.properties[0].event) == (2, "one far")
    assert runs.fates(RUNS, ("SUCCESS", "one SUCCESS far", "two SUCCESS"))["p"] is BROKEN
    near = ("RUNNING", "one SUCCESS near", "two RUNNING")
    assert runs.fates(near, ("FAILURE", "two FAILURE")) == {"p": KEPT, "q": KEPT}


def test_continued_outcome_without_event_is_unchanged():
    answers = (
        "outcomes: {one: [{status: RUNNING, label: driving}, {status: RUNNING, label: turning}, SUCCESS]}\n"
    )
    runs = RecordedRuns(TWO, f"{answers}properties: {{p: {{never: one turning}}}}")
    assert runs.fates(("RUNNING", "one RUNNING driving"), ("RUNNING",)) == {"p": KEPT}
    assert runs.fates(("RUNNING", "one RUNNING"), ("RUNNING",)) == {"p": IN_DOUBT}


def test_property_violated_in_every_matching_run_is_violated():
    answers = "outcomes: {one: [RUNNING, {status: SUCCESS, label: far}, {status: SUCCESS, label: near}]}\n"
    runs = RecordedRuns(TWO, f"{answers}properties: {{p: {{never: [one far, two SUCCESS]}}}}")
    (broken,) = runs.compared(
        ("RUNNING", "one SUCCESS", "two RUNNING"), ("SUCCESS", "two SUCCESS")
    ).properties
    assert (broken.fate, broken.tick, broken.event) == (BROKEN, 2, "two SUCCESS")


def test_undeclared_outcome_is_misfit():
    misfit = RecordedRuns(TWO).misfit(RUNS, ("SUCCESS", "one SUCCESS fine", "two SUCCESS"))
    assert (misfit.tick, misfit.time_sec, misfit.event) == (2, 1.0, "one fine")
    assert misfit.why == "it is assumed that 'one' returns only SUCCESS, FAILURE, RUNNING, but returned fine"
    assert set(misfit.possible) == {"one SUCCESS", "one FAILURE", "one RUNNING"}
    assert misfit.place.rpartition(":")[0].endswith(":3")


def test_outcome_excluded_by_facts_is_misfit_with_required_condition():
    runs = RecordedRuns('<Sequence name="all"><X/><Y/></Sequence>')
    fits = ("SUCCESS", "X SUCCESS", "Y SUCCESS counted")
    assert runs.misfit(fits) is None
    # X has counted up before, in the same tick.
    late = RecordedRuns('<Sequence name="all"><X/><Y name="a"/><Y name="b"/></Sequence>')
    misfit = late.misfit(("SUCCESS", "X SUCCESS", "a SUCCESS counted", "b SUCCESS counted"))
    assert (misfit.tick, misfit.event) == (1, "b counted")
    assert misfit.why == "it is assumed that 'b' returns 'counted' only when f > 0 (f is 0)"
    assert set(misfit.possible) == {"b FAILURE", "b RUNNING"}


def test_second_outcome_of_leaf_in_tick_is_identified_as_misfit():
    runs = RecordedRuns(
        '<RetryUntilSuccessful name="all" num_attempts="3"><A name="one"/></RetryUntilSuccessful>'
    )
    misfit = runs.misfit(RUNS, ("SUCCESS", "one FAILURE", "one SUCCESS odd"))
    assert misfit.event == "one odd"
    assert "one SUCCESS" in misfit.possible
    assert misfit.why.endswith("but returned odd")


def test_leaf_ticked_out_of_turn_is_misfit_with_possible_events():
    misfit = RecordedRuns(TWO).misfit(("RUNNING", "two RUNNING"))
    assert (misfit.event, misfit.why) == ("two RUNNING", "no possible run ticks this leaf at this point")
    assert set(misfit.possible) == {"one SUCCESS", "one FAILURE", "one RUNNING"}


def test_event_after_end_of_tick_is_misfit():
    misfit = RecordedRuns(TWO).misfit(("FAILURE", "one FAILURE", "two SUCCESS"))
    assert (misfit.event, misfit.possible) == ("two SUCCESS", ("the tick ends with FAILURE",))


@pytest.mark.parametrize(
    ("tick", "event", "possible"),
    [
        pytest.param(("SUCCESS",), "one still RUNNING", {"one SUCCESS", "one FAILURE"}, id="an answer"),
        pytest.param(
            ("SUCCESS", "one SUCCESS"),
            "no outcome of two",
            {"two SUCCESS", "two FAILURE", "two RUNNING"},
            id="a leaf",
        ),
        pytest.param(
            ("RUNNING", "one FAILURE"), "all RUNNING", {"the tick ends with FAILURE"}, id="the root"
        ),
        pytest.param(("RUNNING", "one RUNNING", "one halted"), "one halted", {"one continues"}, id="a halt"),
    ],
)
def test_missing_event_of_tick_is_reported(tick, event, possible):
    misfit = RecordedRuns(TWO).misfit(RUNS, tick)
    assert misfit.tick == 2
    assert misfit.event == event
    assert possible <= set(misfit.possible)


def test_outcome_continued_beyond_limit_is_misfit_with_limit():
    limit = "facts: {left: 2}\noutcomes: {one: [{status: FAILURE, label: held, when: left > 0, then: left -= 1}, SUCCESS]}"
    runs = RecordedRuns('<Inverter name="all"><A name="one"/></Inverter>', limit)
    held = ("SUCCESS", "one FAILURE held")
    assert runs.misfit(held, ("SUCCESS",)) is None
    misfit = runs.misfit(held, ("SUCCESS",), ("SUCCESS",))
    assert (misfit.tick, misfit.event, misfit.possible) == (3, "one still held", ("one SUCCESS",))
    assert misfit.why == "it is assumed that 'one' returns 'held' only when left > 0 (left is 0)"


def test_wrong_root_status_is_reported_at_location_of_root():
    ticks = ("RUNNING", "one FAILURE"), ("FAILURE", "one FAILURE odd")
    root, leaf = (int(RecordedRuns(TWO).misfit(tick).place.rpartition(":")[2]) for tick in ticks)
    assert root < leaf


def test_missing_halt_of_leaf_is_reported():
    runs = RecordedRuns('<ReactiveSequence name="all"><P name="one"/><A name="two"/></ReactiveSequence>')
    goes = ("RUNNING", "one SUCCESS", "two RUNNING")
    assert runs.misfit(goes, ("FAILURE", "one FAILURE", "two halted")) is None
    misfit = runs.misfit(goes, ("FAILURE", "one FAILURE"))
    assert (misfit.event, misfit.possible) == ("two continues", ("two halted",))


def test_incomplete_last_tick_is_accepted_if_run_was_not_over():
    half = ("", "one SUCCESS")
    assert RecordedRuns(TWO).misfit(RUNS, half, is_over=False) is None
    assert RecordedRuns(TWO).misfit(RUNS, half) is not None
    assert RecordedRuns(TWO).misfit(half, FINE, is_over=False) is not None
    assert RecordedRuns(TWO).misfit(RUNS, ("", "two SUCCESS"), is_over=False) is not None
    # This tick is known to exist because it has events.
    assert RecordedRuns(TWO).misfit(RUNS, ("SUCCESS",), is_over=False) is not None


def test_properties_are_judged_by_events_alone_after_misfit():
    properties = """properties:
      before it: {never: one SUCCESS}
      behind it: {never: two SUCCESS}
      owed: {after: two SUCCESS, eventually: one FAILURE}
      kept: {never: two FAILURE}
      at the end: {at_end: root == 'FAILURE'}"""
    runs = RecordedRuns(TWO, properties)
    strange = [
        ("RUNNING", "one SUCCESS", "two RUNNING"),
        ("RUNNING", "two RUNNING odd"),
        ("RUNNING",),
        ("RUNNING", "two SUCCESS"),
    ]
    found = runs.compared(*strange, is_over=False)
    assert found.misfit.event == "two odd"
    fates = {each.name: (each.fate, each.tick, each.by_events) for each in found.properties}
    assert fates == {
        "before it": (BROKEN, 1, False),
        "behind it": (BROKEN, 4, True),
        "owed": (OPEN, 0, False),
        "kept": (KEPT, 0, False),
        "at the end": (OPEN, 0, False),
    }
    (behind,) = [each for each in found.properties if each.name == "behind it"]
    assert (behind.event, behind.time_sec) == ("two SUCCESS", 2.0)


def test_facts_are_reset_when_events_alone_are_judged():
    # Y can count only after X has counted, which the search for the run has already applied.
    properties = "properties: {p: {never: Y counted, while: f == 1}}"
    runs = RecordedRuns('<Sequence name="all"><X/><Y/></Sequence>', properties)
    found = runs.compared(("RUNNING", "X RUNNING odd"), ("SUCCESS", "X SUCCESS", "Y SUCCESS counted"))
    assert [(each.fate, each.by_events) for each in found.properties] == [(BROKEN, True)]


def test_only_last_events_are_reported():
    runs = RecordedRuns(
        '<KeepRunningUntilFailure name="all"><A name="one"/></KeepRunningUntilFailure>',
        "properties: {p: {never: one FAILURE}}",
    )
    ticks = list(itertools.repeat(("RUNNING", "one SUCCESS"), 20))
    found = runs.compared(*ticks, ("FAILURE", "one FAILURE"))
    assert [each.tick for each in found.properties[0].run] == list(range(10, 22))
