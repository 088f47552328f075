"""What each form of property forbids, event by event."""

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


def after_all(monitors, state, events):
    """Return the state after some events, and the monitors that they break."""
    broken = 0
    for event in events:
        state, wrong = monitors.next_state(state, event)
        broken |= wrong
    return state, broken


def broken_at(form, events, owes=False):
    """Return the places at which events break a property."""
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
def test_a_property_is_broken_where_it_says(form, events, places):
    assert broken_at(form, events) == places


def test_what_must_come_one_day_is_owed_until_it_comes():
    monitors = MonitorSet([PropertyMonitor(PropertyPattern.AFTER, {0: MAIN, 1: OTHER}, owes=True)])
    after_main, _ = after_all(monitors, MonitorSet.start, (0, 3))
    after_other, _ = after_all(monitors, after_main, (3, 1))
    assert [monitors.pending_monitors(state) for state in (MonitorSet.start, after_main, after_other)] == [
        0,
        1,
        0,
    ]


def test_what_must_come_before_something_is_not_owed_for_ever():
    monitors = MonitorSet([PropertyMonitor(PropertyPattern.AFTER, ROLES)])
    assert monitors.pending_monitors(after_all(monitors, MonitorSet.start, (0,))[0]) == 0


def test_the_order_of_events_in_one_tick_counts():
    monitors = MonitorSet([PropertyMonitor(PropertyPattern.BEFORE, ROLES)])
    assert after_all(monitors, MonitorSet.start, (EVENTS["other"], EVENTS["main"]))[1] == 0
    assert after_all(monitors, MonitorSet.start, (EVENTS["main"], EVENTS["other"]))[1] == 1


# The same once more, as sentences about a whole run: `run[:i]` is what came before the event at i.


def never_breaks(run, i):
    return run[i] == "main"


def before_breaks(run, i):
    since = last(run[:i], "limit")
    return run[i] == "main" and "other" not in run[since + 1 : i]


def after_breaks(run, i):
    asked, paid = last(run[:i], "main"), last(run[:i], "other")
    return run[i] == "limit" and asked > paid and "limit" not in run[asked + 1 : i]


def at_most_once_breaks(run, i):
    since = last(run[:i], "limit")
    return run[i] == "main" and "main" in run[since + 1 : i]


def last(run, event):
    return max((place for place, each in enumerate(run) if each == event), default=-1)


NAIVE = {
    PropertyPattern.NEVER: never_breaks,
    PropertyPattern.BEFORE: before_breaks,
    PropertyPattern.AFTER: after_breaks,
    PropertyPattern.AT_MOST_ONCE: at_most_once_breaks,
}


@pytest.mark.parametrize("form", list(PropertyPattern))
def test_monitors_say_of_random_runs_what_the_property_s_sentence_says(form):
    chance = random.Random(form.value)  # noqa: S311 - the same in every run
    for _ in range(500):
        run = chance.choices(list(EVENTS), k=chance.randint(1, 12))
        expected = [place for place in range(len(run)) if NAIVE[form](run, place)]
        assert broken_at(form, " ".join(run)) == expected, run


def test_monitors_together_say_what_each_says_alone():
    chance = random.Random(1)  # noqa: S311 - the same in every run
    monitors = [PropertyMonitor(form, ROLES) for form in PropertyPattern]
    together, state = MonitorSet(monitors), MonitorSet.start
    alone = [(MonitorSet([monitor]), MonitorSet.start) for monitor in monitors]
    for _ in range(300):
        events = tuple(chance.choices(range(4), k=chance.randint(0, 3)))
        state, broken = after_all(together, state, events)
        answers = [after_all(one, own, events) for one, own in alone]
        alone = [(one, following) for (one, _), (following, _) in zip(alone, answers, strict=True)]
        assert broken == sum(wrong << bit for bit, (_, wrong) in enumerate(answers))
