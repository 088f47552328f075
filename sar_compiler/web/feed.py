"""What browsers are told of a run: its entries, from whoever has them to all who listen."""

import asyncio
from collections import deque
from collections.abc import AsyncIterator, Callable, Iterable, Iterator, Sequence
from itertools import islice

from sar_compiler.journal.journal_entries import JournalEntry
from sar_compiler.web.kept_entries import KeptEntries, as_json, entry_text

# How often news are sent, and how often a page hears that the run lives, in seconds.
_NEWS_SEC, _BEAT_SEC = 0.1, 1.0
# So many entries are put into one message: whoever makes it holds Python's lock for a millisecond.
_MESSAGE = 200
# A browser that does not read is let go when so many characters wait for it; it comes again.
_WAITING = 8_000_000


def message(event: str, data: str) -> str:
    """Return a server-sent event; *data* is in one line, as JSON is."""
    return f"event: {event}\ndata: {data}\n\n"


def _messages(texts: Iterable[str]) -> Iterator[str]:
    rest = iter(texts)
    while part := list(islice(rest, _MESSAGE)):
        yield message("entries", f"[{','.join(part)}]")


class RecordedFeed:
    """What journals have, all of it at once, for a page that scrubs through time.

    Args:
        robots: The entries of each robot, in their order.
        hello: What the page is told first, as JSON values; `robots` are their names.
    """

    def __init__(self, robots: Sequence[Iterable[JournalEntry]], hello: dict[str, object]) -> None:
        self._texts = [entry_text(entry, robot) for robot, entries in enumerate(robots) for entry in entries]
        self._hello = {**hello, "entries": len(self._texts)}
        self._ended = False

    async def stream(self) -> AsyncIterator[str]:
        """Yield the server-sent events for a browser: all there is, and then beats, so that it sees when the server goes."""
        yield message("hello", as_json(self._hello))
        for text in _messages(self._texts):
            yield text
        while not self._ended:
            yield message("beat", "{}")
            await asyncio.sleep(_BEAT_SEC)

    async def run(self) -> None:
        """Do nothing: nothing happens in it any more."""

    def end(self) -> None:
        """Let go of whoever listens."""
        self._ended = True


class _Browser:
    """A browser that follows a run; made in the task that sends to it."""

    def __init__(self) -> None:
        self._waiting: asyncio.Queue[str] = asyncio.Queue()
        self._size = 0
        self._task = asyncio.current_task()

    @property
    def is_told(self) -> bool:
        return self._waiting.empty()

    def put(self, text: str) -> bool:
        """Have a text wait; let go of a browser that has not read for long, and return False, since it has missed something."""
        if self._size > _WAITING:
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
    """What happens in runs, as it happens; who comes late is told first what the others know.

    Args:
        hello: What the page is told first, as JSON values; `robots` are the names of the robots.
        beat: Returns what a page is told every second, as JSON values; called in the server's thread.
        robots: How many robots there are.
    """

    def __init__(
        self, hello: dict[str, object], beat: Callable[[], dict[str, object]], robots: int = 1
    ) -> None:
        self._hello, self._beat = hello, beat
        self._news: deque[tuple[int, JournalEntry]] = deque()
        self._kept = [KeptEntries(robot) for robot in range(robots)]
        self._listeners: set[_Browser] = set()
        self._ended = self._has_told_all = False

    def take(self, entry: JournalEntry, robot: int = 0) -> None:
        """Take an entry of a robot: from any thread, at once."""
        self._news.append((robot, entry))

    async def stream(self) -> AsyncIterator[str]:
        """Yield the server-sent events for a browser, until the run has ended; cancelled if the browser is too slow."""
        listener = _Browser()
        # Between these lines nobody else has a turn: what is kept, and what comes next, are all there is.
        self._listeners.add(listener)
        texts = [text for kept in self._kept for text in kept.texts()]
        try:
            yield message("hello", as_json({**self._hello, "entries": len(texts)}))
            for text in _messages(texts):
                yield text
            while not (self._has_told_all and listener.is_told):
                yield await listener.get()
        finally:
            self._listeners.discard(listener)

    async def run(self) -> None:
        """Tell whoever listens, until the run has ended."""
        loop, due = asyncio.get_running_loop(), 0.0
        while not self._ended:
            await self._tell_news()
            if loop.time() >= due:
                due = loop.time() + _BEAT_SEC
                self._tell(message("beat", as_json({**self._beat(), "pages": len(self._listeners)})))
            await asyncio.sleep(_NEWS_SEC)
        await self._tell_news()
        self._tell(message("bye", "{}"))
        self._has_told_all = True

    def end(self) -> None:
        """Let `run` tell what there is still to be told, and end: from any thread."""
        self._ended = True

    async def _tell_news(self) -> None:
        for text in _messages(self._taken()):
            self._tell(text)
            # Whoever comes here is told what is kept by now, and then the next message.
            await asyncio.sleep(0.0)

    def _taken(self) -> Iterator[str]:
        for _ in range(len(self._news)):
            robot, entry = self._news.popleft()
            yield self._kept[robot].add(entry)

    def _tell(self, text: str) -> None:
        self._listeners = {listener for listener in self._listeners if listener.put(text)}


Feed = RecordedFeed | LiveFeed
