"""Tests of every reader of files with paths that are no files, are elsewhere or are replaced, and with extreme content.

A surface is a way to make the package read a file. `SURFACES` has at least one for each reader: `tests/test_house.py` fails
for a reader without one. No content of a file elsewhere is ever shown, nothing blocks, and nothing ends with a traceback.
"""

import asyncio
import json
import os
import signal
import socket
import sys
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import quote

import pytest

from sar_compiler import opener
from sar_compiler.analysis.approval import approval_folder
from sar_compiler.budget import Budget
from sar_compiler.cli.compile import main as compile_command
from sar_compiler.cli.journal_command import main as journal_command
from sar_compiler.cli.sim import main as sim_command
from sar_compiler.errors import SarError
from sar_compiler.importing.btlog import MAGIC
from sar_compiler.journal.journal_opening import open_journal
from sar_compiler.missions import ParameterReader
from sar_compiler.nodes.installed import entry_points
from sar_compiler.nodes.registry import RegistryError, load_registry
from sar_compiler.opener import is_file
from sar_compiler.project import CommandLineSettings
from sar_compiler.project.trust import ConfigurationCode
from sar_compiler.resources import state_folder
from sar_compiler.runtime.clock import ManualClock
from sar_compiler.sim.occupancy import read_map
from sar_compiler.sim.placement import PoseFile
from sar_compiler.sim.world import load_world
from search_and_rescue.plugin import MISSION
from tests.trees import document
from tests.web.folding import fly

TREE = document('<Sequence><Script code="a := 1"/></Sequence>')
INCLUDING = document("").replace("<Beh", "<include path={}/>\n<Beh", 1)
LACKING = document('<SubTree ID="Elsewhere"/>')
SECRET = "root:x:0:0: never shown"  # noqa: S105 - not a real secret
MAP = "resolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
WORLD = "robot: {x: 1, y: 1, radius: 0.2}\nwalls: []\n"
_MOST_SEC = 60


def command(*words: str) -> Callable[[str], int]:
    """Return a function that runs `sar-compile` with the path of a file for `{}`."""
    return lambda path: compile_command([word.replace("{}", path) for word in words])


def status_of(read: Callable[[], object]) -> int:
    """Return the exit status of a command that only reads a file."""
    try:
        read()
    except SarError as error:
        sys.stderr.write(str(error))
        return 2
    return 0


def read_via(file: str, text: str, then: Callable[[str], int]) -> Callable[[str], int]:
    """Return a function that writes the path into a file as JSON, and then reads that file."""

    def read(path: str) -> int:
        Path(file).write_text(text.replace("{}", json.dumps(path)), encoding="utf-8")
        return then(path)

    return read


def read_at(place: str | Callable[[], Path], then: Callable[[], int]) -> Callable[[str], int]:
    """Return a function that links the file to the fixed path from which it is read, and reads it."""

    def read(path: str) -> int:
        there = Path(place) if isinstance(place, str) else place()
        there.parent.mkdir(parents=True, exist_ok=True)
        with suppress(OSError, ValueError):
            there.unlink(missing_ok=True)
            there.symlink_to(Path(path).absolute())
        return then()

    return read


def read_map_of_world() -> None:
    """Read a world and the map that it names."""
    path = load_world(Path("world.yaml")).map_path
    assert path is not None
    read_map(path)


def read_areas(path: str) -> int:
    """Begin a mission whose parameter file names a file of areas."""
    Path("params.yaml").write_text(
        f"/**: {{ros__parameters: {{areas_file: {json.dumps(path)}, georeference: {{lat: 1.0, lon: 1.0, heading: 0.0}}}}}}\n",
        encoding="utf-8",
    )
    return compile_command(["simulate", "mission.xml", "--params", "params.yaml"])


def read_journal_beside(suffix: str) -> Callable[[str], int]:
    """Return a function that reads a journal with the file beside it."""

    def read(path: str) -> int:
        if not Path("good.journal").exists():
            kept = open_journal(Path("good.journal"))
            fly(kept, 0, 20, clock=ManualClock(0.0), is_ended=True)
            kept.close()
        return read_at(f"good.journal{suffix}", lambda: journal_command(["show", "good.journal"]))(path)

    return read


def read_approval(path: str) -> int:
    """Read the file as an approval."""
    return read_at(lambda: approval_folder() / "a.json", lambda: compile_command(["approve", "--list"]))(path)


def trust_module(path: str) -> int:
    """Trust a configuration with the file as a module."""
    return read_at(
        "gripper/inner.py",
        lambda: status_of(lambda: ConfigurationCode.from_configuration(Path("sar.toml"), ["gripper"])),
    )(path)


def load_package(path: str) -> int:
    """Load a package without leaves that has the file as a module, whose text is searched for leaves."""
    Path("plain").mkdir(exist_ok=True)
    Path("plain/__init__.py").write_text("", encoding="utf-8")

    def look() -> None:
        with suppress(RegistryError):
            load_registry(["plain"])

    return read_at("plain/other.py", lambda: status_of(look))(path)


def read_metadata(path: str) -> int:
    """Search for installed leaves with the file as entry_points.txt."""
    return read_at(
        "site/x-1.dist-info/entry_points.txt",
        lambda: status_of(lambda: list(entry_points("sar_compiler.nodes"))),
    )(path)


def check_in_editor(path: str, text: str) -> int:
    """Let the language server check a text that is open under a file's name; print its findings and messages."""
    pytest.importorskip("pygls")  # an extra
    from pygls.workspace import Workspace

    from sar_compiler.lsp.features import tree_server
    from sar_compiler.lsp.open_text import PlacedFinding

    shown: list[str] = []

    async def session() -> None:
        server: Any = tree_server("1", CommandLineSettings(), [], [], Budget)
        server.protocol._workspace = Workspace(None)
        # There is no client.
        server.window_show_message = lambda params: shown.append(params.message)
        server.window_log_message = server.text_document_publish_diagnostics = lambda _: None
        uri = f"file://{quote(str(Path.cwd() / path))}"
        server.on_opened(uri, text, 1)
        if (file := await server.wait_for_check(uri)) is not None:
            shown.extend(
                str(placed.finding)
                for placed in (*file.shown, *map(PlacedFinding.from_finding, file.elsewhere))
            )
        server.on_closed(uri)

    asyncio.run(session())
    sys.stdout.write("\n".join(shown))
    return 1 if shown else 0


def open_in_editor(path: str) -> int:
    """Let an editor open a file: it sends the text, so the server does not read the file."""
    return check_in_editor(path, Path(path).read_bytes().decode(errors="replace") if is_file(path) else TREE)


class Surface(NamedTuple):
    """A way to make the package read a file.

    Attributes:
        readers: The functions that read it.
        read: Makes the package read the file of a path, and returns an exit status.
        form: The form of its content.
        has_root: Whether the file must be in the folder of the file that names it.
        is_sought: Whether an unreadable file is skipped, because the user has not named it.
    """

    readers: tuple[str, ...]
    read: Callable[[str], int]
    form: str = "yaml"
    has_root: bool = False
    is_sought: bool = False


TREES = "tree/discovery.py:read_tree_file"
YAML = "documents/yaml_files.py:read_yaml"
PARAMETERS = "missions/parameter_file.py:_text_of"
BEGINNING = "tree/discovery.py:is_tree_file"
SURFACES = {
    "a tree": Surface((TREES,), command("validate", "{}"), "xml"),
    "a tree that is formatted": Surface(("cli/format.py:_rewrite",), command("format", "{}"), "xml"),
    "a tree that is fixed": Surface(("validation/validation.py:_write",), command("validate", "--fix", "{}"), "xml"),
    "an included tree": Surface(
        (TREES,), read_via("main.xml", INCLUDING, command("validate", "main.xml")), "xml", has_root=True,
    ),
    "a palette": Surface((TREES,), command("validate", "tree.xml", "--model", "{}"), "xml"),
    "a palette of the settings": Surface(
        (TREES,), read_via("sar.toml", "models = [{}]\n", command("validate", "tree.xml")), "xml", has_root=True
    ),
    "a tree of a set": Surface(
        (TREES, "project/project.py:Project._set_files"),
        read_via("sar.toml", "[project]\ntrees = [{}]\n", command("validate", "lacking.xml")), "xml", has_root=True,
    ),
    "a palette that lies beside a tree": Surface(
        ("tree/discovery.py:is_palette",),
        read_at("beside.xml", lambda: compile_command(["validate", "tree.xml"])), "xml", is_sought=True,
    ),
    "a tree in a folder": Surface(
        (BEGINNING, "tree/discovery.py:_files_in"),
        read_at("folder/one.xml", lambda: compile_command(["validate", "folder"])), "xml", is_sought=True,
    ),
    "settings": Surface(
        ("documents/toml_files.py:read_toml",), read_at("sar.toml", lambda: compile_command(["validate", "tree.xml"])), "toml"
    ),
    "settings for all tools": Surface(
        ("checks/configuration.py:configuration_for",),
        read_at("pyproject.toml", lambda: compile_command(["validate", "tree.xml"])), "toml", is_sought=True,
    ),
    "a tree in an editor": Surface((TREES,), open_in_editor, "xml", is_sought=True),
    "an include in an editor": Surface(
        (TREES,), lambda path: check_in_editor("main.xml", INCLUDING.replace("{}", json.dumps(path))), "xml", has_root=True
    ),
    "a palette in an editor": Surface(
        (TREES,), read_via("sar.toml", "models = [{}]\n", lambda _: check_in_editor("tree.xml", TREE)), "xml", has_root=True
    ),
    "a tree of a set in an editor": Surface(
        (TREES,), read_via("sar.toml", "[project]\ntrees = [{}]\n", lambda _: check_in_editor("lacking.xml", LACKING)), "xml", has_root=True
    ),
    "settings in an editor": Surface(
        ("documents/toml_files.py:read_toml",), read_at("sar.toml", lambda: check_in_editor("tree.xml", TREE)), "toml"
    ),
    "a scenario": Surface(
        (YAML, "analysis/simulate/scenario_files.py:read_scenario"), command("simulate", "tree.xml", "--scenario", "{}")
    ),
    "a scenario of many runs": Surface(
        ("cli/sweep.py:_rows",), command("sweep", "tree.xml", "--scenario", "{}", "--vary", "ticks=1,2", "--runs", "1")
    ),
    "the trace of a scenario": Surface(
        ("checks/golden.py:compare_golden",),
        read_via("s.yaml", "expect: {trace: {}}\n", command("simulate", "tree.xml", "--scenario", "s.yaml")), has_root=True,
    ),
    "properties": Surface(
        ("analysis/verify/properties.py:read_property_file",), command("verify", "tree.xml", "--properties", "{}")
    ),
    "properties that are approved": Surface(
        ("analysis/approval.py:Fingerprint.from_tree",), command("approve", "tree.xml", "--properties", "{}")
    ),
    "parameters": Surface((PARAMETERS,), command("simulate", "tree.xml", "--params", "{}")),
    "areas": Surface(
        ("missions/parameter_reader.py:ParameterReader.read_json_file", "missions/parameter_reader.py:ParameterReader.read_file"),
        read_areas, "json", has_root=True,
    ),
    "a world": Surface(("sim/world.py:load_world",), lambda path: sim_command(["map", path])),
    "the map of a world": Surface(
        ("sim/occupancy.py:read_map",),
        read_via("world.yaml", f"{WORLD}map: {{}}\n", lambda _: status_of(read_map_of_world)),
        has_root=True,
    ),
    "the image of a map": Surface(
        ("sim/occupancy.py:_brightness",),
        read_via("map.yaml", f"image: {{}}\n{MAP}", lambda _: status_of(lambda: read_map(Path("map.yaml")))), "image", has_root=True,
    ),
    "the poses of robots": Surface(
        ("sim/placement.py:PoseFile.read",), lambda path: status_of(PoseFile(Path(path), "world").read), "json"
    ),
    "a journal": Surface(
        ("journal/database.py:JournalFile.read",), lambda path: journal_command(["show", path]), "journal"
    ),
    "a recorded run": Surface(
        (
            "importing/import_run.py:_read_recording", "importing/sqlite_log.py:read_sqlite_log", "importing/bag.py:read_mcap",
        ),
        lambda path: journal_command(["import", path, "-o", "new.journal"]), "btlog",
    ),
    "a journal that is judged": Surface(
        ("journal/database.py:JournalFile.read",), command("conform", "tree.xml", "{}"), "journal"
    ),
    "the log beside a journal": Surface(("journal/database.py:JournalFile.read",), read_journal_beside("-wal"), "journal", is_sought=True),
    "the reserve of a journal": Surface(("journal/spill_file.py:read_reserve",), read_journal_beside("-reserve"), "journal"),
    "the refused start beside a journal": Surface(
        ("journal/refused_start.py:read_refusal",),
        read_at("none.journal-refused", lambda: journal_command(["why", "none.journal"])), "json", is_sought=True,
    ),
    "an approval": Surface(("analysis/approval.py:_read_record", "analysis/approval.py:_record_paths"), read_approval, "json"),
    "a module that is trusted": Surface(("project/trust.py:ConfigurationCode.from_configuration",), trust_module, "python", is_sought=True),
    "a module of a package": Surface(("nodes/registry.py:_submodules_with_leaves",), load_package, "python", is_sought=True),
    "the metadata of a package": Surface(("nodes/installed.py:_metadata_in",), read_metadata, "toml", is_sought=True),
}  # fmt: skip
ELSEWHERE = {
    "tree/forest.py:_Loader._intended_path": "tests/tree/test_forest.py: the files beside a missing one, which are only named",
    "resources.py:require_tree_file": "tests/cli/test_result_cache.py: of a file that is not there, which says why",
    "validation/check_cache.py:CheckCache._load": "tests/cli/test_result_cache.py: damaged results",
    "validation/check_cache.py:add_modules": "tests/cli/test_result_cache.py: modules that are imported already",
    "checks/leaf_classes.py:_module": "tests/checks/test_leaf_classes.py: a module that is exchanged after its import",
    "studio/tree_studio.py:Studio._read.read": "tests/studio/test_edited_document.py: included files",
    "studio/edited_document.py:EditedDocument.is_changed": "tests/studio/test_edited_document.py",
    "studio/edited_document.py:EditedDocument.load": "tests/studio/test_edited_document.py",
    "studio/edited_document.py:EditedDocument.save_text": "tests/studio/test_edited_document.py",
    "lsp/server.py:TreeServer._read": "tests/lsp/test_projects.py: a tree of the set that is no file",
    "project/trust.py:_SourceLoader.get_code": "tests/project/test_untrusted_configuration.py: while a module is imported",
}
"""Readers that no command line reaches, and the tests of them."""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """Work in a folder beside a secret file, as a user without saved state; a blocking test is ended."""
    work = tmp_path / "work"
    work.mkdir()
    monkeypatch.chdir(work)
    monkeypatch.setenv("XDG_STATE_HOME", str(work / "state"))
    monkeypatch.syspath_prepend(str(work / "site"))
    Path("tree.xml").write_text(TREE, encoding="utf-8")
    Path("lacking.xml").write_text(LACKING, encoding="utf-8")
    Path("mission.xml").write_text(document("<ZonesRemaining/>"), encoding="utf-8")
    (tmp_path / "secret").write_text(f"{SECRET}\n" * 20, encoding="utf-8")
    state_folder().mkdir(parents=True)

    def too_long(*_: object) -> None:
        raise TimeoutError(f"it has blocked for {_MOST_SEC} s")

    former = signal.signal(signal.SIGALRM, too_long)
    signal.alarm(_MOST_SEC)
    yield work
    signal.alarm(0)
    signal.signal(signal.SIGALRM, former)


def read_rejected(name: str, path: str, capsys: pytest.CaptureFixture[str]) -> str:
    """Let a surface read a path that must be rejected; return the output."""
    surface = SURFACES[name]
    status = surface.read(path)
    out, err = capsys.readouterr()
    assert status in ((0, 1, 2) if surface.is_sought else (1, 2)), out + err
    assert "Traceback" not in out + err
    assert SECRET not in out + err
    return out + err


def make_socket(path: str) -> None:
    with closing(socket.socket(socket.AF_UNIX)) as listening:
        listening.bind(path)


NO_FILES = {
    "a pipe": (os.mkfifo, "it is a pipe, not a file"),
    "a device": (lambda path: Path(path).symlink_to("/dev/zero"), "it is a device, not a file"),
    "a folder": (os.mkdir, "Is a directory"),
    "a socket": (make_socket, "it is a socket, not a file"),
}


@pytest.mark.parametrize("kind", NO_FILES)
@pytest.mark.parametrize("name", SURFACES)
def test_non_file_is_rejected_without_blocking(name, kind, capsys):
    make, reason = NO_FILES[kind]
    make("odd.xml" if SURFACES[name].form == "xml" else "odd")
    said = read_rejected(name, "odd.xml" if SURFACES[name].form == "xml" else "odd", capsys)
    surface = SURFACES[name]
    # A folder may be searched, and a link to a device leads outside.
    if not surface.is_sought and kind != "a folder":
        assert reason in said or (kind == "a device" and "outside" in said)


# The names of the other files are fixed by the project.
NAMED = [
    name
    for name, surface in SURFACES.items()
    if not surface.is_sought
    and name not in ("settings", "settings in an editor", "the reserve of a journal", "an approval")
]


@pytest.mark.parametrize("path", ["nul\0.xml", "x" * 300, "d/" * 3000], ids=["zero byte", "long", "deep"])
@pytest.mark.parametrize("name", NAMED)
def test_impossible_file_name_is_an_error_message(name, path, capsys):
    read_rejected(name, path, capsys)


ROOTED = [name for name, surface in SURFACES.items() if surface.has_root]


@pytest.mark.parametrize("path", ["../secret", "link", "{here}/secret", "/proc/self/environ"])
@pytest.mark.parametrize("name", ROOTED)
def test_file_outside_folder_is_not_read(name, path, capsys, folder):
    Path("link").symlink_to("../secret")
    said = read_rejected(name, path.format(here=folder.parent), capsys)
    assert "outside" in said or "Elsewhere" in said


@pytest.mark.parametrize("name", ROOTED)
def test_file_replaced_by_link_after_check_is_not_read(name, capsys, monkeypatch):
    """The file is replaced after all checks of its path and before it is opened."""
    form = SURFACES[name].form
    path = "part.xml" if form == "xml" else "part"
    Path(path).write_bytes(next(iter(CONTENTS[form].values())))
    open_it, exchanged = opener._open, list[Path]()

    def exchange_and_open(named, limits):
        if Path(named).name == path and not exchanged:
            exchanged.append(named)
            Path(path).unlink()
            Path(path).symlink_to("../secret")
        return open_it(named, limits)

    monkeypatch.setattr(opener, "_open", exchange_and_open)
    said = read_rejected(name, path, capsys)
    assert exchanged
    assert "it is outside" in said


def _read_map_of(path: str) -> None:
    found = load_world(Path(path)).map_path
    assert found is not None
    read_map(found)


NAMING = {
    "an include": (
        document("").replace("<Beh", '<include path="part"/>\n<Beh', 1), lambda path: compile_command(["validate", path])
    ),
    "a trace": ("expect: {trace: part}\n", lambda path: compile_command(["simulate", "tree.xml", "--scenario", path])),
    "a map": (f"{WORLD}map: part\n", lambda path: status_of(lambda: _read_map_of(path))),
    "an image": (f"image: part\n{MAP}", lambda path: status_of(lambda: read_map(Path(path)))),
}  # fmt: skip


@pytest.mark.parametrize("kind", NAMING)
def test_folder_replaced_by_link_does_not_extend_allowed_paths(kind, capsys, monkeypatch, folder):
    """The link leads to one folder only while the file in it is read; before and after, it leads to another folder."""
    text, read = NAMING[kind]
    link, theirs, other = Path("link"), folder / "theirs", folder.parent / "other"
    name = "main.xml" if kind == "an include" else "main"
    for each in (theirs, other):
        each.mkdir()
        (each / name).write_text(text, encoding="utf-8")
    (other / "part").write_text(f"{SECRET}\n", encoding="utf-8")
    link.symlink_to(other)
    open_it = opener._open

    def exchange_and_open(named, limits):
        if Path(named).name != name:
            return open_it(named, limits)
        link.unlink()
        link.symlink_to(theirs)
        try:
            return open_it(named, limits)
        finally:
            link.unlink()
            link.symlink_to(other)

    monkeypatch.setattr(opener, "_open", exchange_and_open)
    status = read(f"link/{name}")
    out, err = capsys.readouterr()
    assert status in (1, 2)
    assert "outside" in out + err
    assert SECRET not in out + err


def log_with_tree(body: bytes) -> bytes:
    """Return a log of BehaviorTree.CPP that contains a tree."""
    tree = b'<root BTCPP_format="4"><BehaviorTree ID="Main" _fullpath="">' + body + b"</BehaviorTree></root>"
    return MAGIC + b"\x01" + len(tree).to_bytes(4, "little") + tree + bytes(17)


MILLION = 1_000_000
NO_TEXT = b"\xff\xfe\xfa\x80" * 10
CONTENTS = {
    "xml": {
        "a million elements": document("<Sequence>" + "<A/>" * MILLION + "</Sequence>").encode(),
        "deep nesting": document("<Sequence>" * 100_000).encode(),
        "no number": document('<Sleep msec="nan"/>').encode(),
        "no text": NO_TEXT,
    },
    "yaml": {
        "a million elements": b"a: [" + b"1, " * MILLION + b"]",
        "many elements": b"[" + b"1," * 400_000 + b"]",
        "deep nesting": b"[" * 100_000,
        "deep keys": b"{a: " * 50_000,
        "no number": b"{period: .nan, ticks: .inf, resolution: .nan, /**: {ros__parameters: {tick_rate_hz: .nan}}}\n",
        "no text": NO_TEXT,
    },
    "toml": {
        "a million elements": b"models = [" + b"1, " * MILLION + b"]",
        "deep nesting": b"models = " + b"[" * 100_000,
        "no number": b"[findings]\nx = nan\n[tool.sar]\nmodels = nan\n",
        "no text": NO_TEXT,
    },
    "json": {
        "a million elements": b'{"features": [' + b"{}," * MILLION + b"{}]}",
        "deep nesting": b"[" * 100_000,
        "no number": b'{"features": [{"properties": {"name": "a", "poa": NaN}, "geometry": {"type": "Polygon", '
        b'"coordinates": [[[NaN, 1], [1, Infinity], [1, 1]]]}}], "world": "world", "robots": {"a": [[NaN, 0, 0], [0, 0, 1e999]]}}',
        "no text": NO_TEXT,
    },
    "image": {"a million elements": b"P5\n1000000 1000000\n255\n" + bytes(MILLION), "no text": NO_TEXT},
    "journal": {
        "a million elements": b"SQLite format 3\0" + bytes(MILLION),
        "deep nesting": b"{" * 100_000,
        "no number": b'{"key": NaN}\n',
        "no text": NO_TEXT,
    },
    "btlog": {
        "a million elements": log_with_tree(b"<A _uid='1'/>" * MILLION),
        "deep nesting": log_with_tree(b"<Inverter _uid='1'>" * 100_000),
        "no number": log_with_tree(b"<AlwaysSuccess _uid='nan'/>"),
        "no text": log_with_tree(NO_TEXT),
    },
    "python": {"a million elements": b"x = 1\n" * MILLION, "no text": NO_TEXT},
}  # fmt: skip
CASES = [(name, each) for name, surface in SURFACES.items() for each in CONTENTS[surface.form]]


@pytest.mark.parametrize(("name", "content"), CASES, ids=lambda part: part)
def test_extreme_content_is_a_finding_or_an_error_message(name, content, capsys):
    surface = SURFACES[name]
    path = "odd.xml" if surface.form == "xml" else "odd"
    Path(path).write_bytes(CONTENTS[surface.form][content])
    status = surface.read(path)
    out, err = capsys.readouterr()
    assert status in (0, 1, 2)
    assert "Traceback" not in out + err
    assert "internal-error" not in out + err
    assert len(out + err) < 100_000


@pytest.mark.parametrize("name", SURFACES)
def test_growing_file_is_read_up_to_its_limit(name, capsys, monkeypatch):
    """The file grows with each read and never ends."""
    surface, read, sizes = SURFACES[name], os.read, list[int]()
    path = Path("odd.xml" if surface.form == "xml" else "odd")
    path.write_bytes(b" ")
    number = path.stat().st_ino

    def read_and_grow(descriptor: int, most: int) -> bytes:
        if os.fstat(descriptor).st_ino == number:
            sizes.append(most)
            with path.open("ab") as file:
                file.truncate(file.tell() + most)
        return read(descriptor, most)

    monkeypatch.setattr(os, "read", read_and_grow)
    status = surface.read(str(path))
    out, err = capsys.readouterr()
    assert status in (0, 1, 2)
    assert "Traceback" not in out + err
    assert sum(sizes) < 1000 * 2**20


@pytest.mark.parametrize("path", ["../elsewhere/areas.geojson", "{here}/elsewhere/areas.geojson"])
def test_areas_file_named_by_command_line_may_be_anywhere(path, folder):
    there = folder.parent / "elsewhere" / "areas.geojson"
    there.parent.mkdir()
    square = [[0.001, 0.001], [0.002, 0.001], [0.002, 0.002], [0.001, 0.001]]
    area = {
        "properties": {"name": "a", "detection_range": 3.0},
        "geometry": {"type": "Polygon", "coordinates": [square]},
    }
    there.write_text(json.dumps({"features": [area]}), encoding="utf-8")
    given: dict[str, object] = {f"georeference.{key}": 0.0 for key in ("lat", "lon", "heading")}
    reader = ParameterReader({**given, "areas_file": path.format(here=folder.parent)})
    assert [zone["id"] for zone in MISSION.begin(reader).zones.remaining_zones()] == ["a"]
