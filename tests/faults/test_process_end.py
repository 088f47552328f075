"""Tests of the end of a process: a crash of DDS during shutdown does not change its exit status."""

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
ENDING_PROGRAM = """
import atexit, ctypes, os, sys, threading
from sar_compiler.process_end import end_process

def take_down():
    {crash}

atexit.register(print, "tidied up")
print("all is written")
end_process(7, take_down)
"""
RUN_PROGRAM = """
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
def test_process_ends_with_its_status_if_shutdown_crashes(crash):
    done = run(ENDING_PROGRAM.format(crash=crash))
    assert (done.returncode, done.stdout) == (7, "all is written\ntidied up\n"), done


def test_process_waits_for_its_other_threads():
    program = (
        "import sys, threading\n"
        "from sar_compiler.process_end import end_process\n"
        "over = threading.Event()\n"
        "threading.Thread(target=lambda: (over.wait(), print('finished'))).start()\n"
        "threading.Timer(0.2, over.set).start()\n"
        "end_process(3, lambda: None)\n"
    )
    done = run(program)
    assert (done.returncode, done.stdout, done.stderr) == (3, "finished\n", "")


UNENDING_THREAD = """
import threading, sys

def recharge():
    threading.Event().wait(600)

threading.Thread(target=recharge, name="charger").start()
"""


@pytest.mark.parametrize("command", ["sar_compile", "sar_run"])
def test_unending_thread_is_named_and_does_not_block_command(command):
    program = f"{UNENDING_THREAD}sys.argv = ['a-command', '--version']\nfrom sar_compiler.cli import console\nconsole.{command}()\n"
    done = run(program)
    assert done.returncode == 0
    assert (
        "a-command: thread 'charger' is still running in <string>:5, in recharge, so the process ends"
        in done.stderr
    )


def test_unending_exit_function_does_not_block_process():
    program = (
        "import atexit, threading\n"
        "from sar_compiler.process_end import end_process\n"
        "atexit.register(threading.Event().wait, 600)\n"
        "end_process(3)\n"
    )
    assert run(program).returncode == 3


def test_signal_ends_process_waiting_for_thread_with_its_own_status():
    program = (
        f"{UNENDING_THREAD}import os, signal\n"
        "from sar_compiler.process_end import end_process\n"
        "threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()\n"
        "end_process(3)\n"
    )
    done = run(program)
    assert (done.returncode, done.stderr) == (3, "")


@pytest.mark.ros
@pytest.mark.parametrize(("leaf", "status"), [("AlwaysSuccess", 0), ("AlwaysFailure", 1)])
def test_run_ends_with_its_status_if_destroying_node_crashes(tmp_path, leaf, status):
    from sar_compiler.journal.database import JournalFile

    tree, place, report = tmp_path / "tree.xml", tmp_path / "run.journal", tmp_path / "report.json"
    tree.write_text(document(f"<{leaf}/>"), encoding="utf-8")
    done = run(RUN_PROGRAM, tree, "--until", "end", "--journal", place, "--report", report)
    assert done.returncode == status, done
    assert "destroyed" in done.stdout
    file = JournalFile.read(place)
    (only,) = file.runs()
    file.close()
    assert (only.is_over, only.status) == (True, status)
    assert report.read_text("utf-8").strip().endswith("}")
