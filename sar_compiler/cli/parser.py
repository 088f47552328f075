"""The parser of a command line."""

from typing import NoReturn

from sar_compiler.commands import CommandParser


class Parser(CommandParser):
    """The parser of a command, including completion of its arguments."""

    def complete(self) -> NoReturn:
        """Respond to a shell that requests completions."""
        from sar_compiler.cli.completion import add_completers

        add_completers(self)
        super().complete()
