"""Leaves that search for survivors, publish the survivors' frames, and report the survivors."""

from dataclasses import KW_ONLY, dataclass, field
from typing import TYPE_CHECKING, Any

from py_trees.common import Status

from sar_compiler.leaves import (
    GridGeometry,
    Kind,
    Outcome,
    RosLeaf,
    Seconds,
    ServiceLeaf,
    TopicLeaf,
    UnusableValueError,
    Use,
    check_position,
    grid_geometry,
    of_node,
    planar_point,
    qos_profile,
    register,
    value_reports,
)
from search_and_rescue.record import MissionRecord, SurvivorReport
from search_and_rescue.zone_manager import MAP_FRAME, ZoneManager

if TYPE_CHECKING:
    from geometry_msgs.msg import TransformStamped
    from rclpy.node import Node

    from search_and_rescue.coverage import ObstacleMap

_MAP_TOPIC = "map"
"""The topic with the map, published by Nav2's map server or by SLAM. Late subscribers receive the last map."""

# A map cell with at least this percentage is occupied, as in the maps of map_server.
_OCCUPIED = 65

_SEEN_AT_ONCE = 100

# Effects of outcomes in verification and simulation.
_NAMED = "named_by_{detect_node} = true; kept_by_{detect_node} = false"
_ACKNOWLEDGED = (
    "reports_kept -= kept_by_{detect_node} && reports_kept > 0 ? 1 : 0; kept_by_{detect_node} = false"
)
_FORGOTTEN = "found_by_{self} = false; named_by_{self} = false"
_UNTOLD = "found_by_{detect_node} = false; named_by_{detect_node} = false"

_FRAMES_TOPIC = "/tf_static"
"""The topic for static frames. The name is absolute, so missions in a namespace remap `/tf_static:=tf_static`."""


class MapExtent:
    """The extent of the map that a node receives. It is used to reject positions outside the map.

    Use `map_extent_of`: all leaves share one subscription.

    Args:
        node: The rclpy node that subscribes.
    """

    def __init__(self, node: "Node") -> None:
        from nav_msgs.msg import OccupancyGrid

        self._node = node
        self._place: GridGeometry | None = None
        self._grid: OccupancyGrid | None = None
        self._obstacles: ObstacleMap | None = None
        latched = qos_profile(type(self).__name__, "transient_local")
        node.create_subscription(OccupancyGrid, _MAP_TOPIC, self._on_map, latched)

    def check(self, x: float, y: float) -> tuple[float, float]:
        """Return a position (metres, frame `map`) unchanged, or raise an error if it is impossible.

        Raises:
            UnusableValueError: If the position is not finite or not on the map.
        """
        check_position(x, y)
        if self._place is not None and not self._place.contains(x, y):
            raise UnusableValueError(f"({x:.2f}, {y:.2f}) is not on the map")
        return x, y

    def why_impossible(self, x: float, y: float) -> str:
        """Return why a position (metres, frame `map`) is impossible, or an empty string if it is possible."""
        try:
            self.check(x, y)
        except UnusableValueError as error:
            return str(error)
        return ""

    def _on_map(self, message: Any) -> None:
        place = value_reports(self._node).read(f"Topic '{_MAP_TOPIC}'", lambda: grid_geometry(message))
        if place is not None:
            self._place, self._grid, self._obstacles = place, message, None

    def obstacles(self) -> "ObstacleMap | None":
        """Return the cells that block sight and driving: occupied and unknown cells. None without a complete map."""
        # Imported late, because only sweeps need NumPy.
        import numpy as np

        from search_and_rescue.coverage import ObstacleMap

        place = self._place
        if self._grid is not None and place is not None and self._obstacles is None:
            if len(self._grid.data) != place.width * place.height:
                return None
            cells = np.array(self._grid.data, np.int8).reshape(place.height, place.width)
            self._obstacles = ObstacleMap(
                (cells < 0) | (cells >= _OCCUPIED), place.cell_m, (place.x, place.y, place.yaw)
            )
        return self._obstacles


def map_extent_of(node: "Node") -> MapExtent:
    """Return the extent of the map that a node receives. Calls for the same node return the same object."""
    return of_node(node, MapExtent, lambda: MapExtent(node))


@register(
    "DetectSurvivor",
    kind=Kind.ACTION,
    effects="searches the current zone for a survivor",
    uses=(Use.service("{service}"),),
    outcomes=(
        Outcome("SUCCESS", "found", "zones_left > 0", "found_by_{self} = true; named_by_{self} = false"),
        Outcome("SUCCESS", "nothing", "zones_left > 0", _FORGOTTEN),
        Outcome("FAILURE", "no answer", "zones_left > 0", _FORGOTTEN),
        Outcome("FAILURE", "no zone", "zones_left == 0", _FORGOTTEN),
        Outcome("RUNNING", "searching", "zones_left > 0", _FORGOTTEN),
    ),
    facts={"zones_left": 3, "found_by_{self}": False, "named_by_{self}": False},
    reads=("at",),
)
@dataclass(eq=False, repr=False)
class DetectSurvivor(ServiceLeaf):
    """Search the current zone, and store the response. The leaf succeeds even if no survivor was found.

    The leaf fails if the service does not respond, or if the position in the response is not on the map.

    Args:
        zone_manager: The mission's zones.
        record: Records detections.
        service: The service's name.
        server_timeout_sec: Time to wait for a server, in seconds.
        timeout_sec: Time to wait for the response, in seconds.
    """

    name: str
    zone_manager: ZoneManager
    _: KW_ONLY
    record: MissionRecord = field(default_factory=MissionRecord)
    service: str = "detect_survivor"
    server_timeout_sec: Seconds = 10.0
    timeout_sec: Seconds = 5.0

    service_type = "sar_interfaces/srv/DetectSurvivor"

    def __post_init__(self) -> None:
        super().__init__(self.name)
        self.service_name = self.service
        self._zone_id = ""
        self._pose: tuple[float, float] | None = None
        self._survivor_id: str | None = None

    def setup(self, **kwargs: Any) -> None:
        """Create the client and subscribe to the map."""
        super().setup(**kwargs)
        map_extent_of(self.node)

    def was_found(self) -> bool:
        """Return whether the last search found a survivor."""
        return self._pose is not None

    def survivor_pose(self) -> tuple[float, float] | None:
        """Return the survivor's x and y in the frame `map` (metres), or None if none was found."""
        return self._pose

    def survivor_id(self) -> str | None:
        """Return the name assigned to the survivor, or None if no name was assigned."""
        return self._survivor_id

    def set_survivor_id(self, survivor_id: str) -> None:
        """Store the name that was assigned to the survivor."""
        self._survivor_id = survivor_id

    def store_detection(self, survivor: tuple[float, float] | None) -> None:
        """Store the x and y of a survivor in the frame `map` (metres), or None if no survivor was found."""
        self._pose, self._survivor_id = survivor, None

    def request(self) -> Any:
        """Return the request for the current zone, SUCCESS if it was already searched, or FAILURE if none is left."""
        self.store_detection(None)
        if not self.zone_manager.has_remaining():
            self.warn(f"'{self.name}' has no zone to search: every zone has already been visited.")
            return self.outcome(Status.FAILURE, "no zone")
        self._zone_id = self.zone_manager.current_zone()["id"]
        if self.record.before.has_searched(self._zone_id):
            self.log(f"{self._zone_id} was searched in an earlier run.")
            return self._on_answer(self.record.before.pop_search(self._zone_id))
        return self.interface.Request(zone_id=self._zone_id)

    def on_send(self) -> None:
        """Log which zone the robot is searching."""
        self.log(f"Calling {self.service_name} for {self._zone_id}...")

    def on_response(self, response: Any) -> Status:
        """Store the response. The search fails if the survivor's position is impossible."""
        try:
            survivor = self._survivor_position(response)
        except UnusableValueError as error:
            self.record.survivor_unplaced(self._zone_id, str(error))
            return self.on_failure(f"{self.service_name} found a survivor, but {error}")
        self.record.zone_searched(self._zone_id, survivor)
        if survivor is not None:
            self.log(f"Survivor detected at {self._zone_id}!")
        return self._on_answer(survivor)

    def _on_answer(self, survivor: tuple[float, float] | None) -> Status:
        self.store_detection(survivor)
        self.feedback_message = f"{'nobody' if survivor is None else 'survivor'} in {self._zone_id}"
        return self.outcome(Status.SUCCESS, "nothing" if survivor is None else "found")

    def on_failure(self, reason: str) -> Status:
        """Return FAILURE, because no usable response was received."""
        return self.outcome(super().on_failure(reason), "no answer")

    def is_good_news(self, response: Any) -> bool:
        """Return whether the response has a usable position."""
        try:
            self._survivor_position(response)
        except UnusableValueError:
            return False
        return True

    def _survivor_position(self, response: Any) -> tuple[float, float] | None:
        """Return the survivor's position in the frame `map` (metres), or None if no survivor was found.

        Raises:
            UnusableValueError: If the position is impossible.
        """
        extent = map_extent_of(self.node)
        return extent.check(response.survivor_x, response.survivor_y) if response.found else None


@register(
    "AwaitSurvivor",
    kind=Kind.ACTION,
    effects="waits for a detection",
    uses=(Use.topic("{topic}"),),
    outcomes=(
        Outcome(
            "SUCCESS",
            "found",
            "zones_left > 0",
            "found_by_{detect_node} = true; named_by_{detect_node} = false",
        ),
        Outcome("FAILURE", "no zone", "zones_left == 0", _UNTOLD),
        Outcome("RUNNING", "listening", "zones_left > 0", _UNTOLD),
    ),
    facts={"zones_left": 3, "found_by_{detect_node}": False, "named_by_{detect_node}": False},
)
@dataclass(eq=False, repr=False)
class AwaitSurvivor(TopicLeaf):
    """Wait for the detection of an unnamed survivor. Then pass the position to the search leaf, and succeed.

    Messages are collected from setup on, so that a survivor who is detected while another detection is
    handled is not lost. Detectors repeat detections: of several detections in one tick, the last is used. A
    survivor who already has a name is ignored, even if the operator has rejected the detection. A detection
    in a frame other than `map`, from the future, or at an impossible position is reported once and ignored.

    Args:
        detect_node: The search that receives the survivor's position.
        zone_manager: The mission's zones; the detection belongs to the current zone.
        record: Records the detection, and lists the earlier detections.
        topic: The topic's name (`geometry_msgs/msg/PointStamped`, frame `map`, metres).
        same_within: Distance below which two detections are taken to be the same survivor, metres.
    """

    name: str
    detect_node: DetectSurvivor
    zone_manager: ZoneManager
    _: KW_ONLY
    record: MissionRecord = field(default_factory=MissionRecord)
    topic: str = "survivor_detections"
    same_within: float = 1.0

    topic_type = "geometry_msgs/msg/PointStamped"
    waits = True

    def __post_init__(self) -> None:
        super().__init__(self.name)
        self.topic_name = self.topic

    def setup(self, **kwargs: Any) -> None:
        """Subscribe to the topic and to the map."""
        # A detector publishes all visible survivors at the same time, so the queue must be long enough for all of them.
        self.qos = qos_profile(type(self).__name__, self.qos)
        self.qos.depth = _SEEN_AT_ONCE
        super().setup(**kwargs)
        map_extent_of(self.node)

    def initialise(self) -> None:
        """Clear the earlier detection that the search leaf has stored."""
        super().initialise()
        self.detect_node.store_detection(None)

    def update(self) -> Status:
        """Handle a detection that an earlier run did not finish. If there is none, check for new messages."""
        if not self.zone_manager.has_remaining():
            return self.outcome(Status.FAILURE, "no zone")
        zone = self.zone_manager.current_zone()["id"]
        if self.record.before.has_found(zone):
            return self._on_detection(zone, self.record.before.pop_search(zone))
        return super().update()

    def on_message(self, message: Any) -> Status:
        """Pass the position of a new survivor to the search leaf."""
        place = planar_point(message, MAP_FRAME)
        if not self._is_new(place):  # no longer new: found in the meantime
            return self.on_silence()
        zone = self.zone_manager.current_zone()["id"]
        self.record.zone_searched(zone, place)
        return self._on_detection(zone, place)

    def on_silence(self) -> Status:
        """Return RUNNING, because no new survivor was published."""
        self.feedback_message = f"no new survivor on '{self.topic_name}'{self.absence_reason}"
        return self.outcome(Status.RUNNING, "listening")

    def _on_detection(self, zone: str, place: tuple[float, float] | None) -> Status:
        self.detect_node.store_detection(place)
        self.feedback_message = f"survivor in {zone}"
        self.log(f"Survivor seen on the way, in {zone}!")
        return self.outcome(Status.SUCCESS, "found")

    def check_message(self, message: Any) -> None:
        """Check that the position has the right frame and is on the map."""
        map_extent_of(self.node).check(*planar_point(message, MAP_FRAME))

    def _receive(self, message: Any) -> None:
        if self._is_new(planar_point(message, MAP_FRAME)):
            super()._receive(message)

    def _is_new(self, place: tuple[float, float]) -> bool:
        return not self.record.survivors_near(*place, self.same_within)


class StaticTransforms:
    """Publishes the static frames of one node. A late subscriber receives all frames.

    `/tf_static` stores only one message for late subscribers. This message must therefore contain every frame
    published so far, and a frame that is sent again must replace the earlier version. (tf2_ros for Python
    ignores a frame that is sent again.)

    Use `static_transforms_of`: two publishers on one node would each send late subscribers only their own frames.

    Args:
        node: The rclpy node that publishes.
    """

    def __init__(self, node: "Node") -> None:
        from tf2_msgs.msg import TFMessage

        latched = qos_profile(type(self).__name__, "transient_local")
        self._message_type = TFMessage
        self._publisher = node.create_publisher(TFMessage, _FRAMES_TOPIC, latched)
        self._transforms: dict[str, TransformStamped] = {}

    def publish(self, transform: "TransformStamped") -> None:
        """Publish a frame and all earlier frames. An earlier frame with the same `child_frame_id` is replaced."""
        self._transforms[transform.child_frame_id] = transform
        self._publisher.publish(self._message_type(transforms=list(self._transforms.values())))


def static_transforms_of(node: "Node") -> StaticTransforms:
    """Return the publisher of a node's static frames. Calls for the same node return the same object.

    The frames exist as long as the node, so that the frames of a finished mission remain known.
    """
    return of_node(node, StaticTransforms, lambda: StaticTransforms(node))


@register(
    "BroadcastSurvivorTF",
    kind=Kind.ACTION,
    effects="publishes a static frame with a new name for the survivor",
    outcomes=(
        Outcome("SUCCESS", "named", "found_by_{detect_node}", _NAMED),
        Outcome("FAILURE", "nobody found", "!found_by_{detect_node}"),
    ),
    facts=dict.fromkeys(["found_by_{detect_node}", "named_by_{detect_node}", "kept_by_{detect_node}"], False),
)
@dataclass(eq=False, repr=False)
class BroadcastSurvivorTF(RosLeaf):
    """Assign a name to the detected survivor, and publish a static frame with this name below `map`.

    The leaf fails if no survivor was detected.

    Args:
        detect_node: The search that found the survivor; receives the name.
        zone_manager: Assigns the names.
        record: Records the name.
    """

    name: str
    detect_node: DetectSurvivor
    zone_manager: ZoneManager
    _: KW_ONLY
    record: MissionRecord = field(default_factory=MissionRecord)

    def __post_init__(self) -> None:
        super().__init__(self.name)
        self._verdict = Status.INVALID

    def setup(self, **kwargs: Any) -> None:
        """Create or reuse the publisher, and publish the frames of the survivors named in earlier runs."""
        super().setup(**kwargs)
        static_transforms_of(self.node)
        for survivor in self.record.survivors:
            if survivor.survivor_id is not None:
                self._publish(survivor.survivor_id, survivor.x, survivor.y)

    def initialise(self) -> None:
        """Forget the result of the previous activation."""
        self._verdict = Status.RUNNING

    def update(self) -> Status:
        """Publish the frame only once in each activation, so that only one name is assigned."""
        if self._verdict is Status.RUNNING:
            self._verdict = self._broadcast()
        return self._verdict

    def _broadcast(self) -> Status:
        pose = self.detect_node.survivor_pose()
        if pose is None:
            self.warn(f"'{self.name}' has no frame to broadcast: no survivor was found.")
            return Status.FAILURE
        survivor_id = self.record.before.pop_name(*pose)
        if survivor_id is None:
            survivor_id = self.zone_manager.next_survivor_id()
            self.record.survivor_named(survivor_id, *pose)
        self._publish(survivor_id, *pose)
        self.detect_node.set_survivor_id(survivor_id)
        self.feedback_message = f"{survivor_id} at ({pose[0]:.2f}, {pose[1]:.2f})"
        self.log(f"Broadcasting TF frame: {self.feedback_message} in {MAP_FRAME} frame.")
        named = self.record.survivor(survivor_id)
        if named is not None and named.possibly is not None:
            self.log(f"{survivor_id} may be a duplicate of {named.possibly}: the operator must decide.")
        return Status.SUCCESS

    def _publish(self, survivor_id: str, x: float, y: float) -> None:
        from geometry_msgs.msg import TransformStamped

        frame = TransformStamped()
        frame.header.stamp = self.node.get_clock().now().to_msg()
        frame.header.frame_id = MAP_FRAME
        frame.child_frame_id = survivor_id
        frame.transform.translation.x = x
        frame.transform.translation.y = y
        # The position is known, the orientation is not.
        frame.transform.rotation.w = 1.0
        static_transforms_of(self.node).publish(frame)


def survivor_report(
    detect_node: DetectSurvivor, leaf: RosLeaf, record: MissionRecord, lacks: str
) -> SurvivorReport | Status:
    """Return the report of the detected survivor, or a status if there is nothing to report.

    Args:
        detect_node: The search that found the survivor.
        leaf: The leaf, which logs the reason.
        record: Contains whether the base station acknowledged the report in an earlier run.
        lacks: The missing item in the log message, such as `no report to store`.
    """
    survivor_id, pose = detect_node.survivor_id(), detect_node.survivor_pose()
    if survivor_id is None or pose is None:
        missing = "no survivor was found" if pose is None else "the survivor has no name yet"
        leaf.warn(f"'{leaf.name}' has {lacks}: {missing}.")
        return Status.FAILURE
    if record.was_reported(survivor_id):
        leaf.feedback_message = (
            f"the report of {survivor_id}, who was named in an earlier run, is already acknowledged"
        )
        return Status.SUCCESS
    return SurvivorReport(survivor_id, *pose)


@dataclass(eq=False, repr=False)
class ReportLeaf(ServiceLeaf):
    """The base class of leaves that report a survivor to the base station and wait for an acknowledgement.

    Subclasses choose the survivor.

    Args:
        record: Records the acknowledgement.
        service: The service's name.
        server_timeout_sec: Time to wait for a server, in seconds.
        timeout_sec: Time to wait for the response, in seconds.
    """

    name: str
    _: KW_ONLY
    record: MissionRecord = field(default_factory=MissionRecord)
    service: str = "report_survivor"
    server_timeout_sec: Seconds = 10.0
    timeout_sec: Seconds = 5.0

    service_type = "sar_interfaces/srv/ReportSurvivor"

    def __post_init__(self) -> None:
        super().__init__(self.name)
        self.service_name = self.service
        self._survivor_id = ""

    def on_send(self) -> None:
        """Record that the report is being sent, and log the survivor's name."""
        self.record.report_sent(self._survivor_id)
        self.log(f"Reporting {self._survivor_id} to base...")

    def on_response(self, response: Any) -> Status:
        """Return SUCCESS if the base station acknowledged the report, otherwise FAILURE."""
        if not response.acknowledged:
            self.warn(f"Base did not acknowledge {self._survivor_id}.")
            return self.outcome(Status.FAILURE, "refused")
        self.record.record_acknowledgement(self._survivor_id)
        self.feedback_message = f"{self._survivor_id} acknowledged"
        self.log(f"Base acknowledged {self._survivor_id}.")
        return Status.SUCCESS

    def on_failure(self, reason: str) -> Status:
        """Return FAILURE, because a report without a response is not acknowledged."""
        return self.outcome(super().on_failure(reason), "refused")

    def is_good_news(self, response: Any) -> bool:
        """Return whether the report was acknowledged."""
        return bool(response.acknowledged)

    def _request_for(self, report: SurvivorReport) -> Any:
        self._survivor_id = report.survivor_id
        request = self.interface.Request(survivor_id=report.survivor_id)
        request.location.header.frame_id = MAP_FRAME
        request.location.header.stamp = self.node.get_clock().now().to_msg()
        request.location.point.x, request.location.point.y = report.x, report.y
        return request


@register(
    "NotifyBase",
    kind=Kind.ACTION,
    effects="reports the survivor to the base station",
    uses=(Use.service("{service}"),),
    outcomes=(
        Outcome("SUCCESS", "acknowledged", "named_by_{detect_node}", _ACKNOWLEDGED),
        Outcome("FAILURE", "refused", "named_by_{detect_node}"),
        Outcome("FAILURE", "nothing to report", "!named_by_{detect_node}"),
        Outcome("RUNNING", "reporting", "named_by_{detect_node}"),
    ),
    facts={"named_by_{detect_node}": False, "kept_by_{detect_node}": False, "reports_kept": 0},
)
@dataclass(eq=False, repr=False)
class NotifyBase(ReportLeaf):
    """Report the detected survivor. The leaf succeeds if the base station acknowledges the report.

    Args:
        detect_node: The search that found the survivor.
    """

    detect_node: DetectSurvivor

    def request(self) -> Any:
        """Return the request with the report, SUCCESS if it is already acknowledged, or FAILURE without a report."""
        report = survivor_report(self.detect_node, self, self.record, "nothing to report")
        if isinstance(report, Status):
            return self.outcome(report, "nothing to report" if report is Status.FAILURE else "acknowledged")
        return self._request_for(report)


@register(
    "LogNoDetection",
    kind=Kind.ACTION,
    outcomes=(Outcome("SUCCESS", "logged"),),
)
class LogNoDetection(RosLeaf):
    """Log that no survivor was found.

    The tree may also tick this leaf after a report was refused. In this case the log names the detected
    survivor for the operator.

    Args:
        zone_manager: Contains the zone that the log names; None to name no zone.
        record: Contains the survivors detected in the zone.
    """

    def __init__(
        self, name: str, zone_manager: ZoneManager | None = None, *, record: MissionRecord | None = None
    ) -> None:
        super().__init__(name)
        self._zones, self._record = zone_manager, record or MissionRecord()

    def update(self) -> Status:
        """Log that no survivor was found, and return SUCCESS."""
        named = self._zones is not None and self._zones.has_remaining()
        zone = self._zones.current_zone()["id"] if self._zones is not None and named else ""
        place = f" at {zone}" if zone else ""
        self.feedback_message = f"nobody found{place}"
        self.log(f"No survivor found{place}.")
        for survivor in self._record.survivors:
            if survivor.zone_id == zone and survivor.counts and not survivor.acknowledged:
                self.warn(f"Note for the operator: {survivor} was found, and base has not acknowledged it.")
        return Status.SUCCESS
