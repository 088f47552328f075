"""Fixtures that parallel test processes share, and commands from the workspace's install folder."""

import fcntl
import os

import pytest

from tests.packaging.workspace import Workspace
from tests.processes import Command


def made_once(tmp_path_factory, name, make):
    """Return a folder of the test run. The first parallel test process that needs it creates it."""
    place = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        place = place.parent
    folder, done = place / name, place / f"{name}-is-made"
    with (place / f"{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not done.exists():
            make(folder)
            done.touch()
    return folder


@pytest.fixture(scope="session")
def workspace(tmp_path_factory):
    """Return the built workspace."""
    return Workspace(
        made_once(tmp_path_factory, "workspace", lambda folder: Workspace(folder).fill_and_build())
    )


@pytest.fixture
def start(workspace):
    """Start commands of the workspace in its environment; kill those that still run after the test."""
    environment = workspace.environment()
    commands = []

    def start_command(name, *arguments):
        commands.append(Command(workspace.executable(name), *arguments, env=environment))
        return commands[-1]

    yield start_command
    for command in reversed(commands):
        command.kill()
