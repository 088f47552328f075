"""What a mission's page costs while five browsers look: of a core, and of each tick, which shares Python's lock with it; and how soon it is there.

A tree of thirty leaves is ticked ten times a second, as fast as a mission on a robot that has good news all the time; three leaves say
something else in each tick. The browsers are processes of their own, which read what they are told and do not count. How soon there is a
picture is said by Debian's chromium, from the call of the address to the first paint with content.
"""

import shutil
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing
from typing import Any

from py_trees.common import ParallelPolicy
from py_trees.composites import Parallel

from benchmarks.figures import LOOP, Effort, Missing, Result, compared, in_turns, loop, plain
from benchmarks.journaling import Changing
from benchmarks.leaves import Leaf
from sar_compiler.journal.journal import Journal
from sar_compiler.journal.status_watch import StatusWatch
from sar_compiler.ros.runner import TreeRunner

CORE = "a mission's page, while five browsers look"
TICK = "a tick of thirty leaves, time that passes"
NONE = "the same without a page"
FIRST = "the first picture of the page, time that passes"
_LEAVES, _TALKING, _BROWSERS = 27, 3, 5
_PERIOD_SEC = 0.1
_PATIENCE_SEC = 60.0
_READ = "import sys, urllib.request\nfor line in urllib.request.urlopen(sys.argv[1]): pass"


def measure(effort: Effort) -> Iterator[Result]:
    """Yield the share of a core, and what a tick takes."""
    seconds = max(1.0, 10.0 * effort.share)
    taken = in_turns(
        {CORE: lambda: _flown(seconds, page=True), NONE: lambda: _flown(seconds, page=False)}, effort.few
    )
    shares = [with_page[0] - bare[0] for with_page, bare in zip(taken[CORE], taken[NONE], strict=True)]
    yield plain(CORE, statistics.median(shares), "core")
    with_page, bare = ([tick for _, tick in taken[name]] for name in (CORE, NONE))
    yield from compared(TICK, with_page, {NONE: bare})
    yield from _first_pictures(effort.rounds)


def _first_pictures(rounds: int) -> Iterator[Result]:
    """Yield how long it takes from the call of the address to the first picture."""
    chromium, driver = shutil.which("chromium"), shutil.which("chromedriver")
    if not (chromium and driver):
        yield Missing(FIRST, "", "chromium and chromium-driver are not installed")
        return
    with ExitStack() as stack:
        journal = Journal()
        url, browser = _serve(journal, stack), _browser(chromium, driver)
        stack.callback(browser.quit)
        journal.begin({}, {})
        taken = in_turns({FIRST: lambda: _painted(browser, url), LOOP: loop}, rounds)
        yield from compared(FIRST, taken[FIRST], {LOOP: taken[LOOP]})


def _browser(chromium: str, driver: str) -> Any:
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for argument in ("--headless=new", "--disable-gpu", "--disable-dev-shm-usage", "--no-sandbox"):
        options.add_argument(argument)
    return webdriver.Chrome(options=options, service=Service(driver))


def _painted(browser: Any, url: str) -> float:
    """Open the page anew; return when its first picture was there, seconds.

    Raises:
        TimeoutException: If there is none.
    """
    from selenium.webdriver.support.wait import WebDriverWait

    first = "return performance.getEntriesByName('first-contentful-paint')[0]?.startTime"
    browser.get("about:blank")
    browser.get(url)
    milliseconds: float = WebDriverWait(browser, _PATIENCE_SEC).until(lambda _: browser.execute_script(first))
    return milliseconds / 1000.0


def _serve(journal: Journal, stack: ExitStack) -> str:
    """Serve the page of a journal; return its address."""
    from sar_compiler.web.feed import LiveFeed
    from sar_compiler.web.page_server import PageServer

    feed = LiveFeed({"robots": [""], "verbs": [[]]}, dict)
    journal.listen(feed.take)
    server = stack.enter_context(closing(PageServer(feed, 0)))
    server.start()
    return server.url


def _flown(seconds: float, *, page: bool) -> tuple[float, float]:
    """Tick for some time; return the share of a core that the process took, and the median of what a tick took, seconds."""
    leaves = [Leaf(f"leaf {number}") for number in range(_LEAVES)] + [
        Changing(f"talking {number}") for number in range(_TALKING)
    ]
    root = Parallel("root", ParallelPolicy.SuccessOnAll(synchronise=False), leaves)
    runner, journal = TreeRunner(root), Journal()
    runner.add_visitor(StatusWatch(root, journal))
    with ExitStack() as stack:
        if page:
            events = f"{_serve(journal, stack)}events"
            for _ in range(_BROWSERS):
                browser = subprocess.Popen([sys.executable, "-c", _READ, events])
                stack.callback(browser.wait)
                stack.callback(browser.kill)
        else:
            journal.listen(lambda _: None)
        journal.begin({}, {})
        return _ticked(runner, journal, seconds)


def _ticked(runner: TreeRunner, journal: Journal, seconds: float) -> tuple[float, float]:
    ticks: list[float] = []
    began, cpu = time.monotonic(), time.process_time()
    for number in range(round(seconds / _PERIOD_SEC)):
        time.sleep(max(0.0, began + number * _PERIOD_SEC - time.monotonic()))
        start = time.perf_counter()
        runner.tick()
        ticks.append(time.perf_counter() - start)
        if not number % 10:
            journal.watch("pose", x=1.0, y=2.0, yaw=0.5)
    return (time.process_time() - cpu) / (time.monotonic() - began), statistics.median(ticks)
