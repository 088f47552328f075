"""Tests of random faults in random order: after recovery the mission ends, and every survivor is reported under one name."""

import math
import tempfile
from pathlib import Path
from typing import Any

import pytest
from hypothesis import Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    invariant,
    rule,
    run_state_machine_as_test,
)

from tests.faults.crashing_mission import ONCE, Death, Mortal, kinds

pytestmark = pytest.mark.ros

TREE = "search_and_rescue_resilient"
NAMES = [f"zone_{letter}" for letter in "abcdef"]
ZONES = [{"id": name, "x": -3.0 + number, "y": 3.0, "yaw": 1.57} for number, name in enumerate(NAMES)]
# Two of them are so close to each other that they are possible duplicates.
SURVIVORS = {"zone_a": (1.5, 1.25), "zone_b": (-2.0, 0.5), "zone_d": (-2.5, 0.5), "zone_f": (9.0, -4.0)}

# Simulated seconds per real second, so that pauses between attempts are short.
SPEED = 40.0
NONSENSE = (math.nan, math.inf, -math.inf, 1e308, -2e5)
# Error codes of Nav2's servers, permanent and temporary ones, no code, and unknown codes.
CODES = (0, 105, 202, 204, 206, 208, 9003, 65535)
# The longest real time to wait for the end: waits that began before the recovery may still last.
END_SEC = 240.0


class FaultyMission(Mortal):
    """A mission whose servers and clock fail on request."""

    def __init__(self, ros, place):
        from tests.faults.servers import Clock

        super().__init__(ros, place, TREE, ZONES, SURVIVORS)
        self.reports = [self.report]
        self.frames = self.stage.static_frames(self.stage.host().node)
        self.clock = Clock(self.stage.host().node, {"start": 10_000.0, "speed": SPEED})
        self.runner: Any = None
        self.wake_up()

    @property
    def is_over(self):
        """Return whether the tree has succeeded or failed."""
        from py_trees.common import Status

        return self.runner is not None and self.runner.last_status in (Status.SUCCESS, Status.FAILURE)

    def wake_up(self):
        """Begin a life with simulated time."""
        from rclpy.parameter import Parameter

        self.stage.node.set_parameters([Parameter("use_sim_time", value=True)])
        super().wake_up()

    def turn(self):
        """Tick once and spin; after a death, begin the next life."""
        try:
            if self.runner is None:
                if self.left.poll() is None:
                    self.runner = self.start()
            elif not self.is_over:
                self.runner.tick()
            self.stage.spin()
        except Death:
            self.die_now()

    def die_now(self):
        """Die, and begin the next life."""
        self.die()
        self.runner = None
        self.wake_up()

    def replace_navigation(self):
        """Start a new navigation server."""
        self.nav.host.close()
        self.nav = self.stage.nav_server()
        self.nav.script = ["succeed"]

    def replace_detection(self):
        """Start a new detection server."""
        self.detect.host.close()
        self.detect = self.stage.detect_service(SURVIVORS)

    def replace_base(self):
        """Start a new base station without reports."""
        self.report.host.close()
        self.report = self.stage.report_service(acknowledged=True)
        self.reports.append(self.report)

    def recover(self):
        """End all faults."""
        self.clock.obey({"stop": False})
        self.replace_navigation()
        self.replace_detection()
        self.replace_base()

    def told(self):
        """Return the reports that any base station has received, without repetitions."""
        return {
            (each.survivor_id, each.location.point.x, each.location.point.y)
            for server in self.reports
            for each in server.requests
        }

    def frames_told(self):
        """Return the survivor frames that a late subscriber receives, with their positions."""
        return {(name, *self.frames.position(name)[:2]) for name in self.frames.frames}


class AnyFaults(RuleBasedStateMachine):
    """Faults in any order while the mission continues.

    The choice of faults does not depend on the mission, as Hypothesis requires.
    """

    def __init__(self):
        from tests.ros.conftest import Ros

        super().__init__()
        self.folder = tempfile.TemporaryDirectory(prefix="any_faults")
        self.ros = Ros()
        self.flight = FaultyMission(self.ros, Path(self.folder.name) / "mission.journal")

    @invariant()
    def time_passes(self):
        for _ in range(12):
            self.flight.turn()

    @rule(turns=st.integers(1, 60))
    def go_on(self, turns):
        for _ in range(turns):
            self.flight.turn()

    @rule(manner=st.sampled_from(["arrives", "rejects", "aborts", "lingers", "loses results", "keeps goals"]))
    def navigate(self, manner):
        nav = self.flight.nav
        nav.accept = manner != "rejects"
        nav.loses_results = manner == "loses results"
        nav.heed_cancel = manner != "keeps goals"
        nav.script = {"aborts": ["abort"], "lingers": ["feedback"], "keeps goals": []}.get(
            manner, ["succeed"]
        )

    @rule(code=st.sampled_from(CODES))
    def explain_aborts(self, code):
        self.flight.nav.error_code = code

    @rule(order=st.sampled_from(["feedback", "succeed", "abort"]))
    def go_on_driving(self, order):
        for goal in self.flight.nav.active:
            goal.orders.put(order)

    @rule(manner=st.sampled_from(["tells", "loses answers", "talks nonsense"]), x=st.sampled_from(NONSENSE))
    def search(self, manner, x):
        def talk_nonsense(_, response):
            response.found, response.survivor_x = True, x

        detect = self.flight.detect
        detect.loses_answers = manner == "loses answers"
        if manner == "talks nonsense":
            detect.answer = talk_nonsense
        elif manner == "tells":
            self.flight.replace_detection()

    @rule(manner=st.sampled_from(["acknowledges", "refuses", "loses answers"]))
    def listen(self, manner):
        def answer(_, response):
            response.acknowledged = manner != "refuses"

        self.flight.report.answer = answer
        self.flight.report.loses_answers = manner == "loses answers"

    @rule(who=st.sampled_from(["nav", "detect", "report"]))
    def leave(self, who):
        getattr(self.flight, who).host.close()

    @rule(who=st.sampled_from(["navigation", "detection", "base"]))
    def begin_anew(self, who):
        getattr(self.flight, f"replace_{who}")()

    @rule(order=st.sampled_from([{"jump": 5000.0}, {"jump": -90.0}, {"stop": True}, {"stop": False}]))
    def set_clock(self, order):
        self.flight.clock.obey(order)

    @rule()
    def die(self):
        if not self.flight.is_over:
            self.flight.die_now()

    @rule(fact=st.integers(1, 8), written=st.booleans())
    def die_at_a_fact(self, fact, written):
        self.flight.die_at(fact, written=written)

    def teardown(self):
        try:
            self._end()
        finally:
            self.flight.close()
            self.ros.close()
            self.folder.cleanup()

    def _end(self):
        flight = self.flight
        has_way = flight.runner is None or not flight.is_over
        zones_left = has_way and len(flight.record.zones_visited) < len(NAMES) and not flight.record.home
        flight.recover()
        flight.stage.until(lambda: flight.turn() or flight.is_over, "the end of the mission", END_SEC)
        left = [leaf for leaf in flight.runner.root.iterate() if hasattr(leaf, "is_settled")]
        flight.stage.until(lambda: all(leaf.is_settled() for leaf in left), "the end of all goals", END_SEC)
        self._hold(flight, zones_left)
        flight.runner.shutdown()

    def _hold(self, flight, had_zones_left):
        record, shortfalls = flight.record, flight.mission.shortfalls()
        abandoned = [zone["id"] for zone in flight.mission.zones.abandoned_zones()]
        assert sorted((*record.zones_visited, *abandoned)) == NAMES
        # Exactly the survivors in the visited zones were found, each with one name.
        found = {(each.zone_id, each.x, each.y) for each in record.survivors}
        assert found == {(zone, *SURVIVORS[zone]) for zone in record.zones_visited if zone in SURVIVORS}
        named = {(each.survivor_id, each.x, each.y) for each in record.survivors}
        assert len({name for name, *_ in named}) == len(record.survivors) == len(found)
        # All reports are true, every acknowledged survivor was reported, and missing acknowledgements are listed.
        assert flight.told() <= named
        acknowledged = {each.survivor_id for each in record.survivors if each.acknowledged}
        assert acknowledged <= {name for name, *_ in flight.told()}
        for each in record.survivors:
            assert each.acknowledged or f"The base station did not acknowledge {each}." in shortfalls
        if had_zones_left:
            assert len(acknowledged) == len(named)
            assert record.home
        flight.stage.until(lambda: flight.frames_told() == named, f"the frames of {named}")
        facts = kinds(flight.place)
        assert {key: count for key, count in facts.items() if count > 1 and key[0] in ONCE} == {}
        assert flight.nav.active == []


@pytest.mark.costly
@pytest.mark.parametrize("cases", [3, pytest.param(150, marks=pytest.mark.slow)], ids=["short", "long"])
def test_random_faults_leave_every_zone_finished_and_every_survivor_one_name(cases):
    run_state_machine_as_test(
        AnyFaults,
        settings=settings(
            max_examples=cases,
            stateful_step_count=25,
            deadline=None,
            database=None,
            # Failures are not shrunk, because DDS is not deterministic.
            phases=[Phase.generate],
        ),
    )
