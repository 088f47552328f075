"""What a browser that comes late is told: of a long run the few entries from which the others' state follows."""

from collections.abc import Hashable, Mapping
from typing import Any

from sar_compiler.journal.journal_entries import GOAL_ENDED, GOAL_SENT, RUN_BEGAN, JournalEntry
from sar_compiler.journal.json_values import json_text

# Of some kinds only the last entries are told; of all others, facts among them, so many that nobody has more.
_LAST = {"log": 300, GOAL_SENT: 20, GOAL_ENDED: 20}
_MOST = 5000
# A trail of more poses loses every second one.
_TRAIL = 1000
_LATEST_ONLY = ("plan", "map", "progress")


def as_json(data: object) -> str:
    """Return a value as JSON that every reader takes, in short: numbers that are not finite as null."""
    return json_text(data, separators=(",", ":"))


def entry_text(entry: JournalEntry, robot: int) -> str:
    """Return an entry of a robot as a page takes it; one that is no JSON, or is being changed, as a fact that says so."""
    try:
        return as_json({"robot": robot, **entry._asdict()})
    except Exception as error:  # noqa: BLE001 - one entry must not be the end of the page
        data = {"kind": entry.kind, "reason": str(error)}
        return as_json({"robot": robot, **entry._replace(kind="unreadable", data=data)._asdict()})


class KeptEntries:
    """Entries of a run, as JSON, without those that later ones have made needless.

    Of each node it keeps the entries that began its activation and its status, the latest one, and its last failure; of
    poses a trail; of the log the last lines.

    Args:
        robot: Whose entries they are: its place among the robots of a page.
    """

    def __init__(self, robot: int = 0) -> None:
        self._robot = robot
        self._number = 0
        self._of_key: dict[Hashable, tuple[int, str]] = {}
        self._of_kind: dict[str, list[tuple[int, str]]] = {}
        self._status: dict[object, object] = {}

    def add(self, entry: JournalEntry) -> str:
        """Take an entry; return it as JSON."""
        self._number += 1
        text = entry_text(entry, self._robot)
        item = self._number, text
        if entry.kind == RUN_BEGAN:
            # The tree begins anew; the map is still the same one.
            self._of_key = {key: known for key, known in self._of_key.items() if key == "map"}
            self._status.clear()
        if entry.kind == "status":
            self._take_status(entry.data, item)
        elif entry.kind in _LATEST_ONLY:
            self._of_key[entry.kind] = item
        else:
            self._append(entry.kind, item)
        return text

    def _append(self, kind: str, item: tuple[int, str]) -> None:
        items = self._of_kind.setdefault(kind, [])
        items.append(item)
        if kind == "pose":
            if len(items) > _TRAIL:
                del items[:-1:2]
        elif len(items) > (most := _LAST.get(kind, _MOST)):
            del items[: len(items) - most]

    def _take_status(self, data: Mapping[str, Any], item: tuple[int, str]) -> None:
        node, status = data.get("node"), data.get("status")
        if status == "IDLE":  # the page shows what a node came to before it was reset, as something former
            return
        was = self._status.get(node)
        if was != "RUNNING":
            self._of_key["entered", node] = item
        if was != status:
            self._status[node] = status
            self._of_key["since", node] = item
        self._of_key["latest", node] = item
        if status == "FAILURE":
            self._of_key["failed", node] = item

    def texts(self) -> list[str]:
        """Return what is kept, in its order."""
        items = {*self._of_key.values(), *(item for items in self._of_kind.values() for item in items)}
        return [text for _, text in sorted(items)]
