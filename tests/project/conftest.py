"""A checkout of another person's repository, in which a user runs commands."""

import os
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.processes import BIN
from tests.trees import document

LEAVES = """
from pathlib import Path
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from sar_compiler.leaves import Kind, register

Path("{proof}").write_text("it has run")

@register("Grip", kind=Kind.ACTION, outcomes={{Status.SUCCESS}})
class Grip(Behaviour):
    def update(self):
        return Status.SUCCESS
"""

_OURS = {"PYTHONPATH", "PYTHONDONTWRITEBYTECODE", "AMENT_PREFIX_PATH"}


@dataclass
class Checkout:
    """A folder with a tree that needs <Grip>, and beside it the user's own folders."""

    folder: Path
    home: Path

    @property
    def proof(self) -> Path:
        """The file that exists once the leaves of the checkout have been imported."""
        return self.home / "proof"

    @property
    def has_run(self) -> bool:
        return self.proof.exists()

    def write(self, name: str, text: str) -> Path:
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        return path

    def write_leaves(self, name: str = "gripper.py") -> Path:
        return self.write(name, LEAVES.format(proof=self.proof))

    def configure(self, text: str) -> Path:
        return self.write("sar.toml", text)

    def command(self, *words: object, **variables: str) -> subprocess.CompletedProcess[str]:
        """Run a command in the checkout, in a process of its own."""
        environment = {
            **{name: value for name, value in os.environ.items() if name not in _OURS},
            "HOME": str(self.home),
            "XDG_STATE_HOME": str(self.home / "state"),
            **variables,
        }
        return subprocess.run(
            [str(BIN / "sar-compile"), *map(str, words)],
            cwd=self.folder,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
            timeout=120.0,
        )

    def validate(self, *options: str, **variables: str) -> str:
        """Validate the tree, and return the output on both streams."""
        done = self.command("validate", "tree.xml", *options, **variables)
        return done.stdout + done.stderr


@pytest.fixture
def checkout(tmp_path: Path) -> Checkout:
    made = Checkout(tmp_path / "checkout", tmp_path / "home")
    for folder in (made.folder / ".git", made.home):
        folder.mkdir(parents=True)
    made.write("tree.xml", document("<Grip/>"))
    return made
