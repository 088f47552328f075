"""Records the statuses of a tree's nodes in the journal, tick by tick."""

import sys
from collections.abc import Callable, Iterable, Mapping
from types import FrameType
from uuid import UUID

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.visitors import VisitorBase

from sar_compiler.journal.journal import Journal
from sar_compiler.journal.journal_entries import STATUS
from sar_compiler.runtime.outcomes import DeclaredOutcomes, Outcome
from sar_compiler.runtime.skipping import was_skipped
from sar_compiler.runtime.walking import pre_order

_ACTIVE = {Status.RUNNING.value, Status.SUCCESS.value, Status.FAILURE.value}


class StatusWatch(VisitorBase):
    """Records the statuses of nodes as `status` entries with `node`, `tick`, `status` and `message`.

    An entry is written for a ticked node if its status, message or outcome differs from the node's last
    entry, or if the node was not ticked in the previous tick. Nodes are numbered from 0 in pre-order, as in
    the journal's tree. The entry of a leaf with declared outcomes has the `label` of the outcome, which is
    empty if several are possible. HALTED is the status of a node that was stopped while running. IDLE is the
    status of a node that had ended and was reset because an ancestor started over or was stopped. Entries
    with either of these two statuses also contain `last`, the tick in which the node was last ticked.

    If a leaf records an event in a tick, the outcome of the leaf in this tick is written even if it is unchanged. The journal
    then contains an outcome for each event.

    Args:
        root: The tree.
        journal: The journal to write to.
        outcomes: The declared outcomes of leaves, by the ids of their behaviours.
        warn: Called once with the description of each problem of an `outcome_label`.
    """

    def __init__(
        self,
        root: Behaviour,
        journal: Journal,
        outcomes: Mapping[UUID, Iterable[Outcome]] | None = None,
        warn: Callable[[str], object] = lambda _: None,
    ) -> None:
        super().__init__(full=False)
        self._journal = journal
        self._declared = {id_: DeclaredOutcomes(declared) for id_, declared in (outcomes or {}).items()}
        self._warn, self._warned = warn, set[str]()
        self._behaviours = list(pre_order(root))
        self._numbers = {id(behaviour): number for number, behaviour in enumerate(self._behaviours)}
        # For each node, the status, message and label in its last entry, and the tick in which it was last ticked.
        self._last: list[tuple[str, str, str | None]] = [("", "", None)] * len(self._behaviours)
        self._ticked = [0] * len(self._behaviours)
        # The active nodes, and whether each is running. Skipping a node changes neither.
        self._active: dict[int, bool] = {}
        # Only an ancestor can reset a node. Therefore only the root, and the children of nodes that were ticked or reset, are checked.
        self._children = [
            [self._numbers[id(child)] for child in behaviour.children] for behaviour in self._behaviours
        ]
        self._to_check: list[int] = []
        self._tick = 0
        self._is_ticking = False
        self._recording_leaves: set[int] = set()
        journal.leaf_in_hand = self._leaf_in_hand

    def _leaf_in_hand(self) -> Mapping[str, int]:
        """Return the leaf whose method is currently running, and the tick, or an empty mapping.

        The function searches Python's stack at each event. Ticks then need no extra work, which matters
        because ticks are frequent and events are rare. The search finds leaves of any class, in any engine.
        """
        frame: FrameType | None = sys._getframe(1) if self._is_ticking else None  # noqa: SLF001
        while frame is not None:
            number = self._numbers.get(id(frame.f_locals.get("self")))
            if number is not None and not self._behaviours[number].children:
                self._recording_leaves.add(number)
                return {"leaf": number, "tick": self._tick}
            frame = frame.f_back
        return {}

    def initialise(self) -> None:
        """Prepare for the statuses of a new tick."""
        self._tick += 1
        self._is_ticking = True
        self._recording_leaves.clear()
        self._to_check = [0]

    def run(self, behaviour: Behaviour) -> None:
        """Record the status of a ticked node, except a repeated status that need not be recorded."""
        number = self._numbers.get(id(behaviour))
        if number is not None:
            status = "SKIPPED" if was_skipped(behaviour) else behaviour.status.value
            now = str(status), behaviour.feedback_message, self._label(behaviour, str(status))
            self._to_check += self._children[number]
            before, self._ticked[number] = self._ticked[number], self._tick
            if self._last[number] != now or number in self._recording_leaves or before < self._tick - 1:
                self._write(number, *now)

    def finalise(self) -> None:
        """Record the nodes that were stopped or reset, and end the tick."""
        gone = set[int]()
        for number in self._to_check:  # the loop extends the list
            if number in self._active and self._behaviours[number].status is Status.INVALID:
                gone.add(number)
                self._to_check += self._children[number]
        for number in sorted(gone):
            was_running = self._active.pop(number)
            self._write(number, "HALTED" if was_running else "IDLE", "", last=self._ticked[number])
        self._is_ticking = False
        self._journal.write_when_due()

    def _label(self, behaviour: Behaviour, status: str) -> str | None:
        """Return the label of a leaf's outcome.

        It is "" if several are possible, and None without declared outcomes.
        """
        declared = self._declared.get(behaviour.id)
        if declared is None:
            return None
        label = getattr(behaviour, "outcome_label", "")
        objection = declared.why_invalid(status, label)
        if objection and objection not in self._warned:
            self._warned.add(objection)
            self._warn(f"'{behaviour.name}' ({type(behaviour).__name__}): {objection}.")
        return declared.label(status, label)

    def _write(self, number: int, status: str, message: str, label: str | None = None, **more: int) -> None:
        self._last[number] = status, message, label
        if status in _ACTIVE:
            self._active[number] = status == Status.RUNNING.value
        labelled: dict[str, object] = {} if label is None else {"label": label}
        self._journal.record_observation(
            STATUS, node=number, tick=self._tick, status=status, message=message, **labelled, **more
        )
