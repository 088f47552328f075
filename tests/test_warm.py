"""Tests that a forked command equals a started one, except for imported modules."""

import json
import os
import signal
import subprocess
import sys

import pytest

from tests import warm

START = warm.Popen.__base__
PROGRAM = """\
#!{python}
import faulthandler, json, os, signal, sys
numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGPIPE)
print(json.dumps({{
    "words": sys.argv,
    "main": [__name__, sys.modules["__main__"].__file__],
    "path": sys.path,
    "variables": dict(os.environ),
    "folder": os.getcwd(),
    "parent": os.getppid(),
    "group": os.getpgid(0) == os.getpid() or os.getpgid(0),
    "session": os.getsid(0) == os.getpid() or os.getsid(0),
    "handlers": [str(signal.getsignal(each)) for each in numbers],
    "blocked": [each.name for each in signal.pthread_sigmask(signal.SIG_BLOCK, [])],
    "open": sorted(int(each) for each in os.listdir("/proc/self/fd") if os.path.exists("/proc/self/fd/" + each)),
    "standard input": sys.stdin.read(),
    "written at once": [sys.stdout.line_buffering, sys.stdout.write_through, sys.stderr.line_buffering],
    "encodings": [(each.encoding, each.errors) for each in (sys.stdin, sys.stdout, sys.stderr)],
    "fault handler": faulthandler.is_enabled(),
}}), flush=True)
print("rclpy" in sys.modules, file=sys.stderr, flush=True)
{end}
"""
SURROUNDINGS = {
    "as the test": {},
    "words": {"words": ("--sim", "", "ü", "two words")},
    "another folder": {"cwd": "/"},
    "variables": {"env": {"PATH": "/nowhere", **warm.AT_START, "PYTHONFAULTHANDLER": "1"}},
    "a session": {"start_new_session": True},
    "input": {"typed": "a line\n"},
    "errors in the output": {"stderr": subprocess.STDOUT},
}


@pytest.fixture
def program(tmp_path, monkeypatch):
    """Return a function that writes a program that prints the properties of its process."""

    def write(end=""):
        path = tmp_path / "program"
        path.write_text(PROGRAM.format(python=sys.executable, end=end), encoding="utf-8")
        path.chmod(0o755)
        monkeypatch.setattr(warm, "COMMANDS", {str(path)})
        return path

    return write


def run_program(begin, path, *, words=(), typed="", **how):
    """Run a program; return its status, the properties that it printed, and its other output."""
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    # The default environment would include variables that libraries set without `os.environ`.
    process = begin([path, *words], **{"env": dict(os.environ), "text": True, **pipes, **how})
    output, errors = process.communicate(typed, timeout=60.0)
    told, _, rest = output.partition("\n")
    return process.returncode, json.loads(told), rest + (errors or "")


@pytest.mark.parametrize("how", SURROUNDINGS.values(), ids=list(SURROUNDINGS))
def test_forked_process_equals_started_process(program, how):
    path = program()
    (status, forked, rest), (_, started, _) = (
        run_program(warm.Popen, path, **how),
        run_program(START, path, **how),
    )
    assert (status, rest) == (0, "True\n")
    assert {name: (told, started[name]) for name, told in forked.items() if told != started[name]} == {}


@pytest.mark.parametrize(
    ("end", "status"),
    [
        ("sys.exit(3)", 3),
        ("sys.exit('an error')", 1),
        ("raise SystemExit", 0),
        ("raise ValueError('wrong')", 1),
        ("os._exit(4)", 4),
        ("import atexit; atexit.register(print, 'at the end')", 0),
        ("os.kill(os.getpid(), signal.SIGKILL)", -signal.SIGKILL),
        ("signal.raise_signal(signal.SIGTERM)", -signal.SIGTERM),
        ("signal.raise_signal(signal.SIGINT)", -signal.SIGINT),
    ],
)
def test_forked_process_ends_like_started_process(program, end, status):
    path = program(end)
    (forked, _, rest), (started, _, expected) = run_program(warm.Popen, path), run_program(START, path)
    assert (forked, started) == (status, status)
    assert rest.splitlines()[-1] == expected.replace("False", "True").splitlines()[-1]


@pytest.mark.parametrize(
    "how",
    [
        {"env": {**os.environ, "PYTHONPATH": "/nowhere"}},
        {"env": {**os.environ, "LC_ALL": "C"}},
        {"preexec_fn": os.getpid},
        {"pass_fds": [2]},
    ],
    ids=" ".join,
)
def test_process_with_special_options_is_started_not_forked(program, how):
    assert run_program(warm.Popen, program(), **how)[2] == "False\n"


def test_missing_folder_raises_in_the_caller(program):
    with pytest.raises(FileNotFoundError):
        warm.Popen([program()], cwd="/nowhere/at/all")
