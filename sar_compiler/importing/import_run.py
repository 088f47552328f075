"""Import a run that another program has recorded, and write it to a journal."""

import os
from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

from sar_compiler.errors import SarError
from sar_compiler.importing import sqlite_log
from sar_compiler.importing.autoremap import with_remapped_subtrees
from sar_compiler.importing.bag import MCAP_MAGIC, read_mcap
from sar_compiler.importing.btlog import MAGIC, read_btlog
from sar_compiler.importing.journal_writer import JournalWriter, RunSummary
from sar_compiler.importing.recorded_tree import (
    ExportedTree,
    RunNode,
    describe_name_differences,
    describe_node_differences,
    read_exported,
    refuse_differences,
    run_nodes,
)
from sar_compiler.importing.recording import Recording, UnusableRecordingError
from sar_compiler.journal.database import JournalFile
from sar_compiler.journal.last_run import LastRunEvents
from sar_compiler.journal.mission_state import tree_nodes
from sar_compiler.opener import FileKind, read_file, regular_file
from sar_compiler.project import ProjectTree, Workspace
from sar_compiler.tree.model import TreeFile
from sar_compiler.tree.xml_writer import write_xml
from sar_compiler.views.run_tree import describe_tree
from sar_compiler.writing import write_text

_LOG = FileKind("log of a run", 128 * 2**20)
_NAV2 = "nav2:jazzy"
_ALL_REMAPPED = "the recorded tree does not show which subtrees have _autoremap. All subtrees are imported with _autoremap, because one subtree reads a key that it does not write"
_UNWRITTEN = ("unwritten-key", "read-before-write", "maybe-unwritten-key")
"""The codes of findings about keys that may be read before they are written."""


class ImportedRun(NamedTuple):
    """A summary of an imported recording.

    Attributes:
        tree: The tree file.
        nodes: The number of nodes.
        changes: The number of status changes.
        ticks: The number of ticks with status changes.
        runs: The number of runs; a halt of the whole tree ends a run.
        ends: The ends of the runs. The last run has no end if the recording ends earlier.
        unsure: The number of possible tick boundaries that were decided only by a pause of ambiguous length.
        flaws: A sentence for each problem of the recording.
        options: The options that other commands need to read the tree file.
    """

    tree: Path
    nodes: int
    changes: int
    ticks: int
    runs: int
    ends: tuple[RunSummary, ...]
    unsure: int
    flaws: tuple[str, ...]
    options: tuple[str, ...]


def import_run(
    path: Path, journal: Path, projects: Workspace, trees: Sequence[Path] = (), last_run: int | None = None
) -> ImportedRun:
    """Import a recorded run.

    Args:
        path: The recording.
        journal: The path of the journal to write.
        projects: Loads the tree.
        trees: The file of the tree that ran, or several candidates, of which the best match is used. By default, the tree in the
            recording is used, and is written to a file beside the journal.
        last_run: The number of the last run to import; by default, all runs are imported.

    Raises:
        UnusableRecordingError: If the recording cannot be used, was made with another tree, or has no such run.
        JournalError: If the journal cannot be written, or already contains a run.
        SarError: If the tree cannot be read.
    """
    recording = read_recording(path)
    if not recording.times:
        raise UnusableRecordingError(
            f"{path} contains no status change. Either the program has not ticked the tree, or it was killed before the "
            "logger wrote its file"
        )
    place = Path(f"{journal}.xml")
    tree = find_tree(recording, path.resolve(), place, projects, trees)
    writer = _write_journal(journal, recording, tree, last_run)
    if last_run is not None and writer.runs != last_run:
        journal.unlink()
        raise UnusableRecordingError(f"{path} has no run {last_run}: its last run is run {writer.runs}")
    if tree.remapped is not None and not _is_possible(journal, tree, writer):
        assumed, exported = tree.remapped
        write_text(place, write_xml(exported))
        other = find_tree(recording, path.resolve(), place, projects, [place])
        journal.unlink()
        writer = _write_journal(journal, recording, other, last_run)
        if _is_possible(journal, other, writer):
            recording.flaws.remove(_ALL_REMAPPED)
        else:
            write_text(place, write_xml(assumed))
            journal.unlink()
            writer = _write_journal(journal, recording, tree, last_run)
    return ImportedRun(
        tree.place,
        len(tree.nodes),
        len(recording.times),
        writer.ticks,
        writer.runs,
        tuple(writer.ends),
        writer.inferred_boundaries,
        tuple(recording.flaws),
        tuple(word for option in tree.options for word in option),
    )


def _write_journal(
    journal: Path, recording: Recording, tree: "RunTree", last_run: int | None
) -> JournalWriter:
    with closing(JournalFile.create(journal)) as file:
        writer = JournalWriter(file, recording, tree.nodes, tree.about, tree.of_run)
        writer.write(last_run)
    return writer


def _is_possible(journal: Path, tree: "RunTree", writer: JournalWriter) -> bool:
    """Return whether the last run in a journal is a possible run of its tree, or True if this is unknown."""
    from sar_compiler.analysis.assumptions import StartValues
    from sar_compiler.analysis.tree_analysis import conform_tree

    nodes = [*tree_nodes(tree.about["tree"])]
    runs = [LastRunEvents(journal, number, nodes) for number in range(1, writer.runs + 1)]
    if not runs:
        return True
    try:
        found = conform_tree(
            tree.loaded,
            runs[-1],
            [each.name for each in nodes],
            is_over=writer.root_has_ended,
            start=StartValues({}, {}),
            is_imported=True,
            earlier=runs[:-1],
        )
    except SarError:  # for example, a control of the tree has only a model
        return True
    return found.misfit is None


class RunTree(NamedTuple):
    """The tree of a recorded run.

    Attributes:
        place: The tree file.
        nodes: The nodes, ordered by their numbers from 1.
        about: The mission's description, as in a journal.
        of_run: The run's description, as in a journal.
        options: The options that other commands need to read the tree file, each with its value.
        loaded: The tree, as it was loaded from the file.
        remapped: If `_autoremap` was added to all subtrees: the file with it, and the file as the program has exported it.
    """

    place: Path
    nodes: list[RunNode]
    about: dict[str, object]
    of_run: dict[str, object]
    options: list[list[str]]
    loaded: ProjectTree
    remapped: tuple[TreeFile, TreeFile] | None


def find_tree(
    recording: Recording, source: Path | str, place: Path, projects: Workspace, trees: Sequence[Path]
) -> RunTree:
    """Find the tree of a recorded run.

    Args:
        recording: The recorded run.
        source: The recording's file or address.
        place: The file to which the tree in the recording is written if *trees* is empty.
        projects: Loads the tree.
        trees: The candidates, of which the best match is used.

    Raises:
        UnusableRecordingError: If the recording has no tree and *trees* is empty, or no candidate is the tree of the run.
        SarError: If the tree cannot be read.
    """
    exported = read_exported(recording.tree) if recording.tree else None
    if exported is None and not trees:
        raise UnusableRecordingError(
            f"{source} has no tree. Add --tree TREE with the file that bt_navigator has loaded"
        )
    palette = exported.palette if exported is not None else "" if projects.additions.palettes else _NAV2
    if palette:
        added = projects.additions
        models = tuple(dict.fromkeys((*added.models, Path(palette))))
        projects = replace(projects, additions=added._replace(models=models))
    variants: tuple[TreeFile, TreeFile] | None = None
    if exported is not None and not trees:
        trees = (place,)
        file, remapped = with_remapped_subtrees(exported.file)
        if remapped:
            exported = replace(exported, file=file)
            recording.flaws.append(
                "the recorded tree does not show which subtrees have _autoremap. These subtrees are imported with _autoremap, because their scripts read a key before "
                f"they write it: {', '.join(remapped)}"
            )
        _write_tree(place, exported, palette)
        if _add_autoremap(place, exported, palette, projects):
            recording.flaws.append(_ALL_REMAPPED)
            assumed = exported.with_autoremap()
            variants = assumed.without_models_of(palette), exported.without_models_of(palette)
    candidates = []
    for each in trees:
        loaded = projects.load_file(each)
        sketch = loaded.sketch()
        nodes = run_nodes(sketch)
        names = describe_name_differences(recording.names, nodes)
        differences = names if exported is None else describe_node_differences(exported.nodes, nodes)
        candidates.append((differences, each, loaded, sketch, nodes))
    differences, found, loaded, sketch, nodes = min(candidates, key=lambda each: len(each[0]))
    refuse_differences(differences, found)
    about, of_run = describe_tree(sketch)
    options = [["--model", str(each)] for each in projects.additions.models]
    of_run |= {
        "version": version("sar_compiler"),
        "tree_file": str(found.resolve()),
        "options": options,
        "imported": {"file": str(source), "format": recording.form},
        "time": 0.0,
    }
    return RunTree(
        found, nodes, {"mission": None, "simulated": False, **about}, of_run, options, loaded, variants
    )


def read_recording(path: Path) -> Recording:
    """Read a recording, and determine the format of the recording from its content.

    Raises:
        UnusableRecordingError: If the format is unknown, or the recording cannot be used.
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
            raise UnusableRecordingError(f"the file is larger than {_LOG.limit >> 20} MiB")
        return read_btlog(content.data)
    if head.startswith(sqlite_log.MAGIC):
        return sqlite_log.read_sqlite_log(path)
    if head.startswith(MCAP_MAGIC):
        return read_mcap(path)
    raise UnusableRecordingError(
        "the file is neither a log of FileLogger2 (.btlog) or SqliteLogger (.db3), nor a bag (.mcap, .db3)"
    )


def _add_autoremap(place: Path, exported: ExportedTree, palette: str, projects: Workspace) -> bool:
    """Add `_autoremap` to all subtrees if this explains keys that are read but never written.

    Return whether the attribute was added.
    """
    unwritten = _count_unwritten(place, projects) if exported.has_subtrees else 0
    if not unwritten:
        return False
    write_text(place, write_xml(exported.with_autoremap().without_models_of(palette)))
    if _count_unwritten(place, projects) < unwritten:
        return True
    write_text(place, write_xml(exported.without_models_of(palette)))
    return False


def _count_unwritten(place: Path, projects: Workspace) -> int:
    return sum(each.code in _UNWRITTEN for each in projects.load_file(place).check())


def _write_tree(place: Path, exported: ExportedTree, palette: str) -> None:
    text = write_xml(exported.without_models_of(palette))
    if place.exists():
        raise UnusableRecordingError(
            f"{place} already exists. Move it away, or use it as the tree of the run with --tree {place}"
        )
    write_text(place, text)
