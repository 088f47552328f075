"""Reading `worlds/*.yaml`."""

from pathlib import Path
from types import MappingProxyType

from sar_compiler import resources
from sar_compiler.errors import SarError
from sar_compiler.sim.geometry import Box, Cylinder, Pose2D
from sar_compiler.sim.world import World
from sar_compiler.sim.yaml_reader import YamlValue, read_yaml


class WorldError(SarError):
    """There is no such world, or it makes no sense as a whole."""


def find_world(name: str) -> World:
    """Return the world that a user means.

    Args:
        name: The path of a world file, or the name of a shipped world (`disaster_zone`).

    Raises:
        WorldError: If there is no such file, or the robot starts inside an obstacle.
        YamlFileError: If the file has a mistake.
    """
    path = resources.find("worlds", name, ".yaml")
    if not path.is_file():
        raise WorldError(resources.not_found("worlds", name, ".yaml"))
    return load_world(path)


def load_world(path: Path) -> World:
    """Read a world file.

    Args:
        path: The file.

    Raises:
        WorldError: If there is no such file, or the robot starts inside an obstacle.
        YamlFileError: If the file has a mistake; it names file, line, key and what is expected.
    """
    top = read_yaml(path, WorldError).mapping(("robot", "walls"), ("map", "debris", "zones", "survey"))
    robot = top["robot"].mapping(("x", "y", "radius"), ("yaw",))
    debris = [_debris(item) for item in top["debris"].items()] if "debris" in top else []
    zones = top["zones"].mapping(optional=None) if "zones" in top else {}
    world = World(
        name=path.stem,
        start=Pose2D(
            robot["x"].number(), robot["y"].number(), robot["yaw"].number() if "yaw" in robot else 0.0
        ),
        robot_radius=robot["radius"].number(above=0.0),
        boxes=(
            *(_box(item) for item in top["walls"].items()),
            *(shape for shape in debris if isinstance(shape, Box)),
        ),
        cylinders=tuple(shape for shape in debris if isinstance(shape, Cylinder)),
        zones=MappingProxyType({name: _point(value) for name, value in zones.items()}),
        survey=tuple(_point(item) for item in top["survey"].items()) if "survey" in top else (),
        map_path=path.parent / top["map"].text() if "map" in top else None,
    )
    if world.solid.clearance(world.start.x, world.start.y) <= world.robot_radius:
        top["robot"].fail("the robot would start in an obstacle")
    return world


def _debris(value: YamlValue) -> Box | Cylinder:
    shape = value.mapping(("shape",), None)["shape"].text(("box", "cylinder"))
    return _box(value, "shape") if shape == "box" else _cylinder(value)


def _box(value: YamlValue, *further: str) -> Box:
    keys = value.mapping((*further, "x", "y", "size_x", "size_y"), ("yaw",))
    return Box(
        keys["x"].number(),
        keys["y"].number(),
        keys["size_x"].number(above=0.0),
        keys["size_y"].number(above=0.0),
        keys["yaw"].number() if "yaw" in keys else 0.0,
    )


def _cylinder(value: YamlValue) -> Cylinder:
    keys = value.mapping(("shape", "x", "y", "radius"))
    return Cylinder(keys["x"].number(), keys["y"].number(), keys["radius"].number(above=0.0))


def _point(value: YamlValue) -> tuple[float, float]:
    keys = value.mapping(("x", "y"))
    return keys["x"].number(), keys["y"].number()
