"""Timers of which nothing is known but that each is up one day."""

from collections.abc import Hashable

from sar_compiler.checks.verify.choices import Choices
from sar_compiler.checks.verify.trail import Trail

_STARTED, _UP = 1, 2


class Timers:
    """Timers of which each may be up at any look, or at a later one.

    Args:
        choices: Decide whether a timer is up.
        trail: Is told what is waited for; the bit of a timer is that of its node.
    """

    def __init__(self, choices: Choices, trail: Trail) -> None:
        self._choices = choices
        self._trail = trail

    def start(self, index: int, seconds: float) -> Hashable:
        """Start a timer; one without any time is up at once."""
        self._trail.changed |= 1 << index
        return _STARTED if seconds > 0 else _UP

    def is_up(self, index: int, token: int) -> bool:
        """Choose whether a timer is up."""
        if token == _UP or self._choices.pick(2) == 1:
            self._trail.changed |= 1 << index
            return True
        self._trail.going_on |= 1 << index
        return False

    def remaining(self, index: int, token: int) -> float:  # noqa: ARG002 - as the protocol has it
        """Return 0: nobody knows how long it takes."""
        return 0.0
