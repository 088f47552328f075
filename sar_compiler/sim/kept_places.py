"""The places of the robots in a file, so that a simulation that is started again finds them where they stood."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from sar_compiler.errors import SarError
from sar_compiler.sim.geometry import Pose2D
from sar_compiler.sim.placement import Placement

RobotPlaces = Mapping[str, tuple[Pose2D, Pose2D]]
"""Of each robot, by its name: its pose in `map`, and that by its odometry."""

# Larger files are none of ours.
_LARGEST = 1_000_000


class KeptPlacesError(SarError):
    """The file cannot be read or written, or is for something else.

    Attributes:
        path: The file.
    """

    def __init__(self, path: Path, problem: str) -> None:
        self.path = path
        super().__init__(f"{path}: {problem}")


class KeptPlaces:
    """The places of the robots of one world in a file.

    Args:
        path: The file; it need not exist.
        world: The world's name.
    """

    def __init__(self, path: Path, world: str) -> None:
        self._path, self._world = path, world

    def read(self) -> RobotPlaces:
        """Return what was written last; empty if there is no file.

        Raises:
            KeptPlacesError: If it is no such file, or for another world.
        """
        try:
            with self._path.open(encoding="utf-8") as file:
                said: Any = json.loads(file.read(_LARGEST))
            places = {
                str(name): (Pose2D(*map(float, pose)), Pose2D(*map(float, odometry)))
                for name, (pose, odometry) in said["robots"].items()
            }
            world = said["world"]
        except FileNotFoundError:
            return {}
        except OSError as error:
            raise KeptPlacesError(self._path, f"cannot be read: {error.strerror}") from error
        except (ValueError, TypeError, KeyError, AttributeError) as error:
            raise KeptPlacesError(self._path, "holds no places of robots; name another file") from error
        if world != self._world:
            raise KeptPlacesError(
                self._path, f"holds places in another world, {world!r}; delete it, or name another file"
            )
        if not all(pose.is_finite for pair in places.values() for pose in pair):
            raise KeptPlacesError(self._path, "holds a pose that is not finite; delete it")
        return places

    def placed(self, robots: Sequence[Placement]) -> list[Placement]:
        """Return the robots where they stood when they were written last; others at their starts.

        Raises:
            KeptPlacesError: As `read`.
        """
        places = self.read()
        return [Placement(each.name, *places.get(each.name, (each.start,))) for each in robots]

    def write(self, places: RobotPlaces) -> None:
        """Replace the file: whenever the process ends, there is a whole one.

        Raises:
            KeptPlacesError: If it cannot be written.
        """
        robots = {name: [_numbers(pose) for pose in pair] for name, pair in places.items()}
        beside = self._path.with_name(f"{self._path.name}.new")
        try:
            beside.write_text(json.dumps({"world": self._world, "robots": robots}), encoding="utf-8")
            beside.replace(self._path)
        except OSError as error:
            raise KeptPlacesError(self._path, f"cannot be written: {error.strerror}") from error


def _numbers(pose: Pose2D) -> list[float]:
    return [pose.x, pose.y, pose.yaw]
