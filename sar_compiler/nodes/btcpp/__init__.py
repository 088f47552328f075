"""BehaviorTree.CPP: differences between its versions, and conversion of trees to it."""

from typing import NamedTuple


class Version(NamedTuple):
    """A version of BehaviorTree.CPP, without the patch number."""

    major: int
    minor: int

    def __str__(self) -> str:
        """Return it as usually written: `4.10`."""
        return f"{self.major}.{self.minor}"


VERSIONS = {str(version): version for version in (Version(4, 8), Version(4, 9), Version(4, 10))}
"""The known versions; 4.8 means 4.8.0 to 4.8.3, since 4.8.4 checks names like 4.9."""
OLDEST, NEWEST = min(VERSIONS.values()), max(VERSIONS.values())


class VersionChange(NamedTuple):
    """A change of BehaviorTree.CPP's behaviour.

    Attributes:
        since: The first version with the change.
        release: The exact release.
    """

    since: Version
    release: str


NAMES = VersionChange(Version(4, 9), "4.8.4")
"""Rejected: blanks and some characters in tree IDs, compact tags and port names, the ID Root, and two subtrees of one name."""
QUOTES = VersionChange(Version(4, 9), "4.9.0")
"""Rejected: strings in double quotation marks in scripts."""
ORDER = Version(4, 9)
"""Sums, products, and `|` with `^`, are evaluated from the left in scripts; before, `a - b + c` was `a - (b + c)`."""
OPERATORS = Version(4, 9)
"""Operators of scripts can be mixed, `?:` and assignments can be chained, and `&&` binds stronger than `||`."""
STATEMENTS = Version(4, 9)
"""Two statements of a script need no `;` between them; before, it was required."""
NUMBERS = VersionChange(Version(4, 9), "4.9.1")
"""A constant for a subtree that looks like a number is a number; before, it was a string."""
LISTS = VersionChange(Version(4, 9), "4.9.0")
"""The queue of a loop has no type, so a list from another port is accepted; before, such a port was rejected."""

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
"""The control in which BehaviorTree.CPP 4.7 to 4.10 do not recognise nodes in explicit form that are direct children."""
