"""The statuses of a tree's nodes, tick by tick, in the journal."""

import sys
from collections.abc import Callable, Iterable, Mapping
from types import FrameType
from uuid import UUID

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.visitors import VisitorBase

from sar_compiler.journal.journal import Journal
from sar_compiler.journal.journal_entries import STATUS
from sar_compiler.runtime.answers import Answer, DeclaredAnswers
from sar_compiler.runtime.skipping import was_skipped
from sar_compiler.runtime.walking import pre_order

_STANDING = {Status.RUNNING.value, Status.SUCCESS.value, Status.FAILURE.value}


class StatusWatch(VisitorBase):
    """Watches every node that is ticked: kind `status`, with `node` (its number), `tick`, `status`, `message`.

    A node has an entry where its status, its message or its answer is another one than in its last, or it was not ticked in the tick before.
    Nodes are numbered from 0 in pre-order, as in the journal's tree. A leaf that has declared its answers has the `label` of the one it has given, which is
    empty if it has not said which. HALTED is the status of one that was stopped while it was running; IDLE of one that
    had ended, and was reset because what is above it began anew or was stopped; `last` is then the tick in which it was ticked last.

    The journal asks it which leaf notes a fact. What that leaf has answered then is written whether it is another answer or not, so that
    each fact of a tick has the answer by which it came.

    Args:
        root: The tree.
        journal: Where it is written.
        answers: The declared answers of leaves, by the ids of their behaviours.
        warn: Called once with what is wrong with an `answer_label`.
    """

    def __init__(
        self,
        root: Behaviour,
        journal: Journal,
        answers: Mapping[UUID, Iterable[Answer]] | None = None,
        warn: Callable[[str], object] = lambda _: None,
    ) -> None:
        super().__init__(full=False)
        self._journal = journal
        self._answers = {id_: DeclaredAnswers(declared) for id_, declared in (answers or {}).items()}
        self._warn, self._warned = warn, set[str]()
        self._behaviours = list(pre_order(root))
        self._numbers = {id(behaviour): number for number, behaviour in enumerate(self._behaviours)}
        # Of each node: what it has come to last, and the tick in which that was.
        self._last: list[tuple[str, str, str | None]] = [("", "", None)] * len(self._behaviours)
        self._ticked = [0] * len(self._behaviours)
        # The nodes that are not at rest, and whether they run: one that is skipped stays as it is.
        self._standing: dict[int, bool] = {}
        # Only what is above a node brings it to rest: so these are asked that are below the nodes that were ticked, or that came to rest, and the root.
        self._below = [
            [self._numbers[id(child)] for child in behaviour.children] for behaviour in self._behaviours
        ]
        self._asked: list[int] = []
        self._tick = 0
        self._is_ticking = False
        self._noted: set[int] = set()
        journal.leaf_in_hand = self._leaf_in_hand

    def _leaf_in_hand(self) -> Mapping[str, int]:
        """Return the leaf of which a method is being run, and the tick; nothing where no leaf is ticked.

        Facts are rare, and ticks are not: so Python's stack is searched for each fact, and ticks say nothing. That finds a leaf of
        any class, and in any engine.
        """
        frame: FrameType | None = sys._getframe(1) if self._is_ticking else None  # noqa: SLF001
        while frame is not None:
            number = self._numbers.get(id(frame.f_locals.get("self")))
            if number is not None and not self._behaviours[number].children:
                self._noted.add(number)
                return {"leaf": number, "tick": self._tick}
            frame = frame.f_back
        return {}

    def initialise(self) -> None:
        """Begin a tick."""
        self._tick += 1
        self._is_ticking = True
        self._noted.clear()
        self._asked = [0]

    def run(self, behaviour: Behaviour) -> None:
        """Watch a node that was ticked."""
        number = self._numbers.get(id(behaviour))
        if number is not None:
            status = "SKIPPED" if was_skipped(behaviour) else behaviour.status.value
            now = str(status), behaviour.feedback_message, self._label(behaviour, str(status))
            self._asked += self._below[number]
            before, self._ticked[number] = self._ticked[number], self._tick
            if self._last[number] != now or number in self._noted or before < self._tick - 1:
                self._write(number, *now)

    def finalise(self) -> None:
        """Watch the nodes that were stopped or reset, and end the tick."""
        gone = set[int]()
        for number in self._asked:  # which grows by that
            if number in self._standing and self._behaviours[number].status is Status.INVALID:
                gone.add(number)
                self._asked += self._below[number]
        for number in sorted(gone):
            was_running = self._standing.pop(number)
            self._write(number, "HALTED" if was_running else "IDLE", "", last=self._ticked[number])
        self._is_ticking = False
        self._journal.write_when_due()

    def _label(self, behaviour: Behaviour, status: str) -> str | None:
        """Return the label of a leaf's answer; empty if it has not said which, None if it has declared none."""
        declared = self._answers.get(behaviour.id)
        if declared is None:
            return None
        said = getattr(behaviour, "answer_label", "")
        objection = declared.objection(status, said)
        if objection and objection not in self._warned:
            self._warned.add(objection)
            self._warn(f"'{behaviour.name}' ({type(behaviour).__name__}): {objection}.")
        return declared.label(status, said)

    def _write(self, number: int, status: str, message: str, label: str | None = None, **more: int) -> None:
        self._last[number] = status, message, label
        if status in _STANDING:
            self._standing[number] = status == Status.RUNNING.value
        said: dict[str, object] = {} if label is None else {"label": label}
        self._journal.watch(
            STATUS, node=number, tick=self._tick, status=status, message=message, **said, **more
        )
