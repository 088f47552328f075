"""The command line of a helper process, which has this process's import path without the current folder."""

import sys


def helper_command(module: str, function: str, *arguments: str) -> list[str]:
    """Return the command line of a Python process that calls a function and exits with its result.

    Start it with `process_end.dependent_environment` if it must end together with this process.

    Args:
        module: The import path of the function's module.
        function: The name of the function, which is called without arguments.
        arguments: The arguments of the process, in `sys.argv[1:]`.
    """
    # The first statement replaces the import path, in which `-c` puts the current folder first.
    program = (
        f"import sys; sys.path[:] = {sys.path!r}; from {module} import {function}; sys.exit({function}())"
    )
    return [sys.executable, "-c", program, *arguments]
