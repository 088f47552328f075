"""Readable messages for the errors of ROS about its arguments and names."""

import re
from collections.abc import Iterator
from contextlib import contextmanager

from rclpy.exceptions import NameValidationException
from rclpy.impl.implementation_singleton import rclpy_implementation as _rcl

from sar_compiler.errors import SarError


class RosArgumentError(SarError):
    """ROS arguments, or a parameter file among them, that ROS does not accept."""


@contextmanager
def readable_ros_errors() -> Iterator[None]:
    """Convert errors of ROS about its arguments and names, raised in the block, to readable ones.

    Raises:
        RosArgumentError: Instead of rclpy's own errors.
    """
    try:
        yield
    except _rcl.UnknownROSArgsError as error:
        unknown = ", ".join(re.findall(r"'([^']*)'", str(error))) or str(error)
        message = (
            f"not a ROS argument: {unknown} (what follows --ros-args is ROS's, up to a --; "
            "a parameter is given with -p name:=value)"
        )
        raise RosArgumentError(message) from error
    except (_rcl.RCLError, _rcl.RCUtilsError, NameValidationException) as error:
        raise RosArgumentError(_in_words(str(error))) from error


_FORMS = {
    "parameter override rule": "a parameter is given as name:=value, and a list holds values of one type",
    "remap rule": "a name is replaced by from:=to, a node's by __node:=name, the namespace by __ns:=/name",
    "log level": "a level is debug, info, warn, error or fatal, or logger:=level",
}


def _in_words(text: str) -> str:
    """Return a readable text for an error of rcl, without the places in rcl's source code."""
    text = re.sub(r"(, at /\S+:\d+)+$", "", text.strip())
    text = re.sub(r"\s*, at /\S+:\d+", "", text).removeprefix("failed to initialize rcl: ")
    trailing = re.search(r"Couldn't parse trailing (\S+) flag", text)
    if trailing:
        return f"{trailing[1]} needs a value after it"
    rule = re.search(r"Couldn't parse ([a-z ]+): '(.*?)'\. Error: (.*)", text, re.DOTALL)
    if rule is None:
        return f"ROS does not accept its arguments: {' '.join(text.split())}"
    kind, given, reason = rule[1], rule[2], " ".join(rule[3].split())
    in_name = _wrong_in_remap(given.partition(" ")[2]) if kind == "remap rule" else None
    return f"'{given}' is not understood: {in_name or _FORMS.get(kind, reason)}"


# The patterns that rcl refuses in the new name of a rule, besides single characters.
_FAULTS = {
    r"^$": "there is no name after :=",
    r"(^|/)\d": "a name, and each part of it between slashes, begins with a letter or _",
    r"//|/$": "there is no name between or after slashes",
    r"__": "no name has two underscores one after the other",
}


def _wrong_in_remap(rule: str) -> str | None:
    """Return which name of `from:=to` is invalid for ROS, and why; None if the form itself is wrong."""
    old, assigned, new = rule.partition(":=")
    if not assigned or not old:
        return None
    what = old.rpartition(":")[2]  # without the node that the rule is for
    if what == "__ns" and new and not new.startswith("/"):
        return f"a namespace begins with a slash: {old}:=/{new.removeprefix('~/')}"
    if what in ("__node", "__name") and "/" in new:
        return "a node's name has no slash: its namespace is given with __ns:=/name"
    wrong = re.search(r"[^A-Za-z0-9_/]", re.sub("[~*:]", "", old) + new.removeprefix("~"))
    if wrong:
        return f"'{wrong[0]}' is not allowed in a name: letters, digits, _ and /"
    return next((words for fault, words in _FAULTS.items() if re.search(fault, new)), None)
