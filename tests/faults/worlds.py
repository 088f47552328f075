"""A simulated robot, its Nav2 and a base station that outlive missions, and checks of a completed mission."""

import re

import pytest

from tests.faults.crashing_mission import ONCE, kinds
from tests.processes import Command

ACKNOWLEDGED = "survivors found: survivor_1 in zone_a at (-2.50, 3.20), acknowledged"


def is_over(place):
    """Return whether the mission in a journal is over."""
    from sar_compiler.journal.database import JournalFile

    file = JournalFile.read(place)
    try:
        return file.runs()[-1].is_over
    finally:
        file.close()


class World:
    """A robot, its Nav2 and the detection server, which outlive missions, and a base station for each mission.

    Args:
        begin: Starts a command.
    """

    def __init__(self, begin):
        self._begin = begin
        self._base = None
        begin("sar-sim", "run", "--speed", 20).wait_for("runs")
        self.detector = begin("sar-detect-survivor-server").wait_for("ready")

    def base(self):
        """Return a new base station without reports."""
        if self._base is not None:
            self._base.stop()
        self._base = self._begin("sar-report-survivor-server").wait_for("ready")
        return self._base


@pytest.fixture(scope="module")
def world():
    """Start a world once for the module."""
    commands = []

    def begin(*command):
        commands.append(Command(*command))
        return commands[-1]

    yield World(begin)
    for command in reversed(commands):
        command.kill()


def arguments(place, tree, *more):
    """Return the arguments of `sar-run` for a mission in a world."""
    zones = ("-p", "zone_order:=[zone_a, zone_b]", "-p", "use_sim_time:=true")
    return (tree, "--until", "complete", "--journal", place, *more, "--ros-args", *zones)


def end(run):
    """Wait for the end of a mission, and assert that it is complete."""
    assert run.end() == 0, run.output
    assert ACKNOWLEDGED in run.output


def hold(watching, base, place):
    """Assert that a completed mission has the same results as an undisturbed one."""
    received = re.findall(r"Report received: (\S+ at \(.*?\))", base.output)
    assert received == ["survivor_1 at (-2.50, 3.20)"]
    found = kinds(place)
    assert {key: count for key, count in found.items() if count > 1 and key[0] in ONCE} == {}
    for fact in (
        ("zone_visited", "zone_a"),
        ("zone_visited", "zone_b"),
        ("report_acknowledged", "survivor_1"),
    ):
        assert found[fact] == 1
    watching.wait_for_goals(lambda goals: goals and all(status > 3 for status in goals))
