"""What each form of property forbids, event by event."""

import random

import pytest

from sar_compiler.checks.verify.monitors import LIMIT, MAIN, OTHER, Form, Monitor, Monitors

ROLES = {0: MAIN, 1: OTHER, 2: LIMIT}
EVENTS = {"main": 0, "other": 1, "limit": 2, "else": 3}


def broken_at(form, events, owes=False):
    """Return the places at which events break a property."""
    monitors, state, places = Monitors([Monitor(form, ROLES, owes)]), Monitors.start, []
    for place, event in enumerate(events.split()):
        state, broken = monitors.after(state, (EVENTS[event],))
        if broken:
            places.append(place)
    return places


@pytest.mark.parametrize(
    ("form", "events", "places"),
    [
        (Form.NEVER, "else other main limit main", [2, 4]),
        (Form.BEFORE, "main other main", [0]),
        (Form.BEFORE, "other main main", []),
        (Form.BEFORE, "other limit main", [2]),
        (Form.BEFORE, "other limit other main", []),
        (Form.AFTER, "main other limit", []),
        (Form.AFTER, "main limit", [1]),
        (Form.AFTER, "main else limit other", [2]),
        (Form.AFTER, "limit main main other limit", []),
        (Form.AFTER, "main limit limit main limit", [1, 4]),
        (Form.AT_MOST_ONCE, "main limit main", []),
        (Form.AT_MOST_ONCE, "main else main", [2]),
        (Form.AT_MOST_ONCE, "main main main", [1, 2]),
    ],
)
def test_a_property_is_broken_where_it_says(form, events, places):
    assert broken_at(form, events) == places


def test_what_must_come_one_day_is_owed_until_it_comes():
    monitors = Monitors([Monitor(Form.AFTER, {0: MAIN, 1: OTHER}, owes=True)])
    after_main, _ = monitors.after(Monitors.start, (0, 3))
    after_other, _ = monitors.after(after_main, (3, 1))
    assert [monitors.owed(state) for state in (Monitors.start, after_main, after_other)] == [0, 1, 0]


def test_what_must_come_before_something_is_not_owed_for_ever():
    monitors = Monitors([Monitor(Form.AFTER, ROLES)])
    assert monitors.owed(monitors.after(Monitors.start, (0,))[0]) == 0


def test_the_order_of_events_in_one_tick_counts():
    monitors = Monitors([Monitor(Form.BEFORE, ROLES)])
    assert monitors.after(Monitors.start, (EVENTS["other"], EVENTS["main"]))[1] == 0
    assert monitors.after(Monitors.start, (EVENTS["main"], EVENTS["other"]))[1] == 1


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
    Form.NEVER: never_breaks,
    Form.BEFORE: before_breaks,
    Form.AFTER: after_breaks,
    Form.AT_MOST_ONCE: at_most_once_breaks,
}


@pytest.mark.parametrize("form", list(Form))
def test_monitors_say_of_random_runs_what_the_property_s_sentence_says(form):
    chance = random.Random(form.value)  # noqa: S311 - the same in every run
    for _ in range(500):
        run = chance.choices(list(EVENTS), k=chance.randint(1, 12))
        expected = [place for place in range(len(run)) if NAIVE[form](run, place)]
        assert broken_at(form, " ".join(run)) == expected, run


def test_monitors_together_say_what_each_says_alone():
    chance = random.Random(1)  # noqa: S311 - the same in every run
    monitors = [Monitor(form, ROLES) for form in Form]
    together, state = Monitors(monitors), Monitors.start
    alone = [(Monitors([monitor]), Monitors.start) for monitor in monitors]
    for _ in range(300):
        events = tuple(chance.choices(range(4), k=chance.randint(0, 3)))
        state, broken = together.after(state, events)
        answers = [one.after(own, events) for one, own in alone]
        alone = [(one, following) for (one, _), (following, _) in zip(alone, answers, strict=True)]
        assert broken == sum(wrong << bit for bit, (_, wrong) in enumerate(answers))
