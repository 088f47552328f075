"""How much work goes into trying the runs of tree files."""

WORK = 1 << 24
"""The default budget for a file: some 80,000 ticks of 10 nodes, or 4,000 of 4,000."""
_FILES_TRIED = 10
"""For how many files there is so much work; of more files less is tried of each, down to a sixteenth."""


def work_for(files: int) -> int:
    """Return how much is tried of each of so many files: the same in any order, and on any number of processors."""
    return min(WORK, max(WORK * _FILES_TRIED // max(files, 1), WORK // 16))
