"""Tests of the table of test costs."""

import os
import subprocess
import sys
from pathlib import Path

from tests.costs import by_module, find_grown, main

RECORDED = {"a.py": 20.0, "b.py": 20.0, "c.py": 160.0}


def test_module_above_growth_limit_is_reported():
    assert find_grown({**RECORDED, "a.py": 40.0}, RECORDED) == ["a.py: 40.0 s of CPU, expected were 20.0"]


def test_slower_machine_makes_no_difference():
    assert find_grown({module: 3 * seconds for module, seconds in RECORDED.items()}, RECORDED) == []


def test_omitted_tests_do_not_make_other_modules_too_expensive():
    assert find_grown({"a.py": 20.0, "b.py": 20.0, "c.py": 1.0}, RECORDED) == []


def test_too_expensive_module_is_printed_and_fails(tmp_path, capsys):
    table = tmp_path / "costs.tsv"
    table.write_text("cpu_sec\twall_sec\ttest\n99.0\t99.0\ttests/new.py::test_a\n", encoding="utf-8")
    assert main(table) == 1
    assert "costs too much: tests/new.py: 99.0 s of CPU, expected were 0.0" in capsys.readouterr().out
    table.write_text("cpu_sec\twall_sec\ttest\n", encoding="utf-8")
    assert main(table) == 0


def test_new_module_may_take_fifteen_seconds():
    assert find_grown({**RECORDED, "new.py": 14.9}, RECORDED) == []
    assert find_grown({**RECORDED, "new.py": 15.1}, RECORDED) == ["new.py: 15.1 s of CPU, expected were 0.0"]


def test_subset_of_tests_can_be_compared():
    assert find_grown({"a.py": 20.0, "b.py": 21.0}, RECORDED) == []


CONFTEST = """
from pathlib import Path
from tests.costs import CostOfTests

def pytest_configure(config):
    config.pluginmanager.register(CostOfTests(Path("costs.tsv"), is_worker=False))
"""
BUSY = "import time; end = time.process_time() + 0.2\nwhile time.process_time() < end: pass"


def test_child_processes_count_for_their_test(tmp_path):
    busy = f"subprocess.run([sys.executable, '-c', {BUSY!r}])"
    files = {
        "conftest.py": CONFTEST,
        "test_busy.py": f"import subprocess, sys\ndef test_process():\n    {busy}\n",
        "test_idle.py": "def test_nothing():\n    pass\n",
    }
    for name, text in files.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    command = [sys.executable, "-m", "pytest", "--rootdir", tmp_path, tmp_path]
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert "2 passed" in done.stdout, done.stdout
    taken = by_module(tmp_path / "costs.tsv")
    assert taken["test_busy.py"] >= 0.2 > taken["test_idle.py"]
