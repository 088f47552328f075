"""The leaves of the patrol."""

import math
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.leaves import ActionLeaf, Kind, ServiceLeaf, Use, register

from .patrol import Patrol

_OUTCOMES = {Status.SUCCESS, Status.FAILURE, Status.RUNNING}


@register("PointsLeft", kind=Kind.CONDITION, outcomes={Status.SUCCESS, Status.FAILURE})
class PointsLeft(Behaviour):
    """Check whether a point was not visited yet.

    Args:
        name: The node's name.
        patrol: The patrol.
    """

    def __init__(self, name: str, patrol: Patrol) -> None:
        super().__init__(name)
        self._patrol = patrol

    def update(self) -> Status:
        """Return SUCCESS if there is such a point."""
        return Status.SUCCESS if self._patrol.point is not None else Status.FAILURE


@register(
    "DriveToPoint",
    kind=Kind.ACTION,
    outcomes=_OUTCOMES,
    effects="drives the robot to the next point",
    uses=[Use.action("navigate_to_pose"), Use.nav2()],
)
class DriveToPoint(ActionLeaf):
    """Drive to the current point.

    Args:
        name: The node's name.
        patrol: The patrol.
    """

    action_type = "nav2_msgs/action/NavigateToPose"
    action_name = "navigate_to_pose"

    def __init__(self, name: str, patrol: Patrol) -> None:
        super().__init__(name)
        self._patrol = patrol

    def goal(self) -> Any:
        """Return a goal with the pose of the point."""
        point = self._patrol.point
        if point is None:
            return Status.FAILURE
        if point["id"] in self._patrol.photos:
            return Status.SUCCESS  # the resumed run has taken the photo
        self.log(f"Driving to {point['id']}...")
        goal = self.interface.Goal()
        goal.pose.header.frame_id = "map"
        goal.pose.pose.position.x, goal.pose.pose.position.y = point["x"], point["y"]
        goal.pose.pose.orientation.z = math.sin(point["yaw"] / 2)
        goal.pose.pose.orientation.w = math.cos(point["yaw"] / 2)
        return goal


@register(
    "TakePhoto",
    kind=Kind.ACTION,
    outcomes=_OUTCOMES,
    effects="takes a photo of the point",
    uses=[Use.service("take_photo")],
)
class TakePhoto(ServiceLeaf):
    """Take a photo with the camera, and record its name.

    Args:
        name: The node's name.
        patrol: The patrol.
    """

    service_type = "std_srvs/srv/Trigger"
    service_name = "take_photo"

    def __init__(self, name: str, patrol: Patrol) -> None:
        super().__init__(name)
        self._patrol = patrol

    def request(self) -> Any:
        """Return an empty request, or SUCCESS if the resumed run has already taken the photo."""
        if self._patrol.point is not None and self._patrol.point["id"] in self._patrol.photos:
            return Status.SUCCESS
        return self.interface.Request()

    def on_response(self, response: Any) -> Status:
        """Record the photo. Return FAILURE if the camera has taken no photo."""
        if response.success:
            self._patrol.record_photo(response.message)
        return super().on_response(response)


@register("LeavePoint", kind=Kind.ACTION, outcomes={Status.SUCCESS}, effects="continues with the next point")
class LeavePoint(Behaviour):
    """Advance to the next point.

    Args:
        name: The node's name.
        patrol: The patrol.
    """

    def __init__(self, name: str, patrol: Patrol) -> None:
        super().__init__(name)
        self._patrol = patrol

    def update(self) -> Status:
        """Advance to the next point."""
        self._patrol.leave()
        return Status.SUCCESS
