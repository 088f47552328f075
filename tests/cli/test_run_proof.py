"""Proving the properties of a run beside it, for the page."""

import os
from argparse import Namespace
from queue import Queue
from typing import Any

import pytest

from sar_compiler.cli.run_proof import BegunRun, ProofQuestion, RunProof
from sar_compiler.errors import SarError
from sar_compiler.journal.journal_entries import PROPERTIES_WATCHED, JournalEntry
from sar_compiler.project import Workspace
from tests.trees import document
from tests.waiting import SILENCE_SEC

TREE = document("<Sequence><NavigateToZone/><DetectSurvivor/><AdvanceZone/></Sequence>")
PROPERTIES = """facts: {zones_left: 1}
properties:
  a drive before the search: {before: DetectSurvivor starts, comes: NavigateToZone arrived}
  nobody is found: {never: DetectSurvivor found}
  no zone is left: {never: AdvanceZone advanced, while: zones_left > 1}
"""
NAMES = ("a drive before the search", "nobody is found", "no zone is left")


class Run:
    """A run of a tree in which there are two zones; what its page is told."""

    def __init__(self, folder, tree=TREE):
        self.path, self.properties = folder / "tree.xml", folder / "properties.yaml"
        self.path.write_text(tree, encoding="utf-8")
        self.properties.write_text(PROPERTIES, encoding="utf-8")
        self.loaded, self.values, self.mission = Workspace().load_file(self.path), {}, self
        self.options = Namespace(tree_id=None)
        self.told: Queue[Any] = Queue()

    def facts(self):
        return {"zones_left": 2, "unknown to the tree": 1}

    def tell(self, _part, proofs):
        self.told.put(proofs)


def question(run, **more):
    return ProofQuestion(BegunRun.of(run, str(run.properties)), NAMES, **more)


def watched(run):
    """Return what proves the properties of a run, which has said for what it is watched."""
    setup: Any = run
    proof = RunProof(setup)
    proof.feed = setup
    data = {"file": str(run.properties), "properties": [{"name": name} for name in NAMES]}
    proof.take(JournalEntry(1, 1, 0.0, 0.0, PROPERTIES_WATCHED, data))
    return proof


def test_each_property_has_its_verdict_for_runs_that_begin_as_this_one(tmp_path):
    answer = question(Run(tmp_path)).answer()
    # With a single zone, as the file has it, the last one would be proved.
    assert answer["verdicts"] == dict(zip(NAMES, ("proved", "does not hold", "does not hold"), strict=True))
    assert answer["said"].endswith(" s")
    assert "broken off" not in answer["said"]


def test_a_search_that_takes_too_long_is_broken_off_and_says_so(tmp_path):
    answer = question(Run(tmp_path), most_sec=-1.0).answer()
    assert answer["said"].startswith("broken off after ")
    assert set(answer["verdicts"].values()) <= {"not decided", "does not hold"}


def test_a_process_of_its_own_proves_and_is_asked_once(tmp_path):
    run = Run(tmp_path)
    proof = watched(run)
    assert proof.ask({}) == proof.ask({}) == {}
    assert run.told.get(timeout=SILENCE_SEC) == {"verdicts": {}, "said": "being proved…"}
    assert run.told.get(timeout=SILENCE_SEC)["verdicts"]["a drive before the search"] == "proved"
    assert run.told.empty()
    assert proof._process is not None
    pid = proof._process.pid
    assert pid is not None
    # It gives way to all others.
    assert os.getpriority(os.PRIO_PROCESS, pid) == 19


def test_what_cannot_be_proved_is_said_with_the_reason(tmp_path):
    run = Run(tmp_path)
    proof = watched(run)
    run.properties.write_text("properties: {p: {never: Nobody}}", encoding="utf-8")
    proof.ask({})
    run.told.get(timeout=SILENCE_SEC)
    assert run.told.get(timeout=SILENCE_SEC)["said"].startswith("not known: ")


def test_the_end_of_the_run_is_the_end_of_its_proof(tmp_path):
    run = Run(tmp_path)
    proof = watched(run)
    proof.ask({})
    proof.end()
    run.told.get(timeout=SILENCE_SEC)
    assert run.told.get(timeout=SILENCE_SEC)["said"] == "not known: the proof was broken off"
    with pytest.raises(SarError, match="not watched"):
        proof.ask({})


def test_a_run_that_is_not_watched_has_nothing_to_prove(tmp_path):
    run: Any = Run(tmp_path)
    with pytest.raises(SarError, match="not watched"):
        RunProof(run).ask({})
