"""A common subsequence of two lists."""

import bisect
from collections import Counter, defaultdict
from collections.abc import Hashable, Sequence
from typing import NamedTuple

_NEAR = 8
"""For a repeated key, the number of places that are tried on either side of the expected one."""


class _Link(NamedTuple):
    pair: tuple[int, int]
    before: "_Link | None"


def common_subsequence(
    old: Sequence[Hashable | None], new: Sequence[Hashable | None]
) -> list[tuple[int, int]]:
    """Return the indexes in both lists of a long common subsequence.

    It is the longest one unless a key is repeated very often; the time grows little more than the lists
    (the method of Hunt and Szymanski).

    Args:
        old: The keys of one list; None equals nothing.
        new: The keys of the other.
    """
    head = _common_head(old, new)
    tail = _common_head(old[head:][::-1], new[head:][::-1])
    middle = _chained(old[head : len(old) - tail], new[head : len(new) - tail])
    return [
        *((index, index) for index in range(head)),
        *((head + i, head + j) for i, j in middle),
        *((len(old) - tail + index, len(new) - tail + index) for index in range(tail)),
    ]


def _common_head(old: Sequence[Hashable | None], new: Sequence[Hashable | None]) -> int:
    count = 0
    for one, other in zip(old, new, strict=False):
        if one is None or one != other:
            break
        count += 1
    return count


def _chained(old: Sequence[Hashable | None], new: Sequence[Hashable | None]) -> list[tuple[int, int]]:
    places: dict[Hashable, list[int]] = defaultdict(list)
    for j, key in enumerate(new):
        if key is not None:
            places[key].append(j)
    met: Counter[Hashable] = Counter()
    # By the length of a chain: the earliest place where one of that length can end, and that chain.
    ends: list[int] = []
    chains: list[_Link] = []
    for i, key in enumerate(old):
        if key is None or key not in places:
            continue
        nth = met[key]
        met[key] += 1
        # From the last to the first, so that no chain takes two places for one key.
        for j in reversed(places[key][max(nth - _NEAR, 0) : nth + _NEAR + 1]):
            length = bisect.bisect_left(ends, j)
            link = _Link((i, j), chains[length - 1] if length else None)
            ends[length : length + 1] = [j]
            chains[length : length + 1] = [link]
    pairs: list[tuple[int, int]] = []
    last = chains[-1] if chains else None
    while last is not None:
        pairs.append(last.pair)
        last = last.before
    return pairs[::-1]
