"""A simulated camera: a node that publishes a description of each picture as a string on `image_raw`.

All names are relative and all values are parameters. So ROS arguments can move the node to a namespace, rename it,
remap its topic and configure it.
"""

import sys

from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor
from rclpy.context import Context
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from std_msgs.msg import String

from sar_compiler import SarError
from sar_compiler.missions import convert_ros_errors, serve

_RATE = ParameterDescriptor(
    description="pictures per second",
    floating_point_range=[FloatingPointRange(from_value=0.1, to_value=100.0)],
)
_SCENE = ParameterDescriptor(description="the content of the pictures")


class CameraError(SarError):
    """A parameter has an invalid value."""


class Camera(Node):
    """Publishes `std_msgs/msg/String` on the relative topic `image_raw`.

    Parameters: `rate_hz`, pictures per second, 0.1 to 100; `scene`, their content.

    Args:
        context: The context of the node.
        cli_args: The ROS arguments of the node.

    Raises:
        RosArgumentError: If a ROS argument is invalid.
        CameraError: If a parameter has an invalid value.
    """

    def __init__(self, context: Context, cli_args: list[str]) -> None:
        with convert_ros_errors():
            super().__init__("camera_node", context=context, cli_args=cli_args)
        try:
            rate_hz = self.declare_parameter("rate_hz", 1.0, _RATE).value
            self._scene = self.declare_parameter("scene", "an empty room", _SCENE).value
        except ParameterException as error:
            raise CameraError(str(error)) from error
        self._count = 0
        self._pictures = self.create_publisher(String, "image_raw", 10)
        self._timer = self.create_timer(1.0 / rate_hz, self._take_picture)
        self.get_logger().info(f"Publishing on {self._pictures.topic_name}: {self._scene}, {rate_hz:g} Hz.")

    def _take_picture(self) -> None:
        self._count += 1
        self._pictures.publish(String(data=f"picture {self._count} of {self._scene}"))


if __name__ == "__main__":
    sys.exit(serve(Camera, "camera.py", "Publish pictures as strings on image_raw.", sys.argv[1:]))
