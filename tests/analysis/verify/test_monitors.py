"""Tests of monitors: which event violates each form of property."""

import random

import pytest

from sar_compiler.analysis.verify.properties import (
    LIMIT,
    MAIN,
    OTHER,
    MonitorSet,
    PropertyMonitor,
    PropertyPattern,
)

ROLES = {0: MAIN, 1: OTHER, 2: LIMIT}
EVENTS = {"main": 0, "other": 1, "limit": 2, "else": 3}


def process_events(monitors, state, events):
    """Return the state after some events, and the monitors that they violate."""
    broken = 0
    for event in events:
        state, wrong = monitors.next_state(state, event)
        broken |= wrong
    return state, broken


def violation_indices(form, events, owes=False):
    """Return the indices of the events that violate a property."""
    monitors, state, places = MonitorSet([PropertyMonitor(form, ROLES, owes)]), MonitorSet.start, []
    for place, event in enumerate(events.split()):
        state, broken = monitors.next_state(state, EVENTS[event])
        if broken:
            places.append(place)
    return places


@pytest.mark.parametrize(
    ("form", "events", "places"),
    [
        (PropertyPattern.NEVER, "else other main limit main", [2, 4]),
        (PropertyPattern.BEFORE, "main other main", [0]),
        (PropertyPattern.BEFORE, "other main main", []),
        (PropertyPattern.BEFORE, "other limit main", [2]),
        (PropertyPattern.BEFORE, "other limit other main", []),
        (PropertyPattern.AFTER, "main other limit", []),
        (PropertyPattern.AFTER, "main limit", [1]),
        (PropertyPattern.AFTER, "main else limit other", [2]),
        (PropertyPattern.AFTER, "limit main main other limit", []),
        (PropertyPattern.AFTER, "main limit limit main limit", [1, 4]),
        (PropertyPattern.AT_MOST_ONCE, "main limit main", []),
        (PropertyPattern.AT_MOST_ONCE, "main else main", [2]),
        (PropertyPattern.AT_MOST_ONCE, "main main main", [1, 2]),
    ],
)
def test_property_is_violated_at_expected_events(form, events, places):
    assert violation_indices(form, events) == places


def test_eventual_event_is_pending_until_it_occurs():
    monitors = MonitorSet([PropertyMonitor(PropertyPattern.AFTER, {0: MAIN, 1: OTHER}, owes=True)])
    after_main, _ = process_events(monitors, MonitorSet.start, (0, 3))
    after_other, _ = process_events(monitors, after_main, (3, 1))
    assert [monitors.pending_monitors(state) for state in (MonitorSet.start, after_main, after_other)] == [
        0,
        1,
        0,
    ]


def test_event_with_deadline_is_not_pending_forever():
    monitors = MonitorSet([PropertyMonitor(PropertyPattern.AFTER, ROLES)])
    assert monitors.pending_monitors(process_events(monitors, MonitorSet.start, (0,))[0]) == 0


def test_order_of_events_within_tick_matters():
    monitors = MonitorSet([PropertyMonitor(PropertyPattern.BEFORE, ROLES)])
    assert process_events(monitors, MonitorSet.start, (EVENTS["other"], EVENTS["main"]))[1] == 0
    assert process_events(monitors, MonitorSet.start, (EVENTS["main"], EVENTS["other"]))[1] == 1


# The same definitions again, as predicates over a whole run: `run[:i]` has the events before index i.


def violates_never(run, i):
    return run[i] == "main"


def violates_before(run, i):
    since = last_index(run[:i], "limit")
    return run[i] == "main" and "other" not in run[since + 1 : i]


def violates_after(run, i):
    asked, paid = last_index(run[:i], "main"), last_index(run[:i], "other")
    return run[i] == "limit" and asked > paid and "limit" not in run[asked + 1 : i]


def violates_at_most_once(run, i):
    since = last_index(run[:i], "limit")
    return run[i] == "main" and "main" in run[since + 1 : i]


def last_index(run, event):
    return max((place for place, each in enumerate(run) if each == event), default=-1)


NAIVE = {
    PropertyPattern.NEVER: violates_never,
    PropertyPattern.BEFORE: violates_before,
    PropertyPattern.AFTER: violates_after,
    PropertyPattern.AT_MOST_ONCE: violates_at_most_once,
}


@pytest.mark.parametrize("form", list(PropertyPattern))
def test_monitors_match_predicates_in_random_runs(form):
    chance = random.Random(form.value)  # noqa: S311 - the same in every run
    for _ in range(500):
        run = chance.choices(list(EVENTS), k=chance.randint(1, 12))
        expected = [place for place in range(len(run)) if NAIVE[form](run, place)]
        assert violation_indices(form, " ".join(run)) == expected, run


def test_monitor_set_matches_single_monitors():
    chance = random.Random(1)  # noqa: S311 - the same in every run
    monitors = [PropertyMonitor(form, ROLES) for form in PropertyPattern]
    together, state = MonitorSet(monitors), MonitorSet.start
    alone = [(MonitorSet([monitor]), MonitorSet.start) for monitor in monitors]
    for _ in range(300):
        events = tuple(chance.choices(range(4), k=chance.randint(0, 3)))
        state, broken = process_events(together, state, events)
        answers = [process_events(one, own, events) for one, own in alone]
        alone = [(one, following) for (one, _), (following, _) in zip(alone, answers, strict=True)]
        assert broken == sum(wrong << bit for bit, (_, wrong) in enumerate(answers))
