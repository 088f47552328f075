"""Tests of the files for other installation methods: rosdistro entry, conda recipe, GitHub action, dev container."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from catkin_pkg.packages import find_packages
from packaging.requirements import Requirement

from tests.packaging.test_public_files import make_targets_in, targets
from tests.packaging.workspace import REPOSITORY
from tests.processes import BIN

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

PLACEHOLDER = re.compile(
    r"example\.(?:org|com|net)\b|\b(?:OWNER|REPOSITORY|TODO|FIXME|CHANGEME)\b|<your[ -]", re.ASCII
)
# Tests use invalid addresses on purpose, and hashes can match by chance.
NOT_SEARCHED = (":!tests", ":!*.lock", ":!*-lock.json", ":!release/publication.toml")


def toml(path):
    return tomllib.loads(Path(path).read_text(encoding="utf-8"))


def recipe():
    return yaml.safe_load(Path("release/recipe.yaml").read_text(encoding="utf-8"))


def test_all_placeholders_are_declared_in_one_file():
    declared = [entry["placeholder"] for entry in toml("release/publication.toml").values()]
    files = subprocess.run(
        ["git", "grep", "-lI", "", "--", ".", *NOT_SEARCHED],  # noqa: S607
        cwd=REPOSITORY, capture_output=True, text=True, check=True,
    ).stdout.splitlines()  # fmt: skip
    assert "package.xml" in files
    undeclared, used = [], set()
    for name in files:
        text = (REPOSITORY / name).read_text(encoding="utf-8")
        for each in declared:
            used |= {each} if each in text else set()
            text = text.replace(each, "")
        undeclared += [f"{name}: {found}" for found in PLACEHOLDER.findall(text)]
    assert undeclared == []
    assert used == {
        each["placeholder"] for each in toml("release/publication.toml").values() if not each["value"]
    }


def test_recipe_has_requirements_of_project():
    project = toml("pyproject.toml")["project"]
    wanted = {
        (requirement.name.lower(), str(requirement.specifier))
        for requirement in map(Requirement, project["dependencies"])
    }
    assert wanted | {("python", project["requires-python"])} == {
        tuple(each.split()) for each in recipe()["requirements"]["run"]
    }


def test_recipe_installs_commands_of_project():
    project = toml("pyproject.toml")["project"]
    assert sorted(f"{name} = {where}" for name, where in project["scripts"].items()) == sorted(
        recipe()["build"]["python"]["entry_points"]
    )
    about = recipe()["about"]
    assert (about["summary"], about["license"]) == (project["description"], project["license"]["text"])


def test_rosdistro_entry_names_every_ros_package():
    entries = yaml.safe_load(Path("release/rosdistro.yaml").read_text(encoding="utf-8"))["repositories"]
    version = toml("pyproject.toml")["project"]["version"]
    # bloom finds these packages in this repository, and in the repository that is split off.
    found = {
        each.name for folder in (".", "interfaces/sar_interfaces") for each in find_packages(folder).values()
    }
    assert entries.keys() == found == {"sar_compiler", "sar_interfaces"}
    for name, entry in entries.items():
        assert entry["release"]["version"] == f"{version}-1"
        assert entry["release"]["url"].endswith(f"/{name}-release.git")
    assert entries["sar_compiler"]["source"]["version"] == "main"


def test_dev_container_builds_environment_with_readme_packages():
    container = json.loads(Path(".devcontainer/devcontainer.json").read_text(encoding="utf-8"))
    made = container["postCreateCommand"]
    assert make_targets_in(made) == {"env"}
    assert make_targets_in(made) <= targets()
    [said] = re.findall(r"sudo apt install (.+)", Path("README.md").read_text(encoding="utf-8"))
    installed = re.findall(r"--no-install-recommends (.+?) &&", made)[0].split()
    # The image has Python with its headers and venv.
    assert {*said.split()} - {*installed} == {"python3", "python3-venv", "python3-dev"}


@pytest.fixture
def validate_step(tmp_path):
    """Return a function that runs the action's validation step in a folder, as GitHub does; it returns status, output and SARIF."""
    action = yaml.safe_load(Path("action.yml").read_text(encoding="utf-8"))
    [step] = [each for each in action["runs"]["steps"] if each.get("name") == "Validate"]

    def run(**inputs):
        given = {name: inputs.get(name, each["default"]) for name, each in action["inputs"].items()}
        variables = {
            variable: re.sub(r"\$\{\{ inputs\.(\w+) \}\}", lambda match: given[match[1]], value)
            for variable, value in step["env"].items()
        }
        assert not any("${{" in value for value in (step["run"], *variables.values()))
        done = subprocess.run(
            [step["shell"], "--noprofile", "--norc", "-eo", "pipefail", "-c", step["run"]],
            cwd=tmp_path,
            env={**os.environ, **variables, "PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}"},
            capture_output=True,
            text=True,
            check=False,
        )
        log = tmp_path / given["sarif"]
        return done.returncode, done.stdout, json.loads(log.read_text(encoding="utf-8") or "null")

    return run


def tree_with(inside):
    return f'<root BTCPP_format="4">\n<BehaviorTree ID="A">\n{inside}\n</BehaviorTree>\n</root>\n'


def test_action_annotates_faulty_tree_and_fails(validate_step, tmp_path):
    (tmp_path / "good.xml").write_text(tree_with("<AlwaysSuccess/>"), encoding="utf-8")
    (tmp_path / "bad.xml").write_text(tree_with("<AlwaysSucces/>"), encoding="utf-8")
    status, printed, sarif = validate_step()
    assert status == 1
    [annotation] = [line for line in printed.splitlines() if line.startswith("::error ")]
    assert "file=bad.xml,line=3," in annotation
    [result] = sarif["runs"][0]["results"]
    assert (result["level"], result["ruleId"]) == ("error", "unknown-node")


def test_action_passes_trees_without_findings(validate_step, tmp_path):
    (tmp_path / "a folder").mkdir()
    (tmp_path / "a folder" / "good.xml").write_text(tree_with("<AlwaysSuccess/>"), encoding="utf-8")
    status, _, sarif = validate_step(path="a folder", sarif="found.sarif")
    assert (status, sarif["runs"][0]["results"]) == (0, [])


def test_action_passes_options_to_command(validate_step, tmp_path):
    (tmp_path / "tree.xml").write_text(tree_with("<Sequence><AlwaysSuccess/></Sequence>"), encoding="utf-8")
    assert validate_step(options="--strict --model nav2:jazzy")[0] == 0
    status, _, sarif = validate_step(options="--no-such-option")
    assert (status, sarif) == (2, None)
