"""Every command, in every situation, with every leaf that heeds commands: what it answers is declared, and everything said of it has its author."""

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
from tests.chance import rounds

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


NAMED: dict[str, dict[str, str]] = {
    "add_zone": {"zone": "zone"},
    "add_area": {"zone": "zone"},
    "add_hint": {"zone": "zone"},
    "judge_survivor": {"survivor": "survivor"},
}
"""The landmarks that the values of commands name: field by kind."""
NOTHING_SEEN: Mapping[str, str] = {}


class CommandedMission:
    """A mission whose node serves every command, beside the model that a watched run is held against."""

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

    def see(self, command: CommandSpec) -> dict[str, str]:
        """Return what a page would show of a command's objects."""
        run, situation = self.state.runs[-1], self.state.situation
        seen = {
            RUN: run_identity(run.number, run.about),
            OBJECT: situation.objects.get(command.verb.name, ""),
        }
        for kind, field in NAMED.get(command.verb.name, {}).items():
            name = VALUES[command.verb.name][field]
            landmark = situation.landmarks.get((kind, name))
            seen[f"{kind}/{name}"] = landmark.identity if landmark else ""
        return seen

    def give(
        self, command: CommandSpec, by: CommandAuthor = ANN, seen: Mapping[str, str] = NOTHING_SEEN
    ) -> tuple[bool, str]:
        """Give a command as its service would take it, signed; return whether it was accepted, and what was said."""
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
        """Tick the conditions as a tree does; return the status, the label and the message of each, which the model is told of."""
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


def finish(mission: CommandedMission) -> None:
    while mission.search.zones.has_remaining():
        mission.search.zones.select_next_zone()
        mission.watch.raise_fact("zones_left", -1)


def find(mission: CommandedMission) -> None:
    mission.search.record.zone_started("zone_a")
    mission.search.record.zone_searched("zone_a", (1.0, 1.0))
    mission.search.record.survivor_named("survivor_1", 1.0, 1.0)


def pause(mission: CommandedMission) -> None:
    mission.give(COMMANDS[0], BOB)
    mission.tick()


SITUATIONS: dict[str, Callable[[CommandedMission], object]] = {
    "zones are left": lambda _: None,
    "on the way home": finish,
    "somebody was found": find,
    "paused": pause,
}


@pytest.mark.parametrize("situation", SITUATIONS)
@pytest.mark.parametrize("command", COMMANDS, ids=lambda each: each.verb.name)
def test_what_leaves_answer_to_a_command_is_what_proofs_assume_and_has_its_author(
    mission: CommandedMission, command: CommandSpec, situation: str
) -> None:
    SITUATIONS[situation](mission)
    count = len(mission.state.facts)
    accepted, _ = mission.give(command)
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


def test_a_zone_that_is_added_on_the_way_home_is_searched_and_nothing_is_alarmed(
    mission: CommandedMission,
) -> None:
    finish(mission)
    assert mission.give(next(each for each in COMMANDS if each.verb.name == "add_zone"))[0]
    ((status, label, message),) = mission.tick()
    assert (status, label, message) == (
        "FAILURE", "plan changed", f"the plan has changed: zone_e was added by {ANN}"
    )  # fmt: skip
    assert len(mission.tick()) == len(CONDITIONS)
    assert mission.watch.alarms == []


@pytest.mark.parametrize("command", COMMANDS, ids=lambda each: each.verb.name)
def test_a_command_is_served_by_the_leaves_that_its_declaration_names_and_by_no_other(
    ros: Any, command: CommandSpec
) -> None:
    mission = CommandedMission(ros)
    mission.set_up(*mission.leaves.keys() - set(command.served_by))
    name = mission.node.resolve_service_name(f"~/{command.verb.name}")
    assert name not in [each.service_name for each in mission.node.services]
    mission.set_up(*command.served_by)
    assert name in [each.service_name for each in mission.node.services]
    mission.close()


def test_every_command_has_a_sentence_and_stands_in_the_documentation() -> None:
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


def named(name: str) -> CommandSpec:
    return next(each for each in COMMANDS if each.verb.name == name)


def find_again(mission: CommandedMission) -> None:
    if mission.search.record.survivor("survivor_1") is None:
        find(mission)


CHANGES: tuple[Callable[[CommandedMission], object], ...] = (
    lambda mission: mission.search.zones.select_next_zone(),
    lambda mission: mission.search.zones.postpone(),
    lambda mission: mission.search.zones.abandon(),
    find_again,
    *(lambda mission, command=command: mission.give(command, BOB) for command in COMMANDS),
)
"""What may happen while a command waits for its confirmation."""


class Shown(NamedTuple):
    """The state that commands change."""

    left: list[str]
    abandoned: list[Zone]
    survivors: list[tuple[str | None, DetectionVerdict]]
    given: dict[str, str]
    is_held: bool
    hints: dict[str, float]


def shown(mission: CommandedMission) -> Shown:
    orders, zones = mission.search.orders, mission.search.zones
    survivors = [(each.survivor_id, each.standing) for each in mission.search.record.survivors]
    left = [zone["id"] for zone in zones.remaining_zones()]
    given = dict(orders.given)
    return Shown(left, zones.abandoned_zones(), survivors, given, orders.held, dict(zones.hints))


@pytest.mark.parametrize("seed", range(rounds(12)))
def test_nothing_is_done_that_a_command_did_not_name_whatever_changes_before_it_is_confirmed(
    mission: CommandedMission, seed: int
) -> None:
    chance = Random(seed)  # noqa: S311 - repeatable
    for _ in range(chance.randrange(4)):
        chance.choice(CHANGES)(mission)
    command = chance.choice(COMMANDS)
    seen, before = mission.see(command), shown(mission)
    for _ in range(chance.randrange(3)):
        chance.choice(CHANGES)(mission)
    confirmed = shown(mission)
    accepted, answer = mission.give(command, seen=seen)
    if not accepted:
        assert answer
        assert shown(mission) == confirmed
    elif command.verb.name == "skip_zone":
        assert mission.search.zones.abandoned_zones()[-1]["id"] == seen[OBJECT]
    elif command.verb.name == "judge_survivor":
        assert before.survivors == confirmed.survivors
    elif command.verb.name in ("resume", "go_home"):
        assert before.is_held == confirmed.is_held


def test_a_zone_that_is_no_longer_the_next_one_is_not_skipped_and_it_is_said_which_one_is(
    mission: CommandedMission,
) -> None:
    seen = mission.see(named("skip_zone"))
    mission.search.zones.select_next_zone()
    assert mission.give(named("skip_zone"), seen=seen) == (
        False,
        "the object of the command has changed. You saw 'zone_a', and now it is 'zone_b'. Check the change, and repeat the command",
    )
    assert mission.search.zones.abandoned_zones() == []


def test_a_review_is_refused_if_somebody_else_has_reviewed_the_detection_meanwhile(
    mission: CommandedMission,
) -> None:
    find(mission)
    seen = mission.see(named("judge_survivor"))
    mission.search.record.survivor_judged("survivor_1", DetectionVerdict.CONFIRMED, None)
    accepted, answer = mission.give(named("judge_survivor"), seen=seen)
    assert not accepted
    assert answer.startswith(
        "survivor_1 has changed. You saw 'candidate at (1.00, 1.00)', and now it is 'confirmed"
    )


def test_a_command_to_another_run_is_refused(mission: CommandedMission) -> None:
    seen = {**mission.see(named("abort")), RUN: "run 1 (process 1)"}
    accepted, answer = mission.give(named("abort"), seen=seen)
    assert not accepted
    assert answer.startswith("you saw run 1 (process 1), but the mission is now in run 1 (process ")


def test_a_call_without_an_announcement_is_held_to_what_was_announced_last(mission: CommandedMission) -> None:
    """It may have consumed the announcement of a call that comes after it."""
    seen = mission.see(named("skip_zone"))
    assert mission.give(named("skip_zone"), seen=seen)[0]
    assert not mission.give(named("skip_zone"), CommandAuthor())[0]


@pytest.mark.parametrize(
    ("x", "y", "said"), [(30.0, 1.0, "is not on the map"), (1.0, 1.0, "zone_a is already at (1.00, 1.00)")]
)
def test_a_zone_off_the_map_or_on_another_one_is_refused(
    mission: CommandedMission, monkeypatch: pytest.MonkeyPatch, x: float, y: float, said: str
) -> None:
    from nav_msgs.msg import OccupancyGrid

    grid = OccupancyGrid()
    grid.info.width = grid.info.height = 6
    grid.info.resolution, grid.header.frame_id, grid.data = 1.0, "map", [0] * 36
    grid.info.origin.orientation.w = 1.0
    map_extent_of(mission.node)._on_map(grid)
    monkeypatch.setitem(VALUES, "add_zone", {"zone": "zone_e", "x": x, "y": y, "heading": 0.0})
    accepted, answer = mission.give(named("add_zone"))
    assert not accepted
    assert said in answer
