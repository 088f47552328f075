"""The questions that are asked of a tree, their answers from the graph of its states, and what of these is otherwise for another tree."""

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from html import escape

from sar_compiler.analysis.merging import MergedValues
from sar_compiler.analysis.state_search.graph import Breach
from sar_compiler.analysis.state_search.liveness import endings, lasso, owing_for_ever
from sar_compiler.analysis.stub_leaf import StubLeaf
from sar_compiler.analysis.verify.properties import LeftOut, Properties
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
    """A question and its answer.

    Attributes:
        question: What was asked, as what should be.
        outcome: What is known of it.
        reason: Why it does not hold, or is not decided; empty where it is proved.
        trace: A run in which it does not hold, with as few ticks as can be.
    """

    question: str
    outcome: ProofStatus
    reason: str = ""
    trace: Trace | None = None

    def __repr__(self) -> str:
        """Return the question and its answer; a run has many lines of its own."""
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
        verdicts: The questions with their answers.
        states: How many states were found.
        steps: How many steps there are between them: ticks, and parts of ticks that many ticks have in common.
        depth: How many ticks it takes to come everywhere; where not every state was gone through, how many ticks
            every run was followed for.
        complete: Whether every state was gone through.
        left_out: The properties that say nothing about this tree.
        growing: What had most values where not every state was gone through, with their number.
        leaves: The leaves that the runs speak of.
        stopped: Whether somebody wanted the search to end before all was gone through.
        by_semantics: The tags of the nodes that were taken to do what their `semantics` say, each with its class: they have a
            `tick` of their own, of which nothing is proved.
        searches: How many searches there were; with more than one, states and steps are those of all.
        branches: How many parallel branches share nothing, and stood for themselves where the question did not speak of them.
        merged: The keys and facts of which not all values were distinguished, since no run can tell them apart.
    """

    verdicts: tuple[Verdict, ...]
    states: int
    steps: int
    depth: int
    complete: bool
    left_out: tuple[LeftOut, ...] = ()
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
    def proved(self) -> bool:
        """Whether everything is proved."""
        return all(verdict.outcome is ProofStatus.PROVED for verdict in self.verdicts)


NO_ERROR = "no tick raises an error"
EVERY_LEAF = "every leaf can run"
AN_END = "an end can be reached from everywhere"
NO_LIVELOCK = "every run ends"
OWN_RECORDS = "classes of your own do what their records say"


def questions_of(properties: Properties) -> list[str]:
    """Return the questions about a tree: those that are asked of every tree, and its properties."""
    ends = [AN_END, NO_LIVELOCK] if properties.has_end else []
    return [NO_ERROR, EVERY_LEAF, *ends, *properties.names]


class Questions:
    """Answers questions about the runs of a tree.

    Args:
        space: Its states and ticks.
        told: Says in words what a tick raises.
    """

    def __init__(self, space: StateSpace, told: Callable[[BaseException], str]) -> None:
        self._space = space
        self._graph = space.graph
        self._told = told

    def no_error(self) -> Verdict:
        """Return the verdict on whether a tick of any run raises an error."""
        error, unknown = self._graph.error, self._space.unknown
        first = error or unknown
        if first is None:
            return self._unbroken(NO_ERROR)
        assert first.error is not None  # noqa: S101 - that is what kind of breach it is
        outcome = ProofStatus.UNDECIDED if error is None else ProofStatus.BROKEN
        trace = self._space.breach(first)
        return Verdict(NO_ERROR, outcome, self._told(self._space.raised or first.error), trace)

    def every_leaf(self, leaves: Sequence[TreeNode], ran: Collection[int]) -> Verdict:
        """Return the verdict on whether every leaf is ticked in some run."""
        never = [f"'{node.behaviour.name}'" for node in leaves if node.index not in ran]
        if not never:
            return Verdict(EVERY_LEAF, ProofStatus.PROVED)
        names = ", ".join(never)
        if self._space.unknown is not None:
            return Verdict(EVERY_LEAF, ProofStatus.UNDECIDED, self._depends_on(self._space.unknown))
        if self._graph.complete:
            return _broken(EVERY_LEAF, f"in no run is it the turn of {names}")
        return Verdict(EVERY_LEAF, ProofStatus.UNDECIDED, f"so far it was not the turn of {names}")

    def endings(self) -> Iterator[Verdict]:
        """Yield the verdicts on whether the runs end."""
        found = endings(self._graph)
        if found.stuck is None:
            yield self._unbroken(AN_END)
        elif self._space.unknown is not None:
            # An end may come in a run that was not followed.
            yield Verdict(AN_END, ProofStatus.UNDECIDED, self._depends_on(self._space.unknown))
        else:
            yield _broken(AN_END, "after this no end comes any more", self._space.to(found.stuck))
        if found.circling is None:
            yield self._unbroken(NO_LIVELOCK)
        else:
            yield _broken(NO_LIVELOCK, "this run goes on for ever", self._round(found.circling))

    def own_records(self, rule: int, wrong: Callable[[], str]) -> Verdict:
        """Return the verdict on whether the user's controls and decorators do what their records say.

        Args:
            rule: The number of that property.
            wrong: Returns what was done last that a record excludes, in words.
        """
        breach = self._graph.breaches.get(rule)
        if breach is None:
            return self._unbroken(OWN_RECORDS)
        # To tell the run is to play it, its last tick last.
        trace = self._space.breach(breach)
        return _broken(OWN_RECORDS, wrong(), trace)

    def properties(self, properties: Properties) -> Iterator[Verdict]:
        """Yield a verdict for each property."""
        for rule, name in enumerate(properties.names):
            breach = self._graph.breaches.get(rule)
            if breach is not None:
                yield _broken(name, "it is broken in the last tick", self._space.breach(breach))
                continue
            circling = owing_for_ever(self._graph, 1 << rule) if rule in properties.owing else None
            if circling is None:
                yield self._unbroken(name)
            else:
                yield _broken(name, "what must come never comes in this run", self._round(circling))

    def _depends_on(self, breach: Breach) -> str:
        value = unknown_value_of(breach.error)
        assert value is not None  # noqa: S101 - that is what kind of breach it is
        return f"it depends on what '{value.leaf}' writes to '{value.key}'"

    def _round(self, component: list[int]) -> Trace:
        return self._space.lasso(lasso(self._graph, component))

    def _unbroken(self, question: str) -> Verdict:
        graph = self._graph
        if graph.error is not None:
            reason = "a run that raises an error was not followed beyond it"
            return Verdict(question, ProofStatus.UNDECIDED, reason)
        if self._space.unknown is not None:
            return Verdict(question, ProofStatus.UNDECIDED, self._depends_on(self._space.unknown))
        if graph.complete:
            return Verdict(question, ProofStatus.PROVED)
        seen = {0: "what was seen of the first tick", 1: "the first tick of every run"}
        where = seen.get(graph.depth, f"the first {graph.depth:,} ticks of every run")
        reason = f"nothing speaks against it in {where}"
        return Verdict(question, ProofStatus.UNDECIDED, reason)


def _broken(question: str, reason: str, trace: Trace | None = None) -> Verdict:
    return Verdict(question, ProofStatus.BROKEN, reason, trace)


SAME, WORSE, BETTER, OTHER = "the same", "worse", "better", "different"
"""The ways in which an answer can have changed."""

# What is not asked of a tree, because it lacks the leaves, is as little known as what is not decided.
_RANKS: Mapping[ProofStatus | None, int] = {
    ProofStatus.BROKEN: 0,
    ProofStatus.UNDECIDED: 1,
    None: 1,
    ProofStatus.PROVED: 2,
}


@dataclass(frozen=True)
class ComparedAnswer:
    """A question that was asked of two trees, or of one of them.

    Attributes:
        question: The question.
        before: The answer for the one tree; None if it was left out there.
        now: The answer for the other tree; None if it was left out there.
    """

    question: str
    before: Verdict | None
    now: Verdict | None

    @property
    def change(self) -> str:
        """How the answer has changed: `SAME`, `WORSE`, `BETTER`, or `OTHER` for neither."""
        before, now = (None if each is None else each.outcome for each in (self.before, self.now))
        if before is now:
            return SAME
        if _RANKS[before] == _RANKS[now]:
            return OTHER
        return WORSE if _RANKS[now] < _RANKS[before] else BETTER


@dataclass(frozen=True)
class VerificationComparison:
    """The answers about two trees, of which the same was asked.

    Attributes:
        before: The result for the one tree.
        now: The result for the other.
    """

    before: Verification
    now: Verification

    @property
    def answers(self) -> tuple[ComparedAnswer, ...]:
        """Every question that was asked of either tree, in their order."""
        before, now = ({v.question: v for v in each.verdicts} for each in (self.before, self.now))
        return tuple(ComparedAnswer(name, before.get(name), now.get(name)) for name in {**now, **before})

    @property
    def worse(self) -> bool:
        """Whether any answer is worse than before."""
        return any(answer.change == WORSE for answer in self.answers)
