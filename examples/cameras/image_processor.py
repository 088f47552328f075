"""A node that processes the pictures of a camera: it logs each picture and publishes it on `seen`."""

import sys

from rclpy.context import Context
from rclpy.node import Node
from std_msgs.msg import String

from sar_compiler.missions import convert_ros_errors, serve


class ImageProcessor(Node):
    """Subscribes to `camera/image` and publishes on `seen`, both relative and `std_msgs/msg/String`.

    Args:
        context: The context of the node.
        cli_args: The ROS arguments of the node.

    Raises:
        RosArgumentError: If a ROS argument is invalid.
    """

    def __init__(self, context: Context, cli_args: list[str]) -> None:
        with convert_ros_errors():
            super().__init__("image_processor", context=context, cli_args=cli_args)
        self._seen = self.create_publisher(String, "seen", 10)
        self._pictures = self.create_subscription(String, "camera/image", self._process, 10)
        self.get_logger().info(f"Looking at {self._pictures.topic_name}.")

    def _process(self, picture: String) -> None:
        self.get_logger().info(f"I see {picture.data}.")
        self._seen.publish(picture)


if __name__ == "__main__":
    sys.exit(serve(ImageProcessor, "image_processor.py", "Log the content of pictures.", sys.argv[1:]))
