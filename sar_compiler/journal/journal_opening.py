"""Opens the journal of a run, and starts a new mission or resumes the mission in the file."""

import glob
import os
import re
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from sar_compiler.journal.database import JournalFile, is_locked
from sar_compiler.journal.errors import JournalError
from sar_compiler.journal.journal import Journal
from sar_compiler.journal.journal_entries import Ending, JournalRun, day_and_time
from sar_compiler.resources import state_folder

_SUFFIX, _SIMULATED = ".journal", "simulated"
_KEPT_SIMULATED = 10


def default_place(node: str, environment: Mapping[str, str] = os.environ) -> Path:
    """Return the default path of the journal that a ROS node writes.

    Args:
        node: The node's full name.
        environment: The environment variables; a ROS domain other than 0 is part of the file's name.
    """
    domain = environment.get("ROS_DOMAIN_ID") or "0"
    ending = f".domain_{domain}" if domain != "0" else ""
    return state_folder(environment) / f"{node.strip('/').replace('/', '.')}{ending}{_SUFFIX}"


def simulated_place(node: str, *, resume: bool, environment: Mapping[str, str] = os.environ) -> Path:
    """Return the journal path for a simulated run of the given ROS node.

    Args:
        node: The node's full name.
        resume: Whether to return the journal of the last simulated run, whose mission is then resumed,
            instead of a new path.
        environment: The environment variables, as for `default_place`.
    """
    default = default_place(node, environment)
    place = default.with_name(_SIMULATED) / default.name
    own = re.compile(rf"{re.escape(place.stem)}\.\d{{8}}-\d{{6}}(-\d+)?{_SUFFIX}")
    earlier = [path for path in _journals_by_age(place.parent) if own.fullmatch(path.name)]
    if resume:
        return earlier[-1] if earlier else place
    return _backup_path(place, time.time())


def delete_old_simulated(place: Path) -> None:
    """Delete old journals of simulated runs.

    Keep *place*, the nine journals before it, and journals in use.
    """
    others = [path for path in _journals_by_age(place.parent) if path != place]
    for path in others[: 1 - _KEPT_SIMULATED]:
        if not is_locked(path):
            for each in place.parent.glob(
                f"{glob.escape(path.name)}*"
            ):  # including the files of SQLite and the reserve beside the journal
                each.unlink(missing_ok=True)


def _journals_by_age(folder: Path) -> list[Path]:
    """Return the journals in a folder, in the order in which they were last written."""
    found = []
    for path in folder.glob(f"*{_SUFFIX}"):
        with suppress(OSError):  # another process has just deleted it
            found.append((path.stat().st_mtime, path))
    return [path for _, path in sorted(found)]


def open_journal(
    place: Path, *, resume: bool = False, start_over: bool = False, is_named: bool = True
) -> Journal:
    """Open the journal of a run. A file that contains another mission is renamed only when the run starts.

    Args:
        place: The path of the file.
        resume: Whether to resume the mission in the file.
        start_over: Whether to start a new mission even if the mission in the file is unfinished.
        is_named: Whether the user has named the file. A stopped mission in a named file is replaced only with *start_over*.

    Raises:
        JournalError: If the mission to resume does not exist or is over, if the mission to replace is unfinished, if another process is
            writing to the file, or if the file is not a journal.
    """
    if resume and not os.path.exists(place):  # noqa: PTH110 - which raises no error
        raise JournalError(f"there is no journal {place} to resume. Omit --resume")
    file = JournalFile.open(place)
    try:
        return _journal_to_use(file, resume=resume, start_over=start_over, is_named=is_named)
    except BaseException:
        file.close()
        raise


def _journal_to_use(file: JournalFile, *, resume: bool, start_over: bool, is_named: bool) -> Journal:
    runs = file.runs()
    last = runs[-1] if runs else None
    if last is None:
        if not resume:
            return Journal(file)
        raise JournalError(f"the journal {file.path} has no run to resume. Omit --resume")
    if resume:
        if last.is_over:
            raise JournalError(
                f"the mission in the journal {file.path} is over ({last.reason}). Omit --resume to start over"
            )
        return Journal(file)
    if not (start_over or last.is_over or (last.ending is Ending.STOPPED and not is_named)):
        raise JournalError(
            f"the mission in the journal {file.path} is not over: it {_run_description(last)}. Resume the mission with --resume, or "
            "start over with --new, which keeps that journal under another name"
        )
    return Journal(file, _backup_path(file.path, runs[0].began))


def _run_description(run: JournalRun) -> str:
    day = day_and_time(run.ended or run.began)
    if run.ending is None:
        return f"was started on {day}, and crashed"
    return f"was stopped on {day}" if run.ending is Ending.STOPPED else f"failed on {day}"


def _backup_path(place: Path, began: float) -> Path:
    """Return an unused backup path for a journal. The path contains the time at which the mission started."""
    stamp = day_and_time(began, "%Y%m%d-%H%M%S")
    names = (
        f"{place.stem}.{stamp}{count}{place.suffix}" for count in ("", *(f"-{n}" for n in range(2, 1000)))
    )
    return next(path for name in names if not (path := place.with_name(name)).exists())
