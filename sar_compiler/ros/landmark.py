"""What a mission shows of itself on a map; no ROS is needed for it."""

from typing import NamedTuple


class Landmark(NamedTuple):
    """A place that a mission shows on the map.

    Attributes:
        kind: What it is, in a word: `zone`, `survivor`, `base`; markers of a kind have a namespace of their own in RViz.
        name: Its name.
        x: Position in the frame `map`, metres.
        y: Position in the frame `map`, metres.
        state: Its state in a word, which is shown beside the name; empty for none.
        level: How the state is coloured: 0 still to come, 1 in hand, 2 done, 3 given up or wrong.
    """

    kind: str
    name: str
    x: float
    y: float
    state: str = ""
    level: int = 0
