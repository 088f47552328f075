"""Starts commands of the project as forks of a process that has imported all modules, because imports are half of most run times.

Such a command is a separate process and a child of the test process, with its own arguments, environment, folder and streams. It
runs the installed script, and ends as the script does. `Popen` replaces `subprocess.Popen` in all tests
(`tests/conftest.py`). It forks only if a new Python process would start in the same way.
"""

import ctypes
import faulthandler
import functools
import gc
import importlib
import json
import os
import pkgutil
import runpy
import socket
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path
from typing import Any

BIN = Path(sys.executable).parent
COMMANDS = {str(path) for path in BIN.glob("sar-*")}
_MOST_BYTES = 200_000
_SUBREAPER = 36  # PR_SET_CHILD_SUBREAPER in linux/prctl.h
_FAULT_HANDLER = "PYTHONFAULTHANDLER"  # a fork enables the fault handler itself
_begun = threading.Lock()


def read_at_start(variables):
    """Return the variables that Python reads at its start, or that configure the measurement of processes."""
    prefixes = ("COVERAGE_", "LANG", "LC_", "LD_", "PYTHON", "_ROS_WHEELS_")
    return {
        name: value
        for name, value in variables.items()
        if name.startswith(prefixes) and name != _FAULT_HANDLER
    }


AT_START = read_at_start(os.environ)
"""The values of these variables in forks."""


_Started: Any = subprocess.Popen


class Popen(_Started):
    """`subprocess.Popen` that forks a command of the project."""

    def _execute_child(self, args, executable, preexec_fn, close_fds, pass_fds, cwd, env, *others):
        shell, streams, new_session, group = others[2], others[3:9], others[14], [*others, -1][15]
        words = [args] if isinstance(args, (str, bytes, os.PathLike)) else list(args)
        variables = dict(os.environ if env is None else env)
        differs = executable or preexec_fn or pass_fds or shell or group not in (None, -1)
        if differs or os.fspath(words[0]) not in COMMANDS or read_at_start(variables) != AT_START:
            super()._execute_child(args, executable, preexec_fn, close_fds, pass_fds, cwd, env, *others)
            return
        reading, _, _, writing, _, complaining = streams
        ends = [own if own >= 0 else number for number, own in enumerate((reading, writing, complaining))]
        asked = json.dumps([[os.fsdecode(word) for word in words], variables, bool(new_session)])
        folder = os.open(cwd or os.curdir, os.O_PATH | os.O_DIRECTORY)
        try:
            self.pid = _fork(asked.encode(), [*ends, folder])
        finally:
            os.close(folder)
        self._child_created = True
        self._close_pipe_fds(*streams)


def _fork(asked, descriptors):
    """Fork a command; return its process id, which is that of a child of this process."""
    libc = ctypes.CDLL(None)
    with _begun:
        server = _server()
        # A process whose parent ends becomes a child of the nearest subreaper above.
        libc.prctl(_SUBREAPER, 1, 0, 0, 0)
        socket.send_fds(server, [asked], descriptors)
        answer = server.recv(_MOST_BYTES)
        libc.prctl(_SUBREAPER, 0, 0, 0, 0)
    assert answer, "the process that forks commands has ended"
    return int(answer)


@functools.cache
def _server():
    """Start the process that forks commands; return a socket to it. It ends when the socket is closed."""
    here, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with there:
        subprocess.Popen(
            [sys.executable, __file__, str(there.fileno())],
            pass_fds=[there.fileno()],
            # Forking a process that has threads is not safe.
            env={**os.environ, **AT_START, "OPENBLAS_NUM_THREADS": "1"},
        )
    return here


def import_all():
    """Import all modules of the package and of the shipped mission."""
    for name in ("sar_compiler", "search_and_rescue"):
        package = importlib.import_module(name)
        for module in pkgutil.walk_packages(package.__path__, f"{name}."):
            with suppress(ImportError):  # optional libraries may be missing
                importlib.import_module(module.name)


def _register_lttng_handlers():
    """Register fork handlers of LTTng, which ROS loads. Without them a fork, which lacks LTTng's threads, sometimes crashes at exit."""
    loaded = {line.split()[-1] for line in Path("/proc/self/maps").read_text(encoding="utf-8").splitlines()}
    signals = ctypes.create_string_buffer(128)  # a sigset_t
    for path in loaded:
        if "/liblttng-ust-" in path and hasattr(library := ctypes.CDLL(path), "ust_before_fork"):
            os.register_at_fork(
                before=functools.partial(library.ust_before_fork, signals),
                after_in_parent=functools.partial(library.ust_after_fork_parent, signals),
                after_in_child=functools.partial(library.ust_after_fork_child, signals),
            )


def _serve(asking):
    """Import all modules and fork for each request; return in each fork with its request."""
    import_all()
    _register_lttng_handlers()
    gc.freeze()
    while True:
        asked, descriptors, _, _ = socket.recv_fds(asking, _MOST_BYTES, 4)
        if not asked:
            os._exit(0)
        reading, writing = os.pipe()
        middle = os.fork()
        if not middle:
            parent = os.getpid()
            number = os.fork()
            if not number:
                while os.getppid() == parent:
                    os.sched_yield()
                for each in (asking.fileno(), reading, writing):
                    os.close(each)
                return json.loads(asked), descriptors
            os.write(writing, str(number).encode())
            os._exit(0)
        os.waitpid(middle, 0)
        asking.send(os.read(reading, _MOST_BYTES))
        for each in (reading, writing, *descriptors):
            os.close(each)


def _become(words, variables, new_session, descriptors):
    """Give this process the arguments, variables and streams of a request, and run its script."""
    if new_session:
        os.setsid()
    *streams, folder = descriptors
    os.fchdir(folder)
    os.close(folder)
    for number, each in enumerate(streams):
        os.dup2(each, number)
        os.close(each)
    os.environ.clear()
    os.environ.update(variables)
    if variables.get(_FAULT_HANDLER):
        faulthandler.enable()
    output: Any = sys.stdout
    output.reconfigure(line_buffering=sys.stdout.isatty())
    sys.path[0], sys.argv[:] = str(Path(words[0]).resolve().parent), words
    runpy.run_path(words[0], run_name="__main__")


if __name__ == "__main__":
    (_words, _variables, _new_session), _descriptors = _serve(socket.socket(fileno=int(sys.argv[1])))
    _become(_words, _variables, _new_session, _descriptors)
