"""What the mission asks before it acts; answered at once, never RUNNING."""

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.mission.actions.survivors import DetectSurvivor
from sar_compiler.mission.zone_manager import ZoneManager
from sar_compiler.nodes import Kind, register

_YES_OR_NO = {Status.SUCCESS, Status.FAILURE}


@register("ZonesRemaining", kind=Kind.CONDITION, outcomes=_YES_OR_NO)
class ZonesRemaining(Behaviour):
    """Is a zone left to be visited? SUCCESS if so, else FAILURE.

    Args:
        name: The node's name.
        zone_manager: The mission's zones.
    """

    def __init__(self, name: str, zone_manager: ZoneManager) -> None:
        super().__init__(name)
        self._zones = zone_manager

    def update(self) -> Status:
        """Look at the mission's zones."""
        remaining = self._zones.has_remaining()
        self.feedback_message = f"{self._zones.current_index()} of {self._zones.total_zones()} zones visited"
        return Status.SUCCESS if remaining else Status.FAILURE


@register("IsSurvivorDetected", kind=Kind.CONDITION, outcomes=_YES_OR_NO)
class IsSurvivorDetected(Behaviour):
    """Did the last search find a survivor? SUCCESS if so, else FAILURE.

    Args:
        name: The node's name.
        detect_node: The search whose answer counts.
    """

    def __init__(self, name: str, detect_node: DetectSurvivor) -> None:
        super().__init__(name)
        self._detect_node = detect_node

    def update(self) -> Status:
        """Look at the answer of the last search."""
        return Status.SUCCESS if self._detect_node.was_found() else Status.FAILURE
