"""What is proved of the properties for which a run is watched: found out when somebody asks, in a process that gives way to all others."""

import multiprocessing
import os
import time
from collections.abc import Mapping
from functools import partial
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from pathlib import Path
from threading import Lock, Thread
from typing import TYPE_CHECKING, Any, NamedTuple

from sar_compiler.checks.sweep.workers import live_with_parent
from sar_compiler.errors import SarError
from sar_compiler.journal.journal_entries import PROPERTIES_WATCHED, JournalEntry
from sar_compiler.runtime.answers import Fact
from sar_compiler.tree.showing import in_one_line

if TYPE_CHECKING:
    from sar_compiler.cli.companions import RunSetup
    from sar_compiler.project import Additions
    from sar_compiler.project.proof import SearchResult, TreeSearch
    from sar_compiler.runtime.kernel.searching import Progress
    from sar_compiler.web.feed import LiveFeed

# A search ends after so many states and so many seconds.
_MOST_STATES, _MOST_SEC = 500_000, 300.0
NICE = 19
"""How nice to all others a process is that only tells something of a run."""

Proofs = Mapping[str, Any]
"""What is proved, as JSON values: `verdicts` by the names of properties, and what is `said` of that."""


class BegunRun(NamedTuple):
    """A run that has begun, as another process has to know it.

    Attributes:
        path: The tree's file.
        additions: What the user adds to its project.
        tree_id: The tree in it; None for the one that the file executes.
        properties: The file of properties.
        parameters: The keys of the root blackboard.
        facts: The facts as they were when the run began.
    """

    path: Path
    additions: "Additions"
    tree_id: str | None
    properties: str
    parameters: Mapping[str, object]
    facts: Mapping[str, Fact]

    @classmethod
    def of(cls, run: "RunSetup", properties: str) -> "BegunRun":
        """Return a run that begins now, with a file of properties."""
        tree, facts = run.loaded, dict(run.mission.facts())
        given = run.options.tree_id, properties, dict(run.values), facts
        return cls(tree.path, tree.project.additions, *given)

    def search(self, search: "TreeSearch[SearchResult]") -> "SearchResult":
        """Return what a search finds in the runs that begin as this one has.

        Raises:
            SarError: If nothing can be found in this tree.
        """
        from sar_compiler.project import Workspace
        from sar_compiler.project.proof import search_as_begun

        tree = Workspace(self.additions).load_file(self.path)
        given = self.properties, self.facts, self.parameters
        return search_as_begun(tree, tree.binding(self.tree_id), *given, search)


class ProofQuestion(NamedTuple):
    """What is to be proved.

    Attributes:
        run: The run.
        names: The properties.
        most_sec: How long it may take, in seconds.
    """

    run: BegunRun
    names: tuple[str, ...]
    most_sec: float = _MOST_SEC

    def answer(self) -> Proofs:
        """Return what is proved.

        Raises:
            SarError: If that cannot be said of this tree.
        """
        from sar_compiler.checks.verify import verify

        began = time.monotonic()

        def is_late(_: "Progress") -> bool:
            return time.monotonic() - began > self.most_sec

        found = self.run.search(partial(verify, max_states=_MOST_STATES, on_progress=is_late))
        verdicts = {
            each.question: each.outcome.value for each in found.verdicts if each.question in self.names
        }
        took = f"{found.states:,} states, {time.monotonic() - began:.0f} s"
        return {"verdicts": verdicts, "said": took if found.complete else f"broken off after {took}"}


class RunProof:
    """Proves the properties of a run when somebody asks for it.

    Args:
        run: The run.

    Attributes:
        feed: Is told what is proved.
    """

    feed: "LiveFeed"

    def __init__(self, run: "RunSetup") -> None:
        self._run = run
        self._question: ProofQuestion | None = None
        self._process: SpawnProcess | None = None
        self._lock = Lock()

    def take(self, entry: JournalEntry) -> None:
        """Take an entry of the run."""
        if entry.kind == PROPERTIES_WATCHED and entry.data["file"]:
            names = tuple(each["name"] for each in entry.data["properties"])
            self._question = ProofQuestion(BegunRun.of(self._run, entry.data["file"]), names)

    def ask(self, _: Mapping[str, Any]) -> object:
        """Begin to prove, unless somebody has asked for that before.

        Raises:
            SarError: If the run is not watched.
        """
        with self._lock:
            if self._question is None:
                message = "the run is not watched for properties of a file"
                raise SarError(message)
            if self._process is None:
                self._begin(self._question)
        return {}

    def end(self) -> None:
        """Prove no more."""
        with self._lock:
            self._question = None
            if self._process is not None:
                self._process.kill()

    def _begin(self, question: ProofQuestion) -> None:
        # Started afresh: a copy of this process would have its threads' locks, and hold the journal's.
        context = multiprocessing.get_context("spawn")
        receiver, sender = context.Pipe(duplex=False)
        self._process = context.Process(target=_prove, args=(question, sender), daemon=True)
        self._process.start()
        sender.close()
        self.feed.tell("proofs", {"verdicts": {}, "said": "being proved…"})
        Thread(target=self._await, args=(receiver,), name="proof", daemon=True).start()

    def _await(self, receiver: Connection) -> None:
        try:
            self.feed.tell("proofs", receiver.recv())
        except EOFError:  # it was killed, perhaps for the memory that it took
            self.feed.tell("proofs", {"verdicts": {}, "said": "not known: the proof was broken off"})


def _prove(question: ProofQuestion, sender: Connection) -> None:
    live_with_parent()
    os.nice(NICE)
    try:
        sender.send(question.answer())
    except SarError as error:
        sender.send({"verdicts": {}, "said": in_one_line(f"not known: {error}")})
