"""Every command, in every situation, with every leaf that heeds commands: what it answers is declared, and everything said of it has its author."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from py_trees.common import Status

from sar_compiler import load
from sar_compiler.analysis.runtime_monitor import RuntimeMonitor
from sar_compiler.analysis.tree_analysis import stage_of
from sar_compiler.execution.order_record import OrderRecord
from sar_compiler.journal.journal import Journal
from sar_compiler.journal.journal_entries import CommandAuthor
from sar_compiler.journal.mission_state import MissionState
from sar_compiler.journal.status_line import condition
from sar_compiler.runtime.answers import DeclaredAnswers
from search_and_rescue import SPECS
from search_and_rescue.actions.sweeping import PlanSweep
from search_and_rescue.actions.zones import ChooseZone
from search_and_rescue.failsafes import NotAborted, NotRecalled
from search_and_rescue.operating import NotHeld
from search_and_rescue.orders import COMMANDS, VERBS, CommandSpec
from search_and_rescue.search import _SENTENCES, Search
from search_and_rescue.search_events import COMMAND_GIVEN
from search_and_rescue.search_theory import Area, Ground
from search_and_rescue.zone_manager import Zone, ZoneManager

pytestmark = pytest.mark.ros

ANN = CommandAuthor("Ann (page, 127.0.0.1)", "the corridor is full of smoke")
BOB = CommandAuthor("Bob", "the lift is stuck")
TREE = Path("trees/search_areas_guarded.xml")
CONDITIONS = {"NotHeld": NotHeld, "NotAborted": NotAborted, "NotRecalled": NotRecalled}
_DECLARED = {spec.tag: DeclaredAnswers(spec.answers) for spec in SPECS if spec.tag in CONDITIONS}
SQUARE = ((0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0))
VALUES: dict[str, dict[str, Any]] = {
    "add_zone": {"zone": "zone_e", "x": 1.0, "y": 2.0, "heading": 0.0},
    "add_area": {"zone": "zone_f", "corners": [list(each) for each in SQUARE], "poa": 0.1},
    "add_hint": {"zone": "zone_b", "times": 2.0},
    "judge_survivor": {"survivor": "survivor_1", "verdict": "REJECTED"},
}


class CommandedMission:
    """A mission whose node serves every command, beside the model that a watched run is held against."""

    def __init__(self, ros: Any) -> None:
        zones = [Zone(id=name, x=1.0, y=1.0, yaw=0.0) for name in ("zone_a", "zone_b")]
        areas = {zone["id"]: Area(0.3, 0.8, 60.0) for zone in zones}
        manager = ZoneManager(zones, {"x": 0.0, "y": 0.0, "yaw": 0.0}, areas=areas)
        self.search = search = Search(manager)
        self.state, self.journal = MissionState(), Journal()
        self.journal.listen(self.state.take)
        search.keep_in(self.journal)
        self.journal.begin({}, {})
        self.node = ros.node("mission", allow_undeclared_parameters=True)
        self.record = OrderRecord(self.node, VERBS, self.journal)
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
            leaf.say = leaf.complain = self.lines.append
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

    def give(self, command: CommandSpec, by: CommandAuthor = ANN) -> tuple[bool, str]:
        """Give a command as its service would take it, signed; return whether it was accepted, and what was said."""
        verb = command.verb
        name = self.node.resolve_service_name(f"~/{verb.name}")
        (service,) = (each for each in self.node.services if each.service_name == name)
        request = service.srv_type.Request()
        verb.fill(request, verb.check(VALUES.get(verb.name, {})))
        responses: list[Any] = []
        self.record.sign(
            verb.name, by, lambda: responses.append(service.callback(request, service.srv_type.Response()))
        )
        (response,) = responses
        return response.success, response.message

    def tick(self) -> list[tuple[str, str, str]]:
        """Tick the conditions as a tree does; return the status, the label and the message of each, which the model is told of."""
        answers = []
        for tag in CONDITIONS:
            leaf, number = self.leaves[tag], self.numbers[tag]
            added = self.search.facts_added()
            self.watch.raise_fact("zones_left", added["zones_left"] - self.added.get("zones_left", 0))
            self.added = added
            self.watch.looks(number)
            leaf.tick_once()
            label = _DECLARED[tag].label(leaf.status.value, leaf.answer_label) or ""
            self.watch.answers(number, leaf.status.value, label)
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
        mission.search.zones.advance()
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
    assert [alarm.text for alarm in mission.watch.alarms] == []
    if not accepted:
        assert said.kind == "ordered"
    elif command.done and command.verb.name != "resume":
        by = BOB if (command.verb.name, situation) == ("pause", "paused") else ANN
        assert all(f"{command.done} by {by}" in message for _, _, message in failures), failures
        assert len(failures) == 2
        assert str(by) in condition(mission.state).text()
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
