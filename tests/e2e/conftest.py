"""Fixtures for tests of whole missions: processes and observers."""

import pytest

from tests.processes import Command
from tests.ros.conftest import make_ros, ros

__all__ = ["make_ros", "ros", "start", "witness"]


@pytest.fixture
def start():
    """Return a function that starts a command of the project; running commands are killed after the test."""
    commands = []

    def start_command(name, *arguments, env=None):
        commands.append(Command(name, *arguments, env=env))
        return commands[-1]

    yield start_command
    for command in reversed(commands):
        command.kill()


@pytest.fixture
def witness():
    """Return a function that observes a robot from a separate node."""
    from tests.e2e.observers import Witness

    watching = []

    def watch(namespace="/"):
        watching.append(Witness(namespace))
        return watching[-1]

    yield watch
    for each in watching:
        each.close()
