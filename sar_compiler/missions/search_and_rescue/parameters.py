"""The parameters of the detection server, read without ROS."""

from collections.abc import Mapping

from sar_compiler.ros.parameter_reader import ParameterReader

_POINT = ("x", "y")


def read_survivors(
    parameters: Mapping[str, object], default: Mapping[str, tuple[float, float]]
) -> dict[str, tuple[float, float]]:
    """Read the survivors' positions by zone from `survivors.<zone>.{x,y}`.

    Returns:
        The positions in metres in the frame `map`.

    Raises:
        ParameterError: If there are mistakes; has all of them.
    """
    reader = ParameterReader(parameters)
    points = {
        zone_id: reader.point(f"survivors.{zone_id}", _POINT) for zone_id in reader.group("survivors", _POINT)
    }
    reader.complain()
    return {zone_id: (point["x"], point["y"]) for zone_id, point in points.items()} or dict(default)
