"""Start a mission: read the node's parameters for the mission, the run and the tree."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from sar_compiler.missions.faults import NAVIGATION_FAULTS, Fault, parse_fault
from sar_compiler.missions.mission import Mission, MissionRun
from sar_compiler.missions.mission_choice import mission_of
from sar_compiler.missions.parameter_file import read_parameter_file
from sar_compiler.missions.parameter_reader import (
    RUN_PARAMETER_NAMES,
    ParameterReader,
    RunParameters,
    lookalikes,
    read_run,
    report_unused_files,
)
from sar_compiler.nodes.binding.bound import Binding
from sar_compiler.opener import allow_reading
from sar_compiler.project.project_tree import ProjectTree
from sar_compiler.runtime.expressions import name_uses

# The name of the node that runs a tree without a mission.
_PLAIN_NODE_NAME = "sar_run"


class MissionStart(NamedTuple):
    """The result of a successful start.

    Attributes:
        mission: The run of the mission; an instance of the base class for a tree without a mission.
        parameters: The parameters that every run has, with or without a mission.
        notes: Sentences about suspicious parameters, such as a name that probably contains a typo.
    """

    mission: MissionRun
    parameters: RunParameters
    notes: tuple[str, ...]


def node_name(mission: Mission | None) -> str:
    """Return the name of the node on which a mission runs."""
    return mission.name if mission is not None else _PLAIN_NODE_NAME


def begin_run(mission: Mission | None, reader: ParameterReader, binding: Binding) -> MissionStart:
    """Start a run of a mission with a node's parameters.

    Args:
        mission: The mission; None for a tree without a mission.
        reader: Reads the node's parameters.
        binding: The tree, whose tags are bound to nodes.

    Raises:
        ParameterError: If there are errors in the parameters; lists all of them.
    """
    run = mission.begin(reader) if mission is not None else MissionRun()
    parameters = read_run(reader)
    reader.complain()
    if mission is not None and (unlisted := reader.files.keys() - set(mission.path_parameters)):
        raise TypeError(
            f"the mission '{mission.name}' reads the file that the parameter {min(unlisted)} names. Add this parameter to path_parameters"
        )
    own = mission.parameter_names if mission is not None else ()
    keys = (key.removeprefix("@") for key in (*_keys(binding), *_script_keys(binding)))
    names = (*RUN_PARAMETER_NAMES, *own, *keys)
    typos = lookalikes(reader.parameters, names, reader.place_of)
    return MissionStart(run, parameters, (*typos, *report_unused_files(reader, names), *reader.notes))


class FileStart(NamedTuple):
    """The result of starting a run without ROS, with the parameters in a file.

    Attributes:
        parameters: The file's parameters by flat name.
        reader: The reader of the parameters and of the files that they name.
        beginning: The start of a run with these parameters.
    """

    parameters: dict[str, object]
    reader: ParameterReader
    beginning: MissionStart


def start_without_ros(tree: ProjectTree, params: Path | None, binding: Binding) -> FileStart:
    """Start a run of a loaded tree with the parameters in a file, without ROS.

    Raises:
        ParameterFileError: If ROS would reject or misread the file.
        ParameterError: If the mission cannot start with the parameters.
    """
    mission = mission_of(tree, binding)
    node = f"/{node_name(mission)}"
    values = read_parameter_file(params, node) if params is not None else {}
    reader = ParameterReader.from_files(values, [] if params is None else [params], node)
    return FileStart(values, reader, begin_run(mission, reader, binding))


def read_parameters(
    tree: ProjectTree, params: Path | None = None, tree_id: str | None = None
) -> ParameterReader:
    """Read the parameters of a run, and the files that these parameters name, without ROS.

    Args:
        tree: The loaded tree file.
        params: The parameter file; by default the mission's default file, if it has one.
        tree_id: The ID of the tree in the file; by default the main tree.

    Raises:
        TreeError: If there are errors in the tree.
        ParameterFileError: If ROS would reject or misread the parameter file.
        ParameterError: If the mission cannot start with the parameters.
    """
    binding = tree.binding(tree_id)
    mission = mission_of(tree, binding)
    if params is None and mission is not None:
        params = mission.default_parameters()
        if params is not None:
            allow_reading(params)
    return start_without_ros(tree, params, binding).reader


def parse_faults(texts: Iterable[str], mission: Mission | None) -> list[Fault]:
    """Parse the faults of `--fault`, which affect the robot's navigation or the mission's servers.

    Raises:
        FaultError: If a fault is unknown or invalid.
    """
    targets = {**(mission.faults if mission is not None else {}), **NAVIGATION_FAULTS}
    return [parse_fault(text, targets) for text in texts]


def path_parameters(mission: Mission | None, binding: Binding) -> set[str]:
    """Return the names of all parameters that are file paths.

    Such a parameter belongs to the mission, or to a port of a leaf (`{@photos}`).
    """
    ports = (
        key.removeprefix("@")
        for bound in binding.all_nodes()
        for name, key in bound.keys.items()
        if key.startswith("@") and bound.spec.parameters[name].value_type.python is Path
    )
    return {*(mission.path_parameters if mission is not None else ()), *ports}


def fixed_parameters(mission: Mission | None, binding: Binding) -> set[str]:
    """Return the names of the parameters that are read only at the start.

    For a group of parameters, the result contains the first part of their names.
    """
    own = mission.parameter_names if mission is not None else ()
    names = (*RUN_PARAMETER_NAMES, *own, *(key for key in _keys(binding) if key.startswith("@")))
    return {"use_sim_time", *(name.removeprefix("@").partition(".")[0] for name in names)}


def _keys(binding: Binding) -> list[str]:
    return [key for bound in binding.all_nodes() for key in bound.keys.values()]


def _script_keys(binding: Binding) -> Iterator[str]:
    for bound in binding.all_nodes():
        for _, script in bound.scripts():
            yield from (use.name for use in name_uses(script) if use.name.startswith("@"))
