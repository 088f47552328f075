"""Split and compose command lines with ROS arguments, and explain the errors that ROS reports about these arguments."""

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from sar_compiler.errors import SarError

_BEGIN, _END = "--ros-args", "--"
_FILE_FLAG = "--params-file"
_PARAMETER_FLAGS = ("-p", "--param")
_REMAP_FLAGS = ("-r", "--remap")
_ENCLAVE_FLAGS = ("-e", "--enclave")


@dataclass(frozen=True)
class SplitArguments:
    """A command line, split into the command's arguments and ROS arguments.

    Attributes:
        own: The command's own arguments.
        ros: The ROS arguments, without the enclosing `--ros-args` and `--`.
    """

    own: list[str]
    ros: list[str]


def split_arguments(argv: Sequence[str]) -> SplitArguments:
    """Split a command line: the arguments from `--ros-args` to `--`, or to the end, belong to ROS."""
    own: list[str] = []
    ros: list[str] = []
    inside = False
    for argument in argv:
        if argument == _BEGIN:
            inside = True
        elif inside and argument == _END:
            inside = False
        else:
            (ros if inside else own).append(argument)
    return SplitArguments(own, ros)


def init_arguments(ros: Sequence[str], params_file: Path | None = None) -> list[str]:
    """Return the arguments for `rclpy.init`.

    Args:
        ros: The user's ROS arguments, without `--ros-args`.
        params_file: A parameter file that is applied before the user's arguments.

    Raises:
        UnreadableFileError: If a parameter file does not exist or cannot be read.
        ParameterFileError: If ROS would reject or misread a parameter file, including files in the user's arguments.
    """
    first = [] if params_file is None else [_FILE_FLAG, str(params_file)]
    arguments = [*first, *ros]
    for file in parameter_files(arguments):
        from sar_compiler.missions.parameter_file import check_parameter_file

        check_parameter_file(file)
    for_process = _without_node_names(arguments)
    return [_BEGIN, *for_process] if for_process else []


def parameter_files(ros: Sequence[str], params_file: Path | None = None) -> list[Path]:
    """Return the parameter files in the order in which ROS applies them.

    The file *params_file* comes first, followed by the files in the ROS arguments.
    """
    first = [] if params_file is None else [params_file]
    return first + [Path(value) for flag, value in pairwise(ros) if flag == _FILE_FLAG]


def node_arguments(ros: Sequence[str]) -> list[str]:
    """Return the arguments for the mission's node, in addition to the arguments of `rclpy.init`.

    An argument `-p name:=value` must override an earlier parameter file. If it were an argument of the whole process, it would belong to
    the section `/**`, and a section with the node's name in a file would override it. A node's own arguments are applied last.

    A new node name (`-r __node:=name`) is only meant for this node. If it were an argument of the whole process, it would also rename the
    other nodes in the process, such as the servers and the simulator.
    """
    last_file = max((index for index, argument in enumerate(ros) if argument == _FILE_FLAG), default=-1)
    rules: list[str] = []
    for index, (flag, rule) in enumerate(pairwise(ros)):
        if (flag in _PARAMETER_FLAGS and index > last_file) or _names_nodes(flag, rule):
            rules += [flag, rule]
    return [_BEGIN, *rules] if rules else []


def security_arguments(ros: Sequence[str]) -> list[str]:
    """Return the ROS arguments that select the SROS 2 enclave, for use by another process of the mission."""
    return [part for flag, value in pairwise(ros) if flag in _ENCLAVE_FLAGS for part in (flag, value)]


def _names_nodes(flag: str, rule: str) -> bool:
    return flag in _REMAP_FLAGS and rule.startswith(("__node:=", "__name:="))


def _without_node_names(arguments: Sequence[str]) -> list[str]:
    pairs = enumerate(pairwise(arguments))
    left_out = {place for index, pair in pairs if _names_nodes(*pair) for place in (index, index + 1)}
    return [argument for index, argument in enumerate(arguments) if index not in left_out]


class RosArgumentError(SarError):
    """Raised if ROS has rejected a ROS argument or a parameter file."""


@contextmanager
def convert_ros_errors() -> Iterator[None]:
    """Convert rclpy's errors about arguments and names to readable errors.

    Raises:
        RosArgumentError: If rclpy raises an error about an argument or a name.
    """
    from rclpy.exceptions import NameValidationException
    from rclpy.impl.implementation_singleton import rclpy_implementation as rcl

    try:
        yield
    except rcl.UnknownROSArgsError as error:
        unknown = ", ".join(re.findall(r"'([^']*)'", str(error))) or str(error)
        raise RosArgumentError(
            f"unknown ROS argument: {unknown} (all arguments between --ros-args and -- are ROS arguments). "
            "Write a parameter as -p name:=value"
        ) from error
    except (rcl.RCLError, rcl.RCUtilsError, NameValidationException) as error:
        raise RosArgumentError(_readable_error(str(error))) from error


_FORMS = {
    "parameter override rule": "write a parameter as name:=value. All values of a list must have the same type",
    "remap rule": "write from:=to for a name, __node:=name for a node name, or __ns:=/name for a namespace",
    "log level": "write debug, info, warn, error or fatal, or logger:=level",
}


def _readable_error(text: str) -> str:
    """Return a readable message for an error message of rcl, without locations in rcl's source code."""
    text = re.sub(r"(, at /\S+:\d+)+$", "", text.strip())
    text = re.sub(r"\s*, at /\S+:\d+", "", text).removeprefix("failed to initialize rcl: ")
    trailing = re.search(r"Couldn't parse trailing (\S+) flag", text)
    if trailing:
        return f"{trailing[1]} must be followed by a value"
    rule = re.search(r"Couldn't parse ([a-z ]+): '(.*?)'\. Error: (.*)", text, re.DOTALL)
    if rule is None:
        return f"the ROS arguments are invalid: {' '.join(text.split())}"
    kind, given, reason = rule[1], rule[2], " ".join(rule[3].split())
    in_name = _wrong_in_remap(given.partition(" ")[2]) if kind == "remap rule" else None
    return f"'{given}' is invalid: {in_name or _FORMS.get(kind, reason)}"


# The patterns that rcl rejects in the new name of a remap rule, in addition to single characters.
_FAULTS = {
    r"^$": "a name is missing after :=",
    r"(^|/)\d": "each part of a name between slashes must begin with a letter or _",
    r"//|/$": "a name is missing between or after slashes",
    r"__": "a name cannot contain two consecutive underscores",
}


def _wrong_in_remap(rule: str) -> str | None:
    """Describe the wrong name in a remap rule `from:=to`. Return None if the rule has the wrong syntax."""
    old, assigned, new = rule.partition(":=")
    if not assigned or not old:
        return None
    what = old.rpartition(":")[2]  # without the name of the node to which the rule applies
    if what == "__ns" and new and not new.startswith("/"):
        return f"a namespace must begin with a slash: {old}:=/{new.removeprefix('~/')}"
    if what in ("__node", "__name") and "/" in new:
        return "a node name cannot contain a slash: set the namespace with __ns:=/name"
    wrong = re.search(r"[^A-Za-z0-9_/]", re.sub("[~*:]", "", old) + new.removeprefix("~"))
    if wrong:
        return f"'{wrong[0]}' is not allowed in a name: use letters, digits, _ and /"
    return next((words for fault, words in _FAULTS.items() if re.search(fault, new)), None)
