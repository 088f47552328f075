"""Leaves for a door and a battery. They only count their ticks, so they need no robot."""

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.leaves import Kind, register


@register("DoorIsClosed", kind=Kind.CONDITION, outcomes={Status.SUCCESS, Status.FAILURE})
class DoorIsClosed(Behaviour):
    """Check whether the door is closed. After a number of checks it is open.

    Args:
        name: The node's name.
        looks: The number of checks for which the door is closed.
    """

    def __init__(self, name: str, looks: int = 2) -> None:
        super().__init__(name)
        self._looks = looks

    def update(self) -> Status:
        """Check once more."""
        if self._looks == 0:
            self.feedback_message = "open"
            return Status.FAILURE
        self._looks -= 1
        self.feedback_message = "closed"
        return Status.SUCCESS


@register("OpenDoor", kind=Kind.ACTION, outcomes={Status.SUCCESS, Status.FAILURE}, effects="opens the door")
class OpenDoor(Behaviour):
    """Push the door open. The first pushes fail.

    Args:
        name: The node's name.
        sticks: The number of pushes that fail.
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
    """Check whether the charge of the battery suffices. Each check reduces the charge.

    Args:
        name: The node's name.
        percent: The charge at the first check, percent.
        drain: The charge used between two checks, percent.
        enough: The required charge, percent.
    """

    def __init__(self, name: str, percent: float = 50.0, drain: float = 10.0, enough: float = 30.0) -> None:
        super().__init__(name)
        self._percent = percent
        self._drain = drain
        self._enough = enough

    def update(self) -> Status:
        """Check the charge, and reduce it."""
        percent = self._percent
        self._percent = max(0.0, percent - self._drain)
        self.feedback_message = f"{percent:.0f} %"
        return Status.SUCCESS if percent >= self._enough else Status.FAILURE
