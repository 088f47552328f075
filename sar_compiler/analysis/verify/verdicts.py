"""Decides questions about a tree, and compares the verdicts on two trees."""

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from html import escape

from sar_compiler.analysis.merging import MergedValues
from sar_compiler.analysis.state_search.graph import Breach
from sar_compiler.analysis.state_search.liveness import endings, lasso, owing_for_ever
from sar_compiler.analysis.stub_leaf import StubLeaf
from sar_compiler.analysis.verify.properties import InapplicableProperty, Properties
from sar_compiler.analysis.verify.state_space import StateSpace, Trace
from sar_compiler.runtime.kernel.tree_nodes import TreeNode
from sar_compiler.runtime.variables import unknown_value_of


class ProofStatus(str, Enum):
    """The result of verifying one statement about a tree."""

    PROVED = "proved"
    BROKEN = "does not hold"
    UNDECIDED = "not decided"


@dataclass(frozen=True)
class Verdict:
    """A statement about a tree, and the verdict on this statement.

    Attributes:
        question: The statement that should hold.
        outcome: The status of the question.
        reason: The reason for a violation or for an undecided status; empty if the statement is proved.
        trace: A run that violates the statement, with as few ticks as possible; None if there is no such run.
    """

    question: str
    outcome: ProofStatus
    reason: str = ""
    trace: Trace | None = None

    def __repr__(self) -> str:
        """Return the question and the verdict as text, without the run."""
        return f"<{self.question}: {self.outcome.value}{f', {self.reason}' if self.reason else ''}>"

    def _repr_html_(self) -> str:
        return _html_table([self])


def _html_table(verdicts: Iterable[Verdict], caption: str = "") -> str:
    """Return verdicts as an HTML table that notebooks can display."""
    rows = [(each.question, each.outcome.value, each.reason) for each in verdicts]
    body = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows)
    return f"<table><caption>{escape(caption)}</caption>{body}</table>"


@dataclass(frozen=True, repr=False)
class Verification:
    """The result of verifying a tree.

    Attributes:
        verdicts: The verdicts on all questions.
        states: The number of states that were found.
        steps: The number of steps between the states: ticks, and parts of ticks that several ticks share.
        depth: The number of ticks up to which every run was explored.
        complete: Whether every state was explored.
        left_out: The properties that do not apply to the tree.
        growing: The keys, facts and cells with the most different values, with these numbers, if not every state was
            explored.
        leaves: The leaves to which the events of runs refer.
        stopped: Whether the search was stopped early.
        by_semantics: The tags and classes of nodes that were replaced by their declared semantics. Their own `tick`
            methods are not verified.
        searches: The number of searches. If there are several, states and steps are totals.
        branches: The number of independent parallel branches that were replaced by automata.
        merged: The keys and facts whose values were merged, because no run can distinguish them.
    """

    verdicts: tuple[Verdict, ...]
    states: int
    steps: int
    depth: int
    complete: bool
    left_out: tuple[InapplicableProperty, ...] = ()
    growing: tuple[tuple[str, int], ...] = ()
    leaves: tuple[StubLeaf, ...] = ()
    stopped: bool = False
    by_semantics: tuple[tuple[str, str], ...] = ()
    searches: int = 1
    branches: int = 0
    merged: tuple[MergedValues, ...] = ()

    def __repr__(self) -> str:
        counts = Counter(verdict.outcome.value for verdict in self.verdicts)
        answers = ", ".join(f"{count} {outcome}" for outcome, count in counts.items())
        return f"<{type(self).__name__}: {answers}; {self.states:,} states{'' if self.complete else ' and more'}>"

    def _repr_html_(self) -> str:
        return _html_table(self.verdicts, repr(self).strip("<>"))

    @property
    def is_proved(self) -> bool:
        """Whether all statements are proved."""
        return all(verdict.outcome is ProofStatus.PROVED for verdict in self.verdicts)


NO_ERROR = "no tick raises an error"
EVERY_LEAF = "every leaf can run"
AN_END = "an end can be reached from everywhere"
NO_LIVELOCK = "every run ends"
OWN_RECORDS = "your classes behave as they declare"


def questions_of(properties: Properties) -> list[str]:
    """Return the questions about a tree: the general questions and the names of the properties."""
    ends = [AN_END, NO_LIVELOCK] if properties.has_end else []
    return [NO_ERROR, EVERY_LEAF, *ends, *properties.names]


class ProofQuestions:
    """Decides the questions about a tree from the states that a search has found.

    Args:
        space: The states of the tree and the ticks between them.
        explain: Describes the error of a tick.
    """

    def __init__(self, space: StateSpace, explain: Callable[[BaseException], str]) -> None:
        self._space = space
        self._graph = space.graph
        self._explain = explain

    def verdict_on_errors(self) -> Verdict:
        """Return the verdict on whether any tick raises an error."""
        error, unknown = self._graph.error, self._space.unknown
        first = error or unknown
        if first is None:
            return self._not_violated(NO_ERROR)
        assert first.error is not None  # noqa: S101 - true for this kind of violation
        outcome = ProofStatus.UNDECIDED if error is None else ProofStatus.BROKEN
        trace = self._space.breach(first)
        return Verdict(NO_ERROR, outcome, self._explain(self._space.tick_error or first.error), trace)

    def verdict_on_leaves(self, leaves: Sequence[TreeNode], ran: Collection[int]) -> Verdict:
        """Return the verdict on whether every leaf is ticked in some run."""
        never = [f"'{node.behaviour.name}'" for node in leaves if node.index not in ran]
        if not never:
            return Verdict(EVERY_LEAF, ProofStatus.PROVED)
        names = ", ".join(never)
        if self._space.unknown is not None:
            return Verdict(EVERY_LEAF, ProofStatus.UNDECIDED, self._depends_on(self._space.unknown))
        if self._graph.complete:
            return _violation(EVERY_LEAF, f"no run ticks {names}")
        return Verdict(EVERY_LEAF, ProofStatus.UNDECIDED, f"no explored run ticks {names}")

    def endings(self) -> Iterator[Verdict]:
        """Yield the verdicts on whether an end can be reached from every state, and on whether every run ends."""
        found = endings(self._graph)
        if found.stuck is None:
            yield self._not_violated(AN_END)
        elif self._space.unknown is not None:
            # An end may follow in a run that was not explored.
            yield Verdict(AN_END, ProofStatus.UNDECIDED, self._depends_on(self._space.unknown))
        else:
            yield _violation(
                AN_END, "no end of the run can be reached from here", self._space.trace_to(found.stuck)
            )
        if found.circling is None:
            yield self._not_violated(NO_LIVELOCK)
        else:
            yield _violation(NO_LIVELOCK, "this run never ends", self._loop_trace(found.circling))

    def verdict_on_declarations(self, rule: int, wrong: Callable[[], str]) -> Verdict:
        """Return the verdict on whether the user's controls and decorators behave as they declare.

        Args:
            rule: The number of the rule that a deviation violates.
            wrong: Returns a description of the last deviation.
        """
        breach = self._graph.breaches.get(rule)
        if breach is None:
            return self._not_violated(OWN_RECORDS)
        # Creating the trace plays the run. Then `wrong` describes the deviation in the last tick.
        trace = self._space.breach(breach)
        return _violation(OWN_RECORDS, wrong(), trace)

    def properties(self, properties: Properties) -> Iterator[Verdict]:
        """Yield a verdict for each property."""
        for rule, name in enumerate(properties.names):
            breach = self._graph.breaches.get(rule)
            if breach is not None:
                yield _violation(name, "it is violated in the last tick", self._space.breach(breach))
                continue
            circling = owing_for_ever(self._graph, 1 << rule) if rule in properties.owing else None
            if circling is None:
                yield self._not_violated(name)
            else:
                yield _violation(
                    name, "the required event never happens in this run", self._loop_trace(circling)
                )

    def _depends_on(self, breach: Breach) -> str:
        value = unknown_value_of(breach.error)
        assert value is not None  # noqa: S101 - true for this kind of violation
        return f"the result depends on the value that '{value.leaf}' writes to '{value.key}'"

    def _loop_trace(self, component: list[int]) -> Trace:
        return self._space.lasso(lasso(self._graph, component))

    def _not_violated(self, question: str) -> Verdict:
        graph = self._graph
        if graph.error is not None:
            reason = "a tick raises an error, and runs were not explored beyond such ticks"
            return Verdict(question, ProofStatus.UNDECIDED, reason)
        if self._space.unknown is not None:
            return Verdict(question, ProofStatus.UNDECIDED, self._depends_on(self._space.unknown))
        if graph.complete:
            return Verdict(question, ProofStatus.PROVED)
        seen = {0: "the explored part of the first tick", 1: "the first tick of every run"}
        where = seen.get(graph.depth, f"the first {graph.depth:,} ticks of every run")
        reason = f"no violation was found in {where}"
        return Verdict(question, ProofStatus.UNDECIDED, reason)


def _violation(question: str, reason: str, trace: Trace | None = None) -> Verdict:
    return Verdict(question, ProofStatus.BROKEN, reason, trace)


SAME, WORSE, BETTER, OTHER = "the same", "worse", "better", "different"
"""The possible results of comparing the verdicts on two trees."""

# A question that does not apply to a tree (None) ranks like an undecided question.
_RANKS: Mapping[ProofStatus | None, int] = {
    ProofStatus.BROKEN: 0,
    ProofStatus.UNDECIDED: 1,
    None: 1,
    ProofStatus.PROVED: 2,
}


@dataclass(frozen=True)
class ComparedVerdict:
    """The verdicts that two trees have for the same question.

    Attributes:
        question: The question.
        before: The verdict for the first tree; None if the question does not apply to it.
        now: The verdict for the second tree; None if the question does not apply to it.
    """

    question: str
    before: Verdict | None
    now: Verdict | None

    @property
    def change(self) -> str:
        """How the verdict has changed: `SAME`, `WORSE`, `BETTER`, or `OTHER` for any other change."""
        before, now = (None if each is None else each.outcome for each in (self.before, self.now))
        if before is now:
            return SAME
        if _RANKS[before] == _RANKS[now]:
            return OTHER
        return WORSE if _RANKS[now] < _RANKS[before] else BETTER


@dataclass(frozen=True)
class VerificationComparison:
    """A comparison of the verifications of two trees.

    Attributes:
        before: The verification of the first tree.
        now: The verification of the second tree.
    """

    before: Verification
    now: Verification

    @property
    def verdicts(self) -> tuple[ComparedVerdict, ...]:
        """The verdicts on all questions about either tree. The questions about the second tree come first."""
        before, now = ({v.question: v for v in each.verdicts} for each in (self.before, self.now))
        return tuple(ComparedVerdict(name, before.get(name), now.get(name)) for name in {**now, **before})

    @property
    def is_worse(self) -> bool:
        """Whether any verdict is worse for the second tree than for the first."""
        return any(answer.change == WORSE for answer in self.verdicts)
