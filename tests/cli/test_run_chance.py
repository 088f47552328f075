"""How likely a run is to succeed, computed beside it, for the page."""

import os
from argparse import Namespace
from queue import Queue
from typing import Any

import pytest

from sar_compiler.cli.run_chance import ChanceQuestion, RunChance
from sar_compiler.cli.run_proof import BegunRun
from sar_compiler.project import Workspace
from tests.trees import document
from tests.waiting import SILENCE_SEC

TREE = document("<Sequence><NavigateToZone/><DetectSurvivor/></Sequence>")
CHANCES = """answers:
  NavigateToZone: [{answer: arrived, p: 0.8, sec: [2, 4]}, {answer: aborted, p: 0.2, sec: 3}]
  DetectSurvivor: [{answer: found, p: 0.9}, {answer: no answer, p: 0.1}]
properties: {}
"""


class Clock:
    def __init__(self):
        self.time = 100.0

    def now(self):
        return self.time


class Run:
    """A run of a tree, with a clock that is moved by hand; what its page is told."""

    def __init__(self, folder, chances=CHANCES):
        self.path, self.properties = folder / "tree.xml", folder / "properties.yaml"
        self.path.write_text(TREE, encoding="utf-8")
        self.properties.write_text(chances, encoding="utf-8")
        self.loaded, self.values, self.mission = Workspace().load_file(self.path), {}, self
        self.node, self.parameters = None, Namespace(tick_rate_hz=2.0)
        self.options = Namespace(tree_id=None, properties=self.properties)
        self.told: Queue[Any] = Queue()

    def facts(self):
        return {"zones_left": 2}

    def tell(self, _part, chance):
        self.told.put(chance)

    def add_post_tick_handler(self, handler):
        self.handler = handler

    def next(self):
        return self.told.get(timeout=SILENCE_SEC)


class Ticked:
    """A tree that was ticked."""

    def __init__(self, status):
        self.root = self.status = self
        self.value = status


@pytest.fixture
def begin(monkeypatch):
    """Begin to tell the chance of a run, whose leaves are not really there."""
    from sar_compiler.cli import run_chance

    clock, begun = Clock(), []
    monkeypatch.setattr(run_chance, "mission_clock", lambda _node: clock)
    monkeypatch.setattr(run_chance, "was_skipped", lambda _root: False)

    def begin(run):
        chance = RunChance(run)
        chance.feed = run
        chance.begin(run.loaded.preview(), run)
        chance.begin_run()
        begun.append(chance)
        return chance, clock

    yield begin
    for chance in begun:
        chance.end()


def tick(run, chance, root, *answers):
    for number, status, label in answers:
        leaf, declared = chance._leaves[number]
        leaf.answer_label = label
        assert declared.label(status, label) == label
        chance.answers(number, status)
    run.handler(Ticked(root))


def test_the_page_is_told_the_chance_as_the_run_goes_on(tmp_path, begin):
    run = Run(tmp_path)
    chance, clock = begin(run)
    assert run.next() == {"low": pytest.approx(0.72), "high": pytest.approx(0.72), "said": "", "time": 0.0}
    tick(run, chance, "RUNNING", (1, "RUNNING", "driving"))
    clock.time += 3.0
    tick(run, chance, "RUNNING", (1, "RUNNING", "driving"))
    while (told := run.next())["time"] < 3.0:
        assert told["low"] == pytest.approx(0.72)
    # What is left is the later half of the time of an arrival.
    assert told["low"] == told["high"] == pytest.approx(0.9)
    clock.time += 0.5
    tick(run, chance, "FAILURE", (1, "FAILURE", "aborted"))
    while (told := run.next())["time"] < 3.5:
        pass
    assert (told["low"], told["high"]) == (0.0, 0.0)


def test_it_is_computed_in_a_process_that_gives_way_to_all_others_and_ends_with_the_run(tmp_path, begin):
    run = Run(tmp_path)
    chance, _ = begin(run)
    run.next()
    assert os.getpriority(os.PRIO_PROCESS, chance._process.pid) == 19
    chance.end()
    chance._process.join(SILENCE_SEC)
    assert not chance._process.is_alive()


def test_a_process_that_dies_leaves_the_run_alone(tmp_path, begin):
    run = Run(tmp_path)
    chance, _ = begin(run)
    run.next()
    chance._process.kill()
    assert run.next() == {"low": None, "high": None, "said": "the computation was broken off", "time": 0.0}
    for _ in range(3):
        tick(run, chance, "RUNNING", (1, "RUNNING", "driving"))


class Grumpy:
    """A leaf that does not say which of its answers it gives."""

    @property
    def answer_label(self):
        message = "not yours"
        raise ValueError(message)


def test_a_leaf_that_raises_where_it_is_asked_ends_the_figure_and_nothing_else(tmp_path, begin):
    run = Run(tmp_path)
    chance, _ = begin(run)
    run.next()
    chance._leaves[1] = Grumpy(), chance._leaves[1][1]
    chance.answers(1, "RUNNING")
    told = run.next()
    assert (told["low"], told["said"]) == (None, "ValueError: not yours")
    run.handler(Ticked("RUNNING"))
    chance._process.join(SILENCE_SEC)
    assert run.told.empty()


def test_a_process_that_cannot_be_begun_ends_the_figure_and_nothing_else(tmp_path, begin, monkeypatch):
    monkeypatch.setattr("multiprocessing.get_context", lambda _: 1 / 0)
    run = Run(tmp_path)
    chance, _ = begin(run)
    assert run.next()["said"].startswith("ZeroDivisionError")
    run.handler(Ticked("RUNNING"))
    assert chance._process is None


def test_what_cannot_be_computed_is_said_with_the_reason(tmp_path, begin):
    run = Run(tmp_path, CHANCES.replace("properties: {}", "properties: {p: {never: Nobody}}"))
    begin(run)
    told = run.next()
    assert told["low"] is None
    assert "'Nobody'" in told["said"]


def test_without_chances_in_the_file_nothing_is_computed(tmp_path, begin):
    run = Run(tmp_path, "answers: {DetectSurvivor: [{status: SUCCESS}]}\nproperties: {}\n")
    chance, _ = begin(run)
    assert chance._process is None
    assert not hasattr(run, "handler")


def test_bounds_that_say_nothing_are_not_told(tmp_path):
    run: Any = Run(tmp_path, "answers: {NavigateToZone: [{answer: arrived, sec: 3}]}\nproperties: {}\n")
    question = ChanceQuestion(BegunRun.of(run, str(run.properties)), 0.5)
    answer = question.answer(question.begin())
    assert (answer["low"], answer["said"]) == (None, "its chances do not tell")


def test_what_takes_longer_than_a_second_is_not_told(tmp_path):
    run: Any = Run(tmp_path, CHANCES.replace("[2, 4]", "[2, 4000]"))
    question = ChanceQuestion(BegunRun.of(run, str(run.properties)), 0.5, most_sec=-1.0)
    answer = question.answer(question.begin())
    assert (answer["low"], answer["said"]) == (None, "that would take too long")
