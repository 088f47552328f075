"""A command that is forked is what it would be if it was started, but for what it has imported."""

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
    """Return a function that writes a program, which tells what its process is before it ends."""

    def write(end=""):
        path = tmp_path / "program"
        path.write_text(PROGRAM.format(python=sys.executable, end=end), encoding="utf-8")
        path.chmod(0o755)
        monkeypatch.setattr(warm, "COMMANDS", {str(path)})
        return path

    return write


def begun(begin, path, *, words=(), typed="", **how):
    """Begin a program; return its status, what it has told of itself, and what else it has written."""
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    # By default a process is started with what libraries have put past `os.environ`, too.
    process = begin([path, *words], **{"env": dict(os.environ), "text": True, **pipes, **how})
    output, errors = process.communicate(typed, timeout=60.0)
    told, _, rest = output.partition("\n")
    return process.returncode, json.loads(told), rest + (errors or "")


@pytest.mark.parametrize("how", SURROUNDINGS.values(), ids=list(SURROUNDINGS))
def test_a_fork_has_what_a_process_has_that_was_started(program, how):
    path = program()
    (status, forked, rest), (_, started, _) = begun(warm.Popen, path, **how), begun(START, path, **how)
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
def test_it_ends_as_that_does(program, end, status):
    path = program(end)
    (forked, _, rest), (started, _, expected) = begun(warm.Popen, path), begun(START, path)
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
def test_what_python_would_start_otherwise_for_is_started(program, how):
    assert begun(warm.Popen, program(), **how)[2] == "False\n"


def test_a_folder_that_is_not_there_is_an_error_of_whoever_begins_it(program):
    with pytest.raises(FileNotFoundError):
        warm.Popen([program()], cwd="/nowhere/at/all")
