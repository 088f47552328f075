"""What the detection server is told by its parameters, read without ROS."""

from collections.abc import Mapping

from sar_compiler.ros.parameter_reader import ParameterReader

_POINT = ("x", "y")


def read_survivors(
    parameters: Mapping[str, object], default: Mapping[str, tuple[float, float]]
) -> dict[str, tuple[float, float]]:
    """Read where survivors are, by zone, from `survivors.<zone>.{x,y}`.

    Args:
        parameters: A node's parameters by flat name.
        default: The table that counts where no such parameter is given.

    Returns:
        Positions in metres in the frame `map`.

    Raises:
        ParameterError: With every mistake there is, if there is any.
    """
    reader = ParameterReader(parameters)
    points = {
        zone_id: reader.point(f"survivors.{zone_id}", _POINT, given)
        for zone_id, given in reader.group("survivors", _POINT).items()
    }
    reader.complain()
    return {zone_id: (point["x"], point["y"]) for zone_id, point in points.items()} or dict(default)
