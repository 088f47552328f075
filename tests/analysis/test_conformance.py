"""Flights of small trees, held beside all runs of these."""

import itertools

import pytest

from sar_compiler.analysis.conformance import PropertyResult, conform
from sar_compiler.analysis.verify.properties import parse_property_file
from sar_compiler.analysis.verify.recorded_runs import OtherTreeError
from sar_compiler.runtime.events import HALTED, RETURNED, Event, append_end
from sar_compiler.runtime.walking import pre_order
from tests.analysis.verify.stage import TAGS, bound, simulated_tree

KEPT, BROKEN, IN_DOUBT, OPEN = PropertyResult


class Flights:
    """Flights of a tree whose leaves are named, tick by tick.

    Args:
        body: The tree.
        properties: The text of a file of properties.
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
        """Return the events of ticks: of each what the root came to, and what leaves did."""
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


def test_a_run_of_the_tree_conforms():
    found = Flights(TWO).compared(RUNS, ("RUNNING",), FINE)
    assert (found.misfit, found.ticks, found.is_fine) == (None, 3, True)
    assert Flights(TWO).compared(RUNS, ("RUNNING",), is_over=False).ticks == 2


def test_a_flight_of_no_tick_has_broken_nothing():
    found = Flights(TWO, "properties: {p: {never: one SUCCESS}}").compared()
    assert (found.is_fine, found.ticks, found.properties[0].fate) == (True, 0, KEPT)


def test_of_a_flight_of_other_nodes_nothing_is_said():
    flights = Flights(TWO)
    flights.names = ["all", "one", "three"]
    with pytest.raises(OtherTreeError):
        flights.compared(RUNS)


def test_the_event_that_breaks_a_property_is_told_with_its_place_and_what_led_there():
    found = Flights(TWO, "properties: {p: {never: two SUCCESS}}").compared(
        RUNS, ("RUNNING", "one RUNNING"), FINE
    )
    (broken,) = found.properties
    assert (broken.fate, broken.tick, broken.time_sec, broken.event) == (BROKEN, 3, 1.5, "two SUCCESS")
    assert broken.place.rpartition(":")[0].endswith(":3")
    # One that goes on running is told once.
    assert [each.action for each in broken.run] == ["RUNNING", "SUCCESS", "SUCCESS"]
    assert not found.is_fine


def test_what_comes_after_the_event_that_breaks_a_property_did_not_lead_there():
    found = Flights(TWO, "properties: {p: {never: one SUCCESS}}").compared(RUNS, FINE)
    assert [each.leaf for each in found.properties[0].run] == ["one", "one"]


def test_a_property_that_counts_while_a_condition_holds_is_judged_by_what_was_so():
    properties = (
        "properties: {early: {never: Z SUCCESS, while: f == 0}, late: {never: Z SUCCESS, while: f == 1}}"
    )
    flights = Flights('<Sequence name="all"><X/><Z/></Sequence>', properties)
    ticks = [("RUNNING", "X RUNNING"), ("SUCCESS", "X SUCCESS", "Z SUCCESS")]
    assert flights.fates(*ticks) == {"early": KEPT, "late": BROKEN}


def test_what_is_owed_is_broken_at_an_end_and_open_where_the_run_was_stopped():
    flights = Flights(TWO, "properties: {p: {after: one RUNNING, eventually: two FAILURE}}")
    assert flights.fates(RUNS, is_over=False) == {"p": OPEN}
    found = flights.compared(RUNS, FINE)
    assert [(each.fate, each.tick, each.event) for each in found.properties] == [(BROKEN, 2, "")]
    assert flights.fates(RUNS, ("FAILURE", "one SUCCESS", "two FAILURE")) == {"p": KEPT}


def test_what_holds_at_the_end_is_judged_where_there_is_one():
    flights = Flights(TWO, "properties: {p: {at_end: root == 'FAILURE'}}")
    assert flights.fates(RUNS, is_over=False) == {"p": OPEN}
    assert flights.fates(RUNS, FINE) == {"p": BROKEN}
    assert flights.fates(("FAILURE", "one FAILURE")) == {"p": KEPT}


def test_an_end_that_asks_for_idleness_is_judged_when_the_run_is_over_and_where_every_tick_leaves_all_as_it_is():
    over = "end: idle\nproperties: {p: {at_end: root == 'FAILURE'}}"
    assert Flights(TWO, over).fates(RUNS, FINE) == {"p": BROKEN}
    assert Flights(TWO, over).fates(RUNS, FINE, is_over=False) == {"p": OPEN}
    idle = Flights('<Sequence name="all"><RunOnce><A name="one"/></RunOnce><AlwaysSuccess/></Sequence>', over)
    assert idle.fates(("SUCCESS", "one SUCCESS"), ("SUCCESS",), is_over=False) == {"p": BROKEN}


def test_where_the_record_fits_runs_that_break_a_property_and_others_it_may_be_broken():
    answers = "outcomes: {one: [RUNNING, {status: SUCCESS, label: far}, {status: SUCCESS, label: near}]}\n"
    flights = Flights(TWO, f"{answers}properties: {{p: {{never: one far}}, q: {{never: two SUCCESS}}}}")
    found = flights.compared(RUNS, FINE)
    assert [each.fate for each in found.properties] == [IN_DOUBT, BROKEN]
    assert (found.properties[0].tick, found.properties[0].event) == (2, "one far")
    assert flights.fates(RUNS, ("SUCCESS", "one SUCCESS far", "two SUCCESS"))["p"] is BROKEN
    near = ("RUNNING", "one SUCCESS near", "two RUNNING")
    assert flights.fates(near, ("FAILURE", "two FAILURE")) == {"p": KEPT, "q": KEPT}


def test_an_answer_that_goes_on_unnoted_is_the_one_that_it_was():
    answers = (
        "outcomes: {one: [{status: RUNNING, label: driving}, {status: RUNNING, label: turning}, SUCCESS]}\n"
    )
    flights = Flights(TWO, f"{answers}properties: {{p: {{never: one turning}}}}")
    assert flights.fates(("RUNNING", "one RUNNING driving"), ("RUNNING",)) == {"p": KEPT}
    assert flights.fates(("RUNNING", "one RUNNING"), ("RUNNING",)) == {"p": IN_DOUBT}


def test_a_property_that_every_way_has_broken_by_some_tick_is_broken_for_sure_from_there_on():
    answers = "outcomes: {one: [RUNNING, {status: SUCCESS, label: far}, {status: SUCCESS, label: near}]}\n"
    flights = Flights(TWO, f"{answers}properties: {{p: {{never: [one far, two SUCCESS]}}}}")
    (broken,) = flights.compared(
        ("RUNNING", "one SUCCESS", "two RUNNING"), ("SUCCESS", "two SUCCESS")
    ).properties
    assert (broken.fate, broken.tick, broken.event) == (BROKEN, 2, "two SUCCESS")


def test_an_answer_that_nobody_has_declared_is_where_the_flight_leaves_the_tree():
    misfit = Flights(TWO).misfit(RUNS, ("SUCCESS", "one SUCCESS fine", "two SUCCESS"))
    assert (misfit.tick, misfit.time_sec, misfit.event) == (2, 1.0, "one fine")
    assert misfit.why == "it is assumed that 'one' returns only SUCCESS, FAILURE, RUNNING, but returned fine"
    assert set(misfit.possible) == {"one SUCCESS", "one FAILURE", "one RUNNING"}
    assert misfit.place.rpartition(":")[0].endswith(":3")


def test_an_answer_that_facts_exclude_is_told_with_what_would_have_had_to_be_so():
    flights = Flights('<Sequence name="all"><X/><Y/></Sequence>')
    fits = ("SUCCESS", "X SUCCESS", "Y SUCCESS counted")
    assert flights.misfit(fits) is None
    # X counts up before, in the same tick.
    late = Flights('<Sequence name="all"><X/><Y name="a"/><Y name="b"/></Sequence>')
    misfit = late.misfit(("SUCCESS", "X SUCCESS", "a SUCCESS counted", "b SUCCESS counted"))
    assert (misfit.tick, misfit.event) == (1, "b counted")
    assert misfit.why == "it is assumed that 'b' returns 'counted' only when f > 0 (f is 0)"
    assert set(misfit.possible) == {"b FAILURE", "b RUNNING"}


def test_of_a_leaf_that_answers_twice_in_a_tick_it_is_the_answer_that_cannot_be():
    flights = Flights(
        '<RetryUntilSuccessful name="all" num_attempts="3"><A name="one"/></RetryUntilSuccessful>'
    )
    misfit = flights.misfit(RUNS, ("SUCCESS", "one FAILURE", "one SUCCESS odd"))
    assert misfit.event == "one odd"
    assert "one SUCCESS" in misfit.possible
    assert misfit.why.endswith("but returned odd")


def test_a_leaf_whose_turn_it_was_not_is_told_with_what_would_have_come():
    misfit = Flights(TWO).misfit(("RUNNING", "two RUNNING"))
    assert (misfit.event, misfit.why) == ("two RUNNING", "no possible run ticks this leaf at this point")
    assert set(misfit.possible) == {"one SUCCESS", "one FAILURE", "one RUNNING"}


def test_an_event_behind_the_end_of_a_tick_is_told():
    misfit = Flights(TWO).misfit(("FAILURE", "one FAILURE", "two SUCCESS"))
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
def test_what_a_tick_lacks_is_told(tick, event, possible):
    misfit = Flights(TWO).misfit(RUNS, tick)
    assert misfit.tick == 2
    assert misfit.event == event
    assert possible <= set(misfit.possible)


def test_an_answer_that_went_on_longer_than_is_assumed_is_told_with_the_limit():
    limit = "facts: {left: 2}\noutcomes: {one: [{status: FAILURE, label: held, when: left > 0, then: left -= 1}, SUCCESS]}"
    flights = Flights('<Inverter name="all"><A name="one"/></Inverter>', limit)
    held = ("SUCCESS", "one FAILURE held")
    assert flights.misfit(held, ("SUCCESS",)) is None
    misfit = flights.misfit(held, ("SUCCESS",), ("SUCCESS",))
    assert (misfit.tick, misfit.event, misfit.possible) == (3, "one still held", ("one SUCCESS",))
    assert misfit.why == "it is assumed that 'one' returns 'held' only when left > 0 (left is 0)"


def test_what_the_root_came_to_is_told_with_the_place_of_the_root():
    ticks = ("RUNNING", "one FAILURE"), ("FAILURE", "one FAILURE odd")
    root, leaf = (int(Flights(TWO).misfit(tick).place.rpartition(":")[2]) for tick in ticks)
    assert root < leaf


def test_a_leaf_that_was_not_stopped_although_it_had_to_be_is_told():
    flights = Flights('<ReactiveSequence name="all"><P name="one"/><A name="two"/></ReactiveSequence>')
    goes = ("RUNNING", "one SUCCESS", "two RUNNING")
    assert flights.misfit(goes, ("FAILURE", "one FAILURE", "two halted")) is None
    misfit = flights.misfit(goes, ("FAILURE", "one FAILURE"))
    assert (misfit.event, misfit.possible) == ("two continues", ("two halted",))


def test_a_tick_that_was_broken_off_is_none_that_is_wrong_where_the_run_was_not_over():
    half = ("", "one SUCCESS")
    assert Flights(TWO).misfit(RUNS, half, is_over=False) is None
    assert Flights(TWO).misfit(RUNS, half) is not None
    assert Flights(TWO).misfit(half, FINE, is_over=False) is not None
    assert Flights(TWO).misfit(RUNS, ("", "two SUCCESS"), is_over=False) is not None
    # That there was this one is known because something was told of it.
    assert Flights(TWO).misfit(RUNS, ("SUCCESS",), is_over=False) is not None


def test_from_where_a_flight_leaves_the_tree_properties_are_judged_by_its_events_alone():
    properties = """properties:
      before it: {never: one SUCCESS}
      behind it: {never: two SUCCESS}
      owed: {after: two SUCCESS, eventually: one FAILURE}
      kept: {never: two FAILURE}
      at the end: {at_end: root == 'FAILURE'}"""
    flights = Flights(TWO, properties)
    strange = [
        ("RUNNING", "one SUCCESS", "two RUNNING"),
        ("RUNNING", "two RUNNING odd"),
        ("RUNNING",),
        ("RUNNING", "two SUCCESS"),
    ]
    found = flights.compared(*strange, is_over=False)
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


def test_facts_begin_anew_where_events_alone_are_judged():
    # Y can count only what X has counted, which the search for the run has done already.
    properties = "properties: {p: {never: Y counted, while: f == 1}}"
    flights = Flights('<Sequence name="all"><X/><Y/></Sequence>', properties)
    found = flights.compared(("RUNNING", "X RUNNING odd"), ("SUCCESS", "X SUCCESS", "Y SUCCESS counted"))
    assert [(each.fate, each.by_events) for each in found.properties] == [(BROKEN, True)]


def test_only_the_last_events_are_told():
    flights = Flights(
        '<KeepRunningUntilFailure name="all"><A name="one"/></KeepRunningUntilFailure>',
        "properties: {p: {never: one FAILURE}}",
    )
    ticks = list(itertools.repeat(("RUNNING", "one SUCCESS"), 20))
    found = flights.compared(*ticks, ("FAILURE", "one FAILURE"))
    assert [each.tick for each in found.properties[0].run] == list(range(10, 22))
