"""Convert a run that another program recorded to a journal."""

import os
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

from sar_compiler.importing import sqlite_log
from sar_compiler.importing.bag import MCAP_MAGIC, read_mcap
from sar_compiler.importing.btlog import MAGIC, read_btlog
from sar_compiler.importing.recorded_tree import (
    ExportedTree,
    RunNode,
    describe_name_differences,
    describe_node_differences,
    read_exported,
    refuse_differences,
    run_nodes,
)
from sar_compiler.importing.recording import (
    FAILURE,
    IDLE,
    RUNNING,
    SUCCESS,
    WORDS,
    Recording,
    UnusableRecordingError,
)
from sar_compiler.importing.ticks import RecordedTick, TickFinder, TickKind
from sar_compiler.journal.database import JournalFile
from sar_compiler.journal.journal_entries import STATUS, Ending, Row
from sar_compiler.journal.spill_file import RunEnd
from sar_compiler.opener import FileKind, read_file, regular_file
from sar_compiler.project import Workspace
from sar_compiler.tree.xml_writer import write_xml
from sar_compiler.views.run_tree import describe_tree
from sar_compiler.writing import write_text

_LOG = FileKind("log of a run", 128 * 2**20)
_BATCH = 20_000
_NAV2 = "nav2:jazzy"


class ImportedRun(NamedTuple):
    """A summary of the imported run.

    Attributes:
        tree: The file of the tree.
        nodes: The number of nodes.
        changes: The number of changes of status.
        ticks: The number of ticks with changes.
        runs: The number of runs; a halt of the whole tree ends a run.
        unsure: The number of tick boundaries that were inferred from a pause alone.
        flaws: Problems of the recording.
        options: Options for commands that read the tree file.
    """

    tree: Path
    nodes: int
    changes: int
    ticks: int
    runs: int
    unsure: int
    flaws: tuple[str, ...]
    options: tuple[str, ...]


def import_run(path: Path, journal: Path, projects: Workspace, trees: Sequence[Path] = ()) -> ImportedRun:
    """Import a recorded run.

    Args:
        path: The recording.
        journal: The journal to write.
        projects: Loads the tree.
        trees: The file of the tree that ran, or several candidates, of which the best match is used. By default the tree in the
            recording is written next to the journal.

    Raises:
        UnusableRecordingError: If the recording cannot be used, or was made with another tree.
        JournalError: If the journal cannot be written, or already has a run.
        SarError: If the tree cannot be read.
    """
    recording = read_recording(path)
    if not recording.times:
        raise UnusableRecordingError(
            f"{path} has no change of status: the program has not ticked the tree, or was killed before the logger wrote"
        )
    exported = read_exported(recording.tree) if recording.tree else None
    if exported is None and not trees:
        raise UnusableRecordingError(
            f"{path} has no tree. Add --tree TREE, the file that bt_navigator has loaded"
        )
    palette = exported.palette if exported is not None else "" if projects.additions.palettes else _NAV2
    if palette:
        added = projects.additions
        models = tuple(dict.fromkeys((*added.models, Path(palette))))
        projects = replace(projects, additions=added._replace(models=models))
    if exported is not None and not trees:
        trees = (Path(f"{journal}.xml"),)
        _write_tree(trees[0], exported, palette)
    fits = []
    for place in trees:
        sketch = projects.load_file(place).sketch()
        nodes = run_nodes(sketch)
        names = describe_name_differences(recording.names, nodes)
        wrong = names if exported is None else describe_node_differences(exported.nodes, nodes)
        fits.append((wrong, place, sketch, nodes))
    wrong, place, sketch, nodes = min(fits, key=lambda each: len(each[0]))
    refuse_differences(wrong, place)
    about, of_run = describe_tree(sketch)
    options = [["--model", str(each)] for each in projects.additions.models]
    of_run |= {
        "version": version("sar_compiler"),
        "tree_file": str(place.resolve()),
        "options": options,
        "imported": {"file": str(path.resolve()), "format": recording.form},
        "time": 0.0,
    }
    with closing(JournalFile.create(journal)) as file:
        writer = _JournalWriter(
            file, recording, nodes, {"mission": None, "simulated": False, **about}, of_run
        )
        writer.write()
    words = tuple(word for option in options for word in option)
    return ImportedRun(
        place,
        len(nodes),
        len(recording.times),
        writer.ticks,
        writer.runs,
        writer.unsure,
        tuple(recording.flaws),
        words,
    )


def read_recording(path: Path) -> Recording:
    """Read a recording; its content determines the format.

    Raises:
        UnusableRecordingError: If its format is unknown, or it cannot be used.
        UnreadableFileError: If the file cannot be read.
    """
    try:
        return _read_recording(path)
    except UnusableRecordingError as error:
        raise UnusableRecordingError(f"{path} cannot be imported: {error}") from error


def _read_recording(path: Path) -> Recording:
    with regular_file(path) as descriptor:
        head = os.read(descriptor, len(MAGIC))
    if head == MAGIC:
        content = read_file(path, _LOG)
        if len(content.data) > _LOG.limit:
            raise UnusableRecordingError(f"it is larger than {_LOG.limit >> 20} MiB")
        return read_btlog(content.data)
    if head.startswith(sqlite_log.MAGIC):
        return sqlite_log.read_sqlite_log(path)
    if head.startswith(MCAP_MAGIC):
        return read_mcap(path)
    raise UnusableRecordingError(
        "it is neither a log of FileLogger2 (.btlog) or SqliteLogger (.db3), nor a bag (.mcap, .db3)"
    )


def _write_tree(place: Path, exported: ExportedTree, palette: str) -> None:
    text = write_xml(exported.without_models_of(palette))
    if place.exists():
        raise UnusableRecordingError(
            f"{place} already exists. Move it away, or name the tree of the run by --tree {place}"
        )
    write_text(place, text)


class _JournalWriter:
    """Writes the ticks of a recorded run to a journal in the same way as `StatusWatch`."""

    def __init__(
        self,
        file: JournalFile,
        recording: Recording,
        nodes: list[RunNode],
        about: dict[str, object],
        of_run: dict[str, object],
    ) -> None:
        self._file, self._recording, self._nodes = file, recording, nodes
        self._about, self._of_run = about, of_run
        self._finder = TickFinder(nodes, recording)
        self.ticks = self.runs = 0
        self._number = self._run = self._tick = 0
        self._rows: list[Row] = []
        self._begin()

    @property
    def unsure(self) -> int:
        """The number of tick boundaries that were inferred from a pause alone."""
        return self._finder.unsure

    def _begin(self) -> None:
        # For each node its last status other than IDLE, and the tick of that.
        self._shown = [IDLE] * (len(self._nodes) + 1)
        self._ticked = [0] * (len(self._nodes) + 1)
        self._standing: set[int] = set()
        self._tick = self._root = 0

    def write(self) -> None:
        """Write the runs."""
        is_open = False
        for tick in self._finder.ticks():
            if not is_open and tick.kind is not TickKind.HALT:
                self._begin_run(tick)
                is_open = True
            if tick.kind is TickKind.HALT:
                if is_open:
                    self._end(Ending.STOPPED, 1, "the program has halted the tree", tick)
                is_open = False
            else:
                self._write_tick(tick)
        self._flush()
        if is_open and self._root not in (IDLE, RUNNING):
            word = WORDS[self._root]
            self._end(Ending.OVER, int(self._root != SUCCESS), f"the tree returned {word}", tick)

    def _begin_run(self, tick: RecordedTick) -> None:
        self._begin()
        self.runs += 1
        wall = self._recording.began + self._recording.times[tick.first] / 1e6
        of_run = {**self._of_run, "time": self._recording.times[tick.first] / 1e6}
        self._run = self._file.begin_run(self._about, of_run, wall)

    def _end(self, ending: Ending, status: int, reason: str, tick: RecordedTick) -> None:
        self._flush()
        wall = self._recording.began + self._recording.times[tick.behind - 1] / 1e6
        self._file.write((), end=RunEnd(self._run, wall, ending, status, reason))

    def _flush(self) -> None:
        self._file.write(self._rows)
        self._rows = []

    def _write_tick(self, tick: RecordedTick) -> None:
        self._tick += 1
        self.ticks += 1
        recording, count = self._recording, len(self._nodes)
        resting: list[int] = []
        now = {recording.uids[index]: index for index in range(tick.first, tick.behind)}
        for index, uid, status in self._shown_in(tick):
            if self._shown[uid] in (IDLE, SUCCESS, FAILURE) and self._nodes[uid - 1].children:
                resting.append(uid)
            self._show(uid, status)
            if uid == 1:
                self._root = status
            is_reset = status in (SUCCESS, FAILURE) and recording.statuses[now[uid]] == IDLE
            more = ', "is_reset": true' if is_reset else ""
            self._row(index, uid, WORDS[status], more)
        for uid, index in sorted(now.items()):
            # Its end remains shown until a node above it restarts; the log has it reset before.
            if 1 < uid <= count and recording.statuses[index] == IDLE and self._shown[uid] == RUNNING:
                self._row(index, uid, "HALTED", f', "last": {self._ticked[uid]}')
                self._show(uid, IDLE)
                resting.append(uid)
        gone = {
            each
            for uid in resting
            for each in self._standing
            if uid < each < self._finder.end_of(uid) and self._ticked[each] < self._tick
        }
        for uid in sorted(gone):
            self._row(tick.behind - 1, uid, "IDLE", f', "last": {self._ticked[uid]}')
            self._show(uid, IDLE)
        if len(self._rows) >= _BATCH:
            self._flush()

    def _show(self, uid: int, status: int) -> None:
        self._shown[uid] = status
        if status != IDLE:
            self._ticked[uid] = self._tick
        (self._standing.add if status in (SUCCESS, FAILURE) else self._standing.discard)(uid)

    def _shown_in(self, tick: RecordedTick) -> Iterator[tuple[int, int, int]]:
        """Yield the index, node and status of the changes of a tick that belong in a journal.

        For a leaf these are all its outcomes, for any other node only its last status.
        """
        recording, nodes, skipped = self._recording, self._nodes, self._finder.skipped
        last: dict[int, int] = {}
        left_out: set[int] = set()
        for index in range(tick.first, tick.behind):
            uid, status = recording.uids[index], recording.statuses[index]
            if not 0 < uid <= len(nodes):
                continue
            if status == IDLE:
                if not nodes[uid - 1].children:
                    last.pop(uid, None)  # a leaf that was halted, and starts again, returns twice
                continue
            before = last.get(uid)
            # A leaf that says RUNNING first, and ends in the same tick, has returned once.
            if before is not None and (nodes[uid - 1].children or recording.statuses[before] == RUNNING):
                left_out.add(before)
            last[uid] = index
        for index in range(tick.first, tick.behind):
            uid, status = recording.uids[index], recording.statuses[index]
            if status != IDLE and 0 < uid <= len(nodes) and index not in left_out:
                yield index, uid, WORDS.index("SKIPPED") if index in skipped else status

    def _row(self, index: int, uid: int, word: str, more: str) -> None:
        time = self._recording.times[index] / 1e6
        for node in self._nodes[uid - 1].rows:
            self._number += 1
            data = f'{{"node": {node}, "tick": {self._tick}, "status": "{word}", "message": ""{more}}}'
            self._rows.append(Row(self._number, self._run, self._recording.began + time, time, STATUS, data))
