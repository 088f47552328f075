"""Convert a run of another program to journal entries during the run."""

import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Protocol

from sar_compiler.importing.bag import TreeLogReader
from sar_compiler.importing.groot2_client import MOST_WAITING, Groot2Client, NoResponseError
from sar_compiler.importing.import_run import RunTree, find_tree
from sar_compiler.importing.journal_writer import JournalWriter
from sar_compiler.importing.recorded_tree import describe_name_differences, refuse_differences
from sar_compiler.importing.recording import Recording, UnusableRecordingError
from sar_compiler.journal.database import END, JournalFile
from sar_compiler.journal.journal_entries import RUN_BEGAN, RUN_ENDED, JournalEntry, Row, end_data
from sar_compiler.journal.spill_file import RunEnd
from sar_compiler.json_values import json_value
from sar_compiler.project import Workspace


class RunSource(Protocol):
    """The source of the status changes of a run."""

    @property
    def recording(self) -> Recording:
        """The recording of the run so far."""

    def read(self) -> None:
        """Add the changes since the last call to the recording.

        Raises:
            UnusableRecordingError: If the source no longer provides changes.
        """


class Groot2Source:
    """The run of a program that serves Groot2's protocol.

    Args:
        address: The program's host and port, `HOST:PORT`.

    Raises:
        UnusableRecordingError: If no program responds at the address.
    """

    def __init__(self, address: str) -> None:
        self._client = Groot2Client(address)
        self._address = address
        try:
            self.recording = Recording("groot2", 0.0, self._client.read_tree())
            self.recording.began = self._client.start_recording()
            for uid, status in self._client.read_statuses():
                self.recording.add(0, uid, status)
        except UnusableRecordingError:
            self._client.close()
            raise

    def read(self) -> None:
        """Add the changes since the last call to the recording.

        Raises:
            UnusableRecordingError: If the program no longer responds.
        """
        try:
            changes = self._client.read_changes()
        except NoResponseError as error:
            message = (
                f"the program at {self._address} no longer responds. Its last status changes may be missing"
            )
            raise NoResponseError(message) from error
        if len(changes) >= MOST_WAITING:
            self.recording.flaws.append(
                f"the program at {self._address} may have lost status changes, because it stores at most {MOST_WAITING} changes"
            )
        for time, uid, status in changes:
            self.recording.add(time, uid, status)

    def close(self) -> None:
        """Stop recording, and disconnect from the program."""
        with suppress(UnusableRecordingError):
            self._client.stop_recording()
        self._client.close()


class TopicSource:
    """A run whose status changes are published on the topic `behavior_tree_log`.

    Args:
        messages: Returns the serialised messages since the last call.
        lines: Returns the serialised messages of `/rosout` since the last call.
    """

    def __init__(
        self, messages: Callable[[], Iterable[bytes]], lines: Callable[[], Iterable[bytes]] = lambda: ()
    ) -> None:
        self._lines = lines
        self._messages, self._reader = messages, TreeLogReader("topic")
        self.recording = self._reader.recording

    def read(self) -> None:
        """Add the changes and lines since the last call to the recording."""
        for data in self._lines():
            self._reader.add_line(data)
        for data in self._messages():
            self._reader.add(data)


class _EntryList:
    """Collects the entries that a `JournalWriter` writes.

    Args:
        journal: A journal to which the entries are written, too.
    """

    def __init__(self, journal: JournalFile | None) -> None:
        self._entries: list[JournalEntry] = []
        self._journal = journal
        self._run, self._time = 0, 0.0

    def begin_run(self, about: Mapping[str, object], run_about: Mapping[str, object], wall: float) -> int:
        """Add a run; return the run's number."""
        self._run += 1
        if self._journal is not None:
            self._journal.begin_run(about, run_about, wall)
        self._time = float(str(run_about["time"]))
        data = {**about, "run": run_about}
        self._entries.append(JournalEntry(0, self._run, wall, self._time, RUN_BEGAN, data))
        return self._run

    def write(self, watched: Iterable[Row], facts: Sequence[Row] = (), end: RunEnd | None = None) -> None:
        """Add entries and, if given, the end of a run."""
        rows = [*watched, *facts]
        if self._journal is not None and (rows or end is not None):
            self._journal.write(rows, end=end)
        for row in rows:
            self._entries.append(JournalEntry(*row[:5], json_value(row.data)))
            self._time = max(self._time, row.time)
        if end is not None:
            self.show_end(end)

    def show_end(self, end: RunEnd) -> None:
        """Add the end of a run, but do not write it to the journal."""
        data = end_data(end.ending, end.status, end.reason, "")
        self._entries.append(JournalEntry(END, end.run, end.wall, self._time, RUN_ENDED, data))

    def pop(self) -> list[JournalEntry]:
        """Return the entries that were added since the last call."""
        entries, self._entries = self._entries, []
        return entries


class LiveRun:
    """Converts a run to journal entries during the run.

    Args:
        source: The source of the run's changes.
        name: The address of the source.
        projects: Loads the tree.
        trees: The file of the tree that runs, or several candidates, of which the best match is used; by default the source's own tree.
        report: Called with a sentence for each problem of the source.
        journal: A new journal to which the run is written; None for no journal. The source's own tree is written to a file beside the journal.

    Raises:
        JournalError: If the journal cannot be written, or already contains a run.
    """

    def __init__(
        self,
        source: RunSource,
        name: str,
        projects: Workspace,
        trees: Sequence[Path] = (),
        report: Callable[[str], object] = lambda _: None,
        journal: Path | None = None,
    ) -> None:
        self._source, self._name, self._projects, self._trees = source, name, projects, trees
        self._report, self._has_ended = report, False
        self._journal = None if journal is None else JournalFile.create(journal)
        self._entries = _EntryList(self._journal)
        self._tree: RunTree | None = None
        self._writer: JournalWriter | None = None
        self._known = self._ended = 0
        self._folder = tempfile.TemporaryDirectory()
        self._place = Path(self._folder.name, "tree.xml") if journal is None else Path(f"{journal}.xml")

    def read_new(self) -> list[JournalEntry]:
        """Return the journal entries of the run that are new since the last call.

        Raises:
            SarError: If the tree cannot be read, or is not the tree of the run.
        """
        if self._has_ended:
            return []
        recording, end = self._source.recording, ""
        try:
            self._source.read()
        except UnusableRecordingError as error:
            self._has_ended, end = True, str(error)
            self._report(end)
        for flaw in recording.flaws:
            self._report(flaw)
        recording.flaws.clear()
        if self._writer is None and recording.times:
            self._tree = tree = find_tree(recording, self._name, self._place, self._projects, self._trees)
            self._writer = JournalWriter(self._entries, recording, tree.nodes, tree.about, tree.of_run)
        if self._tree is not None and len(recording.names) > self._known:
            self._known = len(recording.names)
            refuse_differences(describe_name_differences(recording.names, self._tree.nodes), self._tree.place)
        if self._writer is not None:
            self._writer.write_next()
            self._show_reported_end(self._writer)
            if end:
                self._writer.end_run(end)
        return self._entries.pop()

    def _show_reported_end(self, writer: JournalWriter) -> None:
        """Show the end of a run that Nav2 has logged.

        Nav2 publishes the tick in which the tree has ended only when the next goal starts. Only then is the end written to the journal.
        """
        end = writer.reported_end()
        if end is not None and end.run != self._ended:
            self._ended = end.run
            self._entries.show_end(end)

    def close(self) -> None:
        """End the run in the journal, if a journal is written, and delete the temporary files."""
        if self._journal is not None:
            if self._writer is not None:
                self._writer.end_run("the recording was stopped")
            self._journal.close()
        self._folder.cleanup()


@contextmanager
def open_live_run(
    topic: str | None,
    groot2: str | None,
    projects: Workspace,
    trees: Sequence[Path],
    report: Callable[[str], object],
    journal: Path | None,
) -> Iterator[LiveRun]:
    """Yield the run of a program that publishes its status changes or serves Groot2's protocol.

    Args:
        topic: The topic on which the program publishes status changes; None for a program that serves Groot2's protocol.
        groot2: The host and port of a program that serves Groot2's protocol, `HOST:PORT`.
        projects: See `LiveRun`.
        trees: See `LiveRun`.
        report: See `LiveRun`.
        journal: See `LiveRun`.

    Raises:
        UnusableRecordingError: If no program responds at the address of *groot2*.
        JournalError: If the journal cannot be written, or already contains a run.
    """
    if topic is None:
        with (
            closing(Groot2Source(groot2 or "")) as source,
            closing(LiveRun(source, groot2 or "", projects, trees, report, journal)) as run,
        ):
            yield run
        return
    from sar_compiler.ros.middleware import require_middleware
    from sar_compiler.ros.serving import spinning_node
    from sar_compiler.ros.tree_log_listener import TreeLogListener

    require_middleware()
    with spinning_node("sar_journal_watch") as node:
        listener = TreeLogListener(node, topic)
        topic_source = TopicSource(listener.messages, listener.lines)
        with closing(LiveRun(topic_source, topic, projects, trees, report, journal)) as run:
            yield run
