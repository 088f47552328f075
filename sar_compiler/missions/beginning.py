"""Beginning a run: what the parameters of its node say of the mission, of the run and of the tree."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from sar_compiler.missions.mission import Mission, MissionRun
from sar_compiler.nodes.binding.bound import Binding
from sar_compiler.ros.faults import NAVIGATION_FAULTS, Fault, parse_fault
from sar_compiler.ros.parameter_reader import (
    RUN_PARAMETER_NAMES,
    ParameterReader,
    RunParameters,
    lookalikes,
    read_run,
    unread_files,
)
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
