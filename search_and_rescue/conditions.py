"""Conditions on the progress of the mission: remaining zones, the last detection, and completion."""

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.leaves import Kind, Outcome, register
from search_and_rescue.actions.survivors import DetectSurvivor
from search_and_rescue.record import MissionRecord
from search_and_rescue.zone_manager import ZoneManager

_COMPLETE = "zones_left == 0 && zones_abandoned == 0 && reports_kept == 0 && at == 'base'"


@register(
    "ZonesRemaining",
    kind=Kind.CONDITION,
    outcomes=(
        Outcome("SUCCESS", "some left", "zones_left > 0"),
        Outcome("FAILURE", "none left", "zones_left == 0"),
    ),
    facts={"zones_left": 3},
)
class ZonesRemaining(Behaviour):
    """Check that a zone is left to visit. The leaf fails if no zone is left.

    Args:
        name: The node's name.
        zone_manager: The mission's zones.
    """

    def __init__(self, name: str, zone_manager: ZoneManager) -> None:
        super().__init__(name)
        self._zones = zone_manager

    def update(self) -> Status:
        """Return SUCCESS if a zone is left, otherwise FAILURE."""
        remaining = self._zones.has_remaining()
        self.feedback_message = f"{self._zones.current_index()} of {self._zones.total_zones()} zones visited"
        return Status.SUCCESS if remaining else Status.FAILURE


@register(
    "IsSurvivorDetected",
    kind=Kind.CONDITION,
    outcomes=(
        Outcome("SUCCESS", "yes", "found_by_{detect_node}"),
        Outcome("FAILURE", "no", "!found_by_{detect_node}"),
    ),
    facts={"found_by_{detect_node}": False},
)
class IsSurvivorDetected(Behaviour):
    """Check that the last search detected a survivor. The leaf fails if no survivor was detected.

    Args:
        name: The node's name.
        detect_node: The `DetectSurvivor` node whose last result is checked.
    """

    def __init__(self, name: str, detect_node: DetectSurvivor) -> None:
        super().__init__(name)
        self._detect_node = detect_node

    def update(self) -> Status:
        """Return SUCCESS if the last search detected a survivor, otherwise FAILURE."""
        return Status.SUCCESS if self._detect_node.was_found() else Status.FAILURE


@register(
    "MissionComplete",
    kind=Kind.CONDITION,
    outcomes=(
        Outcome("SUCCESS", "complete", _COMPLETE),
        Outcome("FAILURE", "incomplete", f"!({_COMPLETE})"),
    ),
    facts={"zones_left": 3, "zones_abandoned": 0, "reports_kept": 0, "at": ""},
)
class MissionComplete(Behaviour):
    """Check that all zones are visited, all reports are acknowledged, and the robot is home. Otherwise fail.

    Args:
        name: The node's name.
        record: The record of the mission.
        zone_manager: The mission's zones.
    """

    def __init__(self, name: str, record: MissionRecord, zone_manager: ZoneManager) -> None:
        super().__init__(name)
        self._record = record
        self._zones = zone_manager

    def update(self) -> Status:
        """Return SUCCESS if the mission is complete, otherwise FAILURE."""
        shortfalls = self._record.shortfalls(self._zones)
        self.feedback_message = " ".join(shortfalls)
        return Status.FAILURE if shortfalls else Status.SUCCESS
