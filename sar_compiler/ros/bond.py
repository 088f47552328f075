"""The bond of a managed node: by it a lifecycle manager, such as Nav2's, sees that the process is alive.

Both ends of a bond say on the topic `bond`, of ROS's package of that name, that they are there; the last thing that one says is that it goes.
Nav2's manager takes a node for dead whose bond it has not heard for `bond_timeout`, and does not bring up one that has none.
"""

from uuid import uuid4

from bond.msg import Status
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.timer import Timer

TOPIC = "bond"
# Those of Nav2's own nodes; the clock of a simulation may stand still.
_PERIOD_SEC, _TIMEOUT_SEC = 0.1, 4.0
_DEPTH = 5


class Bond:
    """A node's end of its bond, which bears the node's name.

    Args:
        node: The node; its executor keeps the bond alive.
    """

    def __init__(self, node: Node) -> None:
        self._node, self._clock = node, Clock(clock_type=ClockType.STEADY_TIME)
        self._publisher = node.create_publisher(Status, TOPIC, _DEPTH)
        self._timer: Timer | None = None
        self._end = ""

    def begin(self) -> None:
        """Be there, until `end`."""
        self.end()
        # To its manager, a node that was activated again is another one.
        self._end = str(uuid4())
        self._timer = self._node.create_timer(
            _PERIOD_SEC, lambda: self._say(is_there=True), clock=self._clock
        )

    def end(self) -> None:
        """Take leave."""
        if self._timer is None:
            return
        self._node.destroy_timer(self._timer)
        self._timer = None
        self._say(is_there=False)

    def _say(self, *, is_there: bool) -> None:
        status = Status(
            id=self._node.get_name(),
            instance_id=self._end,
            active=is_there,
            heartbeat_timeout=_TIMEOUT_SEC,
            heartbeat_period=_PERIOD_SEC,
        )
        status.header.stamp = self._clock.now().to_msg()
        self._publisher.publish(status)
