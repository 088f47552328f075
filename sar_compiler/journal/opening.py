"""Opening the journal of a run: which file, and whether a mission begins in it or goes on."""

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
    """Return where the journal of a node is kept, unless a file is named.

    Args:
        node: The node's full name.
        environment: The environment; of another ROS domain than 0 it is another file.
    """
    domain = environment.get("ROS_DOMAIN_ID") or "0"
    ending = f".domain_{domain}" if domain != "0" else ""
    return state_folder(environment) / f"{node.strip('/').replace('/', '.')}{ending}{_SUFFIX}"


def simulated_place(node: str, *, resume: bool, environment: Mapping[str, str] = os.environ) -> Path:
    """Return where the journal of a simulated run of a node is kept, apart from those of robots.

    Args:
        node: The node's full name.
        resume: Whether it is that of the last run, to go on with it; else a new one.
        environment: The environment, as of `default_place`.
    """
    usual = default_place(node, environment)
    place = usual.with_name(_SIMULATED) / usual.name
    own = re.compile(rf"{re.escape(place.stem)}\.\d{{8}}-\d{{6}}(-\d+)?{_SUFFIX}")
    earlier = [path for path in _by_age(place.parent) if own.fullmatch(path.name)]
    if resume:
        return earlier[-1] if earlier else place
    return _aside(place, time.time())


def forget_simulated(place: Path) -> None:
    """Delete journals of simulated runs beside one that is about to begin, so that the last ten are kept; never one that is written to."""
    others = [path for path in _by_age(place.parent) if path != place]
    for path in others[: 1 - _KEPT_SIMULATED]:
        if not is_locked(path):
            for each in place.parent.glob(
                f"{glob.escape(path.name)}*"
            ):  # with what SQLite and its reserve put beside it
                each.unlink(missing_ok=True)


def _by_age(folder: Path) -> list[Path]:
    """Return the journals in a folder, the one that was written to last at the end."""
    found = []
    for path in folder.glob(f"*{_SUFFIX}"):
        with suppress(OSError):  # another process has just deleted it
            found.append((path.stat().st_mtime, path))
    return [path for _, path in sorted(found)]


def open_journal(place: Path, *, resume: bool = False, anew: bool = False, is_named: bool = True) -> Journal:
    """Open the journal of a run; an earlier mission in the file is put aside only when the run begins.

    Args:
        place: The file.
        resume: Whether to go on with the mission that is in it.
        anew: Whether to begin a mission whatever is in it.
        is_named: Whether the user has named the file: what is in it is then not put aside unasked, though the mission
            was stopped by its operator.

    Raises:
        JournalError: If there is no such mission to go on with, or one is in it that is not over; if a run in another
            process writes to it, or it is no journal.
    """
    if resume and not os.path.exists(place):  # noqa: PTH110 - which raises nothing
        raise JournalError(f"there is no journal {place}, so nothing to resume: leave --resume out")
    file = JournalFile.open(place)
    try:
        return _judged(file, resume=resume, anew=anew, is_named=is_named)
    except BaseException:
        file.close()
        raise


def _judged(file: JournalFile, *, resume: bool, anew: bool, is_named: bool) -> Journal:
    runs = file.runs()
    last = runs[-1] if runs else None
    if last is None:
        if not resume:
            return Journal(file)
        raise JournalError(
            f"nothing has begun in the journal {file.path}, so there is nothing to resume: leave --resume out"
        )
    if resume:
        if last.is_over:
            raise JournalError(
                f"the mission in the journal {file.path} is over ({last.reason}): there is nothing to resume; leave "
                "--resume out to begin anew"
            )
        return Journal(file)
    if not (anew or last.is_over or (last.ending is Ending.STOPPED and not is_named)):
        raise JournalError(
            f"the mission in the journal {file.path} is not over: it {_told(last)}. Go on with it: --resume; or begin "
            "anew, and keep that journal under another name: --new"
        )
    return Journal(file, _aside(file.path, runs[0].began))


def _told(run: JournalRun) -> str:
    day = day_and_time(run.ended or run.began)
    if run.ending is None:
        return f"was begun on {day}, and broke off"
    return f"was stopped on {day}" if run.ending is Ending.STOPPED else f"failed on {day}"


def _aside(place: Path, began: float) -> Path:
    """Return a free name for a journal that is put aside: with the time when its mission began."""
    stamp = day_and_time(began, "%Y%m%d-%H%M%S")
    names = (
        f"{place.stem}.{stamp}{count}{place.suffix}" for count in ("", *(f"-{n}" for n in range(2, 1000)))
    )
    return next(path for name in names if not (path := place.with_name(name)).exists())
