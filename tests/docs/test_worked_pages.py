"""Tests that the commands on pages print the shown output.

A test follows a page from top to bottom in an empty folder, as a reader would. It writes a block under a line like "`there_and_back.xml`:"
to that file, and runs each `sh` block. The `text` block after it must match the output. `…` in a `text` block matches anything;
on a line of its own it matches any number of lines.
"""

import os
import re
import signal
import subprocess
from pathlib import Path

import pytest

from sar_compiler.checks import check
from sar_compiler.nodes.registry import load_registry
from sar_compiler.tree.forest import Forest
from sar_compiler.tree.xml import parse_xml
from tests.docs.markdown import blocks
from tests.processes import BIN
from tests.slowness import without_progress

README = Path("README.md").resolve()
TREES = Path("docs/reference/tree-files.md").resolve()
LEAVES = Path("docs/how-to/write-a-leaf.md").resolve()
CLASSES = Path("docs/reference/leaf-classes.md").resolve()
ROS_LEAVES = Path("docs/how-to/leaves-by-attributes.md").resolve()
TUTORIAL = sorted(Path("docs/tutorial").resolve().glob("[1-6]-*.md"))
# Followed without ROS, with the number of their blocks of commands.
PLAIN = {
    "concepts/behaviour-trees": 1,
    "concepts/statuses": 2,
    "concepts/blackboard": 1,
    "concepts/facts": 2,
    "concepts/proofs": 1,
    "how-to/from-btcpp": 6,
    "how-to/from-py-trees": 2,
    "how-to/why-did-your-robot-fail": 2,
    "reference/world": 1,
}
RUNS = Path("docs/concepts/before-during-after.md").resolve()
COURSE = Path("docs/how-to/course-project.md").resolve()

# The limit for a block of commands. The longest runs a robot for some simulated seconds.
_TIMEOUT_SEC = 120.0


def follow(page, folder, below=""):
    """Run the commands of a page, or of the section below a heading; return the number of blocks, and the differences."""
    typed, otherwise = 0, []
    every = blocks(page)
    if below:
        lines = page.read_text(encoding="utf-8").splitlines()
        first = lines.index(below) + 1
        last = next(n for n, line in enumerate([*lines, "## "], 1) if n > first and line.startswith("## "))
        every = [block for block in every if first < block.line < last]
    for block, following in zip(every, [*every[1:], None], strict=True):
        if block.file:
            path = folder / block.file
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(block.text, encoding="utf-8")
            continue
        after = following.text if following is not None and following.language == "text" else None
        for text, shown in [(block.text, after)] if block.language == "sh" else dialogue(block):
            typed += 1
            done = typed_in(folder, text)
            if shown is None and done.returncode:
                otherwise.append(f"line {block.line}: status {done.returncode}\n{done.stdout}")
            elif shown is not None and not matches(shown, done.stdout):
                otherwise.append(f"line {block.line}: the page shows\n{shown}and there is\n{done.stdout}")
    return typed, otherwise


def dialogue(block):
    """Yield the commands after the prompts of a `console` block, each with the output shown after it."""
    for part in re.split(r"^\$ ", block.text, flags=re.MULTILINE)[1:] if block.language == "console" else ():
        command, _, shown = part.partition("\n")
        yield command, shown or None


def typed_in(folder, text):
    """Run a block of commands in a folder; return standard output and error together."""
    shell = subprocess.Popen(
        ["/bin/bash", "-c", text],
        cwd=folder,
        env={**os.environ, "PATH": f"{BIN}:{os.environ['PATH']}"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    try:
        output, _ = shell.communicate(timeout=_TIMEOUT_SEC)
    except subprocess.TimeoutExpired:
        # Kill the shell with all its children.
        os.killpg(shell.pid, signal.SIGKILL)
        output, _ = shell.communicate()
        pytest.fail(f"did not end within {_TIMEOUT_SEC:g} s:\n{text}\n{output}")
    return subprocess.CompletedProcess(text, shell.returncode, without_progress(output))


def matches(shown, seen):
    """Return whether an output matches the shown text."""
    pattern = "".join(
        r"(?:.*\n)*?" if line.strip() == "…" else re.escape(line.rstrip()).replace("…", ".*") + r"[ ]*\n"
        for line in shown.splitlines()
    )
    return re.fullmatch(pattern, seen) is not None


def test_commands_on_tree_files_page_print_shown_output(tmp_path):
    typed, otherwise = follow(TREES, tmp_path)
    assert typed == 2
    assert otherwise == [], "\n".join(otherwise)


@pytest.mark.parametrize("page", PLAIN)
def test_commands_on_page_without_ros_print_shown_output(page, tmp_path):
    typed, otherwise = follow(Path(f"docs/{page}.md").resolve(), tmp_path)
    assert typed == PLAIN[page]
    assert otherwise == [], "\n".join(otherwise)


@pytest.mark.ros
def test_readme_quick_start_prints_shown_output(tmp_path):
    typed, otherwise = follow(README, tmp_path, "## 60 seconds")
    assert typed == 3
    assert otherwise == [], "\n".join(otherwise)


@pytest.mark.costly
@pytest.mark.ros
def test_tutorial_lessons_in_order_print_shown_output(tmp_path):
    done = [follow(page, tmp_path) for page in TUTORIAL]
    assert [typed for typed, _ in done] == [2, 2, 2, 2, 2, 4]
    assert [each for _, otherwise in done for each in otherwise] == []


@pytest.mark.costly
@pytest.mark.ros
def test_one_property_file_works_before_during_and_after_a_run(tmp_path):
    typed, otherwise = follow(RUNS, tmp_path)
    assert typed == 3
    assert otherwise == [], "\n".join(otherwise)


@pytest.mark.costly
@pytest.mark.ros
def test_commands_on_course_project_page_print_shown_output(tmp_path):
    (tmp_path / "trees").symlink_to(Path("trees").resolve())
    sections = (
        "## Run and check the tree",
        "## Change memory and add OneShot",
        "## Write a leaf",
        "## Write a golden test",
    )
    done = [follow(COURSE, tmp_path, section) for section in sections]
    assert [typed for typed, _ in done] == [4, 4, 3, 1]
    assert [each for _, otherwise in done for each in otherwise] == []


@pytest.mark.ros
def test_commands_on_leaf_page_print_shown_output(tmp_path):
    typed, otherwise = follow(LEAVES, tmp_path)
    assert typed == 4
    assert otherwise == [], "\n".join(otherwise)


@pytest.mark.ros
def test_commands_on_attribute_leaves_page_print_shown_output(tmp_path):
    typed, otherwise = follow(ROS_LEAVES, tmp_path)
    assert typed == 3
    assert otherwise == [], "\n".join(otherwise)


def test_package_on_leaf_page_registers_leaves_by_entry_point(tmp_path):
    for block in blocks(LEAVES):
        if block.file:
            (tmp_path / block.file).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / block.file).write_text(block.text, encoding="utf-8")
    assert typed_in(tmp_path, "sar-compile validate there_and_back.xml").returncode == 1
    # Put the package and its metadata in another folder, as an installation does.
    site = tmp_path.parent / f"{tmp_path.name}_site"
    install = f"-q build_py -d {site} egg_info -e {site}"
    site.mkdir()
    done = typed_in(tmp_path, f"python -c 'import setuptools; setuptools.setup()' {install}")
    assert done.returncode == 0, done.stdout
    done = typed_in(tmp_path, f"PYTHONPATH={site} sar-compile validate there_and_back.xml")
    assert done.stdout == "there_and_back.xml: no findings\n"


@pytest.mark.parametrize(
    "fragment",
    [
        pytest.param(block.text, id=f"{page.name}:{block.line}")
        for page in (TREES, LEAVES, CLASSES)
        for block in blocks(page)
        if block.language == "xml" and not block.file
    ],
)
def test_every_tree_fragment_has_no_findings(fragment):
    whole = f'<root BTCPP_format="4"><BehaviorTree ID="Main">{fragment}</BehaviorTree></root>'
    text = fragment if fragment.startswith("<root") else whole
    assert [
        finding.render()
        for finding in check(Forest.from_file(parse_xml(text, "fragment.xml")), load_registry())
    ] == []
