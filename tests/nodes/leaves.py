"""A module of leaves like a user would write it."""

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from sar_compiler.leaves import Kind, Use, register
from sar_compiler.runtime.context import mission_context


@mission_context(preview=lambda: Radio("preview"))
class Radio:
    def __init__(self, channel: str) -> None:
        self.channel = channel


@register(
    "Say",
    kind=Kind.ACTION,
    outcomes={Status.SUCCESS, Status.FAILURE},
    effects="speaks",
    uses=[Use.service("{service}")],
)
class Say(Behaviour):
    """Say something.

    More details, which are no part of the description.

    Args:
        name: The node's name.
        message: What to say;
            it may be long.
        times: How often.
    """

    def __init__(
        self,
        name: str,
        message: str,
        radio: Radio,
        times: int = 1,
        after: "Listen | None" = None,
        spare: Radio | None = None,
        service: str = "speak",
    ) -> None:
        super().__init__(name)
        self.given = {"message": message, "radio": radio, "times": times, "after": after, "spare": spare}

    def update(self) -> Status:
        return Status.SUCCESS


@register("Listen", kind=Kind.CONDITION)
class Listen(Behaviour):
    """Listen."""

    def __init__(self, name: str, to: Say) -> None:
        super().__init__(name)
        self.to = to

    def update(self) -> Status:
        return Status.SUCCESS


class Unmarked(Say):
    """A subclass of a registered leaf, which is not registered itself."""
