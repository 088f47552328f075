"""What a prediction costs: the resilient mission, with chances and times of all its leaves."""

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from benchmarks.figures import Effort, Result, most_memory, plain
from sar_compiler.loaded_tree import load

SUBJECT = "search_and_rescue_resilient, five zones"
LARGE = "search_and_rescue_resilient, eight zones"
_ZONES, _MANY_ZONES, _MOST_STATES = 5, 8, 2_000_000
_CHANCES = """
answers:
  NavigateToZone: [{answer: arrived, p: 0.7, sec: 30}, {answer: aborted, p: 0.25, sec: 5}, {answer: unavailable, p: 0.05}]
  DetectSurvivor: [{answer: found, p: 0.3, sec: 2}, {answer: nothing, p: 0.6, sec: 2}, {answer: no answer, p: 0.1, sec: 5}]
  NotifyBase: [{answer: acknowledged, p: 0.9, sec: 1}, {answer: refused, p: 0.1, sec: 1}]
  NavigateToBase: [{answer: arrived, p: 0.9, sec: 30}, {answer: aborted, p: 0.07, sec: 5}, {answer: unavailable, p: 0.03}]
  DeliverReports: [{answer: delivered, p: 0.8, sec: 1}, {answer: refused, p: 0.1, sec: 1}, {answer: all but one delivered, p: 0.1, sec: 1}]
"""


def measure(effort: Effort) -> Iterator[Result]:
    """Yield how many states a prediction goes through in a second, with all that it says, how many there are, and what a large one takes in memory."""
    zones = _ZONES if effort.share == 1 else 1
    with tempfile.TemporaryDirectory() as folder:
        answers = Path(folder, "chances.yaml")
        answers.write_text(_CHANCES, encoding="utf-8")
        tree = load("search_and_rescue_resilient")
        tree.predict(answers, facts={"zones_left": 1})
        begun = time.process_time()
        found = tree.predict(answers, facts={"zones_left": zones})
        taken = time.process_time() - begun
        yield plain(SUBJECT, taken / found.states, "s/state")
        yield plain(f"{SUBJECT}: states", float(found.states), "states")
        found = tree.predict(
            answers, facts={"zones_left": _MANY_ZONES if effort.share == 1 else 1}, max_states=_MOST_STATES
        )
        yield plain(f"{LARGE}: states", float(found.states), "states")
        yield plain(f"{LARGE}: memory", most_memory(), "bytes")
