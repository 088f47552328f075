"""Processes and witnesses for tests of whole missions."""

import pytest

from tests.processes import Command
from tests.ros.conftest import make_ros, ros

__all__ = ["make_ros", "ros", "start", "witness"]


@pytest.fixture
def start():
    """Start commands of the project; what still runs after the test is killed."""
    commands = []

    def start_command(name, *arguments, env=None):
        commands.append(Command(name, *arguments, env=env))
        return commands[-1]

    yield start_command
    for command in reversed(commands):
        command.kill()


@pytest.fixture
def witness():
    """Watch robots from a node of the test's own."""
    from tests.e2e.witness import Witness

    watching = []

    def watch(namespace="/"):
        watching.append(Witness(namespace))
        return watching[-1]

    yield watch
    for each in watching:
        each.close()
