"""Tests that the public files of the repository match the project: citation, quality declaration, CI, container."""

import re
from pathlib import Path

import pytest
import yaml

from tests.docs.markdown import anchors
from tests.packaging.test_lock import PYTHONS
from tests.packaging.test_manifest import manifest


def text(name):
    return Path(name).read_text(encoding="utf-8")


def project(key):
    [value] = re.findall(rf'^{key} = "(.+)"$', text("pyproject.toml"), re.MULTILINE)
    return value


def targets():
    """Return the targets of the Makefile."""
    heads = re.findall(r"^([\w -]+):(?!=)", text("Makefile"), re.MULTILINE)
    return {word for head in heads for word in head.split()}


def make_targets_in(commands):
    return set(re.findall(r"\bmake ([a-z][\w-]*)(?![+\w-])", commands))


@pytest.fixture(scope="module")
def workflow():
    return yaml.safe_load(text(".github/workflows/ci.yml"))


def steps(workflow):
    return [step for job in workflow["jobs"].values() for step in job["steps"]]


def test_citation_has_name_version_and_licence_of_project():
    citation = yaml.safe_load(text("CITATION.cff"))
    # Version 1.2.0 of the format requires these keys.
    assert citation["cff-version"] == "1.2.0"
    assert {"message", "title", "authors"} <= set(citation)
    assert all(author.get("name") for author in citation["authors"])
    assert (citation["title"], citation["version"]) == (project("name"), project("version"))
    assert citation["license"] == manifest().findtext("license") == "Apache-2.0"


def test_citation_has_release_date_of_its_version():
    citation = yaml.safe_load(text("CITATION.cff"))
    dates = dict(re.findall(r"^## \[(.+?)\] - (\S+)$", text("CHANGELOG.md"), re.MULTILINE))
    date = citation.get("date-released")
    assert (date and str(date)) == dates.get(project("version"))


def test_quality_declaration_names_this_version_and_an_allowed_level():
    declaration = text("QUALITY_DECLARATION.md")
    version = project("version")
    assert f"`{version}`" in declaration
    [level] = re.findall(r"claims \*\*Quality Level (\d)\*\*", declaration)
    assert int(level) >= 3 or int(version.split(".")[0]) >= 1


def test_quality_declaration_has_every_rep_section_and_existing_make_targets():
    declaration = text("QUALITY_DECLARATION.md")
    rows = re.findall(r"^\| ((?:\d\.[ivx]+(?:, )?)+) \|", declaration, re.MULTILINE)
    assert {row[0] for row in rows} == set("1234567")
    assert make_targets_in(declaration)
    assert make_targets_in(declaration) <= targets()


def test_declared_coverage_matches_required_coverage():
    [demanded] = re.findall(r"^fail_under = (\d+)$", text("pyproject.toml"), re.MULTILINE)
    assert f"fails below {demanded} %" in text("QUALITY_DECLARATION.md")


def test_readme_links_security_policy_quality_declaration_and_citation():
    readme = text("README.md")
    for name in ("SECURITY.md", "QUALITY_DECLARATION.md", "CITATION.cff"):
        assert f"({name})" in readme, name
    assert "where-next" in anchors(Path("README.md"))


def test_public_ci_runs_ci_script_and_builds_wheels_for_every_python(workflow):
    jobs = workflow["jobs"]
    assert ".ci/run" in {step.get("run") for step in jobs["tests"]["steps"]}
    for name in ("tests", "wheels"):
        assert jobs[name]["strategy"]["matrix"]["python"] == list(PYTHONS), name
    assert make_targets_in("\n".join(step.get("run", "") for step in steps(workflow))) <= targets()


def test_public_ci_has_no_write_permission_and_no_secrets(workflow):
    assert workflow["permissions"] == {"contents": "read"}
    assert not any("permissions" in job for job in workflow["jobs"].values())
    assert "secrets." not in text(".github/workflows/ci.yml")
    assert {step["uses"].split("/")[0] for step in steps(workflow) if "uses" in step} == {"actions"}


def test_public_ci_builds_existing_container_file(workflow):
    runs = "\n".join(step.get("run", "") for step in workflow["jobs"]["container"]["steps"])
    [named] = re.findall(r"docker build -f (\S+)", runs)
    assert Path(named).is_file()


def test_container_installs_readme_packages_and_runs_demo():
    container = text("Containerfile").replace("\\\n", " ")
    [said] = re.findall(r"sudo apt install (.+)", text("README.md"))
    [installed] = re.findall(r"apt-get install -y --no-install-recommends (.+?) &&", container)
    # A slim image has no certificates, which pip needs.
    assert set(installed.split()) == {*said.split(), "ca-certificates"}
    assert container.rstrip().endswith('CMD ["make", "demo"]')
    assert make_targets_in(container) | {"demo"} <= targets()
    # The mission must not run as root.
    assert container.index("\nUSER ") < container.index("\nCOPY ")


def test_container_excludes_files_ignored_by_git():
    left_out = {line.removeprefix("**/").strip("/") for line in text(".dockerignore").splitlines()}
    made = {line.strip("/") for line in text(".gitignore").splitlines()}
    # Other tools than `make` create these folders.
    assert made - left_out - {"install", "log", "*.egg-info", "htmlcov"} - {
        ".pytest_cache", ".mypy_cache", ".ruff_cache",
    } == set()  # fmt: skip
    assert ".*_cache" in left_out
