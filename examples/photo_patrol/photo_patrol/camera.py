"""The simulated camera: the service `take_photo`."""

from typing import Any

from rclpy.node import Node
from std_srvs.srv import Trigger

from sar_compiler.missions import ServiceFaults, create_service


class Camera(Node):
    """Answers each call of `take_photo` with the name of a photo.

    Args:
        faults: The faults to inject.
        options: Keyword arguments of `rclpy.node.Node`.
    """

    def __init__(self, faults: ServiceFaults, **options: Any) -> None:
        super().__init__("camera", **options)
        self._count = 0
        create_service(self, Trigger, "take_photo", self._take_photo, refuse=self._refuse, faults=faults)

    def _take_photo(self, _: Any, response: Any) -> Any:
        self._count += 1
        response.success, response.message = True, f"photo_{self._count}"
        self.get_logger().info(f"Took {response.message}.")
        return response

    def _refuse(self, _: Any, response: Any) -> Any:
        response.message = "the lens is covered"
        return response
