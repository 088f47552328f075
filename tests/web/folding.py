"""The state that a page computes from changes, and random histories of runs."""

import json
import random

from sar_compiler.journal.journal import Journal
from sar_compiler.journal.journal_entries import Ending, JournalEntry
from sar_compiler.runtime.clock import ManualClock
from tests.web.conftest import ABOUT, KINDS, POINTS, Patrol


def plain(value):
    """Return values as after JSON, with numbers rounded to six decimals."""
    return json.loads(json.dumps(value), parse_float=lambda text: round(float(text), 6))


def folded(known, change):
    """Return the state of a page after a change, as computed by `static/run.js`."""
    change = plain(change)
    known = {} if change.pop("begin", False) else dict(known)
    if "nodes" in change:
        known["lanes"] = []
    for name in ("log", "trail", "lanes"):
        if name in change:
            known[name] = known.get(name, [])[: change[name]["at"]] + change.pop(name)["values"]
    if "nodes" in change:
        known["states"] = {}
    known["states"] = {**known.get("states", {}), **change.pop("states", {})}
    marks = {**known.get("landmarks", {}), **change.pop("landmarks", {})}
    known["landmarks"] = {key: each for key, each in marks.items() if each is not None}
    known["rasters"] = {**known.get("rasters", {}), **change.pop("rasters", {})}
    return {**known, **change}


def happen(journal, chance, name):
    """Record a random entry in a run."""
    x, point = float(chance.randrange(-9, 9)), chance.choice([*POINTS, "west"])
    status = chance.choice(["RUNNING", "SUCCESS", "FAILURE", "HALTED", "SKIPPED", "IDLE"])
    watched = {
        "status": {
            "node": chance.randrange(3),
            "tick": chance.randrange(99),
            "status": status,
            "message": chance.choice("ab"),
        },
        "pose": {"x": x, "y": -x, "yaw": 0.1},
        "map": {"png": name},
        "plan": {"frame": chance.choice(["map", "odom"]), "points": [[x, x]]},
        "progress": {"target": point, "distance": abs(x), "time_left": None},
        "lacks": {"text": chance.choice(["", "no link"])},
        "battery": {"share": chance.choice([0.5, 0.2])},
        "goal_ended": {"goal": name, "status": 4},
        "properties_watched": {
            "file": "p.yaml",
            "properties": [{"name": each, "if_broken": "tell"} for each in "pq"],
            "left_out": [],
        },
        "properties_owed": {"owed": chance.choice([[], ["p"], ["p", "q"]])},
        "log": {"node": "patrol", "level": chance.choice([20, 30, 40]), "text": name},
        "whatever": {"name": name},
    }
    facts = {
        "point_reached": {
            "point": chance.choice([*POINTS]),
            "state": name,
            "level": chance.choice(["TO_COME", "IN_HAND", "DONE", "GIVEN_UP"]),
        },
        "point_added": {"point": point, "x": x, "y": 0.0},
        "found": {"name": f"find_{chance.randrange(4)}", "x": x, "y": 0.0},
        "lost": {"name": f"find_{chance.randrange(4)}"},
        "forecast": {"rain": chance.choice([None, 0.0, 0.25, 1.0])},
        "mown": {
            "name": chance.choice("pq"),
            "rows": [[chance.random() for _ in range(3)] for _ in range(2)],
        },
        "held": {"is_held": chance.random() < 0.5},
        "property_broken": {"property": chance.choice("pq"), "event": name},
        "assumption_failed": {"assumption": name},
        "alarmed": {"text": chance.choice("pq"), "is_over": chance.random() < 0.5},
    }
    kind = chance.choice([*watched, *facts, "status", "pose"])
    if kind in watched:
        journal.record_observation(kind, **watched[kind])
    else:
        journal.record_event(kind, **facts[kind])


def fly(journal, seed, count, *, clock=None, is_ended=True):
    """Record a run with `count` random entries."""
    chance = random.Random(seed)  # noqa: S311
    journal.clock = clock or ManualClock(chance.uniform(0.0, 1000.0))
    if not journal.is_resumed:
        journal.attach(Patrol(), KINDS)
    journal.begin(ABOUT, {"node": "/patrol"})
    for number in range(count):
        journal.clock.advance(chance.choice([0.0, 0.0, 0.1, 1.0]))
        happen(journal, chance, f"event {number}")
    if is_ended:
        journal.end_run(Ending.STOPPED, 130, "Stopped.")


def history(seed, count):
    """Return the entries of two random runs; for every third seed, the second one is another mission in the same journal."""
    entries = []
    for run in (1, 2):
        journal = Journal()
        told: list[JournalEntry] = []
        journal.add_listener(told.append)
        fly(journal, seed + run, count)
        number = 1 if seed % 3 == 0 else run
        entries += [entry._replace(run=number) for entry in told]
    return entries
