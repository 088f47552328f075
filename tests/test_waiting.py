"""Tests of `tests.waiting` and `tests.processes`: waits continue while there is news, and time limits are enforced."""

import itertools
import os
import signal
import subprocess
import sys
import threading
import time
from types import SimpleNamespace

import pytest

from tests.processes import Command
from tests.waiting import Delay, News


def test_wait_continues_while_there_is_news():
    news = News()
    told = []

    def tell():
        for number in range(25):
            with news:
                told.append(number)
                news.tell()
            time.sleep(0.1)

    threading.Thread(target=tell).start()
    with news:
        news.wait_until(lambda: len(told) == 25, lambda: f"only {told} came", silence_sec=2.0)


def test_wait_without_news_fails_with_complaint():
    news = News()
    with news, pytest.raises(AssertionError, match="nothing came"):
        news.wait_until(lambda: False, lambda: "nothing came", silence_sec=0.05)


class FakeDelay:
    """A delay that grows by 20 s at each reading."""

    def __init__(self, pid):
        assert pid == 7
        self.sec = 0.0

    def look(self):
        self.sec += 20.0


def test_silent_process_gets_more_time_while_it_waits_for_processor(monkeypatch):
    clock = itertools.count(0.0, 20.0)
    monkeypatch.setattr("tests.waiting.time", SimpleNamespace(monotonic=clock.__next__))
    monkeypatch.setattr("tests.waiting.Delay", FakeDelay)
    asked = itertools.count()
    news = News()
    with news:
        assert news.wait_until(lambda: next(asked) == 6, lambda: "it was given up", silence_sec=60.0, pid=7)


LINGERING = """
import signal, sys, time
def linger(*_):
    time.sleep(60.0)
    sys.exit(0)
signal.signal(signal.SIGINT, linger)
print("ready", flush=True)
while True:
    signal.pause()
"""


def test_command_that_ends_too_late_fails_with_its_stack():
    command = Command("python", "-c", LINGERING).wait_for("ready")
    with pytest.raises(
        AssertionError, match=r"(?s)python has not ended after (0\.[3-9]|[1-9]).*line 4 in linger"
    ):
        command.stop(within_sec=0.3)


def test_wait_for_line_fails_when_command_ends_without_it():
    with pytest.raises(AssertionError, match="ended without printing 'more'"):
        Command("python", "-c", "print('once')").wait_for("more")


BUSY = "while True: pass"


def test_delay_measures_waiting_for_the_processor():
    processor = {min(os.sched_getaffinity(0))}
    others = [subprocess.Popen([sys.executable, "-c", BUSY]) for _ in range(2)]
    try:
        for other in others:
            os.sched_setaffinity(other.pid, processor)
        delay = Delay(others[0].pid)
        deadline = time.monotonic() + 60.0
        while delay.sec < 0.05:
            assert time.monotonic() < deadline, "two processes share one processor, and neither waits"
            time.sleep(0.02)
            delay.look()
    finally:
        for other in others:
            other.send_signal(signal.SIGKILL)
            other.wait()
