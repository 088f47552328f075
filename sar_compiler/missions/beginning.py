"""Beginning a run: what the parameters of its node say of the mission, of the run and of the tree."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from sar_compiler.missions.choosing import mission_of
from sar_compiler.missions.faults import NAVIGATION_FAULTS, Fault, parse_fault
from sar_compiler.missions.mission import Mission, MissionRun
from sar_compiler.missions.parameter_file import read_parameter_file
from sar_compiler.missions.parameter_reader import (
    RUN_PARAMETER_NAMES,
    ParameterReader,
    RunParameters,
    lookalikes,
    read_run,
    unread_files,
)
from sar_compiler.nodes.binding.bound import Binding
from sar_compiler.opener import admit
from sar_compiler.project.project_tree import ProjectTree
from sar_compiler.runtime.expressions import name_uses

# The node of a tree that belongs to no mission.
_PLAIN_NODE_NAME = "sar_run"


class Beginning(NamedTuple):
    """The beginning of a run.

    Attributes:
        mission: The run of the mission; of a tree that belongs to none, one that has nothing of its own.
        parameters: The parameters that any run has.
        notes: What is surprising about the parameters, such as a name like one that is read.
    """

    mission: MissionRun
    parameters: RunParameters
    notes: tuple[str, ...]


def node_name(mission: Mission | None) -> str:
    """Return the name of the node on which a mission runs."""
    return mission.name if mission is not None else _PLAIN_NODE_NAME


def begin_run(mission: Mission | None, reader: ParameterReader, binding: Binding) -> Beginning:
    """Begin a run.

    Args:
        mission: The mission; None for a tree that belongs to none.
        reader: The parameters of the node.
        binding: The tree.

    Raises:
        ParameterError: If there are mistakes in the parameters; has all of them.
    """
    run = mission.begin(reader) if mission is not None else MissionRun()
    parameters = read_run(reader)
    reader.complain()
    if mission is not None and (unlisted := reader.files.keys() - set(mission.path_parameters)):
        raise TypeError(
            f"the mission '{mission.name}' reads the file of {min(unlisted)}: list it in path_parameters"
        )
    own = mission.parameter_names if mission is not None else ()
    keys = (key.removeprefix("@") for key in (*_keys(binding), *_script_keys(binding)))
    names = (*RUN_PARAMETER_NAMES, *own, *keys)
    slips = lookalikes(reader.parameters, names, reader.place_of)
    return Beginning(run, parameters, (*slips, *unread_files(reader, names), *reader.notes))


class FileStart(NamedTuple):
    """What a parameter file says of the runs of a tree, read without ROS.

    Attributes:
        parameters: What the file says, by the names of the parameters.
        reader: What was read of it, and of the files that it names.
        beginning: The beginning of a run with it.
    """

    parameters: dict[str, object]
    reader: ParameterReader
    beginning: Beginning


def begin_without_ros(tree: ProjectTree, params: Path | None, binding: Binding) -> FileStart:
    """Begin a run of a loaded tree with the parameters of a file, without ROS.

    Raises:
        ParameterFileError: If ROS would refuse or misread the file.
        ParameterError: If the mission cannot begin with the parameters.
    """
    mission = mission_of(tree, binding)
    node = f"/{node_name(mission)}"
    values = read_parameter_file(params, node) if params is not None else {}
    reader = ParameterReader.of_files(values, [] if params is None else [params], node)
    return FileStart(values, reader, begin_run(mission, reader, binding))


def read_parameters(
    tree: ProjectTree, params: Path | None = None, tree_id: str | None = None
) -> ParameterReader:
    """Return the parameters with which `sar-run` runs a tree, and the files that they name, read without ROS.

    Args:
        tree: The tree.
        params: The parameter file; by default that of the mission, if it has one.
        tree_id: The tree in the file; by default the one that the file executes.

    Raises:
        TreeError: If there are errors.
        ParameterFileError, ParameterError: If the mission cannot begin with the parameters.
    """
    binding = tree.binding(tree_id)
    mission = mission_of(tree, binding)
    if params is None and mission is not None:
        params = mission.default_parameters()
        if params is not None:
            admit(params)
    return begin_without_ros(tree, params, binding).reader


def parse_faults(texts: Iterable[str], mission: Mission | None) -> list[Fault]:
    """Return faults as `--fault` has them, of the robot's navigation or of the mission's servers.

    Raises:
        FaultError: If there is no such fault.
    """
    targets = {**(mission.faults if mission is not None else {}), **NAVIGATION_FAULTS}
    return [parse_fault(text, targets) for text in texts]


def path_parameters(mission: Mission | None, binding: Binding) -> set[str]:
    """Return the parameters that are paths of files: those of the mission, and those that leaves have for a path (`{@photos}`)."""
    ports = (
        key.removeprefix("@")
        for bound in binding.nodes()
        for name, key in bound.keys.items()
        if key.startswith("@") and bound.spec.parameters[name].value_type.python is Path
    )
    return {*(mission.path_parameters if mission is not None else ()), *ports}


def fixed_parameters(mission: Mission | None, binding: Binding) -> set[str]:
    """Return the parameters that are read before the start and never again, or what they stand below."""
    own = mission.parameter_names if mission is not None else ()
    names = (*RUN_PARAMETER_NAMES, *own, *(key for key in _keys(binding) if key.startswith("@")))
    return {"use_sim_time", *(name.removeprefix("@").partition(".")[0] for name in names)}


def _keys(binding: Binding) -> list[str]:
    return [key for bound in binding.nodes() for key in bound.keys.values()]


def _script_keys(binding: Binding) -> Iterator[str]:
    for bound in binding.nodes():
        for _, script in bound.scripts():
            yield from (use.name for use in name_uses(script) if use.name.startswith("@"))
