"""The command of a helper process: Python that imports what this process can, and nothing from the current folder."""

import sys


def helper_command(module: str, function: str, *arguments: str) -> list[str]:
    """Return the command of a process that calls a function and exits with its result.

    Start it with `process_end.dependent_environment` if it is to end when this process does.

    Args:
        module: The import path of the function's module.
        function: The function, which takes no arguments.
        arguments: What it finds in `sys.argv[1:]`.
    """
    # The first statement keeps the current folder, from which `-c` would import, out of the way.
    program = (
        f"import sys; sys.path[:] = {sys.path!r}; from {module} import {function}; sys.exit({function}())"
    )
    return [sys.executable, "-c", program, *arguments]
