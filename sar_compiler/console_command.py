"""The start of a console command, during which Ctrl-C ends the process without a traceback.

Importing a command takes time, and Python would respond to Ctrl-C during the import with a traceback. This module therefore
imports only modules that load quickly, and handles Ctrl-C until the imported command sets its own handler.
"""

import gc
import importlib
import os
import signal
import sys
from types import FrameType
from typing import NoReturn


def console_command(module: str, function: str = "main", *, is_server: bool = False) -> NoReturn:
    """Import a command, run it, and end the process with its exit status. Ctrl-C before or after the run ends the process immediately.

    Args:
        module: The import path of the command's module.
        function: The name of the function that runs the command and returns its exit status.
        is_server: Whether the command is a server. Ctrl-C is the regular way to end a server, so its exit status is then 0.
    """

    def leave(number: int, _frame: FrameType | None) -> None:
        os._exit(0 if is_server else 128 + number)

    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, leave)
    if os.environ.get("PYTHONPATH"):
        _leave_current_folder()
    from sar_compiler.process_end import end_process, end_with_parent

    end_with_parent()
    status = _run_command(module, function)
    end_process(status, name=os.path.basename(sys.argv[0]))  # noqa: PTH119 - importing pathlib is slow


def _run_command(module: str, function: str) -> int:
    """Run a command and return its exit status, even if it raises an exception."""
    try:
        gc.disable()  # imports create no garbage
        command = getattr(importlib.import_module(module), function)
        gc.enable()
        return int(command())
    except SystemExit as end:
        if isinstance(end.code, str):
            sys.stderr.write(f"{end.code}\n")
            return 1
        return end.code or 0
    except ImportError as error:
        from sar_compiler.parts import missing_part

        if (part := missing_part(error)) is None:
            sys.excepthook(*sys.exc_info())
            return 1
        name = os.path.basename(sys.argv[0])  # noqa: PTH119 - as above
        sys.stderr.write(f"{name}: a part of sar_compiler is not installed: sar_compiler.{part}\n")
        return 2
    except BaseException:  # noqa: BLE001 - as the interpreter does, but without waiting for other threads
        sys.excepthook(*sys.exc_info())
        return 1


def _leave_current_folder() -> None:
    """Prevent further imports from the current folder, which may be untrusted.

    Empty and relative entries of `PYTHONPATH` refer to this folder. Modules that the user names can still be imported from it.
    """
    try:
        entries = os.environ["PYTHONPATH"].split(os.pathsep)
        current = {os.path.realpath(each) for each in ("", *entries) if not os.path.isabs(each)}  # noqa: PTH117
    except OSError:  # the folder has been deleted
        return
    removed = [entry for entry in sys.path if os.path.realpath(entry) in current]
    sys.path[:] = [entry for entry in sys.path if entry not in removed]
    if removed:
        from sar_compiler.nodes.installed import pass_over

        pass_over(removed)
