"""Tests of `make release`: its conditions, its commit, and its tag."""

import os
import re
import runpy
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

from tests.packaging.test_workspace import files_below
from tests.packaging.workspace import clone

RELEASE = runpy.run_path(".ci/release.py")
NotReadyError = RELEASE["NotReadyError"]
VERSION = RELEASE["version"]()
TEXT = "# Changelog\n\n## [Unreleased]\n\nSoon.\n\n### Added\n\n- **A**\n\n### Fixed\n\n- b\n"


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """Create a repository with the files that a release changes or reads, and change to its folder."""
    for name in (*RELEASE["VERSIONED"], "CHANGELOG.md", "Makefile", ".ci/release.py", RELEASE["PUBLICATION"]):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(Path(name).read_bytes())
    (tmp_path / "CHANGELOG.md").write_text(TEXT, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    for key in ("AUTHOR", "COMMITTER"):
        monkeypatch.setenv(f"GIT_{key}_NAME", "Somebody")
        monkeypatch.setenv(f"GIT_{key}_EMAIL", "somebody@example.org")
    git("init", "--quiet")
    git("add", ".")
    git("commit", "--quiet", "--message", "Begin")
    return tmp_path


def git(*arguments):
    run = subprocess.run(("git", *arguments), check=True, capture_output=True, text=True)  # noqa: S607
    return run.stdout


def refused_release(*released):
    """Run `make release` for some Pythons, which must fail before it creates or commits anything; return its output."""
    there = {*Path().iterdir()}
    run = subprocess.run(
        ("make", "release", f"PYTHON={sys.executable}", f"RELEASED={' '.join(released)}"),  # noqa: S607
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 2, run.stdout + run.stderr
    assert ({*Path().iterdir()}, git("log", "--format=%s")) == (there, "Begin\n")
    return run.stdout + run.stderr


def test_placeholder_with_value_is_replaced_in_all_files_except_its_own(checkout):
    declared = checkout / RELEASE["PUBLICATION"]
    text = declared.read_text(encoding="utf-8")
    [placeholder] = re.findall(r'^\[maintainer\]\n.*\nplaceholder = "(.+)"$', text, re.MULTILINE)
    head, _, rest = text.partition("[maintainer]")
    declared.write_text(head + "[maintainer]" + rest.replace('value = ""', 'value = "us@robots.example"'))
    assert f'email="{placeholder}"' in (checkout / "package.xml").read_text(encoding="utf-8")
    RELEASE["fill"]()
    assert 'email="us@robots.example"' in (checkout / "package.xml").read_text(encoding="utf-8")
    assert git("diff", "--name-only").split() == ["package.xml", RELEASE["PUBLICATION"]]


def create_built_files(folder, *pythons):
    """Create the files that a build makes for some Pythons."""
    files = [
        f"sar_compiler-{VERSION}.tar.gz",
        *(f"sar_compiler-{VERSION}-cp{each}-cp{each}-manylinux_2_17_x86_64.whl" for each in pythons),
    ]
    for each in files:
        (folder / each).touch()


def test_unreleased_changes_move_under_version_and_older_sections_stay():
    with_section = RELEASE["with_section"]
    first = with_section(TEXT, "0.1.0", "2026-12-01")
    kinds = "### Added\n\n- **A**\n\n### Fixed\n\n- b\n"
    assert first == f"# Changelog\n\n## [Unreleased]\n\n## [0.1.0] - 2026-12-01\n\n{kinds}"
    later = first.replace("## [Unreleased]\n", "## [Unreleased]\n\n### Added\n\n- c\n")
    second = with_section(later, "0.2.0", "2027-01-01")
    head = "# Changelog\n\n## [Unreleased]\n\n## [0.2.0] - 2027-01-01\n\n### Added\n\n- c\n\n"
    assert second == f"{head}## [0.1.0] - 2026-12-01\n\n{kinds}"


def test_release_without_changes_is_refused():
    released = RELEASE["with_section"](TEXT, "0.1.0", "2026-12-01")
    with pytest.raises(NotReadyError, match="nothing under 'Unreleased'"):
        RELEASE["with_section"](released, "0.1.1", "2026-12-02")


def test_changelog_section_and_citation_date_are_committed_once(checkout):
    RELEASE["prepare"]()
    RELEASE["prepare"]()
    assert git("log", "--format=%s").splitlines() == [f"Release {VERSION}", "Begin"]
    assert git("status", "--porcelain") == ""
    heading = rf"^## \[{re.escape(VERSION)}\] - (\d{{4}}-\d\d-\d\d)$"
    [day] = re.findall(heading, Path("CHANGELOG.md").read_text(), re.MULTILINE)
    assert f"version: {VERSION}\ndate-released: {day}\n" in Path("CITATION.cff").read_text()


def test_checkout_with_changes_is_not_released(checkout):
    (checkout / "notes.txt").touch()
    with pytest.raises(NotReadyError, match=r"notes\.txt"):
        RELEASE["prepare"]()
    assert f"[{VERSION}]" not in Path("CHANGELOG.md").read_text()


def test_missing_pythons_are_named_before_anything_is_built(checkout):
    said = refused_release("3.98", "3.99")
    for missing in ("python3.98", "python3.99"):
        assert f"make: {missing} does not start; install it (Debian, Ubuntu: apt install {missing})" in said
    assert "make release RELEASED='" in said


def test_checkout_with_changes_is_refused_before_environment_is_built(checkout):
    (checkout / "notes.txt").touch()
    assert "make: commit or remove first:\n?? notes.txt" in refused_release()


def test_missing_git_identity_is_reported_before_a_file_is_changed(checkout, monkeypatch):
    for key in ("GIT_COMMITTER_NAME", "GIT_COMMITTER_EMAIL", "EMAIL"):
        monkeypatch.delenv(key, raising=False)
    monkeypatch.setenv("GIT_CONFIG_GLOBAL", os.devnull)
    git("config", "user.useConfigOnly", "true")
    with pytest.raises(NotReadyError, match="tell me who you are"):
        RELEASE["prepare"]()
    assert git("status", "--porcelain") == ""


def test_changes_after_failed_release_must_move_to_its_section(checkout):
    RELEASE["prepare"]()
    text = Path("CHANGELOG.md").read_text()
    Path("CHANGELOG.md").write_text(
        text.replace("## [Unreleased]\n", "## [Unreleased]\n\n### Fixed\n\n- c\n")
    )
    git("commit", "--quiet", "--all", "--message", "Mend")
    with pytest.raises(NotReadyError, match=f"has a section for {re.escape(VERSION)}. Move the entries"):
        RELEASE["prepare"]()


def test_files_with_other_version_are_named(checkout):
    text = Path("package.xml").read_text().replace(f"<version>{VERSION}<", "<version>9.9.9<")
    Path("package.xml").write_text(text)
    git("commit", "--quiet", "--all", "--message", "Forget a file")
    with pytest.raises(NotReadyError, match=r"package\.xml has \['9\.9\.9'\]"):
        RELEASE["prepare"]()


def test_tag_is_set_when_all_files_exist_and_only_once(checkout, tmp_path_factory):
    RELEASE["prepare"]()
    folder = tmp_path_factory.mktemp("dist")
    create_built_files(folder, "312")
    with pytest.raises(NotReadyError, match=re.escape(f"lacks sar_compiler-{VERSION}-cp310-")):
        RELEASE["tag"](folder, ["3.10", "3.12"])
    assert git("tag") == ""
    RELEASE["tag"](folder, ["3.12"])
    assert git("tag", "--points-at", "HEAD") == f"v{VERSION}\n"
    with pytest.raises(NotReadyError, match=re.escape(f"v{VERSION} was released already")):
        RELEASE["prepare"]()


def test_checkout_changed_by_build_gets_no_tag(checkout, tmp_path_factory):
    folder = tmp_path_factory.mktemp("dist")
    create_built_files(folder)
    (checkout / "left.txt").touch()
    with pytest.raises(NotReadyError, match=r"left\.txt"):
        RELEASE["tag"](folder, [])
    assert git("tag") == ""


@pytest.mark.costly
def test_source_distribution_has_every_package_file(tmp_path):
    clone(tmp_path / "repository")
    [line] = re.findall(
        r"^\t@SAR_KERNEL=python \$\(BIN\)/(uv build .*)$", Path("Makefile").read_text(), re.MULTILINE
    )
    command = [*line.replace("build/release", str(tmp_path / "made")).split(), "--no-build-isolation"]
    uv = Path(".venv/bin").absolute()
    environment = {**os.environ, "SAR_KERNEL": "python", "PATH": f"{uv}:{os.environ['PATH']}"}
    subprocess.run(command, check=True, cwd=tmp_path / "repository", env=environment)
    [archive] = (tmp_path / "made").glob("*.tar.gz")
    with tarfile.open(archive) as opened:
        opened.extractall(tmp_path / "unpacked", filter="data")
    [unpacked] = (tmp_path / "unpacked").iterdir()
    assert files_below(unpacked) == files_below(tmp_path / "repository")
    kept = {".py", ".yaml", ".css", ".xsd", ".typed"}
    sources = [
        {path.relative_to(folder) for path in (folder / "sar_compiler").rglob("*") if path.suffix in kept}
        for folder in (unpacked, tmp_path / "repository")
    ]
    assert sources[0] == sources[1]
