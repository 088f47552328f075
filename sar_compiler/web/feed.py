"""Server-sent events that give browsers the state of a run and all changes of this state.

A page receives `hello` (the robots and their commands), `changes`, a `beat` every second, `verbs` if the available commands
change, and `bye` at the end.

Why the first `changes` contain the whole state, as changes of an empty state: the page then needs only one function for the
start, for every later message and for a reconnection. A browser reconnects automatically after an interruption. It then opens a
new stream and receives the state at that time. No message has to be stored or numbered.

Why a browser misses no change in between: the feed, its states and all streams belong to one thread and one event loop.
`stream` registers the browser and reads the state without an `await`, so that every change is either in this state or in
the browser's queue.

Why producers never wait: the thread that ticks the tree calls `add_entry`, which only appends to a deque. This is safe without a
lock. The server's thread applies the entries, a hundred at a time, and sends their effects together every tenth of a
second. A burst of entries therefore does not slow down the mission, and a page receives only the last of several poses.

Why a slow browser is disconnected: its queue would grow without limit in the mission's process. The browser reconnects and
receives the current state, which is smaller than the changes that it missed.

Why there are heartbeats: a waiting mission sends no other messages. Without heartbeats, a page could not distinguish a waiting mission
from a server that is suspended or unreachable.
"""

import asyncio
from collections import deque
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from sar_compiler.journal.display import AwaitedItem
from sar_compiler.journal.journal_entries import JournalEntry
from sar_compiler.journal.mission_state import RunProcess
from sar_compiler.json_values import json_text, json_value
from sar_compiler.web.page_state import PageState, all_changes
from sar_compiler.web.replay import Replay

# The intervals between updates, and between heartbeats to a page, in seconds.
_UPDATE_SEC, _BEAT_SEC = 0.1, 1.0
# The number of entries that are processed before other tasks can run. Processing them holds Python's lock for some milliseconds.
_AT_ONCE = 100
# The length of a browser's queue, in characters, at which the browser is disconnected. The browser then reconnects.
_MAX_WAITING = 8_000_000


def as_json(data: object) -> str:
    """Convert a value to compact JSON. Infinite numbers and NaN become null."""
    return json_text(data, separators=(",", ":"))


def message(event: str, data: object) -> str:
    """Return the text of a server-sent event."""
    return f"event: {event}\ndata: {as_json(data)}\n\n"


class ReplayFeed:
    """The recorded states of journals for a replay page. The page requests states by time.

    Args:
        replay: The recordings.
        hello: The first message to the page, as JSON values; `robots` are the names of the robots.
    """

    def __init__(self, replay: Replay, hello: dict[str, object]) -> None:
        self._replay = replay
        self._hello = {**hello, "mode": "replay", "end": replay.end}
        # Requests are processed one after the other, and in parallel with the server's other work.
        self._reader = ThreadPoolExecutor(1, "replay")
        self._pages = 0
        self._ended = False

    async def moment(self, time: float, since: int) -> str:
        """Return the state at a given time as JSON; see `Replay.moment`.

        Raises:
            JournalError: If a journal has become unreadable.
        """
        return await asyncio.get_running_loop().run_in_executor(
            self._reader, lambda: as_json(self._replay.moment(time, since))
        )

    async def stream(self) -> AsyncIterator[str]:
        """Yield the events for a browser: first the duration of the recording, then heartbeats."""
        self._pages += 1
        try:
            yield message("hello", self._hello)
            while not self._ended:
                yield message("beat", {"pages": self._pages})
                await asyncio.sleep(_BEAT_SEC)
        finally:
            self._pages -= 1

    async def run(self) -> None:
        """Do nothing, because a recording has no new events."""

    def finish(self) -> None:
        """End the streams of all browsers."""
        self._ended = True


class _Browser:
    """A browser that follows a run. The task that sends messages to the browser creates this object."""

    def __init__(self) -> None:
        self._waiting: asyncio.Queue[str] = asyncio.Queue()
        self._size = 0
        self._task = asyncio.current_task()

    @property
    def is_up_to_date(self) -> bool:
        return self._waiting.empty()

    def enqueue(self, text: str) -> bool:
        """Queue a text and return True, or disconnect the browser and return False if the queue is full."""
        if self._size > _MAX_WAITING:
            if self._task is not None:
                self._task.cancel()
            return False
        self._size += len(text)
        self._waiting.put_nowait(text)
        return True

    async def get(self) -> str:
        text = await self._waiting.get()
        self._size -= len(text)
        return text


class LiveFeed:
    """The live events of the robots' runs; a browser that connects later first receives the current state.

    Args:
        hello: The first message to the page, as JSON values; `robots` are the names of the robots, `verbs` their commands.
        beat: Returns the heartbeat of every second, as JSON values; called in the server's thread.
        robots: The number of robots.
        journals: The journals of the robots; empty if they have none.
    """

    def __init__(
        self,
        hello: dict[str, object],
        beat: Callable[[], dict[str, object]],
        robots: int = 1,
        journals: Sequence[Path] = (),
    ) -> None:
        self._hello, self._beat = {**hello, "mode": "live"}, beat
        self._verbs: Any = hello.get("verbs") or [[] for _ in range(robots)]
        self._queue: deque[Callable[[], None]] = deque()
        places = [str(each) for each in journals] or [""] * robots
        self._states = [PageState(robot, place) for robot, place in enumerate(places)]
        self._listeners: set[_Browser] = set()
        self._ended = self._has_sent_all = False

    def add_entry(self, entry: JournalEntry, robot: int = 0) -> None:
        """Queue an entry of a robot, from any thread and without blocking."""
        self._queue.append(lambda: _apply_entry(self._states[robot], entry))

    def set_why(self, why: Mapping[str, Any], robot: int = 0) -> None:
        """Queue the cause of the failure of a robot's run, as JSON values, from any thread and without blocking."""
        self._queue.append(lambda: self._states[robot].set_why(why))

    def set_awaited(self, items: Sequence[AwaitedItem], robot: int = 0) -> None:
        """Queue the resources that a robot's next run waits for, from any thread and without blocking."""
        self._queue.append(lambda: self._states[robot].set_awaited(items))

    def set_process(self, process: RunProcess, robot: int = 0) -> None:
        """Queue the state of a robot's process, from any thread and without blocking."""
        self._queue.append(lambda: self._states[robot].set_process(process))

    def offer(self, verbs: Sequence[Mapping[str, Any]], robot: int = 0) -> None:
        """Queue the available commands of a robot, as JSON values, from any thread and without blocking."""
        self._queue.append(lambda: self._send_commands([*verbs], robot))

    def _send_commands(self, verbs: list[Mapping[str, Any]], robot: int) -> None:
        if self._verbs[robot] != verbs:
            self._verbs[robot] = verbs
            self._send(message("verbs", self._verbs))

    async def stream(self) -> AsyncIterator[str]:
        """Yield the server-sent events for a browser until the run has ended."""
        listener = _Browser()
        # No other task runs before the state is read, so the browser receives every change after this state.
        self._listeners.add(listener)
        state = message("changes", [state.full_state() for state in self._states])
        try:
            yield message("hello", {**self._hello, "verbs": self._verbs})
            yield state
            while not (self._has_sent_all and listener.is_up_to_date):
                yield await listener.get()
        finally:
            self._listeners.discard(listener)

    async def run(self) -> None:
        """Send queued entries to the browsers until the run has ended."""
        loop, due = asyncio.get_running_loop(), 0.0
        while not self._ended:
            await self._send_new_entries()
            if loop.time() >= due:
                due = loop.time() + _BEAT_SEC
                self._send(message("beat", {**self._beat(), "pages": len(self._listeners)}))
            await asyncio.sleep(_UPDATE_SEC)
        await self._send_new_entries()
        self._send(message("bye", {}))
        self._has_sent_all = True

    def finish(self) -> None:
        """Make `run` send the queued entries and then return. Any thread can call this method."""
        self._ended = True

    async def _send_new_entries(self) -> None:
        for left in range(len(self._queue), 0, -1):
            self._queue.popleft()()
            if left % _AT_ONCE == 0:
                await asyncio.sleep(0.0)
        if changes := all_changes(self._states):
            self._send(message("changes", changes))

    def _send(self, text: str) -> None:
        self._listeners = {listener for listener in self._listeners if listener.enqueue(text)}


def _apply_entry(state: PageState, entry: JournalEntry) -> None:
    """Apply an entry in its JSON form. If the entry is not valid JSON, apply an event that reports this."""
    try:
        data = json_value(json_text(entry.data))
    except Exception as error:  # noqa: BLE001 - an entry must not end the page
        entry, data = entry._replace(kind="unreadable"), {"kind": entry.kind, "reason": str(error)}
    state.apply(entry._replace(data=data))


Feed = ReplayFeed | LiveFeed
