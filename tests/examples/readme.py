"""Reads the commands and the shown output from the README of an example."""

import re
import shlex
from dataclasses import dataclass, field
from pathlib import Path

from tests.processes import Command

EXAMPLES = Path("examples")

_FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_LOG_LINE = re.compile(r"\[INFO\] \[…\] \[([\w.]+)\]: (.*)")
_OURS = ".venv/bin/"


@dataclass(frozen=True)
class Step:
    """Commands of a README, and the output that it shows.

    Attributes:
        example: The example.
        number: The step's number in its README, from 1.
        commands: The commands as lists of words, without the folder of the program.
        shown: The blocks of output below them.
    """

    example: str
    number: int
    commands: list[list[str]]
    shown: list[str] = field(default_factory=list)

    def __str__(self):
        return f"{self.example}-{self.number}"

    def start(self, start):
        """Start all commands with the fixture `start`, at the same time."""
        return [start(*command) for command in self.commands]

    def unseen(self, commands: list[Command]) -> list[str]:
        """Return the shown lines that no command has printed so far; the numbers of pictures are ignored."""
        output = "\n".join(command.output for command in commands)
        lines = [line for block in self.shown for line in block.splitlines()]
        return [line for line in lines if not re.search(_pattern(line), output, re.MULTILINE)]


def _pattern(line):
    log_line = _LOG_LINE.fullmatch(line)
    if log_line is None:
        return rf"^{re.escape(line)}$"
    text = re.sub(r"picture \d+", r"picture \\d+", re.escape(log_line[2]).replace(r"\ ", " "))
    return rf"^\[INFO\] \[[\d.]+\] \[{re.escape(log_line[1])}\]: {text}$"


def steps(example: str) -> list[Step]:
    """Return the steps of an example's README that need only `make env`."""
    found: list[Step] = []
    for language, block in _FENCE.findall((EXAMPLES / example / "README.md").read_text(encoding="utf-8")):
        if language == "sh":
            found.append(Step(example, len(found) + 1, _commands(block)))
        elif not language:
            found[-1].shown.append(block)
    return [step for step in found if step.commands]


def _commands(block):
    lines = block.replace("\\\n", " ").splitlines()
    return [shlex.split(line.removeprefix(_OURS)) for line in lines if line.startswith(_OURS)]
