"""BehaviorTree.CPP: what differs between its versions; conversion of trees to it."""

from typing import NamedTuple


class Version(NamedTuple):
    """A version of BehaviorTree.CPP, without the number of the release."""

    major: int
    minor: int

    def __str__(self) -> str:
        """Return it as it is written: `4.10`."""
        return f"{self.major}.{self.minor}"


VERSIONS = {str(version): version for version in (Version(4, 8), Version(4, 9), Version(4, 10))}
"""The known versions; 4.8 stands for 4.8.0 to 4.8.3, since 4.8.4 judges names as 4.9 does."""
OLDEST, NEWEST = min(VERSIONS.values()), max(VERSIONS.values())


class VersionChange(NamedTuple):
    """Something that BehaviorTree.CPP does otherwise since a version.

    Attributes:
        since: The version.
        release: The very release.
    """

    since: Version
    release: str


NAMES = VersionChange(Version(4, 9), "4.8.4")
"""IDs of trees, compact tags and names of ports with blanks and some other characters, the ID Root, and two subtrees of one name are refused."""
QUOTES = VersionChange(Version(4, 9), "4.9.0")
"""Texts of scripts in double quotation marks are refused."""
ORDER = Version(4, 9)
"""Since then sums, products, and `|` with `^`, are worked out from the left in scripts; before, `a - b + c` was `a - (b + c)`."""
OPERATORS = Version(4, 9)
"""Since then operators of scripts mix, `?:` and assignments can be chained, and `&&` comes before `||`."""
STATEMENTS = Version(4, 9)
"""Since then two statements of a script need no `;` between them; before, it was refused without one."""
NUMBERS = VersionChange(Version(4, 9), "4.9.1")
"""A constant that is given to a subtree and looks like a number is one; before, it was a text."""
LISTS = VersionChange(Version(4, 9), "4.9.0")
"""The queue of a loop has no type, so that it takes a list that a port has written; before, such a port was refused."""

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
"""The nodes that BehaviorTree.CPP 4.10 registers by itself."""

DROPS_EXPLICIT = "ReactiveSequence"
"""The control in which BehaviorTree.CPP 4.7 to 4.10 do not find nodes in explicit form that are its direct children."""
