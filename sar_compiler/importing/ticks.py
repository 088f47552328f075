"""Find the ticks of a recorded run, because a log of BehaviorTree.CPP contains only status changes.

A tick can only end when the tree is settled: each RUNNING control has a RUNNING child, or may return RUNNING without a RUNNING child. If the tree
is settled, one of these rules decides whether the next change belongs to a new tick:

- The next change belongs to a node that the tick has already passed, because a tick visits the nodes in order. (A loop that restarts within
  a tick is not settled in between.) A leaf may change to RUNNING and end within one tick. This is assumed if no leaf with its tag was ever
  RUNNING while another node changed.
- The pause before the next change is at least half as long as most pauses at known boundaries. A pause alone is weak evidence: a leaf may
  block, the computer may be busy, and two ticks may follow each other without a pause.
- The root has ended, or the program has halted the tree.

A leaf with its own thread can log its end at any moment, and its parent processes the end in the next tick. Such an end is moved to the change
at which the parent continues.

If all children of a control were skipped, the control stays RUNNING in a log although none of its children runs. The start of a later sibling
reveals this.

If the program halts the tree, it halts the root first, and then each node. So nodes that their parents have left in a status other than IDLE
are reset after the root.

A TryCatch with `catch_on_halt` ticks its last child while it is halted by a time limit or by the program. The changes of that child belong to the halt.
"""

from array import array
from bisect import insort
from collections.abc import Iterator, Mapping, Sequence
from enum import Enum
from typing import NamedTuple

from sar_compiler.importing.recorded_tree import RunNode
from sar_compiler.importing.recording import FAILURE, IDLE, RUNNING, SUCCESS, Recording
from sar_compiler.nodes.outcome_sets import ALLOWED, F, K, R, S, attempt, branches, selection
from sar_compiler.nodes.palettes import palettes_containing
from sar_compiler.nodes.registry import language_variants
from sar_compiler.nodes.semantics import Order
from sar_compiler.nodes.spec import Kind

_PAUSE_USEC, _LEAST_USEC, _MOST_USEC = 1000, 100, 50_000
"""Default, minimum and maximum of the shortest pause that separates two ticks, in microseconds."""
_TRIED = 20_000
"""The number of status changes at the start of the log that are used to estimate the shortest pause."""
_ENOUGH = 5
"""The minimum number of known tick boundaries that are needed to estimate the shortest pause."""
_NEAR = 3
"""A pause is ambiguous if it differs from the shortest pause by less than this factor."""


_SILENT = ("PipelineSequence", "NonblockingSequence", "Precondition", "SkipUnlessUpdated", "WaitValueUpdate")
"""The controls and decorators, other than selecting controls, that become RUNNING only after they have ticked a child."""


class WaitRule(Enum):
    """The condition under which a RUNNING node may have returned RUNNING in the current tick."""

    FREE = "always, for a leaf or a control of an unknown kind"
    CHILD = "while a child is RUNNING"
    WAITS = "while its child is RUNNING or IDLE"
    LATER = "while its child is RUNNING, or after the child has succeeded, because the node never ends in the tick in which the child succeeds"
    TURNS = "while its child is RUNNING, or when the child has started and ended in this tick and has not restarted"
    STEPS = "while a child is RUNNING, or when a child has started and ended in this tick and the next child has not started"
    REACTIVE = "while one child is RUNNING and all other children are IDLE"
    PARALLEL = "while a child is RUNNING, all children were ticked, and no threshold is reached"


_BETWEEN = (WaitRule.STEPS, WaitRule.TURNS, WaitRule.LATER)
"""The rules of nodes that may return RUNNING after one child has ended and before a child starts again."""
_TOGETHER = (WaitRule.REACTIVE, WaitRule.PARALLEL)
"""The rules of controls that tick several children in each tick."""


class TickKind(Enum):
    """The kind of a `RecordedTick`."""

    TICK = "a tick"
    ENDS = "a tick in which the root has ended"
    HALT = "a halt of the whole tree by the program"


class RecordedTick(NamedTuple):
    """The status changes of one tick, or of one halt of the whole tree.

    Attributes:
        first: The index of the first change.
        behind: The index after the last change.
        kind: Whether this is a tick or a halt.
    """

    first: int
    behind: int
    kind: TickKind


class TickFinder:
    """Finds the ticks of a recorded run.

    Args:
        nodes: The nodes of the tree, ordered by number.
        recording: The recorded run.

    Attributes:
        skipped: The indices of changes to RUNNING after which the node was skipped, for the ticks yielded so far.
        unsure: The number of possible tick boundaries that were decided only by a pause of ambiguous length.
    """

    def __init__(self, nodes: Sequence[RunNode], recording: Recording) -> None:
        self._nodes, self._recording = nodes, recording
        count = len(nodes) + 1
        self._parents = [0, *(node.parent for node in nodes)]
        self._children: list[tuple[int, ...]] = [(1,), *(node.children for node in nodes)]
        self._rules = [WaitRule.FREE, *map(_wait_rule, nodes)]
        self._pauses_after = [(), *map(_pauses_after, nodes)]
        self._ends = list(range(1, count + 1))
        for uid in range(count - 1, 0, -1):
            parent = self._parents[uid]
            self._ends[parent] = max(self._ends[parent], self._ends[uid])
        skippable = [False, *map(_may_skip, nodes)]
        for uid in range(count - 1, 0, -1):
            skippable[self._parents[uid]] |= skippable[uid]
        self._skippable, self._skips_any = skippable, any(skippable)
        # Nodes that may be skipped without any change of status.
        self._skips_silently = [False, *map(_may_skip, nodes)]
        self._starts_silently = [False, *map(_starts_silently, nodes)]
        for uid in range(count - 1, 0, -1):
            parent = self._parents[uid]
            self._skips_silently[parent] |= self._skips_silently[uid] and self._starts_silently[parent]
        # Whether a node waits, or may wait, before it first ticks a child.
        semantics = [node.bound.spec.semantics for node in nodes]
        self._waits_first = [
            False,
            *(
                each.possible is None or each.wait_sec is not None or _waits_without_child(node)
                for node, each in zip(nodes, semantics, strict=True)
            ),
        ]
        self._is_known = [False, *(each.possible is not None for each in semantics)]
        # Whether the first child of a control decides which other child runs.
        self._branches = [False, *(each.possible is branches for each in semantics)]
        # Whether a node ticks no child after a RUNNING one; a PipelineSequence does.
        self._stops_at_running = [False, *(bool(language_variants(node.tag)) for node in nodes)]
        self._has_while = [False, *("_while" in node.bound.element.attributes for node in nodes)]
        self._delays = [False, *(each.wait_sec is not None for each in semantics)]
        # Whether a node halts its child after a time limit.
        self._limits = [False, *(bool(node.children) and _has_limit(node) for node in nodes)]
        # Whether a node or one of its ancestors may halt its descendants at the beginning of a tick.
        may_halt = [False, *map(_halts, nodes)]
        self._repeats = [False, *map(_repeats, nodes)]
        for uid in range(1, count):
            may_halt[uid] |= may_halt[self._parents[uid]]
        self._may_halt = may_halt
        # For each node, the TryCatch that ticks the node while the TryCatch is halted; 0 for none.
        self._catches = [0] * (count + 1)
        for uid, node in enumerate(nodes, 1):
            if node.bound.spec.semantics.possible is attempt and _ticks_when_halted(node):
                self._catches[node.children[-1] : self._ends[uid]] = [uid] * (
                    self._ends[uid] - node.children[-1]
                )
        self._thresholds = [(count, count), *map(_thresholds, nodes)]
        # The tags of leaves that were RUNNING while another node changed.
        self._lasting: set[str] = set()
        self._threads = self._find_threads()
        self._begin()

    def _begin(self) -> None:
        count = len(self._nodes) + 1
        self.skipped: set[int] = set()
        self.unsure = self._read = 0
        self._sure: list[int] = []
        self._statuses = [IDLE] * count
        self._running = [0] * count
        self._unsettled = [False] * count
        self._left = 0
        # For each node: the index of its last change, the tick in which it last left IDLE, and the tick in which it last ended.
        self._since, self._started, self._ended = [0] * count, [0] * count, [0] * count
        # For each node, the index of the change that last halted it. Some controls halt themselves before they end.
        self._rested = [-1] * count
        # For each node, the tick in which it was last reset to IDLE.
        self._reset = [0] * count
        self._outcomes = [IDLE] * count
        # The nodes that were skipped, although the log shows them as RUNNING.
        self._passed_over: set[int] = set()
        # The TryCatch nodes that are being halted and therefore tick their last child.
        self._catching: set[int] = set()
        self._open: set[int] = set()
        # The nodes that have returned RUNNING between two runs of children, and those that have to tick the next child in this tick.
        self._paused: set[int] = set()
        self._due: set[int] = set()
        self._tick = 0
        self._next_tick()

    def end_of(self, uid: int) -> int:
        """Return the number that follows the last descendant of a node."""
        return self._ends[uid]

    def ticks(self) -> Iterator[RecordedTick]:
        """Yield each tick of the run and each halt of the whole tree, in order."""
        if self._recording.messages:
            yield from self._split(_PAUSE_USEC, 0, len(self._recording.times))
            return
        self._move_halts_of_timers()
        self._move_ends_of_threads()
        for _ in self._split(_PAUSE_USEC, 0, _TRIED):
            pass
        pause = _PAUSE_USEC
        if len(self._sure) >= _ENOUGH:
            pause = sorted(self._sure)[len(self._sure) // 10] // 2
        self._begin()
        yield from self._split(min(max(pause, _LEAST_USEC), _MOST_USEC), 0, len(self._recording.times))

    def next_ticks(self) -> Iterator[RecordedTick]:
        """Yield the ticks that were recorded since the last call. The last recorded change is assumed to end a tick."""
        first, self._read = self._read, len(self._recording.times)
        yield from self._split(_PAUSE_USEC, first, self._read)
        self._next_tick()

    def _split(self, pause: int, first: int, most: int) -> Iterator[RecordedTick]:
        times, uids, statuses, count = (
            self._recording.times,
            self._recording.uids,
            self._recording.statuses,
            len(self._nodes),
        )
        rest, behind, is_over = -1, 0, False
        for index in range(first, min(most, len(uids))):
            uid, status = uids[index], statuses[index]
            if index < behind or not 0 < uid <= count:
                continue
            self._find_skipped(index, uid, status)
            paused = self._paused_before(uid) if status != IDLE and not self._recording.messages else []
            if index > first and (paused or self._is_first(index, pause, is_over=is_over)):
                yield RecordedTick(first, index, TickKind.ENDS if is_over else TickKind.TICK)
                first, is_over = index, False
                self._next_tick()
                for each in paused:
                    self._pass_over(each, index)
            if status != IDLE:
                rest = rest if self._catches[uid] else -1
            elif rest < 0 and not self._left:
                rest = index
            was = self._change(index, uid, status)
            if uid == 1 and status == IDLE:
                is_over = was in (SUCCESS, FAILURE)
                behind = self._reset_others(index + 1, most)
                found = self._ticks_before_rest(first, index, rest, behind, was)
                if found:
                    yield from found
                    first, is_over = behind, False
                    self._next_tick()
        if first < min(most, len(times)):
            yield RecordedTick(first, min(most, len(times)), TickKind.ENDS if is_over else TickKind.TICK)

    def _ticks_before_rest(
        self, first: int, index: int, rest: int, behind: int, was: int
    ) -> list[RecordedTick]:
        """Return the ticks that end when the root becomes IDLE and other nodes are reset.

        Return an empty list if these changes alone do not end a tick.

        Args:
            first: The first change of the tick.
            index: The change of the root.
            rest: The first of the changes to IDLE before the root's change; negative for none.
            behind: The change after the last change that resets another node.
            was: The status of the root before.
        """
        if was != RUNNING or self._ends_next(index):
            return [RecordedTick(first, index + 1, TickKind.ENDS)] if behind > index + 1 else []
        begin = max(first, rest) if rest >= 0 else first
        before = [RecordedTick(first, begin, TickKind.TICK)] if begin > first else []
        return [*before, RecordedTick(begin, behind, TickKind.HALT)]

    def _reset_others(self, index: int, most: int) -> int:
        """Process the changes that reset other nodes after the root; return the index of the next change."""
        uids, statuses = self._recording.uids, self._recording.statuses
        while (
            index < min(most, len(uids)) and statuses[index] == IDLE and 1 < uids[index] <= len(self._nodes)
        ):
            self._change(index, uids[index], IDLE)
            index += 1
        return index

    def _ends_next(self, index: int) -> bool:
        """Return whether the root's next change is its result.

        Some controls become IDLE before they return a result.
        """
        uids, statuses = self._recording.uids, self._recording.statuses
        return index + 1 < len(uids) and uids[index + 1] == 1 and statuses[index + 1] in (SUCCESS, FAILURE)

    def _is_first(self, index: int, pause: int, *, is_over: bool) -> bool:
        """Return whether a change is the first change of a tick."""
        if self._begins_message(index):
            return True
        if self._catches[self._recording.uids[index]] in self._catching:
            return False
        is_settled = not self._left and not any(map(self._is_ticked, self._due))
        return is_over or self._is_restart(index) or (is_settled and self._is_border(index, pause))

    def _begins_message(self, index: int) -> bool:
        """Return whether a change is the first one of a message, and so of a tick. No tick continues in the next message."""
        messages = self._recording.messages
        return bool(messages) and messages[index] != messages[index - 1]

    def _is_ticked(self, uid: int) -> bool:
        """Return whether a node can be ticked: no ancestor is waiting for the result of the ancestor's condition.

        A WhileDoElse may wait for its condition without halting its other children.
        """
        while parent := self._parents[uid]:
            condition = self._children[parent][0]
            if self._branches[parent] and uid != condition and self._statuses[condition] == RUNNING:
                return False
            uid = parent
        return True

    def _is_restart(self, index: int) -> bool:
        """Return whether a change starts a node that cannot start again in the same tick.

        The node has already started or was reset in this tick, and no ancestor repeats the node within a tick.
        """
        uid, status = self._recording.uids[index], self._recording.statuses[index]
        ends_by_halt = self._rested[uid] == index - 1 and status != RUNNING
        return (
            status != IDLE == self._statuses[uid]
            and self._tick in (self._started[uid], self._reset[uid])
            and not ends_by_halt
            and not self._is_repeated(uid)
        )

    def _is_repeated(self, uid: int) -> bool:
        """Return whether an ancestor may tick a node again in this tick.

        An ancestor that repeats its child may do so if the child has ended in this tick, or if the ancestor's kind is unknown.
        """
        while uid:
            parent = self._parents[uid]
            if self._repeats[parent] and (self._ended[uid] == self._tick or not self._is_known[parent]):
                return True
            uid = parent
        return False

    def _next_tick(self) -> None:
        self._tick += 1
        self._passed = self._done = 0
        self._has_turned = False
        self._due = {uid for uid in self._paused if self._has_to_continue(uid)}
        self._paused.clear()

    def _has_to_continue(self, uid: int) -> bool:
        """Return whether a node that returned RUNNING between two runs of children must change in every later tick."""
        below = self._children[uid]
        ended = [each for each in below if self._statuses[each] != IDLE]
        following = (
            below[:1]
            if self._rules[uid] is WaitRule.TURNS
            else [each for each in below if ended and each > ended[-1]]
        )
        if (
            self._statuses[uid] != RUNNING
            or not following
            or self._skips_silently[following[0]]
            or self._may_halt[uid]
        ):
            return False
        while uid := self._parents[uid]:
            if self._rules[uid] in (WaitRule.FREE, WaitRule.WAITS):
                return False
        return True

    def _visit(self, uid: int, status: int) -> None:
        """Store how far the tick has come after a change of the given node.

        The tick has passed all nodes before `_passed`, except the ancestors of the node `_done`.
        """
        is_late = self._is_ancestor_of_done(uid) or (
            self._starts_silently[uid] and any(map(self._statuses.__getitem__, self._children[uid]))
        )
        if is_late or status != RUNNING or not self._children[uid]:
            self._passed, self._done = self._ends[uid], uid
        else:
            self._passed, self._done = uid, 0

    def _is_ancestor_of_done(self, uid: int) -> bool:
        """Return whether a node is an ancestor of the last node that the tick has passed."""
        return uid < self._done and self._ends[uid] >= self._passed

    def _is_later_tick(self, reset: int, then: int, status: int) -> bool:
        """Return whether the node *reset* returned RUNNING in this tick and is reset in a later tick.

        In that later tick, the node *then* has the next new status, *status*.
        """
        parent = self._parents[reset]
        if self._ends[reset] <= then < self._ends[parent] and self._rules[parent] is not WaitRule.PARALLEL:
            return self._is_waiting_for_tick(reset)
        if status not in (SUCCESS, FAILURE) or self._rules[then] is not WaitRule.PARALLEL or parent != then:
            return False
        found = [self._statuses[each] for each in self._children[then]]
        is_waiting = any(map(self._is_waiting_for_tick, self._children[then]))
        return is_waiting and not self._is_decided(then, found)

    def _is_waiting_for_tick(self, uid: int) -> bool:
        """Return whether a node returned RUNNING in this tick without a RUNNING child, and continues in the next tick."""
        return self._rules[uid] in _BETWEEN and self._is_between(uid)

    def _is_passed(self, uid: int) -> bool:
        """Return whether the tick has passed a node and all of its descendants."""
        return self._ends[uid] <= self._passed and not self._is_ancestor_of_done(uid)

    def _is_border(self, index: int, pause: int) -> bool:
        """Return whether a change is the first change of a tick, given that the tick before it may be complete."""
        uid, status = self._recording.uids[index], self._recording.statuses[index]
        gap = self._recording.times[index] - self._recording.times[index - 1]
        known = self._is_known_border(index, uid, status)
        if known is not None:
            return known
        if status != IDLE and uid < self._passed and not self._is_ancestor_of_done(uid):
            return self._is_visited_again(index, gap, pause)
        if status == IDLE and not (self._may_halt[uid] or self._skips_any):
            return False
        self.unsure += pause // _NEAR < gap < pause * _NEAR
        return gap >= pause

    def _is_known_border(self, index: int, uid: int, status: int) -> bool | None:
        """Return whether a change is the first change of a tick, or None if this cannot be decided here.

        The decision depends on the states of the node and of the node's parent.
        """
        ends = status in (SUCCESS, FAILURE)
        if ends and self._rested[uid] == index - 1:
            return False
        if status != IDLE and self._has_returned(uid):
            return True
        parent = self._parents[uid]
        if self._rules[parent] is WaitRule.LATER and self._since[uid] <= self._since[parent]:
            return False
        if ends and self._continues(uid):
            return False
        if status != IDLE:
            return None
        return True if self._is_late_halt(index) else False if self._is_of_same_halt(index) else None

    def _is_visited_again(self, index: int, gap: int, pause: int) -> bool:
        """Return whether a change starts a new tick, given that the current tick has already passed the node."""
        uids, uid = self._recording.uids, self._recording.uids[index]
        is_adjacent = uids[index - 1] == uid and self._recording.statuses[index - 1] == RUNNING
        if is_adjacent and self._nodes[uid - 1].tag not in self._lasting:
            return gap >= max(pause, _PAUSE_USEC)
        if not self._has_turned:
            self._sure.append(gap)
        return True

    def _has_returned(self, uid: int) -> bool:
        """Return whether a node or its parent has returned RUNNING in this tick without a RUNNING child."""
        parent = self._parents[uid]
        if self._delays[parent] and self._started[parent] == self._tick > self._ended[uid]:
            return self._statuses[parent] == RUNNING
        if self._rules[uid] is WaitRule.LATER and self._is_between(uid):
            return True
        while parent and self._statuses[parent] == IDLE:
            parent = self._parents[parent]  # a decorator that becomes RUNNING only after its child
        return self._is_waiting_for_tick(parent)

    def _is_between(self, uid: int) -> bool:
        """Return whether a RUNNING node has a child that has ended in this tick, and no RUNNING child."""
        return (
            self._statuses[uid] == RUNNING
            and not self._running[uid]
            and any(
                self._ended[each] == self._tick and self._since[each] > self._since[uid]
                for each in self._children[uid]
            )
        )

    def _continues(self, uid: int) -> bool:
        """Return whether a node that ends does so in the same tick as its child.

        In a later tick, a child would change first.
        """
        if not self._is_between(uid):
            return False
        if self._rules[uid] is WaitRule.TURNS:
            return True
        return self._rules[uid] is WaitRule.STEPS and not any(
            self._skippable[each] for each in self._children[uid] if self._ended[each] != self._tick
        )

    def _is_late_halt(self, index: int) -> bool:
        """Return whether a change begins a halt that belongs to a new tick.

        The halt belongs to a new tick if the halting node has already returned RUNNING in this tick.
        """
        uids, statuses, done = self._recording.uids, self._recording.statuses, self._done
        first = uids[index]
        while index < len(uids) and (statuses[index] == IDLE or self._is_caught(index)):
            if self._halts_by_condition(uids[index]):
                return True
            index += 1
        if index == len(uids) or not 0 < uids[index] <= len(self._nodes):
            return False
        then = uids[index]
        ends = statuses[index] in (SUCCESS, FAILURE)
        has_stepped = ends and self._parents[first] == then and self._has_stepped(then)
        if has_stepped or self._is_later_tick(first, then, statuses[index]):
            return True
        if ends and self._is_passed(then) and then < first < self._ends[then]:
            return True  # a node that the tick has passed cannot end in it
        if statuses[index] == FAILURE and self._limits[then] and then < first < self._ends[then]:
            return self._passed > then and self._statuses[then + 1] == RUNNING
        # The last node that has returned is ticked again.
        is_inside = done < first < self._ends[done] and done < then < self._ends[done]
        return self._statuses[done] == RUNNING and is_inside

    def _halts_by_condition(self, uid: int) -> bool:
        """Return whether `_while` halts a node that has already returned RUNNING in this tick.

        Such a halt belongs to a later tick, because the condition of `_while` takes effect only at the start of a tick.
        """
        done = self._done
        if (
            not (0 < uid <= done < self._ends[uid] and self._has_while[uid])
            or self._statuses[done] != RUNNING
        ):
            return False
        while done > uid:
            done = self._parents[done]
            if self._rules[done] in (WaitRule.PARALLEL, WaitRule.FREE) or not self._stops_at_running[done]:
                return False
        return self._rules[self._parents[uid]] is not WaitRule.PARALLEL

    def _move_halts_of_timers(self) -> None:
        """Move each halt by a time limit to the tick in which the limiting node fails.

        Such a halt can happen at any moment.
        """
        uids, statuses = self._recording.uids, self._recording.statuses
        held: dict[int, list[int]] = {}
        moved: dict[int, list[int]] = {}
        left_out: set[int] = set()
        was = [IDLE] * (len(self._nodes) + 1)
        for index, uid in enumerate(uids):
            if not 0 < uid <= len(self._nodes):
                continue
            if uid in held:
                moved[index] = held.pop(uid)
                left_out.update(moved[index])
            limit = self._parents[uid]
            if (
                statuses[index] == IDLE
                and self._limits[limit]
                and was[uid] == was[limit] == RUNNING
                and uids[index + 1 : index + 2] != array("H", [limit])
            ):
                held[limit] = self._changes_of_halt(index)
            was[uid] = statuses[index]
        if left_out:
            self._reorder(moved, left_out)

    def _changes_of_halt(self, index: int) -> list[int]:
        """Return the indices of the changes that form a halt, given the index of the last change.

        Nodes are halted in post-order.
        """
        uids, statuses, ends = self._recording.uids, self._recording.statuses, self._ends
        limit, found, caught = self._parents[uids[index]], [index], 0
        halted = {uids[index]}
        while index := index - 1:
            uid, later = uids[index], uids[index + 1]
            if not limit < uid < ends[limit] or (uids[index - 1] == uid and statuses[index] == IDLE):
                break
            if self._catches[uid] in halted:
                caught = len(found) + 1
            elif statuses[index] != IDLE or not (caught == len(found) or self._is_in_post_order(uid, later)):
                break
            halted.add(uid)
            found.append(index)
        if caught and caught == len(found):
            # A halt resets the running child before it ticks the last one. Without this reset, the last child was ticked before the halt.
            while len(found) > 1 and self._catches[uids[found[-1]]]:
                found.pop()
        return found[::-1]

    def _is_caught(self, index: int) -> bool:
        """Return whether a change belongs to a node that a TryCatch ticks while the TryCatch is halted."""
        uid = self._recording.uids[index]
        return uid <= len(self._nodes) and bool(self._catches[uid])

    def _find_threads(self) -> list[bool]:
        """Return for each node whether the node may be a leaf with its own thread.

        The first status of such a leaf is always RUNNING.
        """
        recording, count = self._recording, len(self._nodes)
        uids, times = recording.uids, recording.times
        lasting, excluded, was = set[str](), set[str](), [IDLE] * (count + 1)
        for index, (uid, status) in enumerate(zip(uids, recording.statuses, strict=True)):
            if not 0 < uid <= count:
                continue
            if was[uid] == IDLE and status > RUNNING:
                excluded.add(self._nodes[uid - 1].tag)
            elif (
                status == RUNNING
                and index + 1 < len(uids)
                and (uids[index + 1] != uid or times[index + 1] - times[index] >= _PAUSE_USEC)
            ):
                lasting.add(self._nodes[uid - 1].tag)
            was[uid] = status
        possible = {
            tag for tag in lasting - excluded if not (language_variants(tag) or palettes_containing(tag))
        }
        return [False, *(not node.children and node.tag in possible for node in self._nodes)]

    def _is_in_post_order(self, uid: int, later: int) -> bool:
        return later <= uid < self._ends[later] if uid >= later else self._ends[uid] <= later

    def _is_of_same_halt(self, index: int) -> bool:
        """Return whether a change belongs to the same halt as the change before it.

        A halt may pause to wait for the thread of a leaf.
        """
        uids = self._recording.uids
        is_halt = self._recording.statuses[index - 1] == IDLE and uids[index - 1] <= len(self._nodes)
        return is_halt and self._is_in_post_order(uids[index - 1], uids[index])

    def _move_ends_of_threads(self) -> None:
        """Move the end of each leaf with its own thread to the tick in which the parent processes this end."""
        recording, count = self._recording, len(self._nodes)
        uids, statuses = recording.uids, recording.statuses
        # The indices of the ends that no parent has processed so far.
        held: list[int] = []
        # The indices of the ends to insert before a change, by the index of that change; and the indices of changes to omit at their own positions.
        moved: dict[int, list[int]] = {}
        left_out: set[int] = set()
        was = [IDLE] * (count + 1)
        for index, uid in enumerate(uids):
            if not 0 < uid <= count:
                continue
            shown = [each for each in held if self._shows_end(index, uids[each])]
            for end in [*shown]:
                parent = self._parents[uids[end]]
                is_same = self._is_passed_over(end) and self._is_close(end, index)
                # A Parallel resets its children in order. So the reset of a later node is not a reset by the Parallel.
                if is_same and (statuses[index] != IDLE or uid > uids[end]):
                    continue
                if is_same and self._needs_end(index, parent, end, was):
                    left_out.discard(end)
                elif (
                    not is_same
                    and self._was_noticed(index, parent, end, was)
                    and not self._was_decided_before(parent, end, shown, was)
                ):
                    # A parent processes the ends of its children in order.
                    insort(moved.setdefault(index, []), end, key=uids.__getitem__)
                held.remove(end)
            parent, status = self._parents[uid], statuses[index]
            if (
                status == RUNNING
                and not self._children[uid]
                and uids[index + 1 : index + 2] != array("H", [uid])
            ):
                self._lasting.add(self._nodes[uid - 1].tag)
            has_ended = was[uid] == RUNNING and status in (SUCCESS, FAILURE) and self._threads[uid]
            was[uid] = status
            is_last = index + 1 == len(uids)
            if (
                has_ended
                and not is_last
                and self._must_continue(index, parent, was)
                and (
                    self._is_passed_over(index)
                    or not self._shows_end(index + 1, uid)
                    or not self._was_noticed(index + 1, parent, index, was)
                    or self._was_decided_before(parent, index, [*held, index], was)
                )
            ):
                held.append(index)
                left_out.add(index)
        left_out.difference_update(held)
        if left_out:
            self._reorder(moved, left_out)

    def _reorder(self, moved: Mapping[int, Sequence[int]], left_out: set[int]) -> None:
        """Insert the changes in *moved* before the given indices, and omit the changes in *left_out*.

        The omitted changes are the moved changes at their original positions.
        """
        recording = self._recording
        ordered = Recording(recording.form, recording.began)
        for index, uid in enumerate(recording.uids):
            for end in moved.get(index, ()):
                ordered.add(recording.times[index], recording.uids[end], recording.statuses[end])
            if index not in left_out:
                ordered.add(recording.times[index], uid, recording.statuses[index])
        recording.times, recording.uids, recording.statuses = ordered.times, ordered.uids, ordered.statuses

    def _is_close(self, index: int, later: int) -> bool:
        """Return whether a thread may have logged a change during the tick of a later change.

        This is possible if the two changes are close in time.
        """
        return self._recording.times[later] - self._recording.times[index] < _LEAST_USEC

    def _is_passed_over(self, index: int) -> bool:
        """Return whether a leaf ended after its Parallel had ticked a later child, with which the Parallel continues.

        The end of the leaf is neither the first nor the last change of the recording.
        """
        uids, leaf = self._recording.uids, self._recording.uids[index]
        parent, before, following = self._parents[leaf], uids[index - 1], uids[index + 1]
        if (
            not leaf < before < self._ends[parent]
            or self._rules[parent] is not WaitRule.PARALLEL
            or not self._is_close(index - 1, index)
        ):
            return False
        # If an earlier child changes next, the next tick has begun, unless this child only resets its own children.
        is_earlier = leaf < following < before and self._ends[following] <= before
        return not is_earlier or self._recording.statuses[index + 1] == IDLE

    def _must_continue(self, index: int, parent: int, statuses: Sequence[int]) -> bool:
        """Return whether a parent must end or tick another child in the tick in which it processes a child's end."""
        if self._rules[parent] is WaitRule.FREE:
            return False
        if self._rules[parent] is WaitRule.PARALLEL:
            found = [statuses[each] for each in self._children[parent]]
            has_decided = RUNNING not in found or self._is_decided(parent, found)
            return has_decided or self._is_passed_over(index)
        # Only a control that ticks its children in order can have several RUNNING children, and then need not continue.
        is_in_order = self._nodes[parent - 1].bound.spec.semantics.order is Order.IN_ORDER
        return not (is_in_order and any(statuses[each] == RUNNING for each in self._children[parent]))

    def _shows_end(self, index: int, leaf: int) -> bool:
        """Return whether a change shows that the leaf's parent has processed the end of the leaf."""
        uid, parent = self._recording.uids[index], self._parents[leaf]
        if parent < uid < leaf:
            return self._recording.statuses[index] == IDLE and self._parents[uid] == parent
        return parent <= uid < self._ends[parent]

    def _was_decided_before(self, parent: int, end: int, shown: Sequence[int], was: Sequence[int]) -> bool:
        """Return whether a Parallel had its result before it processed the given end, which it then ignored.

        *shown* has the indices of all ends that its next change shows.
        """
        if self._rules[parent] is not WaitRule.PARALLEL:
            return False
        uids = self._recording.uids
        later = {uids[each] for each in shown if uids[each] >= uids[end]}
        found = [RUNNING if child in later else was[child] for child in self._children[parent]]
        return self._is_decided(parent, found)

    def _skip_resets(self, index: int, parent: int) -> int:
        """Return the index of the first change, from *index* on, that does not reset a descendant of the given node.

        Ends of other leaves with their own threads, which may be logged at any time, are skipped, too.
        """
        uids, statuses = self._recording.uids, self._recording.statuses
        while index < len(uids):
            uid = uids[index]
            if parent < uid < self._ends[parent]:
                is_skipped = statuses[index] == IDLE
            else:
                is_skipped = (
                    uid <= len(self._nodes) and self._threads[uid] and statuses[index] in (SUCCESS, FAILURE)
                )
            if not is_skipped:
                break
            index += 1
        return index

    def _needs_end(self, index: int, parent: int, end: int, was: Sequence[int]) -> bool:
        """Return whether a Parallel can have ended only because the given leaf had ended.

        The Parallel resets its children from the change *index* on; the leaf ends at the change *end*.
        """
        uids, statuses = self._recording.uids, self._recording.statuses
        leaf, index = uids[end], self._skip_resets(index, parent)
        if uids[index : index + 1] != array("H", [parent]) or statuses[index] == IDLE:
            return False
        return not self._is_decided(
            parent, [RUNNING if each == leaf else was[each] for each in self._children[parent]]
        )

    def _was_noticed(self, index: int, parent: int, end: int, was: Sequence[int]) -> bool:
        """Return whether a parent processed the end of a leaf before a given change, and did not halt the leaf instead.

        *index* is the index of the change, and *end* is the index of the leaf's end.
        """
        uids, statuses = self._recording.uids, self._recording.statuses
        if statuses[index] != IDLE:
            return True
        first, *others = self._children[parent]
        if self._branches[parent] and uids[end] != first and was[first] in (SUCCESS, FAILURE):
            # A WhileDoElse halts the child of the other branch if the result of its condition changes.
            branch = others[:1] if was[first] == SUCCESS else others[1:]
            if branch != [uids[end]]:
                return False
        at = self._skip_resets(index, parent)
        bound = self._nodes[parent - 1].bound
        if bound.spec.semantics.possible is attempt and uids[at : at + 1] == array(
            "H", [self._children[parent][-1]]
        ):
            # A TryCatch ticks its last child after another one has failed, and some do so when they are halted.
            while (
                at < len(uids)
                and parent < uids[at] < self._ends[parent]
                and self._catches[uids[at]] == parent
            ):
                at += 1
            return uids[at : at + 1] != array("H", [parent]) or statuses[at] != IDLE
        if uids[at : at + 2] == array("H", [parent, parent]) and statuses[at] == IDLE:
            at += 1  # some controls halt themselves before they end
        if at < len(uids) and uids[at] == parent:
            # If a control that ticks its children in order ends with a different status, another child has determined the result.
            is_in_order = bound.spec.semantics.order is Order.IN_ORDER
            return statuses[at] == statuses[end] if is_in_order else statuses[at] != IDLE
        is_condition = self._branches[parent] and uids[end] == first  # is never halted alone
        return bound.spec.kind is not Kind.CONTROL or bound.spec.semantics.resumes or is_condition

    def _change(self, index: int, uid: int, status: int) -> int:
        """Process a status change of a node; return the node's previous status."""
        parent = self._parents[uid]
        self._due.discard(uid)
        self._due.discard(parent)
        if status == IDLE:
            self._catching.discard(uid)
        elif self._catches[uid] == parent and self._is_catching(index, parent):
            self._catching.add(parent)
        if status != IDLE:
            self._visit(uid, status)
            if self._passed_over:
                self._resume_skipped(parent)
        self._passed_over.discard(uid)
        was = self._statuses[uid]
        self._statuses[uid] = status
        self._running[parent] += (status == RUNNING) - (was == RUNNING)
        self._since[uid] = index
        if was == IDLE and not (status in (SUCCESS, FAILURE) and self._rested[uid] == index - 1):
            self._started[uid] = self._tick
        if was == RUNNING and status == IDLE:
            self._rested[uid] = index
        if status == IDLE:
            self._reset[uid] = self._tick
        if status in (SUCCESS, FAILURE):
            self._ended[uid], self._outcomes[uid] = self._tick, status
        self._update_settled(uid)
        self._update_settled(parent)
        return was

    def _is_catching(self, index: int, uid: int) -> bool:
        """Return whether a TryCatch is being halted.

        A TryCatch is being halted if the previous change has reset its running child.
        """
        before = self._recording.uids[index - 1]
        is_child = 0 < before <= len(self._nodes) and self._parents[before] == uid
        return uid > 0 and is_child and self._rested[before] == index - 1

    def _find_skipped(self, index: int, uid: int, status: int) -> None:
        """Find the controls that were skipped before a change of a node outside of these controls.

        A skipped control is RUNNING without a RUNNING child.
        """
        if status == IDLE and self._may_halt[uid]:
            return
        if not self._children[uid] and self._statuses[uid] == RUNNING:
            return  # a leaf with its own thread may end at any moment
        is_found = True
        while is_found:
            left = [
                each
                for each in self._open
                if not each <= uid < self._ends[each]
                and self._statuses[each] == RUNNING
                and not self._running[each]
                and (
                    self._rules[each] not in _TOGETHER
                    or not any(map(self._statuses.__getitem__, self._children[each]))
                )
            ]
            is_found = bool(left)
            for each in left:
                self.skipped.add(self._since[each])
                self._pass_over(each, index)

    def _pass_over(self, uid: int, index: int) -> None:
        """Change a RUNNING node to IDLE, because the node was skipped. The log does not show this change."""
        self._since[uid] = index
        self._passed_over.add(uid)
        self._show(uid, IDLE)

    def _paused_before(self, uid: int) -> list[int]:
        """Return the nodes that returned RUNNING in this tick, and that the next tick skips if the given node changes.

        If a later sibling of such a node, or a descendant of this sibling, is ticked, the parent has passed the node.
        """
        found: list[int] = []
        while parent := self._parents[uid]:
            if self._rules[parent] in (WaitRule.CHILD, WaitRule.STEPS) and self._stops_at_running[parent]:
                found += [each for each in self._children[parent] if each < uid and self._has_paused(each)]
            uid = parent
        return found

    def _has_paused(self, uid: int) -> bool:
        """Return whether a node has certainly returned RUNNING in this tick after the end of a child."""
        if not self._is_waiting_for_tick(uid):
            return False
        if self._rules[uid] is WaitRule.STEPS:
            return self._has_stepped(uid)
        return self._rules[uid] is WaitRule.LATER or self._is_quick(self._children[uid][0], uid)

    def _has_stepped(self, uid: int) -> bool:
        """Return whether a control returned RUNNING between a child that has started in this tick and the next child."""
        below = self._children[uid]
        ended = [each for each in below if self._statuses[each] != IDLE]
        is_before = self._rules[uid] is WaitRule.STEPS and bool(ended) and ended[-1] != below[-1]
        return is_before and not self._running[uid] and self._is_quick(ended[-1], uid)

    def _resume_skipped(self, uid: int) -> None:
        """Set the skipped ancestors of a ticked node to RUNNING again. The log does not show this change."""
        while uid:
            if uid in self._passed_over:
                self._passed_over.discard(uid)
                self._show(uid, RUNNING)
            uid = self._parents[uid]

    def _show(self, uid: int, status: int) -> None:
        parent = self._parents[uid]
        self._running[parent] += (status == RUNNING) - (self._statuses[uid] == RUNNING)
        self._statuses[uid] = status
        self._update_settled(uid)
        self._update_settled(parent)

    def _count_unsettled(self, uid: int, *, is_unsettled: bool) -> None:
        self._left += is_unsettled - self._unsettled[uid]
        self._unsettled[uid] = is_unsettled
        (self._open.add if is_unsettled else self._open.discard)(uid)

    def _update_settled(self, uid: int) -> None:
        if uid and self._children[uid]:
            self._count_unsettled(uid, is_unsettled=not self._is_settled(uid))

    def _is_settled(self, uid: int) -> bool:
        """Return whether a control or decorator may have returned its current status in this tick."""
        running, rule = self._running[uid], self._rules[uid]
        if self._statuses[uid] != RUNNING:
            return not running
        if rule is WaitRule.FREE:
            return True
        found = [self._statuses[each] for each in self._children[uid]]
        if self._branches[uid] and found[0] in (SUCCESS, FAILURE):
            return found[1 if found[0] == SUCCESS else 2 :][:1] == [RUNNING]
        if rule is WaitRule.REACTIVE:
            return running == 1 and found.count(IDLE) == len(found) - 1 and not self._has_decided(uid)
        if rule is WaitRule.PARALLEL:
            return bool(running) and self._is_below_thresholds(uid, found)
        return bool(running) or self._is_pausing(uid, found)

    def _is_pausing(self, uid: int, found: Sequence[int]) -> bool:
        """Return whether a node without a RUNNING child may have returned RUNNING, given the statuses of its children."""
        rule, below = self._rules[uid], self._children[uid]
        if rule in (WaitRule.WAITS, WaitRule.LATER):
            return not any(found) and self._is_waiting(below[0], uid)
        is_settled = False
        if rule is WaitRule.TURNS:
            is_settled = found == [IDLE] and self._since[below[0]] > self._since[uid]
            is_settled = is_settled and self._is_quick(below[0], uid)
        elif rule is WaitRule.STEPS:
            ended = [each for each, status in zip(below, found, strict=True) if status != IDLE]
            is_settled = bool(ended) and ended[-1] != below[-1] and self._is_quick(ended[-1], uid)
        self._has_turned |= is_settled
        (self._paused.add if is_settled else self._paused.discard)(uid)
        return is_settled

    def _is_waiting(self, child: int, uid: int) -> bool:
        """Return whether a decorator whose child is IDLE may have returned RUNNING."""
        is_later = self._rules[uid] is WaitRule.LATER
        if self._since[child] <= self._since[uid]:
            return self._waits_first[uid] or (is_later and self._skippable[child])
        if self._ended[child] < self._tick or not self._is_known[uid]:
            return True
        return is_later and self._outcomes[child] == SUCCESS

    def _has_decided(self, uid: int) -> bool:
        """Return whether a child of a control has ended in this tick with the status that ends the control."""
        goes_on = SUCCESS if self._nodes[uid - 1].bound.spec.semantics.goes_on == S else FAILURE
        return any(
            self._ended[each] == self._tick
            and self._statuses[each] != RUNNING
            and self._outcomes[each] != goes_on
            and self._since[each] > self._since[uid]
            for each in self._children[uid]
        )

    def _is_below_thresholds(self, uid: int, found: list[int]) -> bool:
        """Return whether a Parallel has ticked all children without reaching a threshold."""
        return not self._is_decided(uid, found) and all(
            status != IDLE or self._skips_silently[each] or each in self._passed_over
            for each, status in zip(self._children[uid], found, strict=True)
        )

    def _is_decided(self, uid: int, found: Sequence[int]) -> bool:
        """Return whether a Parallel has reached a threshold, or can no longer reach its number of successes."""
        successes, failures = self._thresholds[uid]
        failed = found.count(FAILURE)
        is_reached = found.count(SUCCESS) >= successes or failed >= failures
        return is_reached or successes <= len(found) < successes + failed

    def _is_quick(self, uid: int, parent: int) -> bool:
        """Return whether a node started and ended in this tick with a status that lets its parent return RUNNING."""
        is_of_tick = self._started[uid] == self._ended[uid] == self._tick
        return is_of_tick and self._outcomes[uid] in self._pauses_after[parent]


def _wait_rule(node: RunNode) -> WaitRule:
    """Return the condition under which a node may have returned RUNNING, according to its semantics."""
    semantics, count = node.bound.spec.semantics, len(node.children)
    is_decorator = node.bound.spec.kind is not Kind.CONTROL
    if not count or semantics.possible is None:
        return WaitRule.WAITS if count == 1 and is_decorator else WaitRule.FREE
    if semantics.order is Order.TOGETHER:
        return WaitRule.PARALLEL
    if node.bound.is_reactive:
        return WaitRule.REACTIVE
    pauses = _pauses_after(node)
    if not pauses or not is_decorator:
        return WaitRule.STEPS if pauses else WaitRule.CHILD
    if semantics.rounds is not None:
        return WaitRule.TURNS
    return WaitRule.LATER if pauses == (SUCCESS,) else WaitRule.WAITS


def _pauses_after(node: RunNode) -> tuple[int, ...]:
    """Return the statuses of children, SUCCESS or FAILURE, after which a node may return RUNNING."""
    return tuple(status for status, bit in ((SUCCESS, S), (FAILURE, F)) if _result(node, bit) & R)


def _result(node: RunNode, bit: int) -> int:
    """Return, as bits, the possible statuses of a node whose children all have the same status."""
    possible = node.bound.spec.semantics.possible
    return possible(node.bound, [bit] * len(node.children), ALLOWED) if possible and node.children else 0


def _waits_without_child(node: RunNode) -> bool:
    """Return whether a decorator of the language may return RUNNING before it ticks its child."""
    return bool(language_variants(node.tag)) and _pauses_after(node) == (SUCCESS, FAILURE)


def _starts_silently(node: RunNode) -> bool:
    """Return whether a node may tick a child before it becomes RUNNING."""
    return node.tag in _SILENT or node.bound.spec.semantics.possible in (None, selection)


def _may_skip(node: RunNode) -> bool:
    is_by_itself = bool((_result(node, S) | _result(node, F)) & K)
    return is_by_itself or not node.bound.element.attributes.keys().isdisjoint(("_skipIf", "_while"))


def _has_limit(node: RunNode) -> bool:
    return node.bound.spec.semantics.limit_sec is not None


def _halts(node: RunNode) -> bool:
    """Return whether a node may halt its descendants at the start of a tick."""
    possible = node.bound.spec.semantics.possible
    chooses = bool(node.children) and possible in (None, selection)
    return chooses or _has_limit(node) or "_while" in node.bound.element.attributes


def _repeats(node: RunNode) -> bool:
    """Return whether a node may tick a child again in the tick in which the child has ended."""
    semantics = node.bound.spec.semantics
    is_unknown = semantics.possible is None and bool(node.children)
    return is_unknown or semantics.resumes or semantics.rounds is not None


def _ticks_when_halted(node: RunNode) -> bool:
    """Return whether a TryCatch ticks its last child when it is halted."""
    return node.bound.element.attributes.get("catch_on_halt", "false").lower() not in ("false", "0")


def _thresholds(node: RunNode) -> tuple[int, int]:
    """Return the number of successes and the number of failures that end a Parallel.

    If a number is unknown, the returned number exceeds the number of children.
    """
    ports, count = node.bound.spec.semantics.counts, len(node.children)
    if len(ports) != 2:  # noqa: PLR2004 - successes and failures
        return count + 1, count + 1
    given = node.bound.element.attributes
    return _number(given, ports[0], -1, count), _number(given, ports[1], 1, count)


def _number(attributes: Mapping[str, str], name: str, default: int, count: int) -> int:
    try:
        number = int(attributes.get(name, default))
    except ValueError:
        return count + 1
    return number if number >= 0 else max(count + number + 1, 0)
