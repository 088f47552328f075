"""Tests of every command in every situation with all leaves that serve commands: outcomes are declared, and messages name the author."""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import pytest
from py_trees.common import Status

from sar_compiler import load
from sar_compiler.analysis.runtime_monitor import RuntimeMonitor
from sar_compiler.analysis.tree_analysis import stage_of
from sar_compiler.execution.command_authors import CommandAuthors
from sar_compiler.journal.command_objects import OBJECT, RUN, run_identity
from sar_compiler.journal.journal import Journal
from sar_compiler.journal.journal_entries import CommandAuthor
from sar_compiler.journal.mission_state import MissionState
from sar_compiler.journal.status_line import condition
from sar_compiler.runtime.outcomes import DeclaredOutcomes
from search_and_rescue import SPECS
from search_and_rescue.actions.survivors import map_extent_of
from search_and_rescue.actions.sweep_leaves import PlanSweep
from search_and_rescue.actions.zones import ChooseZone
from search_and_rescue.failsafes import NotAborted, NotRecalled
from search_and_rescue.operator_commands import COMMANDS, VERBS, CommandSpec
from search_and_rescue.operator_leaves import NotHeld
from search_and_rescue.record import DetectionVerdict
from search_and_rescue.search import _SENTENCES, Search
from search_and_rescue.search_events import COMMAND_GIVEN
from search_and_rescue.search_theory import Ground, SearchExpectation
from search_and_rescue.zone_manager import Zone, ZoneManager
from tests.random_inputs import rounds

pytestmark = pytest.mark.ros

ANN = CommandAuthor("Ann (page, 127.0.0.1)", "the corridor is full of smoke")
BOB = CommandAuthor("Bob", "the lift is stuck")
TREE = Path("trees/search_areas_guarded.xml")
CONDITIONS = {"NotHeld": NotHeld, "NotAborted": NotAborted, "NotRecalled": NotRecalled}
_DECLARED = {spec.tag: DeclaredOutcomes(spec.outcomes) for spec in SPECS if spec.tag in CONDITIONS}
SQUARE = ((0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0))
VALUES: dict[str, dict[str, Any]] = {
    "add_zone": {"zone": "zone_e", "x": 1.0, "y": 2.0, "heading": 0.0},
    "add_area": {"zone": "zone_f", "corners": [list(each) for each in SQUARE], "poa": 0.1},
    "add_hint": {"zone": "zone_b", "times": 2.0},
    "judge_survivor": {"survivor": "survivor_1", "verdict": "REJECTED"},
}


LANDMARK_FIELDS: dict[str, dict[str, str]] = {
    "add_zone": {"zone": "zone"},
    "add_area": {"zone": "zone"},
    "add_hint": {"zone": "zone"},
    "judge_survivor": {"survivor": "survivor"},
}
"""For each command, the field with the name of a landmark, by kind of the landmark."""
NOTHING_SEEN: Mapping[str, str] = {}


class CommandedMission:
    """A mission whose node serves every command, with the runtime monitor that compares it with the model."""

    def __init__(self, ros: Any) -> None:
        zones = [Zone(id=name, x=1.0, y=1.0, yaw=0.0) for name in ("zone_a", "zone_b")]
        areas = {zone["id"]: SearchExpectation(0.3, 0.8, 60.0) for zone in zones}
        manager = ZoneManager(zones, {"x": 0.0, "y": 0.0, "yaw": 0.0}, areas=areas)
        self.search = search = Search(manager)
        self.state, self.journal = MissionState(), Journal()
        self.journal.add_listener(self.state.apply)
        search.use_journal(self.journal)
        self.journal.begin({}, {})
        self.node = ros.node("mission", allow_undeclared_parameters=True)
        self.record = CommandAuthors(self.node, VERBS, self.journal)
        search.sweeps.grounds["zone_a"] = Ground(SQUARE, 1.0, 1.0)
        self.leaves: dict[str, Any] = {
            "NotHeld": NotHeld("NotHeld?", search.orders, manager, record=search.record),
            "NotAborted": NotAborted("NotAborted?", search.orders, record=search.record),
            "NotRecalled": NotRecalled("NotRecalled?", search.orders, record=search.record),
            "ChooseZone": ChooseZone("ChooseZone", manager, orders=search.orders, sweeps=search.sweeps),
            "PlanSweep": PlanSweep(
                "PlanSweep", zone_manager=manager, sweeps=search.sweeps, orders=search.orders
            ),
        }
        self.lines: list[str] = []
        for leaf in self.leaves.values():
            leaf.log = leaf.warn = self.lines.append
        simulated = stage_of(load(TREE)).play().simulated
        self.numbers = {
            type_: leaf.number
            for leaf in simulated.leaves
            for type_ in CONDITIONS
            if leaf.name == f"{type_}?"
        }
        self.watch = RuntimeMonitor(simulated, None)
        self.watch.raise_fact("orders_left", search.limits()["orders_left"])
        self.added: dict[str, int] = {}
        self.watch.raise_fact(
            "zones_left", manager.total_zones() - int(simulated.fact_values()["zones_left"])
        )

    def set_up(self, *tags: str) -> None:
        for tag in tags or self.leaves:
            self.leaves[tag].setup(node=self.node)
        self.record.begin()

    def close(self) -> None:
        for leaf in self.leaves.values():
            leaf.shutdown()

    def displayed_identities(self, command: CommandSpec) -> dict[str, str]:
        """Return the identities of a command's objects as the page would display them."""
        run, situation = self.state.runs[-1], self.state.situation
        seen = {
            RUN: run_identity(run.number, run.about),
            OBJECT: situation.objects.get(command.verb.name, ""),
        }
        for kind, field in LANDMARK_FIELDS.get(command.verb.name, {}).items():
            name = VALUES[command.verb.name][field]
            landmark = situation.landmarks.get((kind, name))
            seen[f"{kind}/{name}"] = landmark.identity if landmark else ""
        return seen

    def send(
        self, command: CommandSpec, by: CommandAuthor = ANN, seen: Mapping[str, str] = NOTHING_SEEN
    ) -> tuple[bool, str]:
        """Send a command with its author to its service; return whether it was accepted, and the message."""
        verb = command.verb
        name = self.node.resolve_service_name(f"~/{verb.name}")
        (service,) = (each for each in self.node.services if each.service_name == name)
        request = service.srv_type.Request()
        verb.fill(request, verb.check(VALUES.get(verb.name, {})))
        responses: list[Any] = []
        self.record.sign(
            verb.name,
            by,
            lambda: responses.append(service.callback(request, service.srv_type.Response())),
            seen,
        )
        (response,) = responses
        return response.success, response.message

    def tick(self) -> list[tuple[str, str, str]]:
        """Tick the conditions as a tree does, and report them to the monitor; return status, label and message of each."""
        answers = []
        for tag in CONDITIONS:
            leaf, number = self.leaves[tag], self.numbers[tag]
            added = self.search.added_facts()
            self.watch.raise_fact("zones_left", added["zones_left"] - self.added.get("zones_left", 0))
            self.added = added
            self.watch.on_before_event(number)
            leaf.tick_once()
            label = _DECLARED[tag].label(leaf.status.value, leaf.outcome_label) or ""
            self.watch.on_status(number, leaf.status.value, label)
            answers.append((leaf.status.value, label, leaf.feedback_message))
            if leaf.status is Status.FAILURE:
                break
        self.watch.end_tick("RUNNING")
        return answers


@pytest.fixture
def mission(ros: Any) -> Iterator[CommandedMission]:
    made = CommandedMission(ros)
    made.set_up()
    yield made
    made.close()


def visit_all_zones(mission: CommandedMission) -> None:
    while mission.search.zones.has_remaining():
        mission.search.zones.select_next_zone()
        mission.watch.raise_fact("zones_left", -1)


def detect_survivor(mission: CommandedMission) -> None:
    mission.search.record.zone_started("zone_a")
    mission.search.record.zone_searched("zone_a", (1.0, 1.0))
    mission.search.record.survivor_named("survivor_1", 1.0, 1.0)


def pause_mission(mission: CommandedMission) -> None:
    mission.send(COMMANDS[0], BOB)
    mission.tick()


SITUATIONS: dict[str, Callable[[CommandedMission], object]] = {
    "zones remain": lambda _: None,
    "on the way home": visit_all_zones,
    "survivor found": detect_survivor,
    "paused": pause_mission,
}


@pytest.mark.parametrize("situation", SITUATIONS)
@pytest.mark.parametrize("command", COMMANDS, ids=lambda each: each.verb.name)
def test_command_outcome_is_declared_and_names_author(
    mission: CommandedMission, command: CommandSpec, situation: str
) -> None:
    SITUATIONS[situation](mission)
    count = len(mission.state.facts)
    accepted, _ = mission.send(command)
    (said, *_) = mission.state.facts[count:]
    assert ANN.name in said.text
    assert ANN.reason in said.text
    failures = [answer for _ in range(2) for answer in mission.tick() if answer[0] == "FAILURE"]
    assert any(ANN.name in line and ANN.reason in line for line in mission.lines), mission.lines
    assert [alarm.sentence for alarm in mission.watch.alarms] == []
    if not accepted:
        assert said.kind == "ordered"
    elif command.done and command.verb.name != "resume":
        by = BOB if (command.verb.name, situation) == ("pause", "paused") else ANN
        assert all(f"{command.done} by {by}" in message for _, _, message in failures), failures
        assert len(failures) == 2
        assert str(by) in condition(mission.state).to_line()
    elif failures and situation != "paused":
        assert all(str(ANN) in message for _, _, message in failures)


def test_zone_added_on_way_home_changes_plan_without_alarm(
    mission: CommandedMission,
) -> None:
    visit_all_zones(mission)
    assert mission.send(next(each for each in COMMANDS if each.verb.name == "add_zone"))[0]
    ((status, label, message),) = mission.tick()
    assert (status, label, message) == (
        "FAILURE", "plan changed", f"the plan has changed: zone_e was added by {ANN}"
    )  # fmt: skip
    assert len(mission.tick()) == len(CONDITIONS)
    assert mission.watch.alarms == []


@pytest.mark.parametrize("command", COMMANDS, ids=lambda each: each.verb.name)
def test_command_is_served_only_by_declared_leaves(ros: Any, command: CommandSpec) -> None:
    mission = CommandedMission(ros)
    mission.set_up(*mission.leaves.keys() - set(command.served_by))
    name = mission.node.resolve_service_name(f"~/{command.verb.name}")
    assert name not in [each.service_name for each in mission.node.services]
    mission.set_up(*command.served_by)
    assert name in [each.service_name for each in mission.node.services]
    mission.close()


def test_every_command_has_sentence_and_documentation() -> None:
    services = Path("docs/missions/search-and-rescue.md").read_text(encoding="utf-8")
    facts = Path("docs/reference/journal.md").read_text(encoding="utf-8")
    manual = " ".join(
        Path(f"docs/{page}.md").read_text(encoding="utf-8")
        for page in ("operate/operators-manual", "how-to/search-by-probability", "how-to/cover-areas")
    )
    for command in COMMANDS:
        assert command.fact in _SENTENCES
        assert f"`~/{command.verb.name}`" in services
        assert f"`{command.fact}`" in facts
        assert command.verb.label in manual, command.verb.label
    lasting = [each.verb.name for each in COMMANDS if each.fact == COMMAND_GIVEN]
    assert all(f"`{name}`" in facts for name in lasting)


def command_named(name: str) -> CommandSpec:
    return next(each for each in COMMANDS if each.verb.name == name)


def detect_survivor_once(mission: CommandedMission) -> None:
    if mission.search.record.survivor("survivor_1") is None:
        detect_survivor(mission)


CHANGES: tuple[Callable[[CommandedMission], object], ...] = (
    lambda mission: mission.search.zones.select_next_zone(),
    lambda mission: mission.search.zones.postpone(),
    lambda mission: mission.search.zones.abandon(),
    detect_survivor_once,
    *(lambda mission, command=command: mission.send(command, BOB) for command in COMMANDS),
)
"""Changes that may happen while a command waits for its confirmation."""


class CommandedState(NamedTuple):
    """The state of the mission that commands can change."""

    left: list[str]
    abandoned: list[Zone]
    survivors: list[tuple[str | None, DetectionVerdict]]
    given: dict[str, str]
    is_held: bool
    hints: dict[str, float]


def state_of(mission: CommandedMission) -> CommandedState:
    orders, zones = mission.search.orders, mission.search.zones
    survivors = [(each.survivor_id, each.standing) for each in mission.search.record.survivors]
    left = [zone["id"] for zone in zones.remaining_zones()]
    given = dict(orders.given)
    return CommandedState(left, zones.abandoned_zones(), survivors, given, orders.held, dict(zones.hints))


@pytest.mark.parametrize("seed", range(rounds(12)))
def test_confirmed_command_affects_only_objects_that_operator_saw(
    mission: CommandedMission, seed: int
) -> None:
    chance = Random(seed)  # noqa: S311 - repeatable
    for _ in range(chance.randrange(4)):
        chance.choice(CHANGES)(mission)
    command = chance.choice(COMMANDS)
    seen, before = mission.displayed_identities(command), state_of(mission)
    for _ in range(chance.randrange(3)):
        chance.choice(CHANGES)(mission)
    confirmed = state_of(mission)
    accepted, answer = mission.send(command, seen=seen)
    if not accepted:
        assert answer
        assert state_of(mission) == confirmed
    elif command.verb.name == "skip_zone":
        assert mission.search.zones.abandoned_zones()[-1]["id"] == seen[OBJECT]
    elif command.verb.name == "judge_survivor":
        assert before.survivors == confirmed.survivors
    elif command.verb.name in ("resume", "go_home"):
        assert before.is_held == confirmed.is_held


def test_skip_is_rejected_if_next_zone_has_changed(
    mission: CommandedMission,
) -> None:
    seen = mission.displayed_identities(command_named("skip_zone"))
    mission.search.zones.select_next_zone()
    assert mission.send(command_named("skip_zone"), seen=seen) == (
        False,
        "the object of the command has changed. You saw 'zone_a', and now it is 'zone_b'. Check the change, and repeat the command",
    )
    assert mission.search.zones.abandoned_zones() == []


def test_review_is_rejected_if_detection_was_reviewed_meanwhile(
    mission: CommandedMission,
) -> None:
    detect_survivor(mission)
    seen = mission.displayed_identities(command_named("judge_survivor"))
    mission.search.record.survivor_judged("survivor_1", DetectionVerdict.CONFIRMED, None)
    accepted, answer = mission.send(command_named("judge_survivor"), seen=seen)
    assert not accepted
    assert answer.startswith(
        "survivor_1 has changed. You saw 'candidate at (1.00, 1.00)', and now it is 'confirmed"
    )


def test_command_for_another_run_is_rejected(mission: CommandedMission) -> None:
    seen = {**mission.displayed_identities(command_named("abort")), RUN: "run 1 (process 1)"}
    accepted, answer = mission.send(command_named("abort"), seen=seen)
    assert not accepted
    assert answer.startswith("you saw run 1 (process 1), but the mission is now in run 1 (process ")


def test_call_without_announcement_is_checked_against_last_one(mission: CommandedMission) -> None:
    """The call may have consumed the announcement of a later call."""
    seen = mission.displayed_identities(command_named("skip_zone"))
    assert mission.send(command_named("skip_zone"), seen=seen)[0]
    assert not mission.send(command_named("skip_zone"), CommandAuthor())[0]


@pytest.mark.parametrize(
    ("x", "y", "said"), [(30.0, 1.0, "is not on the map"), (1.0, 1.0, "zone_a is already at (1.00, 1.00)")]
)
def test_zone_off_map_or_on_another_zone_is_rejected(
    mission: CommandedMission, monkeypatch: pytest.MonkeyPatch, x: float, y: float, said: str
) -> None:
    from nav_msgs.msg import OccupancyGrid

    grid = OccupancyGrid()
    grid.info.width = grid.info.height = 6
    grid.info.resolution, grid.header.frame_id, grid.data = 1.0, "map", [0] * 36
    grid.info.origin.orientation.w = 1.0
    map_extent_of(mission.node)._on_map(grid)
    monkeypatch.setitem(VALUES, "add_zone", {"zone": "zone_e", "x": x, "y": y, "heading": 0.0})
    accepted, answer = mission.send(command_named("add_zone"))
    assert not accepted
    assert said in answer
