"""What a parameter file says of the runs of a tree, without ROS."""

from collections.abc import Callable
from pathlib import Path

from sar_compiler.checks.assumptions import StartValues
from sar_compiler.missions.beginning import begin_run, node_name
from sar_compiler.missions.mission import Mission
from sar_compiler.nodes.binding.bound import Binding
from sar_compiler.ros.parameter_file import read_parameter_file
from sar_compiler.ros.parameter_reader import ParameterReader


def start_values(
    path: str | Path, binding: Binding, mission: Mission | None, note: Callable[[str], None]
) -> StartValues:
    """Return what a parameter file says of the runs of a tree.

    Args:
        path: The file.
        binding: The tree.
        mission: Its mission; None for a plain tree.
        note: Is told what is surprising in the file.

    Raises:
        ParameterFileError: If ROS would refuse or misread the file.
        ParameterError: If the mission cannot begin with the parameters.
    """
    node = f"/{node_name(mission)}"
    values = read_parameter_file(path, node)
    reader = ParameterReader.of_files(values, [path], node)
    begun = begin_run(mission, reader, binding)
    for text in filter(None, (reader.elsewhere, *begun.notes)):
        note(text if text.startswith(f"{path}:") else f"{path}: {text}")
    return StartValues(values, begun.mission.facts(), 1.0 / begun.parameters.tick_rate_hz)
