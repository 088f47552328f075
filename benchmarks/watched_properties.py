"""What it costs a flight to be watched for properties: the events of the resilient mission, as a scenario plays them."""

import statistics
from collections.abc import Iterator

from benchmarks.figures import Effort, Result, plain, timed
from sar_compiler.analysis.tree_analysis import watch_tree
from sar_compiler.loaded_tree import load

SUBJECT = "an event and property, the resilient mission"
_ZONES = 40


def measure(effort: Effort) -> Iterator[Result]:
    """Yield the CPU seconds that an event takes, shared among the properties: conditions, facts and monitors."""
    zones = effort.size(_ZONES)
    tree = load("search_and_rescue_resilient")
    run = tree.simulate(scenario={"facts": {"zones_left": zones}, "ticks": 100_000}).until_end().run
    events = [event for tick in run.ticks for event in tick.events]
    taken = []
    for _ in range(effort.rounds):
        watch = watch_tree(tree, run.simulated.compiled, facts={"zones_left": zones})
        seconds = timed(lambda: [*map(watch.take, events)])  # noqa: B023 - called at once
        if watch.alarms:
            message = f"the run is none that keeps the properties: {watch.alarms[0].text}"
            raise ValueError(message)
        taken.append(seconds / len(events) / watch.properties.rules.count)
    yield plain(SUBJECT, statistics.median(taken), "s/event")
