"""Named numbers in scripts."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from sar_compiler.runtime.context import mission_context


@mission_context
@dataclass(frozen=True)
class Enums:
    """The names of enumerations that scripts and Switch may use.

    Attributes:
        numbers: The number that each name stands for.
    """

    numbers: Mapping[str, int] = field(default_factory=dict)
