"""The pages that are worked through from top to bottom do what they say.

Such a page is followed as a reader would, in an empty folder: a block under a line like "`there_and_back.xml`:" is
written to that file, an `sh` block is typed, and the `text` block after it is what one sees. `…` in it stands
for anything, on a line of its own for any number of lines.
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

TREES = Path("docs/reference/tree-files.md").resolve()
LEAVES = Path("docs/how-to/write-a-leaf.md").resolve()
ROS_LEAVES = Path("docs/how-to/leaves-by-attributes.md").resolve()
TEN_MINUTES = Path("docs/how-to/from-btcpp.md").resolve()
TUTORIAL = Path("docs/tutorial/README.md").resolve()
WORLD = Path("docs/reference/world.md").resolve()

# How long a block of commands may take; the longest flies a robot for some simulated seconds.
_TIMEOUT_SEC = 120.0


def follow(page, folder):
    """Do what a page says; return how many blocks of commands there were, and what went otherwise."""
    typed, otherwise = 0, []
    every = blocks(page)
    for block, following in zip(every, [*every[1:], None], strict=True):
        if block.file:
            path = folder / block.file
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(block.text, encoding="utf-8")
        elif block.language == "sh":
            typed += 1
            done = typed_in(folder, block.text)
            shown = following.text if following is not None and following.language == "text" else None
            if shown is None and done.returncode:
                otherwise.append(f"line {block.line}: status {done.returncode}\n{done.stdout}")
            elif shown is not None and not matches(shown, done.stdout):
                otherwise.append(f"line {block.line}: the page shows\n{shown}and there is\n{done.stdout}")
    return typed, otherwise


def typed_in(folder, text):
    """Type a block of commands in a folder; standard output and error come together."""
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
        # The shell and all that it has started.
        os.killpg(shell.pid, signal.SIGKILL)
        output, _ = shell.communicate()
        pytest.fail(f"did not end within {_TIMEOUT_SEC:g} s:\n{text}\n{output}")
    return subprocess.CompletedProcess(text, shell.returncode, without_progress(output))


def matches(shown, seen):
    """Return whether what is seen is what is shown."""
    pattern = "".join(
        r"(?:.*\n)*?" if line.strip() == "…" else re.escape(line.rstrip()).replace("…", ".*") + r"[ ]*\n"
        for line in shown.splitlines()
    )
    return re.fullmatch(pattern, seen) is not None


def test_a_tree_is_written_as_the_page_says(tmp_path):
    typed, otherwise = follow(TREES, tmp_path)
    assert typed == 2
    assert otherwise == [], "\n".join(otherwise)


def test_a_world_is_written_as_the_page_says(tmp_path):
    typed, otherwise = follow(WORLD, tmp_path)
    assert typed == 1
    assert otherwise == [], "\n".join(otherwise)


def test_a_tree_of_others_is_brought_along_as_the_page_says(tmp_path):
    typed, otherwise = follow(TEN_MINUTES, tmp_path)
    assert typed == 5
    assert otherwise == [], "\n".join(otherwise)


@pytest.mark.ros
def test_the_tutorial_does_what_it_says(tmp_path):
    typed, otherwise = follow(TUTORIAL, tmp_path)
    assert typed == 9
    assert otherwise == [], "\n".join(otherwise)


@pytest.mark.ros
def test_a_leaf_is_written_and_flown_as_the_page_says(tmp_path):
    typed, otherwise = follow(LEAVES, tmp_path)
    assert typed == 4
    assert otherwise == [], "\n".join(otherwise)


@pytest.mark.ros
def test_leaves_by_attributes_are_checked_as_the_page_says(tmp_path):
    typed, otherwise = follow(ROS_LEAVES, tmp_path)
    assert typed == 3
    assert otherwise == [], "\n".join(otherwise)


def test_the_package_of_the_page_registers_its_leaves_by_entry_point(tmp_path):
    for block in blocks(LEAVES):
        if block.file:
            (tmp_path / block.file).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / block.file).write_text(block.text, encoding="utf-8")
    assert typed_in(tmp_path, "sar-compile validate there_and_back.xml").returncode == 1
    # What an installation does, without one: the package and its metadata in a folder elsewhere.
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
        for page in (TREES, LEAVES)
        for block in blocks(page)
        if block.language == "xml" and not block.file
    ],
)
def test_every_fragment_of_a_tree_is_correct(fragment):
    whole = f'<root BTCPP_format="4"><BehaviorTree ID="Main">{fragment}</BehaviorTree></root>'
    text = fragment if fragment.startswith("<root") else whole
    assert [
        finding.render() for finding in check(Forest.of(parse_xml(text, "fragment.xml")), load_registry())
    ] == []
