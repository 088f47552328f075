"""The possible answers of a leaf to a tick, as plain data, for runs without a robot."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

Fact: TypeAlias = bool | int | float | str
"""The types of a fact."""

STATUSES = ("SUCCESS", "FAILURE", "RUNNING", "SKIPPED")
"""The statuses of an answer, the usual ones first."""


@dataclass(frozen=True)
class Answer:
    """One possible answer of a leaf to a tick.

    In the scripts, and in the names of facts, `{self}` stands for the node's name as an identifier, and
    `{parameter}` for that of the node that a reference parameter refers to. In the scripts it also stands for
    the value of a parameter that is a whole number.

    Attributes:
        status: `SUCCESS`, `FAILURE`, `RUNNING` or `SKIPPED`.
        label: What it means, in a word or two: "found", "refused"; empty for the status's own name.
        when: A script over facts; the answer is possible only if it is true. Empty: always.
        then: A script that changes facts when the answer is given.
    """

    status: str
    label: str = ""
    when: str = ""
    then: str = ""

    @property
    def name(self) -> str:
        """Its label, or else its status."""
        return self.label or self.status


def nominal(options: Sequence[Answer]) -> Answer:
    """Return the first answer that is not RUNNING, or else the first one."""
    return next((answer for answer in options if answer.status != "RUNNING"), options[0])
