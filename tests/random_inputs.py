"""The number of random inputs that tests try: some in every run, many more in `make soak`."""

import os

TIMES = float(os.environ.get("SAR_ROUNDS", "1"))
"""The factor compared with a normal run."""


def rounds(count: int) -> int:
    """Return the number of random inputs to try, from the number in a normal run."""
    return max(1, round(count * TIMES))
