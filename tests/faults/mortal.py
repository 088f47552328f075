"""Missions that die, in this process."""

from collections import Counter
from contextlib import nullcontext
from typing import Any

from tests.full_disk import full_disk

ONCE = ("zone_searched", "survivor_named", "report_acknowledged", "zone_visited")
"""The facts of which there is one for each zone, or each survivor."""

SURVIVORS = {"zone_a": (1.5, 1.25), "zone_b": (-2.0, 0.5)}


class Death(BaseException):
    """What SIGKILL is to a process."""


class Mortal:
    """Lives of one mission in this process, over real DDS, each with the journal of the one before.

    Args:
        ros: The ROS context.
        place: The journal.
        tree: A shipped tree.
        zones: Its zones; those of the stage by default.
        survivors: Who is found, by zone.

    Attributes:
        stage: The mission's node, and its servers.
        journal: The journal of this life.
        mission: The run of the mission in this life.
        left: The goals of earlier lives.
        facts: How many facts this life has written.
        full_from: The number of the fact from which on the disk is full in this life; None if it is not.
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
        """The record of the mission in this life."""
        from search_and_rescue.record import MissionRecord

        return self.mission.context[MissionRecord]

    def refuse(self, count):
        """Let base refuse the first reports."""

        def answer(_, response):
            response.acknowledged = len(self.report.requests) > count

        self.report.answer = answer

    def wake_up(self):
        """Begin a life: take over what earlier ones have done, and cancel the goals that they have left."""
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
        """Begin a life, and wait for the end of the goals that earlier ones have left; return the runner of the tree."""
        self.wake_up()
        self.stage.until(lambda: self.left.poll() is None, "the end of the goals that were left")
        return self.start()

    def live(self, dies_at=None, *, written=False):
        """Live until the mission is complete, or until a fact is to be written.

        Args:
            dies_at: The number of that fact in this life, from 1; None to live on.
            written: Whether it is written before that.
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
        """Leave everything as SIGKILL does."""
        self.journal._file.close()
        self.journal._reserve.close(is_needed=True)
        self.stage.renew_node()

    def die_at(self, number, *, written):
        """Die when this life writes a fact: a `Death` is raised.

        Args:
            number: The number of the fact from now on; None to live on.
            written: Whether it is written before that.
        """
        write, self.facts = self.journal._file.write, 0
        seen: set[int] = set()

        def write_or_die(watched, facts=(), end=None):
            new = {fact.number for fact in facts} - seen  # those that could not be written come again
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
        """What the world has been told: the reports, each once, and the frames."""
        reports = {
            (each.survivor_id, each.location.point.x, each.location.point.y) for each in self.report.requests
        }
        return sorted(reports)

    def outcome(self):
        """How the mission stands at the end."""
        return self.record.zones_visited, self.record.survivors, self.told()

    def close(self):
        self.stage.close()


def kinds(place):
    """Count the facts of a journal, each with its zone or survivor."""
    from sar_compiler.journal.database import JournalFile

    file = JournalFile.read(place)
    try:
        facts = [*file.events()]
    finally:
        file.close()
    return Counter((fact.kind, fact.data.get("zone") or fact.data.get("survivor")) for fact in facts)
