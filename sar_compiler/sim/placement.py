"""The robots of a world and their start poses, from the command line or a file."""

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sar_compiler.errors import SarError
from sar_compiler.opener import POSES, MissingFileError, UnreadableFileError, read_file
from sar_compiler.sim.geometry import ORIGIN, Pose2D

_FORM = "NAME, NAME:X,Y or NAME:X,Y,YAW (metres and radians, frame map)"
# A valid part of a ROS namespace; rmw allows about 240 characters for a complete namespace.
_NAME = re.compile(r"(?!.*__)[A-Za-z_][A-Za-z0-9_]{0,99}")

QUICK_NAME, NAV2_NAME = "quick", "nav2"
MANNER_NAMES = (QUICK_NAME, NAV2_NAME)
"""The names of the Nav2 substitute's manners of driving (`sim.navigator`)."""


class PlacementError(SarError):
    """Robots cannot be placed as requested.

    Attributes:
        robot: The name of the robot, or the text of an invalid placement; empty for the robot without a name.
    """

    def __init__(self, robot: str, problem: str) -> None:
        self.robot = robot
        super().__init__(f"robot '{robot}': {problem}" if robot else f"the robot {problem}")


@dataclass(frozen=True)
class Placement:
    """One robot in a world.

    Attributes:
        name: The robot's name; the robot's nodes are in the namespace `/name`. If the name is empty, the nodes are in the namespace of the
            simulation and use the global `/tf`.
        start: The robot's pose at time zero, frame `map`; the world's start if None.
        odometry: The pose at time zero according to the robot's odometry.
        localised: Whether the localisation knows the robot's pose without an initial pose.
        like: The manner of driving of the robot's Nav2 substitute, one of `MANNER_NAMES`.
    """

    name: str
    start: Pose2D | None = None
    odometry: Pose2D = ORIGIN
    localised: bool = False
    like: str = QUICK_NAME

    @property
    def action(self) -> str:
        """The name of the robot's navigation action."""
        return f"/{self.name}/navigate_to_pose" if self.name else "navigate_to_pose"

    @property
    def ros_arguments(self) -> list[str]:
        """The ROS arguments that put the robot's nodes and transforms into the robot's namespace."""
        if not self.name:
            return []
        return ["--ros-args", "-r", f"__ns:=/{self.name}", "-r", "/tf:=tf", "-r", "/tf_static:=tf_static"]


def parse_placement(text: str) -> Placement:
    """Parse `NAME[:X,Y[,YAW]]`.

    Raises:
        PlacementError: If the text has another form, ROS rejects the name, or a number is not finite.
    """
    name, colon, pose = text.partition(":")
    if not name:
        raise PlacementError(text, f"has no name. Write {_FORM}")
    if not _NAME.fullmatch(name):
        problem = (
            f"'{name}' is not a valid namespace. Use at most 100 letters, digits and single underscores, without a "
            f"digit at the start, and write {_FORM}"
        )
        raise PlacementError(text, problem)
    if not colon:
        return Placement(name)
    numbers = [_number(text, part) for part in pose.split(",")]
    if len(numbers) not in {2, 3}:
        problem = f"'{pose}' has {len(numbers)} number{'s' * (len(numbers) != 1)}. Write {_FORM}"
        raise PlacementError(text, problem)
    return Placement(name, Pose2D(*numbers))


def _number(text: str, part: str) -> float:
    try:
        value = float(part)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise PlacementError(text, f"'{part}' is not a finite number. Write {_FORM}")
    return value


RobotPlaces = Mapping[str, tuple[Pose2D, Pose2D]]
"""The pose in `map` and the odometry pose of each robot, by the robot's name."""


class PoseFileError(SarError):
    """A pose file cannot be read or written, or contains no valid poses for the world.

    Attributes:
        path: The path of the file.
    """

    def __init__(self, path: Path, problem: str) -> None:
        self.path = path
        super().__init__(f"{path}: {problem}")


class PoseFile:
    """A file with the poses of the robots in a world.

    Args:
        path: The path of the file, which need not exist.
        world: The world's name.
    """

    def __init__(self, path: Path, world: str) -> None:
        self._path, self._world = path, world

    def read(self) -> RobotPlaces:
        """Return the last written poses, or no poses if the file does not exist.

        Raises:
            PoseFileError: If the file is invalid, or contains poses of another world.
        """
        try:
            data: Any = json.loads(read_file(self._path, POSES).decode())
            places = {
                str(name): (Pose2D(*map(float, pose)), Pose2D(*map(float, odometry)))
                for name, (pose, odometry) in data["robots"].items()
            }
            world = data["world"]
        except MissingFileError:
            return {}
        except UnreadableFileError as error:
            raise PoseFileError(self._path, f"the file cannot be read: {error.reason}") from error
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
            raise PoseFileError(
                self._path, "the file contains no poses of robots. Choose another file"
            ) from error
        if world != self._world:
            raise PoseFileError(
                self._path,
                f"the file contains poses for another world, {world!r}. Delete the file, or choose another file",
            )
        if not all(pose.is_finite for pair in places.values() for pose in pair):
            raise PoseFileError(self._path, "the file contains a pose that is not finite. Delete the file")
        return places

    def restore(self, robots: Sequence[Placement]) -> list[Placement]:
        """Return the robots at the poses in the file. A robot without a pose in the file is at its start.

        Raises:
            PoseFileError: As for `read`.
        """
        places = self.read()
        return [Placement(each.name, *places.get(each.name, (each.start,))) for each in robots]

    def write(self, places: RobotPlaces) -> None:
        """Replace the content of the file atomically.

        Raises:
            PoseFileError: If the file cannot be written.
        """
        robots = {name: [_numbers(pose) for pose in pair] for name, pair in places.items()}
        beside = self._path.with_name(f"{self._path.name}.new")
        try:
            beside.write_text(json.dumps({"world": self._world, "robots": robots}), encoding="utf-8")
            beside.replace(self._path)
        except OSError as error:
            raise PoseFileError(self._path, f"the file cannot be written: {error.strerror}") from error


def _numbers(pose: Pose2D) -> list[float]:
    return [pose.x, pose.y, pose.yaw]
