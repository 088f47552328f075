"""Errors of the project's own: what fails on one tree becomes a finding about that tree, and everything else goes on."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from types import FrameType

from sar_compiler.errors import SarError
from sar_compiler.nodes.constructors import RegistrationError
from sar_compiler.tree.diagnostic import Diagnostic
from sar_compiler.tree.model import Element
from sar_compiler.tree.source import Source, Span
from sar_compiler.tree.synthetic import NO_SPANS

_EXPECTED = (SarError, ImportError, OSError, UnicodeEncodeError)
"""What commands have a message for: wrong use, what is not installed, and output that cannot be written."""

_HINT = (
    "the check is at fault, not the file: please report it, with the file and what sar-compile --version says"
)
_CLASS_HINT = "mend the class; nothing else that depends on this node is checked"
_START = Span(1, 1, 1, 1)


def failure_of_rule(
    name: str, error: Exception, default: Element, found: Iterable[Diagnostic]
) -> Iterator[Diagnostic]:
    """Yield the finding that a rule has failed, or that a user's class has.

    Args:
        name: The rule's name.
        error: What it raised.
        default: The element that is named where it is not known which one the rule was looking at.
        found: What was found so far: what fails in the same place for several rules, which all need it, is told once.

    Raises:
        Exception: The error itself, if commands have a message for it.
    """
    element = _looked_at(error) or default
    if isinstance(error, RegistrationError):
        told = str(error)
        finding = element.finding("faulty-class", told, hint=_CLASS_HINT)
    elif isinstance(error, _EXPECTED):
        raise error
    else:
        told = _told(error)
        message = f"the rule {name} failed here: {told}"
        finding = element.finding("internal-error", message, hint=_HINT)
    said = (each.message for each in found if each.code == finding.code)
    if not any(message == finding.message or message.endswith(told) for message in said):
        yield finding


def failure_of_file(path: Path, error: Exception, what: str = "check") -> Diagnostic:
    """Return the finding that something else than a rule has failed on a file.

    Args:
        path: The file.
        error: What was raised.
        what: What has failed.

    Raises:
        Exception: The error itself, if commands have a message for it.
    """
    if isinstance(error, _EXPECTED):
        raise error
    message = f"the {what} of this file failed: {_told(error)}"
    return Diagnostic("internal-error", message, Source(str(path), "", NO_SPANS), _START, hint=_HINT)


def _told(error: Exception) -> str:
    """Return an error with the place in the sources that it comes from."""
    last = [*_calls(error)][-1]
    place = f"{Path(last.f_code.co_filename).name}, in {last.f_code.co_name}"
    return f"{type(error).__name__}: {error} ({place})"


def _looked_at(error: Exception) -> Element | None:
    """Return the element that was looked at when an error was raised: that of the innermost call that has one."""
    values = (value for frame in reversed([*_calls(error)]) for value in frame.f_locals.values())
    elements = (value if isinstance(value, Element) else getattr(value, "element", None) for value in values)
    return next((each for each in elements if isinstance(each, Element)), None)


def _calls(error: Exception) -> Iterator[FrameType]:
    """Yield the calls that an error came through, the innermost last."""
    step = error.__traceback__
    while step is not None:
        yield step.tb_frame
        step = step.tb_next
