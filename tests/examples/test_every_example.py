"""Tests of every example: the table lists it, and its README names its files."""

import ast
import re
from collections import Counter
from pathlib import Path

import pytest
import yaml

from tests.examples.readme import EXAMPLES

FOLDERS = sorted(path for path in EXAMPLES.iterdir() if path.is_dir() and path.name != "__pycache__")
# Plain programs, examples without a program to start, and a separate package.
NOT_LAUNCHED = {"cameras", "failsafes", "mission_test", "recorded_runs", "scenarios", "photo_patrol"}
LAUNCH_FILES = sorted(EXAMPLES.rglob("*.launch.py"))


def name(path):
    return path.name


def test_table_of_examples_lists_every_folder():
    text = (EXAMPLES / "README.md").read_text(encoding="utf-8")
    listed = re.findall(r"^\| \[(\w+)\]\((\w+)/README\.md\) \|", text, re.MULTILINE)
    assert sorted(listed) == [(folder.name, folder.name) for folder in FOLDERS]


@pytest.mark.parametrize("folder", FOLDERS, ids=name)
def test_readme_names_each_file_of_its_folder(folder):
    readme = (folder / "README.md").read_text(encoding="utf-8")
    files = {path.name for path in folder.iterdir() if path.is_file()} - {"README.md"}
    assert [file for file in sorted(files) if f"`{file}`" not in readme] == []


@pytest.mark.parametrize("folder", FOLDERS, ids=name)
def test_every_launchable_example_has_a_launch_file(folder):
    assert bool([*folder.glob("*.launch.py")]) == (folder.name not in NOT_LAUNCHED)


@pytest.mark.parametrize("path", LAUNCH_FILES, ids=name)
def test_readme_shows_launch_command_of_launch_file(path):
    readme = (path.parent / "README.md").read_text(encoding="utf-8")
    assert re.search(rf"^ros2 launch (sar_compiler )?\S*{re.escape(path.name)}\b", readme, re.MULTILINE)


def test_launch_file_names_are_unique():
    names = Counter(path.name for path in [*LAUNCH_FILES, *Path("launch").glob("*.launch.py")])
    assert [name for name, count in names.items() if count > 1] == []


def test_every_parameter_of_drive_to_goal_is_a_launch_argument():
    folder = EXAMPLES / "drive_to_goal"
    parameters = yaml.safe_load((folder / "params.yaml").read_text(encoding="utf-8"))["/**"][
        "ros__parameters"
    ]
    module = ast.parse((folder / "drive_to_goal.launch.py").read_text(encoding="utf-8"))
    arguments = next(
        ast.literal_eval(line.value)
        for line in module.body
        if isinstance(line, ast.Assign) and ast.unparse(line.targets[0]) == "VALUES"
    )
    assert list(arguments) == list(parameters)
