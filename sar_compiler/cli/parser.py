"""The parser of a command line."""

from typing import NoReturn

from sar_compiler.commands import CommandParser


class Parser(CommandParser):
    """The parser of a command, which completes the values of its arguments as well."""

    def complete(self) -> NoReturn:
        """Answer the shell that asks for completions."""
        from sar_compiler.cli.completion import add_completers

        add_completers(self)
        super().complete()
