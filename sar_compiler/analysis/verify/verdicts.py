"""The questions about a tree, their verdicts, and the comparison of two trees' verdicts."""

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
    """The status of a question."""

    PROVED = "proved"
    BROKEN = "does not hold"
    UNDECIDED = "not decided"


@dataclass(frozen=True)
class Verdict:
    """A question and its verdict.

    Attributes:
        question: The statement that should hold.
        outcome: The status of the proof.
        reason: The reason for a violation or an undecided result; empty if it is proved.
        trace: A violating run, with as few ticks as possible.
    """

    question: str
    outcome: ProofStatus
    reason: str = ""
    trace: Trace | None = None

    def __repr__(self) -> str:
        """Return the question and its verdict without the run."""
        return f"<{self.question}: {self.outcome.value}{f', {self.reason}' if self.reason else ''}>"

    def _repr_html_(self) -> str:
        return _table([self])


def _table(verdicts: Iterable[Verdict], caption: str = "") -> str:
    """Return verdicts as a table for notebooks."""
    rows = [(each.question, each.outcome.value, each.reason) for each in verdicts]
    body = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows)
    return f"<table><caption>{escape(caption)}</caption>{body}</table>"


@dataclass(frozen=True, repr=False)
class Verification:
    """The result of verifying a tree.

    Attributes:
        verdicts: The verdicts on all questions.
        states: The number of states found.
        steps: The number of steps between them: ticks, and parts of ticks that several ticks share.
        depth: The number of ticks in which all states are reached; if not all states were explored, the number of
            ticks for which every run was explored.
        complete: Whether every state was explored.
        left_out: The properties that do not apply to this tree.
        growing: The keys, facts and cells with the most values if not every state was explored, with the number of
            values.
        leaves: The leaves that the runs name.
        stopped: Whether the search was stopped early.
        by_semantics: The tags of the nodes whose `semantics` were assumed, each with its class: they have their own
            `tick`, about which nothing is proved.
        searches: The number of searches; with more than one, states and steps are totals.
        branches: The number of independent parallel branches that were replaced by automata.
        merged: The keys and facts with merged values, because no run can distinguish them.
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
        return _table(self.verdicts, repr(self).strip("<>"))

    @property
    def is_proved(self) -> bool:
        """Whether everything is proved."""
        return all(verdict.outcome is ProofStatus.PROVED for verdict in self.verdicts)


NO_ERROR = "no tick raises an error"
EVERY_LEAF = "every leaf can run"
AN_END = "an end can be reached from everywhere"
NO_LIVELOCK = "every run ends"
OWN_RECORDS = "your classes behave as they declare"


def questions_of(properties: Properties) -> list[str]:
    """Return the questions about a tree: the general ones and its properties."""
    ends = [AN_END, NO_LIVELOCK] if properties.has_end else []
    return [NO_ERROR, EVERY_LEAF, *ends, *properties.names]


class ProofQuestions:
    """Answers questions about the runs of a tree.

    Args:
        space: Its states and ticks.
        told: Describes the error of a tick.
    """

    def __init__(self, space: StateSpace, told: Callable[[BaseException], str]) -> None:
        self._space = space
        self._graph = space.graph
        self._told = told

    def verdict_on_errors(self) -> Verdict:
        """Return the verdict on whether any tick raises an error."""
        error, unknown = self._graph.error, self._space.unknown
        first = error or unknown
        if first is None:
            return self._not_violated(NO_ERROR)
        assert first.error is not None  # noqa: S101 - true for this kind of violation
        outcome = ProofStatus.UNDECIDED if error is None else ProofStatus.BROKEN
        trace = self._space.breach(first)
        return Verdict(NO_ERROR, outcome, self._told(self._space.tick_error or first.error), trace)

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
        """Yield the verdicts on whether the runs end."""
        found = endings(self._graph)
        if found.stuck is None:
            yield self._not_violated(AN_END)
        elif self._space.unknown is not None:
            # An end may follow in a run that was not explored.
            yield Verdict(AN_END, ProofStatus.UNDECIDED, self._depends_on(self._space.unknown))
        else:
            yield _violation(AN_END, "the run cannot end after this", self._space.trace_to(found.stuck))
        if found.circling is None:
            yield self._not_violated(NO_LIVELOCK)
        else:
            yield _violation(NO_LIVELOCK, "this run never ends", self._round(found.circling))

    def verdict_on_declarations(self, rule: int, wrong: Callable[[], str]) -> Verdict:
        """Return the verdict on whether the user's controls and decorators match their declarations.

        Args:
            rule: The number of that property.
            wrong: Returns a description of the last deviation.
        """
        breach = self._graph.breaches.get(rule)
        if breach is None:
            return self._not_violated(OWN_RECORDS)
        # Creating the trace plays the run, ending with its last tick.
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
                yield _violation(name, "the required event never happens in this run", self._round(circling))

    def _depends_on(self, breach: Breach) -> str:
        value = unknown_value_of(breach.error)
        assert value is not None  # noqa: S101 - true for this kind of violation
        return f"it depends on the value that '{value.leaf}' writes to '{value.key}'"

    def _round(self, component: list[int]) -> Trace:
        return self._space.lasso(lasso(self._graph, component))

    def _not_violated(self, question: str) -> Verdict:
        graph = self._graph
        if graph.error is not None:
            reason = "runs were not explored beyond an error"
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
"""The possible changes of a verdict."""

# A question that does not apply to a tree, because it lacks the leaves, ranks like an undecided one.
_RANKS: Mapping[ProofStatus | None, int] = {
    ProofStatus.BROKEN: 0,
    ProofStatus.UNDECIDED: 1,
    None: 1,
    ProofStatus.PROVED: 2,
}


@dataclass(frozen=True)
class ComparedVerdict:
    """A question about two trees, or about one of them.

    Attributes:
        question: The question.
        before: The answer for the first tree; None if it was left out there.
        now: The answer for the second tree; None if it was left out there.
    """

    question: str
    before: Verdict | None
    now: Verdict | None

    @property
    def change(self) -> str:
        """The change of the verdict: `SAME`, `WORSE`, `BETTER`, or `OTHER` for neither."""
        before, now = (None if each is None else each.outcome for each in (self.before, self.now))
        if before is now:
            return SAME
        if _RANKS[before] == _RANKS[now]:
            return OTHER
        return WORSE if _RANKS[now] < _RANKS[before] else BETTER


@dataclass(frozen=True)
class VerificationComparison:
    """The verdicts on the same questions about two trees.

    Attributes:
        before: The result for the first tree.
        now: The result for the second tree.
    """

    before: Verification
    now: Verification

    @property
    def verdicts(self) -> tuple[ComparedVerdict, ...]:
        """All questions about either tree, in order."""
        before, now = ({v.question: v for v in each.verdicts} for each in (self.before, self.now))
        return tuple(ComparedVerdict(name, before.get(name), now.get(name)) for name in {**now, **before})

    @property
    def is_worse(self) -> bool:
        """Whether any verdict is worse than before."""
        return any(answer.change == WORSE for answer in self.verdicts)
