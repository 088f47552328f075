"""A colcon workspace with a copy of the repository: created, built and sourced."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

from tests.processes import BIN

REPOSITORY = Path(__file__).resolve().parents[2]
# Files that a clone does not have, for a folder without git.
_NOT_CLONED = shutil.ignore_patterns(".*", "build", "install", "log", "dist", "*.egg-info", "__pycache__")


def _cloned_files():
    """Return the files of the repository according to git; None without git."""
    listing = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"],  # noqa: S607
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        check=False,
    )
    names = [name for name in listing.stdout.split("\0") if (REPOSITORY / name).is_file()]
    return names if listing.returncode == 0 and "package.xml" in names else None


def clone(target):
    """Copy the files of a clone of the repository, including uncommitted ones."""
    names = _cloned_files()
    if names is None:
        shutil.copytree(REPOSITORY, target, ignore=_NOT_CLONED)
        return
    for name in names:
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(REPOSITORY / name, target / name)


class Workspace:
    """A colcon workspace whose only repository is a copy of this one.

    Args:
        path: Its folder, which must not exist before `fill_and_build`.
    """

    def __init__(self, path):
        self.path = path
        self.repository = path / "src" / "sar_compiler"
        self.share = path / "install" / "sar_compiler" / "share" / "sar_compiler"

    def fill_and_build(self, *options):
        """Copy the repository into the workspace and build it with ROS from the environment."""
        clone(self.repository)
        self.build(*options)

    def build(self, *options):
        """Build; fail with the output of colcon if the build fails."""
        ros = {"AMENT_PREFIX_PATH": sys.prefix, "CMAKE_PREFIX_PATH": sys.prefix}
        done = subprocess.run(
            [
                BIN / "colcon", "build", "--base-paths", "src", "src/sar_compiler/interfaces", *options,
                "--event-handlers", "console_direct+",
                "--cmake-args", f"-DPython3_EXECUTABLE={sys.executable}", "-DBUILD_TESTING=OFF",
            ],
            cwd=self.path,
            # The tests of the wheel check that a build compiles the kernel.
            env={**os.environ, **ros, "SAR_KERNEL": "python", "PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}"},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stdout

    def executable(self, name):
        """Return the path at which `ros2 run sar_compiler` finds a command."""
        return self.path / "install" / "sar_compiler" / "lib" / "sar_compiler" / name

    def environment(self):
        """Return the environment of a shell that has sourced the workspace."""
        printed = self._run(["bash", "-c", 'source "$0" && env -0', self.path / "install" / "setup.bash"])
        return dict(entry.split("=", 1) for entry in printed.split("\0") if entry)

    def say(self, name, *arguments):
        """Run a command of the workspace in its environment; return the output."""
        return self._run([self.executable(name), *arguments], self.environment())

    def evaluate(self, statements):
        """Run Python statements in its environment; return their output."""
        return self._run([sys.executable, "-c", statements], self.environment()).strip()

    def _run(self, command, environment=None):
        # Not in the checkout, because Python imports from the current folder first.
        done = subprocess.run(
            command, cwd=self.path, env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout
