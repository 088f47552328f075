"""Tests of the package installed with pip into a separate environment."""

import importlib.metadata
import os
import re
import subprocess
import sys
import sysconfig

import pytest
from packaging.requirements import Requirement

from tests.packaging.conftest import made_once
from tests.packaging.test_workspace import files_below
from tests.packaging.workspace import clone

# Building the wheel takes 20 seconds, and its list of files changes rarely.
pytestmark = pytest.mark.costly


def run_successfully(*command, **options):
    """Run a command that must succeed; return what it printed."""
    run = subprocess.run(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False, **options
    )
    assert run.returncode == 0, run.stdout
    return run.stdout


def install(folder):
    """Install the package without its dependencies into a new environment next to a clone."""
    clone(folder / "repository")
    # Installing another pip would take longer than installing the package.
    run_successfully(sys.executable, "-m", "venv", "--without-pip", folder / "environment")
    pip = (sys.executable, "-m", "pip", "--python", folder / "environment" / "bin" / "python")
    options = ("--no-deps", "--disable-pip-version-check")
    variables = {**os.environ, "MYPYC_OPT_LEVEL": "0", "PIP_NO_COMPILE": "1"}
    run_successfully(
        *pip, "wheel", *options, "--wheel-dir", folder / "wheel", folder / "repository", env=variables
    )
    run_successfully(*pip, "install", *options, *(folder / "wheel").iterdir(), env=variables)


@pytest.fixture(scope="session")
def installed(tmp_path_factory):
    """Return the folders of the clone and of the environment."""
    folder = made_once(tmp_path_factory, "wheel", install)
    return folder / "repository", folder / "environment"


def test_every_shipped_file_is_in_the_environment(installed):
    repository, environment = installed
    assert files_below(environment / "share" / "sar_compiler") == files_below(repository)


def test_description_on_index_has_only_absolute_links(installed):
    _, environment = installed
    (metadata,) = environment.rglob("sar_compiler-*.dist-info/METADATA")
    text = metadata.read_text(encoding="utf-8")
    assert "Description-Content-Type: text/markdown" in text
    targets = re.findall(r"\]\(([^)]+)\)", text)
    assert targets
    assert [each for each in targets if not each.startswith("https://")] == []
    assert "![" not in text


@pytest.mark.parametrize("part", ["studio", "web"])
def test_static_page_files_are_in_the_package(installed, part):
    repository, environment = installed
    (page,) = environment.rglob(f"{part}/static")
    assert {path.name for path in page.iterdir()} == {
        path.name for path in (repository / f"sar_compiler/{part}/static").iterdir()
    }


def test_every_stylesheet_and_template_is_in_the_package(installed):
    repository, environment = installed
    (package,) = environment.rglob("sar_compiler/py.typed")
    sheets = [
        {path.relative_to(folder) for ending in ("css", "jinja") for path in folder.rglob(f"*.{ending}")}
        for folder in (package.parent, repository / "sar_compiler")
    ]
    assert sheets[0] == sheets[1]


def test_ament_index_of_environment_has_the_package(installed):
    _, environment = installed
    index = environment / "share" / "ament_index" / "resource_index" / "packages"
    assert [path.name for path in index.iterdir()] == ["sar_compiler"]
    assert (environment / "share" / "sar_compiler" / "package.xml").is_file()


def test_shipped_tree_is_shown_by_name_and_kernel_is_compiled(installed, tmp_path):
    _, environment = installed
    # Only libraries come from the environment of the tests.
    variables = {**os.environ, "PYTHONPATH": sysconfig.get_path("purelib")}
    printed = run_successfully(
        environment / "bin" / "sar-compile", "show", "search_and_rescue", cwd=tmp_path, env=variables
    )
    assert "MissionOrReturnToBase" in printed
    version = run_successfully(environment / "bin" / "sar-compile", "--version", cwd=tmp_path, env=variables)
    assert "kernel: compiled" in version
    root = "import sar_compiler.resources as r; print(r.shipped_root())"
    printed = run_successfully(environment / "bin" / "python", "-c", root, cwd=tmp_path, env=variables)
    assert printed.strip() == str(environment / "share" / "sar_compiler")


def test_wheel_has_at_most_3_megabytes(installed):
    [wheel] = (installed[0].parent / "wheel").iterdir()
    assert wheel.stat().st_size <= 3_000_000


FOREIGN = """<root BTCPP_format="4">
  <BehaviorTree ID="Fetch">
    <Sequence>
      <Script code="tries := 0"/>
      <RetryUntilSuccessful num_attempts="3"><OpenDoor door="front"/></RetryUntilSuccessful>
    </Sequence>
  </BehaviorTree>
  <TreeNodesModel><Action ID="OpenDoor"><input_port name="door" type="std::string"/></Action></TreeNodesModel>
</root>
"""


def requirements_of(names):
    """Return some distributions with all their requirements, without extras."""
    found: dict[str, importlib.metadata.Distribution] = {}
    for name in names:
        distribution = importlib.metadata.distribution(name)
        wanted = map(Requirement, distribution.requires or ())
        more = [each.name for each in wanted if each.marker is None or each.marker.evaluate({"extra": ""})]
        found |= {name: distribution, **requirements_of(more)}
    return found


@pytest.mark.parametrize(
    ("command", "said"), [("validate", "no findings"), ("show", "OpenDoor"), ("verify", "4 proved")]
)
def test_foreign_tree_is_checked_with_required_packages_only(installed, tmp_path, command, said):
    _, environment = installed
    (metadata,) = environment.rglob("sar_compiler-*.dist-info")
    needed = map(Requirement, importlib.metadata.Distribution.at(metadata).requires or ())
    libraries = tmp_path / "libraries"
    libraries.mkdir()
    names = [each.name for each in needed if each.marker is None or each.marker.evaluate({"extra": ""})]
    for distribution in requirements_of(names).values():
        for top in {file.parts[0] for file in distribution.files or ()} - {"..", "__pycache__"}:
            (libraries / top).symlink_to(distribution.locate_file(top))
    assert (libraries / "lxml").is_dir()
    assert not (libraries / "rclpy").exists()
    tree = tmp_path / "fetch.xml"
    tree.write_text(FOREIGN, encoding="utf-8")
    variables = {**os.environ, "PYTHONPATH": str(libraries)}
    assert said in run_successfully(
        environment / "bin" / "sar-compile", command, tree, cwd=tmp_path, env=variables
    )
