"""Record a robot's messages during a mission in the mission's journal: pose, plan, map, and log."""

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

# Of a larger map only some cells are drawn.
_CELLS = 4_000_000
# As map_saver draws: white for free cells, black for occupied ones, and a grey for unknown ones.
_UNKNOWN = 205
_GREY = bytes(254 - 254 * cell // 100 if cell <= 100 else _UNKNOWN for cell in range(256))  # noqa: PLR2004


def grid_image(message: Any) -> tuple[int, int, int, bytes] | None:
    """Return a `nav_msgs/msg/OccupancyGrid` as a PNG whose upper edge is the highest y.

    Returns:
        Width and height in pixels, the cells for each pixel's width and height, and the file; None for an invalid map.
    """
    width, height = message.info.width, message.info.height
    cells = bytes(memoryview(message.data).cast("B"))
    if not cells or len(cells) != width * height:
        return None
    step = 1
    # A map of a single row stays a single row.
    while max(1, width // step) * max(1, height // step) > _CELLS:
        step += 1
    pixels = cells.translate(_GREY)
    wide, high = max(1, width // step), max(1, height // step)
    starts = (row * step * width for row in reversed(range(high)))
    # Each row starts with its filter: none.
    rows = b"".join(b"\0" + pixels[start : start + wide * step : step] for start in starts)
    return wide, high, step, _png(wide, high, zlib.compress(rows, 6))


def _png(width: int, height: int, data: bytes) -> bytes:
    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", data), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
        for kind, content in chunks
    )


# Minimum interval, seconds of the node's clock: a map in progress is published continuously.
_PERIODS_SEC = {POSE: 1.0, PLAN: 1.0, MAP: 10.0, BATTERY: 1.0}
# A plan has a point every few centimetres; a drawing needs fewer.
_POINTS = 200
# Interval between checks for postponed messages, in seconds of the node's clock.
_LOOK_SEC = 0.5
# The number of lines that are queued until the node reads a burst of the log.
_LINES = 200
# Any node can write to the log: limits for the characters of a line, and for other nodes' lines between two checks.
_LONGEST, _OTHERS = 2000, 20


class RobotObserver:
    """Watches topics for a journal.

    - `pose`: `x`, `y` (m) and `yaw` (rad) in the frame `map`, from `amcl_pose`
    - `plan`: `points`, x and y in metres in the plan's `frame`, from `plan`
    - `map`: `png`, an image in base64 of `width` and `height` pixels of `resolution` metres, whose lower left corner is at `x`, `y`
      (m), turned by `yaw` (rad), from `map`; where it is another one than before
    - `battery`: `share`, of 1 for a full one, to the percent, from `battery_state`; where it is another one than before
    - `lacks`: `text`, why the robot cannot drive (Nav2 is not active, transforms have stopped), empty when it can again
    - `log`: `node`, `level` (as in `rcl_interfaces/msg/Log`), `text`, and when it was said, `stamp` (s since 1970): a line comes later than what
      happens meanwhile; of other nodes than the mission's own only warnings and errors

    Args:
        node: The mission's node.
        journal: The journal to write to.
    """

    def __init__(self, node: Node, journal: Journal) -> None:
        self._journal, self._reports = journal, value_reports(node)
        self._name = node.get_logger().name
        self._due = dict.fromkeys(_PERIODS_SEC, -math.inf)
        self._newest: dict[str, Any] = {}
        self._takers: dict[str, Callable[[Any], None]] = {
            POSE: self._on_pose,
            PLAN: self._on_plan,
            MAP: self._on_map,
            BATTERY: self._on_battery,
        }
        self._map: tuple[object, ...] = ()
        self._battery = math.nan
        self._others = 0
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        for message, topic, take, qos in (
            (Path, "plan", partial(self._on_message, PLAN), QoSProfile(depth=1)),
            (OccupancyGrid, "map", partial(self._on_message, MAP), latched),
            # Matches drivers that publish reliably and those that do not.
            (
                BatteryState,
                "battery_state",
                partial(self._on_message, BATTERY),
                QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT),
            ),
            (Log, "/rosout", self._on_log, QoSProfile(depth=_LINES)),
        ):
            node.create_subscription(message, topic, take, qos)
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
        """Record the latest postponed message."""
        for kind in tuple(self._newest):
            self._record(kind)
        # A stopped localisation usually takes Nav2 down. Its loss is the cause, and more urgent: the robot may be anywhere.
        lost = self._robot.lost_transforms()
        if (lacks := (lost or self._robot.lacks, bool(lost))) != self._lacks:
            self._lacks = lacks
            text, is_position_lost = lacks
            self._journal.record_observation(
                LACKS, text=text, **({"is_position_lost": True} if is_position_lost else {})
            )
        left_out, self._others = self._others - _OTHERS, 0
        if left_out > 0:
            text = f"{left_out} more warnings of other nodes within {_LOOK_SEC:g} s are omitted."
            self._journal.record_observation(LOG, node=self._name, level=Log.WARN, text=text)

    def _record(self, kind: str) -> None:
        if self._is_due(kind):
            self._takers[kind](self._newest.pop(kind))

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
        said = (*place, zlib.crc32(message.data))
        # Drawing a map takes time in the thread that ticks, so the same map is not drawn again.
        if said == self._map or (drawn := grid_image(message)) is None:
            return
        self._map = said
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
        # After a clock was set back, the interval starts over.
        if self._due[kind] - _PERIODS_SEC[kind] <= now < self._due[kind]:
            return False
        self._due[kind] = now + _PERIODS_SEC[kind]
        return True
