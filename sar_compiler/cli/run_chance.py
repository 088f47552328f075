"""How likely a run is to succeed from where it is: computed beside it, in a process that gives way to all others."""

import multiprocessing
import os
import time
from collections.abc import Callable
from functools import partial
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from queue import SimpleQueue
from threading import Thread
from typing import TYPE_CHECKING, Any, NamedTuple

from py_trees.behaviour import Behaviour
from py_trees.trees import BehaviourTree

from sar_compiler.checks.sweep.workers import live_with_parent
from sar_compiler.checks.verify.properties import read_property_file
from sar_compiler.cli.run_proof import NICE, BegunRun
from sar_compiler.compiler import CompiledTree
from sar_compiler.errors import SarError, UndecidableError
from sar_compiler.ros.clock import mission_clock
from sar_compiler.ros.engine import Engine, error_text
from sar_compiler.runtime.answers import DeclaredAnswers
from sar_compiler.runtime.kernel.searching import Progress
from sar_compiler.runtime.leaf_ear import hear
from sar_compiler.runtime.skipping import was_skipped
from sar_compiler.runtime.walking import pre_order
from sar_compiler.tree.showing import in_one_line

if TYPE_CHECKING:
    from sar_compiler.checks.predict.present import PresentChance
    from sar_compiler.cli.companions import RunSetup
    from sar_compiler.web.feed import LiveFeed

# What takes longer is not shown, in seconds of the processor; how often there is another figure, in seconds.
_MOST_SEC, _EVERY_SEC = 1.0, 1.0
_MOST_STATES = 100_000
# Bounds that are further apart say nothing.
_WIDEST = 0.995

SentTick = tuple[float, tuple[tuple[int, str, str], ...], str]
"""What `PresentChance.take` takes."""


class ChanceQuestion(NamedTuple):
    """What is asked.

    Attributes:
        run: The run.
        period_sec: The time between two ticks, seconds.
        most_sec: How long a figure may take, in seconds of the processor.
    """

    run: BegunRun
    period_sec: float
    most_sec: float = _MOST_SEC

    def begin(self) -> "PresentChance":
        """Return what follows the run.

        Raises:
            SarError: If that cannot be.
            ImportError: If numpy or scipy is not installed.
        """
        from sar_compiler.checks.predict.present import PresentChance

        return self.run.search(partial(PresentChance, period_sec=self.period_sec, known=self.run.facts))

    def answer(self, present: "PresentChance") -> dict[str, Any]:
        """Return the chance of success from the moment up to which the run was followed, as JSON values.

        These are `low` and `high`, or null with what is `said` in their place, and the `time`.
        """
        began = time.process_time()

        def is_late(_: Progress) -> bool:
            return time.process_time() - began > self.most_sec

        said = "its chances do not tell"
        try:
            low, high = present.chance(_MOST_STATES, is_late)
        except UndecidableError as error:
            low, high, said = 0.0, 1.0, str(error)
        if high - low > _WIDEST:
            return not_known(said, present.now)
        return {"low": low, "high": high, "said": "", "time": present.now}


def not_known(why: str, now: float = 0.0) -> dict[str, Any]:
    """Return that nothing is known, as `ChanceQuestion.answer` does."""
    return {"low": None, "high": None, "said": in_one_line(why), "time": now}


class RunChance:
    """Tells a page how likely its run is to succeed from where it is, where its file of properties says how likely answers are.

    Args:
        run: The run.

    Attributes:
        feed: Is told.
    """

    feed: "LiveFeed"

    def __init__(self, run: "RunSetup") -> None:
        self._run = run
        self._leaves: dict[int, tuple[Behaviour, DeclaredAnswers]] = {}
        self._answers: list[tuple[int, str, str]] = []
        self._ticks: SimpleQueue[SentTick | None] = SimpleQueue()
        self._process: SpawnProcess | None = None
        self._clock, self._began = mission_clock(run.node), 0.0
        self._properties = ""
        self._is_over = False

    def begin(self, tree: CompiledTree, engine: Engine) -> None:
        """Hear the leaves of the tree from now on, if there is anything to tell."""
        options = self._run.options
        given = options.properties
        file = self._run.loaded.default_properties(options.tree_id) if given is True else given
        if not file or not read_property_file(file).has_chances:
            return
        self._properties = str(file)
        declared = tree.origins.declared_answers()
        for number, behaviour in enumerate(pre_order(tree.root)):
            if behaviour.id in declared and not behaviour.children:
                self._leaves[number] = behaviour, DeclaredAnswers(declared[behaviour.id])
                hear(behaviour, number, self)
        engine.add_post_tick_handler(self._end_tick)

    def begin_run(self) -> None:
        """Begin to compute."""
        if self._properties:
            self._hear(self._begin)

    def _begin(self) -> None:
        self._began = self._clock.now()
        period_sec = 1.0 / self._run.parameters.tick_rate_hz
        question = ChanceQuestion(BegunRun.of(self._run, self._properties), period_sec)
        # Started afresh, as a proof is.
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        process = context.Process(target=_foretell, args=(question, theirs), daemon=True)
        process.start()
        self._process = process
        theirs.close()
        Thread(target=self._send, args=(ours,), name="chance out", daemon=True).start()
        Thread(target=self._receive, args=(ours,), name="chance in", daemon=True).start()

    def looks(self, number: int) -> None:
        """Be told that a leaf is about to do something."""

    def starts(self, number: int) -> None:
        """Be told that a leaf starts."""

    def halts(self, number: int) -> None:
        """Be told that a leaf was halted."""

    def answers(self, number: int, status: str) -> None:
        """Be told what a leaf has answered."""
        self._hear(self._take_answer, number, status)

    def _take_answer(self, number: int, status: str) -> None:
        leaf, declared = self._leaves[number]
        said = getattr(leaf, "answer_label", "")
        self._answers.append((number, status, declared.label(status, said)))

    def _end_tick(self, tree: BehaviourTree) -> None:
        self._hear(self._take_end, tree)

    def _take_end(self, tree: BehaviourTree) -> None:
        answers, self._answers = tuple(self._answers), []
        root = "SKIPPED" if was_skipped(tree.root) else tree.root.status.value
        self._ticks.put((self._clock.now() - self._began, answers, root))

    def _hear(self, take: Callable[..., object], *what: object) -> None:
        """Have something taken; who only tells how likely success is ends no mission."""
        if self._is_over:
            return
        try:
            take(*what)
        except Exception as error:  # noqa: BLE001
            self.end()
            self.feed.tell("chance", not_known(error_text(error)))

    def end(self) -> None:
        """Tell nothing more."""
        self._is_over = True
        self._ticks.put(None)
        if self._process is not None:
            self._process.kill()

    def _send(self, connection: Connection) -> None:
        # In a thread of its own: a process that gives way to all others may not read for a while.
        try:
            while (tick := self._ticks.get()) is not None:
                connection.send(tick)
        except OSError:  # it has come to its end, of which the other thread tells
            pass

    def _receive(self, connection: Connection) -> None:
        try:
            while (told := connection.recv()) is not None:
                self.feed.tell("chance", told)
        except (EOFError, OSError):
            if not self._is_over:  # it was killed, perhaps for the memory that it took
                self.feed.tell("chance", not_known("the computation was broken off"))
        self._is_over = True


def _foretell(question: ChanceQuestion, connection: Connection) -> None:
    live_with_parent()
    os.nice(NICE)
    try:
        present = question.begin()
        while True:
            due = time.monotonic() + _EVERY_SEC
            connection.send(question.answer(present))
            present.take(*connection.recv())
            while connection.poll(max(due - time.monotonic(), 0.0)):
                present.take(*connection.recv())
    except (SarError, ImportError) as error:
        connection.send(not_known(str(error)))
        connection.send(None)
    except EOFError:
        pass
