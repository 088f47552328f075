"""How many random inputs the tests try: some in every run, many more in `make soak`."""

import os

TIMES = float(os.environ.get("SAR_ROUNDS", "1"))
"""How many times as many as in every run."""


def rounds(count: int) -> int:
    """Return how many random inputs to try where every run tries so many."""
    return max(1, round(count * TIMES))
