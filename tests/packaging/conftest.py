"""The workspace that the tests share, and processes out of its install folder."""

import fcntl
import os

import pytest

from tests.packaging.workspace import Workspace
from tests.processes import Command


@pytest.fixture(scope="session")
def workspace(tmp_path_factory):
    """Build the workspace once, whichever of the parallel test processes needs it first."""
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent
    made = Workspace(folder / "workspace")
    done = folder / "workspace-is-built"
    with (folder / "workspace.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not done.exists():
            made.fill_and_build()
            done.touch()
    return made


@pytest.fixture
def start(workspace):
    """Start commands of the workspace in a shell that has sourced it; what still runs after the test is killed."""
    environment = workspace.environment()
    commands = []

    def start_command(name, *arguments):
        commands.append(Command(workspace.executable(name), *arguments, env=environment))
        return commands[-1]

    yield start_command
    for command in reversed(commands):
        command.kill()
