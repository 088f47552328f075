"""The argument parser of a command, with completion in shells."""

from typing import NoReturn

from sar_compiler.commands import CommandParser


class Parser(CommandParser):
    """The argument parser of a command, which also completes arguments in a shell."""

    def complete(self) -> NoReturn:
        """Print the completions that a shell requests, and end the process."""
        from sar_compiler.cli.completion import add_completers

        add_completers(self)
        super().complete()
