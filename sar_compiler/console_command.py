"""Start of a console command: from its first line on, Ctrl-C ends it without a traceback.

Importing a command takes a moment, in which Python would respond to Ctrl-C with a traceback. This module therefore
imports nothing slow, and handles Ctrl-C until the imported command handles it in its own way.
"""

import gc
import importlib
import os
import signal
import sys
from types import FrameType
from typing import NoReturn


def console_command(module: str, function: str = "main", *, is_server: bool = False) -> NoReturn:
    """Import a command, run it, and end the process with its status; Ctrl-C before and after that ends it at once.

    Args:
        module: The import path of its module.
        function: Its function, which returns the exit status.
        is_server: Whether being stopped is its regular end.
    """

    def leave(number: int, _frame: FrameType | None) -> None:
        os._exit(0 if is_server else 128 + number)

    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, leave)
    if os.environ.get("PYTHONPATH"):
        _leave_current_folder()
    from sar_compiler.process_end import end_process, end_with_parent

    end_with_parent()
    status = _status_of(module, function)
    end_process(status, name=os.path.basename(sys.argv[0]))  # noqa: PTH119 - pathlib takes a moment to import


def _status_of(module: str, function: str) -> int:
    """Return the exit status of a command, however it ends."""
    try:
        gc.disable()  # the imports leave nothing to collect
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
        name = os.path.basename(sys.argv[0])  # noqa: PTH119 - as below
        sys.stderr.write(f"{name}: a part of sar_compiler is not installed: sar_compiler.{part}\n")
        return 2
    except BaseException:  # noqa: BLE001 - the interpreter would do the same, and then wait for other threads
        sys.excepthook(*sys.exc_info())
        return 1


def _leave_current_folder() -> None:
    """Prevent further imports from the current folder, which may be untrusted.

    An empty or relative part of `PYTHONPATH` means this folder. Modules named by the user are still searched there.
    """
    try:
        written = os.environ["PYTHONPATH"].split(os.pathsep)
        current = {os.path.realpath(each) for each in ("", *written) if not os.path.isabs(each)}  # noqa: PTH117
    except OSError:  # the folder has been deleted
        return
    here = [entry for entry in sys.path if os.path.realpath(entry) in current]
    sys.path[:] = [entry for entry in sys.path if entry not in here]
    if here:
        from sar_compiler.nodes.installed import pass_over

        pass_over(here)
