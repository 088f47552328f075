"""Leaves about a door and a battery; they need no robot, because they count how often they are asked."""

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler import Kind, register


@register("DoorIsClosed", kind=Kind.CONDITION, outcomes={Status.SUCCESS, Status.FAILURE})
class DoorIsClosed(Behaviour):
    """Is the door closed? Somebody opens it after some looks.

    Args:
        name: The node's name.
        looks: How many looks find it closed.
    """

    def __init__(self, name: str, looks: int = 2) -> None:
        super().__init__(name)
        self._looks = looks

    def update(self) -> Status:
        """Look once more."""
        if self._looks == 0:
            self.feedback_message = "somebody has opened it"
            return Status.FAILURE
        self._looks -= 1
        self.feedback_message = "closed"
        return Status.SUCCESS


@register("OpenDoor", kind=Kind.ACTION, outcomes={Status.SUCCESS, Status.FAILURE}, effects="opens the door")
class OpenDoor(Behaviour):
    """Push the door open; it sticks for the first pushes.

    Args:
        name: The node's name.
        sticks: How many pushes fail.
    """

    def __init__(self, name: str, sticks: int = 2) -> None:
        super().__init__(name)
        self._sticks = sticks

    def update(self) -> Status:
        """Push once."""
        if self._sticks == 0:
            self.feedback_message = "open"
            return Status.SUCCESS
        self._sticks -= 1
        self.feedback_message = "it sticks"
        return Status.FAILURE


@register("BatteryOk", kind=Kind.CONDITION, outcomes={Status.SUCCESS, Status.FAILURE})
class BatteryOk(Behaviour):
    """Is there enough in the battery? Each look finds less in it.

    Args:
        name: The node's name.
        percent: The charge at the first look, percent.
        drain: How much is used between two looks, percent.
        enough: How much is enough, percent.
    """

    def __init__(self, name: str, percent: float = 50.0, drain: float = 10.0, enough: float = 30.0) -> None:
        super().__init__(name)
        self._percent = percent
        self._drain = drain
        self._enough = enough

    def update(self) -> Status:
        """Look at the battery, and use some of it."""
        percent = self._percent
        self._percent = max(0.0, percent - self._drain)
        self.feedback_message = f"{percent:.0f} %"
        return Status.SUCCESS if percent >= self._enough else Status.FAILURE
