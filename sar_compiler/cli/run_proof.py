"""What is proved of the properties for which a run is watched: found out when somebody asks, in a process that gives way to all others."""

import multiprocessing
import os
import time
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from threading import Lock, Thread
from typing import TYPE_CHECKING, Any, NamedTuple

from sar_compiler.checks.sweep.workers import live_with_parent
from sar_compiler.errors import SarError
from sar_compiler.journal.journal_entries import PROPERTIES_WATCHED, JournalEntry
from sar_compiler.tree.showing import in_one_line

if TYPE_CHECKING:
    from multiprocessing.connection import Connection
    from multiprocessing.context import SpawnProcess

    from sar_compiler.cli.companions import RunSetup
    from sar_compiler.project import Additions
    from sar_compiler.runtime.answers import Fact
    from sar_compiler.runtime.kernel.searching import Progress
    from sar_compiler.web.feed import LiveFeed

# A search ends after so many states and so many seconds; it is as nice to other processes as can be.
_MOST_STATES, _MOST_SEC, _NICE = 500_000, 300.0, 19

Proofs = Mapping[str, Any]
"""What is proved, as JSON values: `verdicts` by the names of properties, and what is `said` of that."""


class ProofQuestion(NamedTuple):
    """What is to be proved.

    Attributes:
        path: The tree's file.
        additions: What the user adds to its project.
        tree_id: The tree in it; None for the one that the file executes.
        properties: The file of properties.
        names: The properties.
        parameters: The keys of the root blackboard.
        facts: The facts as they were when the run began.
        most_sec: How long it may take, in seconds.
    """

    path: Path
    additions: "Additions"
    tree_id: str | None
    properties: str
    names: tuple[str, ...]
    parameters: Mapping[str, object]
    facts: "Mapping[str, Fact]"
    most_sec: float = _MOST_SEC

    def answer(self) -> Proofs:
        """Return what is proved.

        Raises:
            SarError: If that cannot be said of this tree.
        """
        from sar_compiler.checks.verify import verify
        from sar_compiler.project import Workspace
        from sar_compiler.project.proof import search_as_begun

        began = time.monotonic()

        def is_late(_: "Progress") -> bool:
            return time.monotonic() - began > self.most_sec

        tree = Workspace(self.additions).load_file(self.path)
        search = partial(verify, max_states=_MOST_STATES, on_progress=is_late)
        given = self.properties, self.facts, self.parameters
        found = search_as_begun(tree, tree.binding(self.tree_id), *given, search)
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
            run, names = self._run, tuple(each["name"] for each in entry.data["properties"])
            tree, tree_id = run.loaded, run.options.tree_id
            facts = dict(run.mission.facts())
            given = entry.data["file"], names, dict(run.values), facts
            self._question = ProofQuestion(tree.path, tree.project.additions, tree_id, *given)

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
        self.feed.tell_proofs({"verdicts": {}, "said": "being proved…"})
        Thread(target=self._await, args=(receiver,), name="proof", daemon=True).start()

    def _await(self, receiver: "Connection") -> None:
        try:
            self.feed.tell_proofs(receiver.recv())
        except EOFError:  # it was killed, perhaps for the memory that it took
            self.feed.tell_proofs({"verdicts": {}, "said": "not known: the proof was broken off"})


def _prove(question: ProofQuestion, sender: "Connection") -> None:
    live_with_parent()
    os.nice(_NICE)
    try:
        sender.send(question.answer())
    except SarError as error:
        sender.send({"verdicts": {}, "said": in_one_line(f"not known: {error}")})
