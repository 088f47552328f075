"""Reading `worlds/*.yaml`."""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from sar_compiler import resources
from sar_compiler.checks.configuration import path_inside
from sar_compiler.documents.yaml_files import read_yaml
from sar_compiler.errors import SarError
from sar_compiler.sim.geometry import Box, Cylinder, Pose2D
from sar_compiler.sim.world import World

_EMPTY_HINT = "write robot: {x: 0, y: 0, radius: 0.22}, and walls: with a list of rectangles"


class WorldError(SarError):
    """There is no such world."""


def find_world(name: str) -> World:
    """Return a world by its name or path.

    Args:
        name: The path of a world file, or the name of a shipped world (`disaster_zone`).

    Raises:
        WorldError: If there is no such file.
        TreeError: If the file has mistakes, or the robot starts inside an obstacle; carries all findings.
    """
    path = resources.find("worlds", name, ".yaml")
    if not path.exists():
        raise WorldError(resources.not_found("worlds", name, ".yaml"))
    return load_world(path)


def load_world(path: Path) -> World:
    """Read a world file.

    Raises:
        UnreadableFileError: If the file does not exist or cannot be read.
        TreeError: If the file has mistakes, or the robot starts inside an obstacle; carries all findings.
    """
    document = read_yaml(path, _EMPTY_HINT)
    said = document.hold("world").data
    map_path = (
        path_inside(document, path.parent, document.root.mapping["map"], "map") if "map" in said else None
    )
    document.raise_findings()
    robot, debris = said["robot"], said.get("debris", ())
    world = World(
        name=path.stem,
        start=Pose2D(robot["x"], robot["y"], robot.get("yaw", 0.0)),
        robot_radius=robot["radius"],
        boxes=tuple(
            Box(**_sizes(each)) for each in (*said["walls"], *debris) if each.get("shape") != "cylinder"
        ),
        cylinders=tuple(Cylinder(**_sizes(each)) for each in debris if each["shape"] == "cylinder"),
        places=MappingProxyType(
            {name: (point["x"], point["y"]) for name, point in said.get("zones", {}).items()}
        ),
        survey=tuple((point["x"], point["y"]) for point in said.get("survey", ())),
        map_path=map_path,
    )
    if world.solid.clearance(world.start.x, world.start.y) <= world.robot_radius:
        message = "the robot would start in an obstacle"
        document.report("wrong-value", message, document.root.name_at(("robot",)))
    document.raise_findings()
    return world


def _sizes(obstacle: Mapping[str, Any]) -> dict[str, float]:
    return {name: size for name, size in obstacle.items() if name != "shape"}
