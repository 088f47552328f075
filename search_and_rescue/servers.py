"""Simulated servers. `detect_survivor` searches for survivors, and `report_survivor` acts as the base station."""

import math
from typing import Any

from geometry_msgs.msg import PointStamped
from sar_interfaces.srv import DetectSurvivor, ReportSurvivor

from sar_compiler.leaves import UnusableValueError, planar_point, robot_estimate
from sar_compiler.missions import (
    DataNode,
    ServiceFaults,
    create_service,
    flat_parameters,
    lookalikes,
    shorten_to_line,
)
from search_and_rescue.hiding import HiddenSurvivor
from search_and_rescue.zone_manager import MAP_FRAME, read_survivors

SURVIVORS = {"zone_a": (-2.5, 3.2), "zone_c": (4.1, -2.5)}
"""The default position of the survivor in each zone: x and y in metres, frame `map`."""
_SEEN_EVERY_SEC = 0.5


class DetectSurvivorServer(DataNode):
    """The server of `detect_survivor`. The parameters `survivors.<zone>.{x,y}` or a default table define survivors.

    In a zone with the parameter `zones.<zone>.detection_range` (metres), a survivor is detected only while the robot is within this distance.
    Unless a survivor is hidden, the server also publishes these survivors on `survivor_detections` twice a second while they are detected
    (`geometry_msgs/msg/PointStamped`, frame `map`).

    Args:
        faults: The faults to inject.
        hiding: The hidden survivor, which replaces the table; None for the table.
        options: Keyword arguments of `DataNode`, such as `context` and `cli_args`.

    Raises:
        ParameterError: If the table in the parameters is invalid.
        RosArgumentError: If a name or a value in the ROS arguments is not allowed for a node.
    """

    def __init__(
        self, faults: ServiceFaults | None = None, hiding: HiddenSurvivor | None = None, **options: Any
    ) -> None:
        super().__init__("detect_survivor_server", **options)
        parameters = flat_parameters(self)
        table = read_survivors(parameters, SURVIVORS)
        self._table, self._hiding = table, hiding
        # The zone parameters of the mission are also set on this node if a parameter file addresses all nodes.
        ranges = {zone: parameters.get(f"zones.{zone}.detection_range") for zone in table}
        self._ranges = {zone: reach for zone, reach in ranges.items() if isinstance(reach, int | float)}
        depends_on_place = hiding.ground is not None if hiding else bool(self._ranges)
        self._robot = robot_estimate(self) if depends_on_place else None
        self._seen = self.create_publisher(PointStamped, "survivor_detections", 10)
        if self._ranges and not hiding:
            self.create_timer(_SEEN_EVERY_SEC, self._publish_seen)
        for note in lookalikes(parameters, ["survivors", "zones"]):
            self.get_logger().warning(note)
        create_service(self, DetectSurvivor, "detect_survivor", self._on_request, faults=faults)
        self.get_logger().info("DetectSurvivor service ready.")

    def _on_request(self, request: Any, response: Any) -> Any:
        survivor, zone = self._detect(request.zone_id), shorten_to_line(request.zone_id)
        if survivor is None:
            self.get_logger().info(f"Detection request for {zone}: NOT FOUND")
            return response
        response.found = True
        response.survivor_x, response.survivor_y = x, y = survivor
        self.get_logger().info(f"Detection request for {zone}: FOUND at ({x:.2f}, {y:.2f})")
        return response

    def _publish_seen(self) -> None:
        for zone in self._ranges:
            if survivor := self._detect(zone):
                message = PointStamped()
                message.header.frame_id, message.header.stamp = MAP_FRAME, self.get_clock().now().to_msg()
                message.point.x, message.point.y = survivor
                self._seen.publish(message)

    def _detect(self, zone: str) -> tuple[float, float] | None:
        """Return the position (metres, frame `map`) of the survivor detected in a zone, or None without a detection."""
        pose = self._robot.last_pose() if self._robot is not None else None
        robot = pose[:2] if pose is not None else None
        if self._hiding is not None:
            return self._hiding.search(zone, robot)
        survivor = self._table.get(zone)
        if survivor is None or zone not in self._ranges:
            return survivor
        return survivor if robot is not None and math.dist(robot, survivor) <= self._ranges[zone] else None


class ReportSurvivorServer(DataNode):
    """The server of `report_survivor`. It acknowledges every report with a position in the frame `map`.

    A report that is sent again, because the sender missed the response, is acknowledged again and logged as a repetition.

    Args:
        faults: The faults to inject.
        options: Keyword arguments of `DataNode`, such as `context` and `cli_args`.

    Raises:
        RosArgumentError: If a name or a value in the ROS arguments is not allowed for a node.
    """

    def __init__(self, faults: ServiceFaults | None = None, **options: Any) -> None:
        super().__init__("report_survivor_server", **options)
        self._received: set[str] = set()
        create_service(
            self, ReportSurvivor, "report_survivor", self._on_request, refuse=self._refuse, faults=faults
        )
        self.get_logger().info("ReportSurvivor service ready.")

    def _on_request(self, request: Any, response: Any) -> Any:
        try:
            planar_point(request.location, MAP_FRAME)
        except UnusableValueError as error:
            return self._refuse(request, response, f": {error}")
        response.acknowledged, report = True, _describe(request)
        again = " again" if report in self._received else ""
        self._received.add(report)
        self.get_logger().info(f"Report received{again}: {report}. Acknowledged.")
        if not again:
            self.get_logger().info(
                f"The point of {shorten_to_line(request.survivor_id)} is in frame '{MAP_FRAME}'."
            )
        return response

    def _refuse(self, request: Any, response: Any, why: str = "") -> Any:
        self.get_logger().warning(f"Report of {_describe(request)} refused{why}.")
        return response


def _describe(request: Any) -> str:
    point = request.location.point
    return f"{shorten_to_line(request.survivor_id)} at ({point.x:.2f}, {point.y:.2f})"
