"""What is shown of missions whose journals have their facts alone: those of versions that wrote nothing behind them."""

from collections.abc import Iterable, Iterator

from sar_compiler.journal.journal_entries import GOAL_ENDED, OF_ROBOT, ORDERED, RUN_BEGAN, JournalEntry
from sar_compiler.journal.situation import CHANGED, Display, beginning, changes_by
from sar_compiler.missions.choosing import load_missions
from sar_compiler.missions.mission import MissionRun
from sar_compiler.ros.parameter_reader import ParameterReader

_WATCHED = (*OF_ROBOT, "status", "progress", "lacks", "breakpoint", ORDERED, GOAL_ENDED, CHANGED)


def add_displays(stream: Iterable[JournalEntry]) -> Iterator[JournalEntry]:
    """Yield the entries of a journal, with what each fact has changed of what the mission shows.

    That stands in the journal, and is passed on. Where it does not, the mission that is installed says it; if none of that name is, or the
    facts are not its own any more, the rest is yielded as it is.
    """
    entries = iter(stream)
    run: MissionRun | None = None
    shown, following = Display(), next(entries, None)
    while following is not None:
        entry, following = following, next(entries, None)
        yield entry
        is_first = entry.kind == RUN_BEGAN
        if is_first:
            says_itself = following is not None and following.kind == CHANGED
            run = None if says_itself else run or run_of(entry)
        if run is None or entry.kind in _WATCHED:
            continue
        try:
            run.apply(entry._replace(data=entry.data["run"]) if is_first else entry)
            before, shown = shown, run.display()
            changed = (
                beginning(run.kinds, shown)
                if is_first
                else changes_by(entry, run.sentence(entry), before, shown)
            )
        except Exception:  # noqa: BLE001 - whatever a mission makes of facts that are not its own
            yield from [following] if following is not None else []
            yield from entries
            return
        if changed:
            yield entry._replace(kind=CHANGED, data=changed)


def run_of(entry: JournalEntry) -> MissionRun | None:
    """Return a run of the mission whose journal begins with an entry, just begun; None if no such mission is installed."""
    try:
        mission = load_missions()[entry.data["mission"]]
        # A journal may be anybody's, so no file that it names is read. What was read of one is among the parameters.
        given = entry.data["run"]["parameters"].items()
        return mission.begin(
            ParameterReader({name: value for name, value in given if name not in mission.path_parameters})
        )
    except Exception:  # noqa: BLE001 - it is another one by now, or is not installed
        return None
