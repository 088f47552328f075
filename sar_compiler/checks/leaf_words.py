"""The words for leaves in files beside a tree: their names, answers and effects."""

import functools
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

from sar_compiler.checks.conditions import Names, names_of, slips
from sar_compiler.checks.typed_values import script
from sar_compiler.compiler.simulated_tree import SimulatedTree, fits
from sar_compiler.documents.located import Document, Value
from sar_compiler.nodes.spec import NodeSpec
from sar_compiler.runtime.answers import STATUSES
from sar_compiler.runtime.expressions import Script
from sar_compiler.runtime.stub_leaf import ANSWERED, HALTED, STARTED, Event, StubLeaf
from sar_compiler.tree.guessing import nearest

STARTS = "starts"
_DEEDS = {STARTS: STARTED, HALTED: HALTED}


@dataclass(frozen=True)
class EventPattern:
    """Something that leaves can do, as a file says it: `DetectSurvivor found`.

    Attributes:
        text: How it is written.
        leaves: The leaves that are meant.
        what: `STARTED`, `ANSWERED` or `HALTED`.
        answer: For `ANSWERED`: the label or the status.
    """

    text: str
    leaves: tuple[StubLeaf, ...]
    what: str
    answer: str = ""

    def matches(self, event: Event) -> bool:
        """Return whether an event matches this pattern."""
        if event.what != self.what or event.leaf not in self.leaves:
            return False
        return event.answer is None or self.answer in (event.answer.label, event.answer.status)


class LeafWords:
    """The words for the leaves of one tree, and for what conditions ask of it."""

    def __init__(self, simulated: SimulatedTree) -> None:
        self.leaves = simulated.leaves
        self._simulated = simulated
        self._origins = simulated.compiled.origins

    @functools.cached_property
    def names(self) -> Names:
        """The names that conditions know."""
        return names_of(self._simulated)

    def spec(self, leaf: StubLeaf) -> NodeSpec:
        """Return what the registry or a model says of a leaf."""
        return self._origins[leaf.id].bound.spec

    def named(self, key: str) -> tuple[StubLeaf, ...]:
        """Return the leaves that a key names: a path, a name or a tag."""
        return tuple(leaf for leaf in self.leaves if fits(key, leaf.path, leaf.tag))

    def find(self, document: Document, value: Value) -> tuple[StubLeaf, ...]:
        """Return the leaves that a value names; reports one that names none."""
        key = value.text or ""
        found = self.named(key)
        if not found:
            self._report_unknown(document, value, key)
        return found

    def answer(self, document: Document, value: Value, leaves: Sequence[StubLeaf]) -> str | None:
        """Return a label or a status that each of some leaves can answer; reports anything else."""
        text, known = value.text or "", words_of(leaves)
        if text not in known:
            message = f"'{leaves[0].name}' never answers '{text}'; it answers {', '.join(known)}"
            document.report("unknown-answer", message, value, suggestion=nearest(text, known))
            return None
        return text

    def condition(
        self, document: Document, value: Value | None, own: Collection[str], later: Collection[str] = ()
    ) -> Script | None:
        """Return a condition; reports what is wrong with it.

        Args:
            document: The file.
            value: The condition; None if none is written.
            own: The names of what is known of the run itself.
            later: The names of what is known of it only when a tick is over.
        """
        condition = script(document, value)
        if condition is None or value is None:
            return None
        found = list(slips(condition, self.names, own, later))
        for slip in found:
            code = "wrong-condition" if slip.hint else "unknown-fact"
            document.report(code, slip.message, value, slip.place, suggestion=slip.suggestion, hint=slip.hint)
        return None if found else condition

    def deed(self, document: Document, value: Value) -> EventPattern | None:
        """Return what leaves are said to do; reports a text that says nothing of the kind."""
        text = value.text or ""
        words = text.split(" ")
        for count in range(len(words) - 1, 0, -1):
            key, rest = " ".join(words[:count]), " ".join(words[count:])
            leaves = self.named(key)
            if leaves:
                return self._of(document, value, leaves, (text, rest))
        known = self.named(text)
        if known:
            message = f"'{text}' is a leaf; an event says what it does as well"
            example = f"write {text} {words_of(known)[0]}"
            document.report("wrong-value", message, value, hint=example)
        else:
            self._report_unknown(document, value, words[0])
        return None

    def _of(
        self, document: Document, value: Value, leaves: tuple[StubLeaf, ...], texts: tuple[str, str]
    ) -> EventPattern | None:
        text, rest = texts
        if rest in _DEEDS:
            return EventPattern(text, leaves, _DEEDS[rest])
        known = words_of(leaves)
        if rest in known:
            return EventPattern(text, leaves, ANSWERED, rest)
        message = f"'{leaves[0].name}' never does '{rest}'; it does {', '.join([*known, *_DEEDS])}"
        near = nearest(rest, [*known, *_DEEDS])
        part = (len(text) - len(rest), len(text))
        document.report("unknown-answer", message, value, part, suggestion=near)
        return None

    def _report_unknown(self, document: Document, value: Value, key: str) -> None:
        names = list(dict.fromkeys(word for leaf in self.leaves for word in (leaf.name, leaf.tag)))
        message = f"no leaf that can be scripted is called '{key}'; there is {', '.join(names) or 'none'}"
        document.report("unknown-leaf", message, value, suggestion=nearest(key, names))


def words_of(leaves: Iterable[StubLeaf]) -> list[str]:
    """Return the labels of what some leaves can answer, then the statuses."""
    labels = [answer.label for leaf in leaves for answer in leaf.answers if answer.label]
    statuses = {answer.status for leaf in leaves for answer in leaf.answers}
    return [*dict.fromkeys(labels), *(status for status in STATUSES if status in statuses)]
