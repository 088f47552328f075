"""The command line of a helper process that has the same import path as this process."""

import sys


def helper_command(module: str, function: str, *arguments: str) -> list[str]:
    """Return the command line of a Python process that calls a function and exits with its result.

    If the helper process must end together with this process, start it with `process_end.dependent_environment`.

    Args:
        module: The import path of the function's module.
        function: The name of the function. It is called without arguments, and returns the exit status.
        arguments: The arguments of the process, which it finds in `sys.argv[1:]`.
    """
    # With `-c`, Python adds the current folder to the import path, so the first statement replaces the path.
    program = (
        f"import sys; sys.path[:] = {sys.path!r}; from {module} import {function}; sys.exit({function}())"
    )
    return [sys.executable, "-c", program, *arguments]
