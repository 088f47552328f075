"""BehaviorTree.CPP: differences between its versions, and conversion of trees to it."""

from typing import NamedTuple


class Version(NamedTuple):
    """A version of BehaviorTree.CPP, without the patch number."""

    major: int
    minor: int

    def __str__(self) -> str:
        """Return the version in the usual notation: `4.10`."""
        return f"{self.major}.{self.minor}"


VERSIONS = {str(version): version for version in (Version(4, 8), Version(4, 9), Version(4, 10))}
"""The known versions. Version 4.8 means 4.8.0 to 4.8.3, because 4.8.4 checks names in the same way as 4.9."""
OLDEST, NEWEST = min(VERSIONS.values()), max(VERSIONS.values())


class VersionChange(NamedTuple):
    """A change of BehaviorTree.CPP's behaviour.

    Attributes:
        since: The first version with the change.
        release: The first release with the change, including the patch number.
    """

    since: Version
    release: str


NAMES = VersionChange(Version(4, 9), "4.8.4")
"""Rejects spaces and some characters in tree IDs, compact tags and port names, the ID Root, and equally named subtrees."""
QUOTES = VersionChange(Version(4, 9), "4.9.0")
"""Rejects strings in double quotation marks in scripts."""
ORDER = Version(4, 9)
"""Evaluates sums and products, and `|` and `^`, from the left in scripts.

Older versions read `a - b + c` as `a - (b + c)`.
"""
OPERATORS = Version(4, 9)
"""Allows mixed operators, chained `?:` and chained assignments in scripts; `&&` binds stronger than `||`."""
STATEMENTS = Version(4, 9)
"""Allows two statements of a script without a `;` between them. Older versions require the `;`."""
NUMBERS = VersionChange(Version(4, 9), "4.9.1")
"""Reads a constant for a subtree as a number if it looks like one. Older versions read it as a string."""
LISTS = VersionChange(Version(4, 9), "4.9.0")
"""Accepts a list from another port as the queue of a loop, because the queue has no type.

Older versions reject the port.
"""

BUILT_IN = frozenset(
    {
        *(
            "AlwaysFailure",
            "AlwaysSuccess",
            "AsyncFallback",
            "AsyncSequence",
            "Delay",
            "Fallback",
            "ForceFailure",
        ),
        *(
            "ForceSuccess",
            "IfThenElse",
            "Inverter",
            "KeepRunningUntilFailure",
            "LoopBool",
            "LoopDouble",
            "LoopInt",
        ),
        *(
            "LoopString",
            "Parallel",
            "ParallelAll",
            "Precondition",
            "ReactiveFallback",
            "ReactiveSequence",
            "Repeat",
        ),
        *("RetryUntilSuccessful", "RunOnce", "Script", "ScriptCondition", "Sequence", "SequenceWithMemory"),
        *(
            "SetBlackboard",
            "SkipUnlessUpdated",
            "Sleep",
            "SubTree",
            "Switch2",
            "Switch3",
            "Switch4",
            "Switch5",
        ),
        *(
            "Switch6",
            "Timeout",
            "TryCatch",
            "UnsetBlackboard",
            "WaitValueUpdate",
            "WasEntryUpdated",
            "WhileDoElse",
        ),
    }
)
"""The nodes that BehaviorTree.CPP 4.10 registers."""

DROPS_EXPLICIT = "ReactiveSequence"
"""The control whose direct children BehaviorTree.CPP 4.7 to 4.10 do not recognise in explicit form."""
