"""What the commands say on a machine where a library is missing."""

import subprocess
import sys

import pytest


def run_without(library, *arguments):
    """Run a command in an interpreter that cannot import a library; return its status and what it said."""
    command, *rest = arguments
    program = (
        f"import sys; sys.modules[{library!r}] = None\n"
        f"from sar_compiler.cli.{command} import main; sys.exit(main({rest!r}))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    return done.returncode, done.stderr


@pytest.mark.parametrize("library", ["numpy", "PIL"])
def test_the_simulator_names_what_it_lacks(library, tmp_path):
    status, said = run_without(library, "sim", "map", "-o", str(tmp_path / "map"))
    assert (status, "Traceback" in said) == (2, False)
    assert f"the simulator is not complete (import of {library}" in said
    assert "pip install 'sar_compiler[sim]'" in said


def test_flying_without_ros_says_where_ros_comes_from():
    status, said = run_without("rclpy", "run", "--sim")
    assert status == 2
    assert "ROS 2 is not here" in said
