"""Tests of untrusted input: too large, damaged or misleading files, and texts with control characters."""

import json
import math
import os
import random
import re
import resource
import struct
import subprocess
import sys
import unicodedata
import zlib
from collections import Counter
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from sar_compiler.cli.compile import main as compile_command
from sar_compiler.cli.sim import main as sim_command
from sar_compiler.missions.parameter_file import ParameterFileError, check_parameter_file
from sar_compiler.ros.message_values import FARTHEST_M
from sar_compiler.sim.occupancy import read_map
from sar_compiler.sim.world import load_world
from sar_compiler.tree.diagnostic import TreeError
from sar_compiler.tree.display_text import escape_to_one_line
from search_and_rescue.actions.navigation import describe_end
from search_and_rescue.actions.survivors import MapExtent
from tests.processes import BIN
from tests.slowness import without_progress
from tests.trees import document

TREE = document('<Sequence><Script code="a := 1"/></Sequence>')
MAP = "resolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
WORLD = "robot: {x: 1, y: 1, radius: 0.2}\nwalls: []\n"


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("tree.xml").write_text(TREE, encoding="utf-8")
    Path("project").mkdir()
    Path("project/tree.xml").write_text(TREE, encoding="utf-8")


def read_map_of_world(world):
    path = load_world(Path(world)).map_path
    assert path is not None
    return read_map(path)


@pytest.mark.parametrize(
    "command",
    [
        ["validate", "large"],
        ["validate", "tree.xml", "--model", "large"],
        ["simulate", "tree.xml", "--scenario", "large"],
        ["verify", "tree.xml", "--properties", "large"],
        ["simulate", "tree.xml", "--params", "large"],
    ],
    ids=" ".join,
)
def test_too_large_file_is_reported(command, capsys):
    with Path("large").open("wb") as file:
        file.truncate(2**36)  # a sparse file
    assert compile_command(command) in (1, 2)
    out, err = capsys.readouterr()
    assert "larger than" in out + err


def test_too_large_configuration_is_reported(capsys):
    with Path("sar.toml").open("wb") as file:
        file.truncate(2**36)
    assert compile_command(["validate", "tree.xml"]) == 1
    assert "sar.toml:1:1: error[file-too-large]" in capsys.readouterr().out


def png(width, height):
    """Return a well-compressed image of one colour."""

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    rows = zlib.compress(bytes((width + 7) // 8 + 1) * height, 9)
    head = struct.pack(">IIBBBBB", width, height, 1, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")


def run_limited(*command, kind=resource.RLIMIT_AS, most=2**31):
    """Run a command with a resource limit, by default of its address space in bytes."""
    return subprocess.run(
        [str(part) for part in command],
        capture_output=True,
        text=True,
        check=False,
        timeout=120.0,
        preexec_fn=lambda: resource.setrlimit(kind, (most, most)),
        # Bytecode that is truncated by a limit of the file size would be read by the next import of the module.
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"},
    )


def test_image_size_is_checked_before_decoding():
    Path("map.png").write_bytes(png(13_000, 13_000))
    Path("map.yaml").write_text(f"image: map.png\n{MAP}", encoding="utf-8")
    program = "import sys, pathlib; from sar_compiler.sim.occupancy import read_map; read_map(pathlib.Path('map.yaml'))"
    done = run_limited(sys.executable, "-c", program)
    assert "the image has 13000 x 13000 pixels. Reduce the image to at most 2,000,000 pixels" in done.stderr


@pytest.mark.parametrize("command", [["simulate", "--ticks", "60"], ["verify"]], ids=" ".join)
def test_string_doubled_by_script_does_not_fill_memory(command):
    body = """<Sequence><Script code="a := '0123456789abcdef'"/>
        <Repeat num_cycles="40"><Script code="a := a + a"/></Repeat></Sequence>"""
    Path("tree.xml").write_text(document(body), encoding="utf-8")
    done = run_limited(BIN / "sar-compile", *command, "tree.xml")
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert "but the limit is 4,096" in done.stdout + done.stderr


@pytest.mark.parametrize("form", ["xml", "yaml"])
def test_file_with_too_many_elements_is_not_read_completely(form, monkeypatch, capsys):
    monkeypatch.setattr(f"sar_compiler.tree.{form}.MAX_ELEMENTS", 100)
    leaves = {"xml": "<AlwaysSuccess/>\n" * 200, "yaml": "    - AlwaysSuccess\n" * 200}[form]
    text = document(f"<Sequence>\n{leaves}</Sequence> and no end")
    if form == "yaml":
        text = f"root:\n  children:\n  - BehaviorTree:\n      ID: A\n      children:\n      - Sequence:\n          children:\n{leaves}"
    Path(f"many.{form}").write_text(text.replace("    - A", "          - A"), encoding="utf-8")
    assert compile_command(["validate", f"many.{form}"]) == 1
    out = capsys.readouterr().out
    assert "error[too-many-nodes]: the file has more than 100 elements" in out
    assert out.count("error") == 1


@pytest.mark.parametrize("form", ["xml", "yaml"])
def test_element_with_too_many_attributes_is_one_finding(form, capsys):
    names = [f"a{number}" for number in range(200_000 if form == "xml" else 2_000)]
    if form == "xml":
        text = document("<AlwaysSuccess " + " ".join(f'{name}="1"' for name in names) + "/>")
    else:
        written = "".join(f"      {name}: 1\n" for name in names)
        text = f"root:\n  children:\n  - BehaviorTree:\n      ID: A\n{written}"
    Path(f"wide.{form}").write_text(text, encoding="utf-8")
    assert compile_command(["validate", f"wide.{form}"]) == 1
    out = capsys.readouterr().out
    assert "has more than 1,000 attributes" in out
    assert out.count("error") == 1
    assert len(out) < 10_000


def test_map_that_does_not_fit_on_disk_is_reported_and_removed():
    done = run_limited(BIN / "sar-sim", "map", "-o", "map", kind=resource.RLIMIT_FSIZE, most=1000)
    assert (done.returncode, without_progress(done.stderr)) == (
        2,
        "sar-sim: cannot write map.pgm: File too large\n",
    )
    assert list(Path().glob("*map*")) == []


def damage(rng, data):
    """Return data with a few bytes changed, removed or inserted."""
    changed = bytearray(data)
    for _ in range(rng.randint(1, 4)):
        place = rng.randrange(min(len(changed), rng.choice((16, 64, len(changed))))) if changed else 0
        kind = rng.randrange(4)
        if kind == 0:
            changed[place : place + 1] = bytes([rng.randrange(256)])
        elif kind == 1:
            del changed[place : place + rng.randint(1, 8)]
        elif kind == 2:
            changed[place:place] = rng.choice((b"9" * 8, b"\n", b"# ", b"-1", rng.randbytes(6)))
        else:
            del changed[place:]
    return bytes(changed)


def write_images():
    picture = Image.new("L", (21, 20), 254)
    picture.putpixel((3, 4), 0)
    for name in ("map.pgm", "map.png", "map.bmp", "map.jpg"):
        picture.save(name)
        yield name


@pytest.mark.parametrize("rounds", [150, pytest.param(5000, marks=pytest.mark.slow)], ids=["short", "long"])
def test_damaged_map_image_is_a_map_or_a_finding(rounds):
    rng = random.Random(rounds)  # noqa: S311 - nothing secret
    findings: Counter[str] = Counter()
    for name in write_images():
        original = Path(name).read_bytes()
        Path("map.yaml").write_text(f"image: {name}\n{MAP}", encoding="utf-8")
        for _ in range(rounds):
            Path(name).write_bytes(damage(rng, original))
            try:
                read_map(Path("map.yaml"))
            except TreeError as error:
                findings.update(finding.code for finding in error.findings)
    assert set(findings) == {"wrong-value"}


MISSION = """/**:
  ros__parameters:
    zone_order: [zone_a, zone_b]
    tick_rate_hz: 5.0
    zones:
      zone_a: {x: 1.5, y: -2.0, yaw: 0.5}
      zone_b: {x: 0x10, y: 1e3, yaw: .5}
    set_initial_pose: true
/robot1/mission:
  ros__parameters: {name: "text", list: [1, 2, 3], words: [a, 'b']}
"""
TURNING = {"LRE", "RLE", "LRO", "RLO", "PDF", "LRI", "RLI", "FSI", "PDI"}
# Texts with a meaning in YAML, in ROS's YAML parser, or in names.
PIECES = [
    *"/*:-_#&!|>'\"%@`,[]{}?\\ \t\n.0",
    "**",
    "//",
    "__",
    "- ",
    ": ",
    "\n  ",
    "~",
    "yes",
    "1_0",
    "ros__parameters",
    "\0",
    "é",
    "\ufeff",
]


@pytest.mark.ros
@pytest.mark.parametrize("rounds", [400, pytest.param(20_000, marks=pytest.mark.slow)], ids=["short", "long"])
def test_parameter_file_that_passes_check_is_accepted_by_ros(rounds):
    import rclpy
    from rclpy.context import Context

    rng = random.Random(rounds)  # noqa: S311 - nothing secret
    passed, refused = 0, []
    for _ in range(rounds):
        text = MISSION
        for _ in range(rng.randint(1, 3)):
            place = rng.randrange(len(text))
            text = text[:place] + rng.choice(PIECES) + text[place + rng.choice((0, 0, 1, 5)) :]
        Path("p.yaml").write_text(text, encoding="utf-8")
        with suppress(ParameterFileError):
            check_parameter_file("p.yaml")
            passed += 1
            context = Context()
            try:
                rclpy.init(args=["--ros-args", "--params-file", "p.yaml"], context=context)
            except Exception as error:  # noqa: BLE001 - in ROS' own words
                refused.append((str(error), text))
            context.try_shutdown()
    assert passed > rounds / 20
    assert refused == []


@given(st.floats(), st.floats(), st.floats(), st.floats(), st.floats(), st.floats(), st.integers(0, 10**6))
def test_impossible_survivor_position_is_rejected_on_any_map(x, y, resolution, origin, z, w, cells):
    extent = object.__new__(MapExtent)
    extent._place = extent._grid = extent._obstacles = None
    extent._node = SimpleNamespace(get_logger=lambda: SimpleNamespace(warning=lambda _: None))
    position, orientation = SimpleNamespace(x=origin, y=0.0), SimpleNamespace(x=0.0, y=0.0, z=z, w=w)
    pose = SimpleNamespace(position=position, orientation=orientation)
    extent._on_map(
        SimpleNamespace(info=SimpleNamespace(resolution=resolution, width=cells, height=cells, origin=pose))
    )
    possible = math.isfinite(x) and math.isfinite(y) and max(abs(x), abs(y)) <= FARTHEST_M
    assert possible or extent.why_impossible(x, y)


@given(st.integers(-128, 127), st.integers(0, 2**16 - 1), st.text(max_size=50))
def test_description_of_any_drive_end_is_one_clean_line(status, code, message):
    said = escape_to_one_line(describe_end(status, SimpleNamespace(error_code=code, error_msg=message)))
    assert "Cc" not in map(unicodedata.category, said.replace("\t", ""))
    assert not TURNING & set(map(unicodedata.bidirectional, said))


class TestReferencedFiles:
    SECRET = "root:x:0:0: never shown"  # noqa: S105 - not a real secret

    @pytest.fixture(autouse=True)
    def elsewhere(self):
        Path("secret").write_text(f"{self.SECRET}\n" * 20, encoding="utf-8")

    @pytest.mark.parametrize("path", ["../secret", "link", "{here}/secret"])
    def test_world_cannot_name_map_outside_its_folder(self, path, capsys):
        here = Path.cwd()
        Path("project/link").symlink_to(here / "secret")
        text = path.format(here=here)
        Path("project/world.yaml").write_text(f"{WORLD}map: {text}\n", encoding="utf-8")
        assert sim_command(["map", "project/world.yaml"]) == 2
        err = capsys.readouterr().err
        assert f"project/world.yaml:3:6: error[setting-outside]: map: '{text}' is outside the folder" in err
        assert self.SECRET not in err

    def test_map_cannot_name_image_outside_its_folder(self):
        Path("project/map.yaml").write_text(f"image: ../secret\n{MAP}", encoding="utf-8")
        with pytest.raises(
            TreeError, match=r"setting-outside\]: image: '../secret' is outside the folder"
        ) as error:
            read_map(Path("project/map.yaml"))
        assert self.SECRET not in str(error.value)

    def test_map_may_be_in_other_folder_of_repository(self):
        Path(".git").mkdir()
        Path("maps").mkdir()
        Image.new("L", (40, 40), 254).save("maps/m.pgm")
        Path("maps/m.yaml").write_text(f"image: m.pgm\n{MAP}", encoding="utf-8")
        Path("project/world.yaml").write_text(f"{WORLD}map: ../maps/m.yaml\n", encoding="utf-8")
        assert read_map_of_world("project/world.yaml").cells.shape == (40, 40)

    def test_scenario_cannot_name_trace_outside_its_folder(self, capsys):
        Path("project/s.yaml").write_text("expect: {trace: ../secret}\n", encoding="utf-8")
        assert compile_command(["simulate", "project/tree.xml", "--scenario", "project/s.yaml"]) == 1
        out, err = capsys.readouterr()
        assert "error[setting-outside]: trace: '../secret' is outside" in out + err
        assert self.SECRET not in out + err


EVIL = "z\x1b]0;PWNED\x07\x1b[2J\u202e\u009b"


class TestControlCharacters:
    @pytest.fixture(autouse=True)
    def _nothing_passes(self, capsys):
        yield
        out, err = capsys.readouterr()
        assert not set("\x1b\x07\u202e\u009b") & set(out + err)
        assert re.search(r"\\(x1b|u001b|x9b|u009b)", out + err)

    @pytest.mark.parametrize("form", ["text", "json", "sarif", "github"])
    def test_names_and_values_of_tree_are_escaped(self, form):
        body = '<Parallel success_count="&#x9b;\u202e"><AlwaysSuccess/></Parallel>'
        Path("tree.xml").write_text(document(body), encoding="utf-8")
        compile_command(["validate", "tree.xml", "--format", form])

    @pytest.mark.parametrize("form", ["unicode", "ascii", "json"])
    def test_drawn_tree_is_escaped(self, form):
        Path("tree.xml").write_text(
            document('<Sequence name="\\x1b&#x9b;\u202e"><Script code=""/></Sequence>'), encoding="utf-8"
        )
        assert compile_command(["show", "tree.xml", "--format", form]) == 0

    def test_file_name_is_escaped(self):
        compile_command(["validate", f"{EVIL}.xml"])

    def test_argument_is_escaped(self):
        with pytest.raises(SystemExit):
            compile_command([EVIL])

    def test_finding_name_is_escaped(self):
        compile_command(["explain", EVIL])

    def test_configuration_key_is_escaped(self):
        Path("sar.toml").write_text('[findings]\n"\\u001b]0;PWNED\\u0007" = "off"\n', encoding="utf-8")
        compile_command(["validate", "tree.xml"])

    def test_leaf_name_in_scenario_is_escaped(self):
        Path("s.yaml").write_text('leaves: {"\\e[2J\\x07": SUCCESS}\n', encoding="utf-8")
        compile_command(["simulate", "tree.xml", "--scenario", "s.yaml"])

    def test_parameter_name_is_escaped(self):
        Path("p.yaml").write_text('/**: {ros__parameters: {"\\e[2J\\x07": ~}}\n', encoding="utf-8")
        compile_command(["simulate", "tree.xml", "--params", "p.yaml"])

    def test_zone_name_in_world_is_escaped(self):
        Path("w.yaml").write_text(
            'robot: {x: 1, y: 1, radius: 1}\nwalls: []\nzones: {"\\e[2J": 7}\n', encoding="utf-8"
        )
        sim_command(["map", "w.yaml"])


def test_line_break_in_value_creates_no_output_line(capsys):
    Path("tree.xml").write_text(
        document('<Sequence><Parallel success_count="&#10;::error::forged"/></Sequence>'), encoding="utf-8"
    )
    assert compile_command(["validate", "tree.xml"]) == 1
    assert not [line for line in capsys.readouterr().out.splitlines() if line.startswith("::error")]


def test_escaped_json_has_same_data(capsys):
    Path("tree.xml").write_text(
        document('<Sequence name="&#x9b;\u202e"><Script code=""/></Sequence>'), encoding="utf-8"
    )
    assert compile_command(["show", "tree.xml", "--format", "json"]) == 0
    assert json.loads(capsys.readouterr().out)["name"] == "\x9b\u202e"
