"""The command of a helper process: Python with this process's import path, and without the current folder."""

import sys


def helper_command(module: str, function: str, *arguments: str) -> list[str]:
    """Return the command of a process that calls a function and exits with its result.

    Start it with `process_end.dependent_environment` if it must end together with this process.

    Args:
        module: The import path of the function's module.
        function: The function, which takes no arguments.
        arguments: Its arguments, available in `sys.argv[1:]`.
    """
    # The first statement removes the current folder, from which `-c` would import.
    program = (
        f"import sys; sys.path[:] = {sys.path!r}; from {module} import {function}; sys.exit({function}())"
    )
    return [sys.executable, "-c", program, *arguments]
