"""The cost of proofs, predictions and zone orders."""

import json
import statistics
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from benchmarks.commands import SCRIPTS, Cost, run
from benchmarks.figures import Effort, medians
from benchmarks.rows import Benchmark, Limit, Measured, MissedError, Row, seconds
from benchmarks.trees import around, described, mission, sequence

_RESILIENT = "search_and_rescue_resilient"
_SHIPPED = ("search_and_rescue", _RESILIENT, "search_areas")
_OWN = 17
_PROBABILITIES = """
outcomes:
  NavigateToZone: [{outcome: arrived, p: 0.7, sec: 30}, {outcome: aborted, p: 0.25, sec: 5}, {outcome: unavailable, p: 0.05}]
  DetectSurvivor: [{outcome: found, p: 0.3, sec: 2}, {outcome: nothing, p: 0.6, sec: 2}, {outcome: no answer, p: 0.1, sec: 5}]
  NotifyBase: [{outcome: acknowledged, p: 0.9, sec: 1}, {outcome: refused, p: 0.1, sec: 1}]
  NavigateToBase: [{outcome: arrived, p: 0.9, sec: 30}, {outcome: aborted, p: 0.07, sec: 5}, {outcome: unavailable, p: 0.03}]
  DeliverReports: [{outcome: delivered, p: 0.8, sec: 1}, {outcome: refused, p: 0.1, sec: 1}, {outcome: all but one delivered, p: 0.1, sec: 1}]
"""
# A leaf would not show how often it orders the zones, so a separate process orders them once, which also shows the memory.
_ORDER = """
import sys
import numpy as np
from search_and_rescue.search_theory import SearchExpectation
from search_and_rescue.zone_manager import ZoneManager
from search_and_rescue.zone_order import order_areas

count = int(sys.argv[1])
chance = np.random.default_rng(count)
names = [f"zone_{at}" for at in range(count)]
places = chance.uniform(0.0, 500.0, (count, 2)).tolist()
zones = [{"id": name, "x": x, "y": y, "yaw": 0.0} for name, (x, y) in zip(names, places, strict=True)]
shares = 1.0 + chance.pareto(1.2, count)
expected = zip(0.9 * shares / shares.sum(), chance.uniform(0.5, 0.95, count), chance.uniform(5, 60, count), strict=True)
areas = {name: SearchExpectation(*map(float, each)) for name, each in zip(names, expected, strict=True)}
plan = ZoneManager(zones, {"x": 0.0, "y": 0.0, "yaw": 0.0}, areas=areas, speed_mps=0.5)
assert len(order_areas("expected_find", plan.tour(plan.eligible_zones()))) == count
"""


def _patrol() -> str:
    """Return a patrol that counts its rounds forever; no node reads the number."""
    visits = [
        around("ForceSuccess", [sequence([f'<Check name="Free{at}"/>', f'<Try name="Drive{at}"/>'])])
        for at in range(3)
    ]
    rounds = sequence([*visits, '<Script code="rounds = rounds + 1"/>'])
    return described(sequence(['<Script code="rounds := 0"/>', around("KeepRunningUntilFailure", [rounds])]))


@contextmanager
def set_up(_effort: Effort) -> Iterator[Path]:
    """Set up a folder with files."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "patrol.xml").write_text(_patrol(), encoding="utf-8")
        (folder / "probabilities.yaml").write_text(_PROBABILITIES, encoding="utf-8")
        for at in range(_OWN):
            (folder / f"mission_{at}.xml").write_text(mission(at, has_scripts=at % 2 == 0), encoding="utf-8")
        yield folder


def _verify(*words: str | Path) -> Cost:
    """Run `sar-compile verify`.

    Raises:
        MissedError: It has not explored all states.
    """
    cost = run([SCRIPTS / "sar-compile", "verify", *words, "--format", "json"], statuses=(0, 1))
    if not json.loads(cost.printed)["complete"]:
        raise MissedError(f"not decided after {seconds(cost.cpu)} CPU and {cost.memory:.0f} MB")
    return cost


def _cpu_and_memory(command: Sequence[str | Path], rounds: int) -> Measured:
    return Measured(medians(lambda: run(command)[1:3], rounds))


def _patrol_row(folder: Path, effort: Effort) -> Measured:
    return Measured(medians(lambda: _verify(folder / "patrol.xml")[1:3], effort.few))


def _usual_row(folder: Path, effort: Effort) -> Measured:
    files: list[str | Path] = [*_SHIPPED, *(folder / f"mission_{at}.xml" for at in range(_OWN))]
    chosen = files[: effort.size(len(files), 2)]
    taken = [medians(lambda: (_verify(file).cpu,), 2)[0] for file in chosen]  # noqa: B023 - called at once
    note = f"of {len(taken)}; the slowest {seconds(max(taken))}"
    return Measured((statistics.median(taken),), note)


def _large_row(_folder: Path, effort: Effort) -> Measured:
    zones = 8 if effort.share == 1 else 1
    words = (_RESILIENT, "--set", f"zones_left={zones}", "--max-states", "100000000")
    return Measured(medians(lambda: _verify(*words)[1:3], 2))


def _predict_row(folder: Path, effort: Effort) -> Measured:
    zones = 5 if effort.share == 1 else 1
    words: list[str | Path] = [
        "--outcomes",
        folder / "probabilities.yaml",
        "--set",
        f"zones_left={zones}",
        "--max-states",
        "1000000",
    ]
    return _cpu_and_memory([SCRIPTS / "sar-compile", "predict", _RESILIENT, *words], 2)


def _order_row(_folder: Path, effort: Effort) -> Measured:
    return _cpu_and_memory([SCRIPTS / "python", "-c", _ORDER, str(effort.size(1000))], effort.few)


BENCHMARK = Benchmark(
    (
        Row(
            "`verify` of a patrol that counts its rounds",
            (Limit(1.0, "s CPU"), Limit(150.0, "MB")),
            "explores all states; no node reads the count",
            _patrol_row,
        ),
        Row(
            "`verify` of twenty trees as people write them, the median",
            (Limit(0.5, "s CPU"),),
            "shipped trees, and others of 20 to 60 nodes; explores all states",
            _usual_row,
        ),
        Row(
            "`verify` of the resilient mission with 8 zones",
            (Limit(15.0, "s CPU"), Limit(500.0, "MB")),
            "explores all states, and checks the mission's properties",
            _large_row,
        ),
        Row(
            "`predict` of the resilient mission with 5 zones",
            (Limit(14.0, "s CPU"), Limit(600.0, "MB")),
            "probabilities and times of all leaves",
            _predict_row,
        ),
        Row(
            "the order of 1,000 zones",
            (Limit(2.0, "s CPU"), Limit(200.0, "MB")),
            "`expected_find`, with straight lines as paths; includes the start of the process",
            _order_row,
        ),
    ),
    set_up,
)
