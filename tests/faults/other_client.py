"""Another client of the navigation action, such as RViz, in the test's own process."""

from typing import Any

from typing_extensions import Self

from tests.ros.conftest import Ros


class OtherClient:
    """Sends its own goals."""

    def __enter__(self) -> "Self":
        from nav2_msgs.action import NavigateToPose
        from rclpy.action import ActionClient

        self._ros = Ros()
        self._type = NavigateToPose
        self._client = ActionClient(self._ros.node("other_client"), NavigateToPose, "navigate_to_pose")
        return self

    def send(self) -> None:
        """Send a goal, and wait until it is accepted."""
        self._ros.spin_until(self._client.server_is_ready, "the server")
        accepted: Any = self._client.send_goal_async(self._type.Goal())
        self._ros.spin_until(accepted.done, "the acceptance")

    def __exit__(self, *_: object) -> None:
        self._client.destroy()
        self._ros.close()
