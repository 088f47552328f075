"""Record a robot's pose, plan, map, battery charge and log messages in the mission's journal."""

import base64
import math
import struct
import zlib
from collections.abc import Callable
from functools import partial
from typing import Any

from nav_msgs.msg import OccupancyGrid, Path
from rcl_interfaces.msg import Log
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import BatteryState

from sar_compiler.journal.journal import Journal
from sar_compiler.journal.journal_entries import (
    BATTERY,
    GOAL_ENDED,
    LACKS,
    LOG,
    MAP,
    PLAN,
    POSE,
    JournalEntry,
)
from sar_compiler.ros.message_values import (
    PlanarPose,
    battery_share,
    frame_of,
    grid_geometry,
    logged_sec,
    path_points,
    value_reports,
)
from sar_compiler.ros.robot_estimate import robot_estimate

# Maximum number of pixels of an image. For a larger map, only every second, third, … cell is drawn.
_CELLS = 4_000_000
# The grey value of unknown cells. As in map_saver's images, free cells are white and occupied cells are black.
_UNKNOWN = 205
_GREY = bytes(254 - 254 * cell // 100 if cell <= 100 else _UNKNOWN for cell in range(256))  # noqa: PLR2004


def grid_image(message: Any) -> tuple[int, int, int, bytes] | None:
    """Convert a `nav_msgs/msg/OccupancyGrid` to a PNG image whose upper edge has the maximum y.

    Returns:
        The width and height in pixels, the number of cells along each side of a pixel, and the image file; None for an invalid map.
    """
    width, height = message.info.width, message.info.height
    cells = bytes(memoryview(message.data).cast("B"))
    if not cells or len(cells) != width * height:
        return None
    step = 1
    # A map with a single row has an image with a single row.
    while max(1, width // step) * max(1, height // step) > _CELLS:
        step += 1
    pixels = cells.translate(_GREY)
    wide, high = max(1, width // step), max(1, height // step)
    starts = (row * step * width for row in reversed(range(high)))
    # Each row starts with the number of its filter, which is 0 for no filter.
    rows = b"".join(b"\0" + pixels[start : start + wide * step : step] for start in starts)
    return wide, high, step, _png(wide, high, zlib.compress(rows, 6))


def _png(width: int, height: int, data: bytes) -> bytes:
    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", data), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
        for kind, content in chunks
    )


# Minimum interval between two entries of a kind, in seconds of the node's clock, because topics such as the map can be published continuously.
_PERIODS_SEC = {POSE: 1.0, PLAN: 1.0, MAP: 10.0, BATTERY: 1.0}
# Maximum number of recorded points of a plan. Nav2's plans have a point every few centimetres, which a drawing does not need.
_POINTS = 200
# Interval between checks for postponed messages, in seconds of the node's clock.
_LOOK_SEC = 0.5
# Maximum number of log lines that are queued until the node reads them.
_LINES = 200
# Maximum length of a log line in characters, and maximum number of other nodes' lines between two checks. Any node can write to the log.
_LONGEST, _OTHERS = 2000, 20


class RobotObserver:
    """Records messages of the robot's topics as journal entries.

    - `pose`: `x`, `y` (m) and `yaw` (rad) in the frame `map`, from the topic `amcl_pose`
    - `plan`: `points`, x and y (m) in the plan's `frame`, from the topic `plan`
    - `map`: `png`, an image in base64 with `width` and `height` pixels of `resolution` metres. Its lower left corner is at `x` and `y` (m), and it
      is rotated by `yaw` (rad). From the topic `map`, if the map has changed
    - `battery`: `share`, the charge from 0 to 1, rounded to 0.01, from the topic `battery_state`, if it has changed
    - `lacks`: `text`, the reason why the robot cannot drive (Nav2 is not active, or transforms have stopped); empty when it can drive again
    - `log`: `node`, `level` (as in `rcl_interfaces/msg/Log`), `text`, and `stamp`, the time at which the line was logged (s since 1970),
    which is earlier than the entry's time. For nodes other than the mission's node, only warnings and errors are recorded

    Args:
        node: The mission's node.
        journal: The mission's journal.
    """

    def __init__(self, node: Node, journal: Journal) -> None:
        self._journal, self._reports = journal, value_reports(node)
        self._name = node.get_logger().name
        self._due = dict.fromkeys(_PERIODS_SEC, -math.inf)
        self._newest: dict[str, Any] = {}
        self._recorders: dict[str, Callable[[Any], None]] = {
            POSE: self._on_pose,
            PLAN: self._on_plan,
            MAP: self._on_map,
            BATTERY: self._on_battery,
        }
        self._map: tuple[object, ...] = ()
        self._battery = math.nan
        self._others = 0
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        for message, topic, callback, qos in (
            (Path, "plan", partial(self._on_message, PLAN), QoSProfile(depth=1)),
            (OccupancyGrid, "map", partial(self._on_message, MAP), latched),
            # Best effort is compatible with reliable and unreliable publishers.
            (
                BatteryState,
                "battery_state",
                partial(self._on_message, BATTERY),
                QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT),
            ),
            (Log, "/rosout", self._on_log, QoSProfile(depth=_LINES)),
        ):
            node.create_subscription(message, topic, callback, qos)
        self._robot, self._lacks = robot_estimate(node), ("", False)
        self._robot.add_listener(partial(self._on_message, POSE))
        if self._robot.pose is not None:
            self._on_message(POSE, self._robot.pose)
        node.create_timer(_LOOK_SEC, self._record_postponed)
        journal.add_listener(self._on_entry)

    def _on_entry(self, entry: JournalEntry) -> None:
        if entry.kind == GOAL_ENDED:
            self._newest.pop(PLAN, None)

    def _on_message(self, kind: str, message: Any) -> None:
        self._newest[kind] = message
        self._record(kind)

    def _record_postponed(self) -> None:
        """Record due messages, changes of the reason why the robot cannot drive, and the number of omitted log lines."""
        for kind in tuple(self._newest):
            self._record(kind)
        # If the localisation stops, Nav2 usually fails, too. Then only the lost localisation is recorded: it is the cause, and the robot's
        # position is unknown.
        lost = self._robot.lost_transforms()
        if (lacks := (lost or self._robot.lacks, bool(lost))) != self._lacks:
            self._lacks = lacks
            text, is_position_lost = lacks
            self._journal.record_observation(
                LACKS, text=text, **({"is_position_lost": True} if is_position_lost else {})
            )
        left_out, self._others = self._others - _OTHERS, 0
        if left_out > 0:
            text = f"{left_out} further warnings of other nodes within {_LOOK_SEC:g} s are omitted."
            self._journal.record_observation(LOG, node=self._name, level=Log.WARN, text=text)

    def _record(self, kind: str) -> None:
        if self._is_due(kind):
            self._recorders[kind](self._newest.pop(kind))

    def _on_pose(self, pose: PlanarPose) -> None:
        self._journal.record_observation(POSE, **pose._asdict())

    def _on_plan(self, message: Any) -> None:
        if (points := self._reports.read("Topic 'plan'", lambda: path_points(message))) is None:
            return
        step = max(1, math.ceil(len(points) / _POINTS))
        drawn = [(round(x, 3), round(y, 3)) for x, y in (*points[:-1:step], *points[-1:])]
        self._journal.record_observation(PLAN, frame=frame_of(message), points=drawn)

    def _on_map(self, message: Any) -> None:
        if (place := self._reports.read("Topic 'map'", lambda: grid_geometry(message))) is None:
            return
        identity = (*place, zlib.crc32(message.data))
        # An unchanged map is not drawn again, because drawing takes time in the thread that ticks the tree.
        if identity == self._map or (drawn := grid_image(message)) is None:
            return
        self._map = identity
        width, height, step, data = drawn
        at, png = {"x": place.x, "y": place.y, "yaw": place.yaw}, base64.b64encode(data).decode()
        resolution = place.cell_m * step
        self._journal.record_observation(
            MAP, resolution=resolution, width=width, height=height, **at, png=png
        )

    def _on_battery(self, message: Any) -> None:
        read = self._reports.read("Topic 'battery_state'", lambda: battery_share(message))
        if read is not None and (share := round(read, 2)) != self._battery:
            self._battery = share
            self._journal.record_observation(BATTERY, share=share)

    def _on_log(self, message: Any) -> None:
        if message.name != self._name:
            if message.level < Log.WARN:
                return
            self._others += 1
            if self._others > _OTHERS:
                return
        text = message.msg if len(message.msg) <= _LONGEST else f"{message.msg[:_LONGEST]} [...]"
        stamp = logged_sec(message)
        self._journal.record_observation(LOG, node=message.name, level=message.level, text=text, stamp=stamp)

    def _is_due(self, kind: str) -> bool:
        now = self._journal.clock.now()
        # If the clock was set back, the interval starts over.
        if self._due[kind] - _PERIODS_SEC[kind] <= now < self._due[kind]:
            return False
        self._due[kind] = now + _PERIODS_SEC[kind]
        return True
