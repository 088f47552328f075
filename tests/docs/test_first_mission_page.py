"""Tests of the page about an operator's first mission: its quotes are in the sources, and the rehearsal of a low battery works."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.docs.markdown import blocks, codes
from tests.processes import BIN

PAGE = Path("docs/operate/first-mission.md")
FOLDERS = (Path("sar_compiler"), Path("search_and_rescue"))
SUFFIXES = {".py", ".js", ".jinja", ".html"}
TEXT = PAGE.read_text(encoding="utf-8")


def quotes_in(section):
    """Return the quoted texts of a section, without commands."""
    prose = re.sub(r"^```.*?^```", "", TEXT, flags=re.MULTILINE | re.DOTALL)
    found = re.search(rf"^## {section}\n(.*?)(?=^## |\Z)", prose, re.MULTILINE | re.DOTALL)
    assert found, section
    return [code for code in codes(found[1]) if " " in code and not code.startswith(("sar-", "pkill"))]


# Values that the sources insert: the robot's name, a zone's name, a time.
_VALUES = re.compile(r"^The robot(?= has)|zone_\w+|\d:\d\d")


def test_every_quoted_sentence_is_in_the_sources():
    sources = "\n".join(
        path.read_text(encoding="utf-8").lower()
        for folder in FOLDERS
        for path in sorted(folder.rglob("*"))
        if path.suffix in SUFFIXES
    )
    quotes = [
        text for section in ("Send commands", "Read the report", "No contact") for text in quotes_in(section)
    ]
    parts = [
        part.strip(" .").lower() for text in quotes for part in re.split(r"(?<=\.) ", _VALUES.sub("", text))
    ]
    assert len(parts) >= 6
    assert [part for part in parts if part not in sources] == []


@pytest.mark.ros
def test_low_battery_rehearsal_works_as_documented(tmp_path):
    (block,) = [each for each in blocks(PAGE) if "low.yaml" in each.text]
    make, run = block.text.splitlines()
    (tmp_path / ".git").mkdir()  # a world can name any map in its repository
    for folder in ("worlds", "maps"):
        shutil.copytree(folder, tmp_path / folder)
    subprocess.run(["/bin/bash", "-c", make], cwd=tmp_path, check=True)
    command, _, options = run.partition(" --view ")
    assert options == "web --open"
    done = subprocess.run(
        ["/bin/bash", "-c", f"{BIN}/{command} --speed 20 --journal low.journal"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    (alarm,) = quotes_in("Rehearse a low battery")
    pattern = re.escape(alarm).replace("19\\.9", r"19\.\d")
    assert done.returncode == 1, done.stderr
    assert re.search(f"zone_c and zone_d were abandoned: {pattern}", done.stdout), done.stdout
    assert "back at base:    yes" in done.stdout
