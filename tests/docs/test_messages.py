"""Tests that the project prints the messages that the documentation explains."""

import ast
import functools
import re
import subprocess
from pathlib import Path

import pytest
import yaml

from sar_compiler.missions.parameter_file import check_parameter_file
from sar_compiler.missions.parameter_reader import ParameterReader
from tests.docs.markdown import blocks, codes, tables
from tests.processes import BIN

TROUBLESHOOTING = Path("docs/operate/troubleshooting.md")
PARAMETERS = Path("docs/reference/parameters.md")
TREES = Path("docs/reference/tree-files.md")
LEAVES = Path("docs/reference/leaf-classes.md")
# Sections of the troubleshooting page with messages of other programs, or with errors that test_usage_errors tests.
OTHER_SECTIONS = ("Messages of other programs", "Installing", "Wrong usage, status 2")
# Sources of messages other than Python modules.
OTHER_SOURCES = (Path("Makefile"),)


@functools.cache
def tree_of(path):
    """Return the syntax tree of a module."""
    return ast.parse(path.read_text(encoding="utf-8"))


def constants_of(path):
    """Return the string constants of a module by name."""
    return {
        target.id: node.value.value
        for node in tree_of(path).body
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant)
        for target in node.targets
        if isinstance(target, ast.Name) and isinstance(node.value.value, str)
    }


def imported_constants(path):
    """Yield the string constants that a module imports from other modules of the project."""
    for node in tree_of(path).body:
        if isinstance(node, ast.ImportFrom) and node.module:
            other = Path(f"{node.module.replace('.', '/')}.py")
            if other.is_file():
                known = constants_of(other)
                yield from ((each.name, known[each.name]) for each in node.names if each.name in known)


def texts_of(path):
    """Yield the strings of a module. An f-string is split at inserted values, except constants of the project."""
    constants = {**dict(imported_constants(path)), **constants_of(path)}
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value
        elif isinstance(node, ast.JoinedStr):
            yield from "".join(piece_of(value, constants) for value in node.values).split("\0")


def piece_of(value, constants):
    if isinstance(value, ast.Constant):
        return str(value.value)
    named = isinstance(value, ast.FormattedValue) and isinstance(value.value, ast.Name)
    return constants.get(value.value.id, "\0") if named else "\0"


@functools.cache
def texts_of_the_source():
    """Return all strings of the sources by file."""
    texts = {
        str(path): list(texts_of(path))
        for folder in ("sar_compiler", "search_and_rescue")
        for path in Path(folder).rglob("*.py")
    }
    return texts | {str(path): [path.read_text(encoding="utf-8")] for path in OTHER_SOURCES}


def quoted_messages(page, chosen):
    """Return the messages in the first column of a page's tables, with their locations, under chosen headings."""
    found = [
        (f"{page.name}:{line}", message)
        for heading, line, cells in tables(page)
        if chosen(heading)
        for message in codes(cells[0])
    ]
    assert len(found) > 4, page
    return found


def test_every_explained_message_is_in_the_sources():
    explained = [
        *quoted_messages(TROUBLESHOOTING, lambda heading: heading not in OTHER_SECTIONS),
        *quoted_messages(PARAMETERS, lambda heading: heading == "Mistakes in the whole file"),
        *quoted_messages(LEAVES, lambda heading: heading == "Refused definitions"),
    ]
    wrong = []
    for place, message in explained:
        parts = [part.strip() for part in message.split("…") if part.strip()]
        is_printed = any(
            all(any(part in text for text in texts) for part in parts)
            for texts in texts_of_the_source().values()
        )
        if not is_printed or all(len(part) <= 4 for part in parts):
            wrong.append(f"{place} {message}")
    assert wrong == []


BASE = next(block.text for block in blocks(PARAMETERS) if block.file == "params.yaml")
# Errors whose messages are sufficient, so that the page does not explain them.
UNDOCUMENTED_ERRORS = [
    ("zone_order: kitchen", "parameter zone_order: must be a list of zone ids, but is the string 'kitchen'"),
    ('zone_order: ["attic", "attic"]', "parameter zone_order: names 'attic' more than once"),
    (
        'zone_order: ["attic", 2]',
        "'zone_order' mixes text with an integer: all values of a list must have the same type",
    ),
    ("attic: {x: 3.5, y: .nan, yaw: 1.57}", "parameter zones.attic.y: must be a finite number, but is nan"),
    ("attic: {x: 3.5, y: 3.0}", "parameter zones.attic.yaw: is missing: write a number"),
    (
        "attic: {x: 3.5, y: 3.0, yaw: 1.57, z: 0.0}",
        "parameter zones.attic.z: is unknown, expected one of x, y, yaw, poa, pod, look_sec",
    ),
    ("tick_rate_hz: fast", "parameter tick_rate_hz: must be a number, but is the string 'fast'"),
    ("set_initial_pose: 3", "parameter set_initial_pose: must be true or false, but is the number 3"),
    (
        "geofence: [0.0, 0.0, 5.0]",
        "parameter geofence: must contain x and y of three or more corners, [x1, y1, x2, y2, x3, y3], but contains 3 numbers",
    ),
    (
        "georeference: {lat: 91.0, lon: 16.4, heading: 90.0}",
        "parameter georeference.lat: must be degrees between -90 and 90, not 91",
    ),
    ("time_limit_sec: -1", "parameter time_limit_sec: must be seconds from 0 to 1000000000, but is -1"),
    ("use_sim_time: hello", "parameter use_sim_time must be true or false, but is 'hello'"),
]
DOCUMENTED_ERRORS = [
    (codes(cells[0])[0], codes(cells[1])[0])
    for heading, _, cells in tables(PARAMETERS)
    if heading == "Mistakes"
]
MISTAKES = [
    pytest.param(written, said, id=written) for written, said in [*DOCUMENTED_ERRORS, *UNDOCUMENTED_ERRORS]
]


@pytest.mark.ros
@pytest.mark.parametrize(("written", "said"), MISTAKES)
def test_parameter_file_error_is_reported_with_documented_message(tmp_path, written, said):
    file = tmp_path / "params.yaml"
    file.write_text(with_line(BASE, written), encoding="utf-8")
    done = subprocess.run(
        [BIN / "sar-run", "--check", "--params", file],
        capture_output=True,
        text=True,
        timeout=60.0,
        check=False,
    )
    assert done.returncode == 2, done.stderr
    pattern = re.escape(said).replace("…", r"[\d:]+")
    if (
        said.startswith("parameter ") and "use_sim_time" not in said
    ):  # ROS itself refuses use_sim_time, without a location
        pattern = rf"params\.yaml:\d+:\d+: {pattern}"
    assert re.search(pattern, done.stderr.replace(str(file), "params.yaml")), done.stderr


def with_line(base, written):
    """Replace the line with the same key, and the lines nested below it, by a new line; append it if there is none."""
    key = written.split(":")[0]
    lines = base.splitlines()
    at = next((number for number, line in enumerate(lines) if line.strip().startswith(f"{key}:")), len(lines))
    indent = " " * (len(lines[at]) - len(lines[at].lstrip()) if at < len(lines) else 4)
    after = at + 1
    while after < len(lines) and lines[after].startswith(f"{indent} "):
        after += 1
    return "\n".join([*lines[:at], f"{indent}{written}", *lines[after:]]) + "\n"


def test_base_parameter_file_is_correct(tmp_path):
    file = tmp_path / "params.yaml"
    file.write_text(BASE, encoding="utf-8")
    check_parameter_file(file)
    reader = ParameterReader(flat(yaml.safe_load(BASE)["/**"]["ros__parameters"]))
    assert reader.places("zone")[0]["id"] == "kitchen"
    reader.complain()


def flat(parameters, prefix=""):
    pairs = [
        flat(value, f"{prefix}{key}.").items() if isinstance(value, dict) else [(f"{prefix}{key}", value)]
        for key, value in parameters.items()
    ]
    return dict(pair for each in pairs for pair in each)
