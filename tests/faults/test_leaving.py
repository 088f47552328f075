"""When all that a run has to write is written, nothing that DDS does while it is taken down changes its status."""

import subprocess
import sys

import pytest

from tests.trees import document

CRASHES = {
    "in the thread that takes it down": "ctypes.string_at(0)",
    "by an abort": "os.abort()",
    "in a thread of its own, while the other waits for it and keeps the interpreter": (
        "threading.Thread(target=lambda: ctypes.CDLL(None).memset(1, 0, 1)).start(); ctypes.PyDLL(None).sleep(600)"
    ),
    "never, but hangs": "ctypes.PyDLL(None).sleep(600)",
}
LEAVES = """
import atexit, ctypes, os, sys, threading
from sar_compiler.ros.middleware import leave

def take_down():
    {crash}

atexit.register(print, "tidied up")
print("all is written")
leave(7, take_down)
"""
RUNS = """
import ctypes, rclpy.node
from sar_compiler.cli.run import command

rclpy.node.Node.destroy_node = lambda self: (print("destroyed", flush=True), ctypes.string_at(0))
command()
"""


def run(program, *arguments):
    return subprocess.run(
        [sys.executable, "-c", program, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=120.0,
        check=False,
    )


@pytest.mark.parametrize("crash", CRASHES.values(), ids=CRASHES)
def test_a_process_ends_with_its_status_where_what_is_taken_down_crashes(crash):
    done = run(LEAVES.format(crash=crash))
    assert (done.returncode, done.stdout) == (7, "all is written\ntidied up\n"), done


def test_a_process_waits_for_what_its_other_threads_have_to_finish():
    program = (
        "import sys, threading\n"
        "from sar_compiler.ros.middleware import leave\n"
        "over = threading.Event()\n"
        "threading.Thread(target=lambda: (over.wait(), print('finished'))).start()\n"
        "threading.Timer(0.2, over.set).start()\n"
        "leave(3, lambda: None)\n"
    )
    done = run(program)
    assert (done.returncode, done.stdout, done.stderr) == (3, "finished\n", "")


@pytest.mark.ros
@pytest.mark.parametrize(("leaf", "status"), [("AlwaysSuccess", 0), ("AlwaysFailure", 1)])
def test_a_run_ends_with_its_status_where_its_node_crashes_at_the_end(tmp_path, leaf, status):
    from sar_compiler.journal.database import JournalFile

    tree, place, report = tmp_path / "tree.xml", tmp_path / "run.journal", tmp_path / "report.json"
    tree.write_text(document(f"<{leaf}/>"), encoding="utf-8")
    done = run(RUNS, tree, "--until", "end", "--journal", place, "--report", report)
    assert done.returncode == status, done
    assert "destroyed" in done.stdout
    file = JournalFile.read(place)
    (only,) = file.runs()
    file.close()
    assert (only.is_over, only.status) == (True, status)
    assert report.read_text("utf-8").strip().endswith("}")
