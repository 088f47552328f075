"""Missions that crash and resume within the test's own process."""

from collections import Counter
from contextlib import nullcontext
from typing import Any

from tests.full_disk import full_disk

ONCE = ("zone_searched", "survivor_named", "report_acknowledged", "zone_visited")
"""The kinds of events that occur at most once for each zone or survivor."""

SURVIVORS = {"zone_a": (1.5, 1.25), "zone_b": (-2.0, 0.5)}


class Death(BaseException):
    """Stands for SIGKILL of the process."""


class Mortal:
    """Consecutive lives of one mission in this process, with real DDS, each resuming the journal of the previous one.

    Args:
        ros: The ROS context.
        place: The journal.
        tree: A shipped tree.
        zones: Its zones; those of the stage by default.
        survivors: Positions of the survivors by zone.

    Attributes:
        stage: The mission's node, and its servers.
        journal: The journal of this life.
        mission: The run of the mission in this life.
        left: The orphaned goals of earlier lives.
        facts: The number of events that this life has written.
        full_from: The number of the event from which the disk is full in this life, or None.
    """

    def __init__(self, ros, place, tree, zones=None, survivors=SURVIVORS):
        from tests.missions.mission_stage import ZONES, Stage

        self.stage = Stage(ros.context)
        self.zones, self.survivors = zones or ZONES, survivors
        self.nav = self.stage.nav_server()
        self.nav.script = ["succeed"]
        self.detect = self.stage.detect_service(survivors)
        self.report = self.stage.report_service(acknowledged=True)
        self.place, self.tree = place, tree
        self.facts = 0
        self.full_from: int | None = None
        self.journal: Any = None
        self.mission: Any = None
        self.left: Any = None
        self._compiled: Any = None

    @property
    def record(self):
        """Return the record of the mission in this life."""
        from search_and_rescue.record import MissionRecord

        return self.mission.context[MissionRecord]

    def refuse(self, count):
        """Let the base station refuse the first `count` reports."""

        def answer(_, response):
            response.acknowledged = len(self.report.requests) > count

        self.report.answer = answer

    def wake_up(self):
        """Begin a life: resume the journal and start to cancel the goals of earlier lives."""
        from sar_compiler.compiler import compile_tree
        from sar_compiler.journal.journal_opening import open_journal
        from sar_compiler.loaded_tree import load
        from sar_compiler.missions.parameter_reader import ParameterReader
        from sar_compiler.ros.clock import mission_clock
        from sar_compiler.ros.orphaned_goals import OrphanedGoals
        from sar_compiler.runtime.clock import Clock
        from search_and_rescue.plugin import MISSION
        from tests.missions.mission_stage import BASE

        parameters = {"zone_order": [zone["id"] for zone in self.zones]}
        parameters |= {
            f"zones.{zone['id']}.{key}": zone[key] for zone in self.zones for key in ("x", "y", "yaw")
        }
        parameters |= {f"base_station.{key}": value for key, value in BASE.items()}
        self.journal = open_journal(self.place, resume=self.place.exists())
        self.mission = MISSION.begin(ParameterReader(parameters))
        self.mission.use_journal(self.journal)
        context = {Clock: mission_clock(self.stage.node), **self.mission.context}
        self._compiled = compile_tree(load(self.tree).binding(), context, {})
        self.journal.begin({"mission": "search_and_rescue"}, {})
        self.left = OrphanedGoals(self.stage.node, self.journal)

    def start(self):
        """Return the runner of the tree, once the goals of the last life have ended."""
        from sar_compiler.ros.orphaned_goals import record_goals
        from sar_compiler.ros.runner import TreeRunner

        runner = TreeRunner(self._compiled)
        record_goals(self.stage.node, self.journal)
        runner.setup(node=self.stage.node)
        return runner

    def begin(self):
        """Begin a life, and wait for the end of the orphaned goals; return the runner of the tree."""
        self.wake_up()
        self.stage.until(lambda: self.left.poll() is None, "the end of the goals that were left")
        return self.start()

    def live(self, dies_at=None, *, written=False):
        """Run until the mission is complete, or until an event is written; return whether it is complete.

        Args:
            dies_at: The number of that event in this life, from 1; None for no death.
            written: Whether the event is written before the death.
        """
        runner = self.begin()
        self.die_at(dies_at, written=written)

        def complete():
            runner.tick()
            return not self.mission.shortfalls()

        try:
            self.stage.until(complete, f"the end of the mission (lacks: {self.mission.shortfalls()})")
        except Death:
            self.die()
            return False
        runner.shutdown()
        self.die()
        return True

    def die(self):
        """Leave the files and the node as after SIGKILL."""
        self.journal._file.close()
        self.journal._reserve.close(is_needed=True)
        self.stage.renew_node()

    def die_at(self, number, *, written):
        """Raise `Death` when this life writes an event.

        Args:
            number: The number of the event from now on; None for no death.
            written: Whether the event is written before the death.
        """
        write, self.facts = self.journal._file.write, 0
        seen: set[int] = set()

        def write_or_die(watched, facts=(), end=None):
            new = {fact.number for fact in facts} - seen  # events that could not be written are passed again
            seen.update(new)
            self.facts += len(new)
            dies = bool(new) and self.facts == number
            if dies and not written:
                raise Death
            is_full = self.full_from is not None and self.facts >= self.full_from
            with full_disk() if is_full else nullcontext():
                write(watched, facts, end)
            if dies:
                raise Death

        self.journal._file.write = write_or_die

    def told(self):
        """Return the reports that the base station has received, without repetitions."""
        reports = {
            (each.survivor_id, each.location.point.x, each.location.point.y) for each in self.report.requests
        }
        return sorted(reports)

    def outcome(self):
        """Return the visited zones, the survivors and the reports."""
        return self.record.zones_visited, self.record.survivors, self.told()

    def close(self):
        self.stage.close()


def kinds(place):
    """Count the events of a journal by kind and by zone or survivor."""
    from sar_compiler.journal.database import JournalFile

    file = JournalFile.read(place)
    try:
        facts = [*file.events()]
    finally:
        file.close()
    return Counter((fact.kind, fact.data.get("zone") or fact.data.get("survivor")) for fact in facts)
