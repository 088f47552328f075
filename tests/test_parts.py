"""Tests of the package without one part: commands that do not need the part work, and others name the missing part."""

import json
import shutil
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest

from sar_compiler.cli.compile import main
from sar_compiler.journal.journal_opening import open_journal
from tests.test_house import CORE, PARTS
from tests.trees import document
from tests.views.recorded_runs import ScriptedPolicy, run_and_record, simulated

TREE = '<Sequence><Script code="a := 1"/><Sleep msec="5"/><ScriptCondition code="a == 1"/></Sequence>'
PACKAGE = Path("sar_compiler")
# The module of the command line and the required parts of each command.
COMPILE, JOURNAL = "sar_compiler.cli.compile", "sar_compiler.cli.journal_command"
COMMANDS = {
    "validate tree.xml": (COMPILE, set()),
    "show tree.xml": (COMPILE, set()),
    "show --format json tree.xml": (COMPILE, set()),
    "format --check tree.xml": (COMPILE, set()),
    "convert tree.xml --to yaml": (COMPILE, set()),
    "schema --format json": (COMPILE, set()),
    "--help": (COMPILE, set()),
    "validate --format sarif tree.xml": (COMPILE, {"views"}),
    "validate --fix tree.xml": (COMPILE, {"validation"}),
    "show --format svg tree.xml": (COMPILE, {"views"}),
    "diff tree.xml tree.xml": (COMPILE, {"views"}),
    "nodes": (COMPILE, {"views"}),
    "explain unread-key": (COMPILE, {"views"}),
    "simulate tree.xml --scenario empty.yaml": (COMPILE, {"analysis"}),
    "verify tree.xml": (COMPILE, {"analysis"}),
    "predict tree.xml": (COMPILE, {"analysis"}),
    "check run.journal": (JOURNAL, {"journal", "reports"}),
    "show run.journal": (JOURNAL, {"journal", "reports", "views"}),
    "stats run.journal": (JOURNAL, {"analysis", "journal", "reports"}),
    "why run.journal": (JOURNAL, {"journal", "reports", "views"}),
    "import delivery_failed -o imported.journal": (JOURNAL, {"importing", "journal", "views"}),
}
# The text in the error of a command without a part that it needs.
MISSING = "sar_compiler.{}"
_PROGRAM = """
import glob, importlib, json, os, pkgutil, re, sys

# What is not ours is imported once for all parts, and the core, which needs none of them, once for all commands.
import jsonschema, lxml.etree, numpy, py_trees, scipy.sparse.linalg, yaml

sys.meta_path[:] = [finder for finder in sys.meta_path if "__editable__" not in getattr(finder, "__module__", "")]
places, core, commands = map(json.loads, sys.argv[1:])
sought = os.open("sought", os.O_CREAT | os.O_TRUNC | os.O_RDWR)


class Finder:
    # Finds nothing, but notes which parts are looked for, whether they are imported or only asked for.
    def find_spec(name, path=None, target=None):
        os.write(sought, (name + "\\n").encode())


sys.meta_path.insert(0, Finder)


def parts_sought():
    parts = re.findall(r"^sar_compiler\\.(\\w+)", open("sought").read(), re.MULTILINE)
    os.truncate("sought", 0)
    os.lseek(sought, 0, os.SEEK_SET)
    return sorted(set(parts))


for part, place in places.items():
    if not os.fork():
        sys.path.insert(0, place)
        for room in core:
            package = importlib.import_module(f"sar_compiler.{room}")
            for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
                importlib.import_module(module.name)
        parts_sought()
        # A command that does not look for a part cannot miss it.
        takers = commands
        if part:
            with open("takers.json") as file:
                takers = [command for command, parts in json.load(file).items() if part in parts]
        results, sought_by = {}, {}
        for command in takers:
            child = os.fork()
            if not child:
                output = os.open("output", os.O_CREAT | os.O_TRUNC | os.O_WRONLY)
                os.dup2(output, 1)
                os.dup2(output, 2)
                from sar_compiler.console_command import console_command

                sys.argv = [commands[command], *command.split()]
                console_command(commands[command])
            _, ended = os.waitpid(child, 0)
            for path in glob.glob("imported.*"):
                os.remove(path)
            results[command] = (os.waitstatus_to_exitcode(ended), re.sub(r"[0-9.]+ m?s\\b", "TIME", open("output").read()))
            sought_by[command] = parts_sought()
        if not part:
            with open("takers.json", "w") as file:
                json.dump(sought_by, file)
        with open(f"{place}/results.json", "w") as file:
            json.dump(results, file)
        os._exit(0)
    os.wait()
"""


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Return a folder with a tree, a scenario, and the journal of a run of the tree."""
    folder = tmp_path_factory.mktemp("parts")
    tree = folder / "tree.xml"
    tree.write_text(document(TREE), encoding="utf-8")
    assert main(["format", str(tree)]) == 0
    (folder / "empty.yaml").write_text("leaves: {}\n", encoding="utf-8")
    with closing(open_journal(folder / "run.journal")) as journal:
        run_and_record(simulated(tree), ScriptedPolicy(), journal, tree_file=str(tree), tree_id="Main")
    return folder


def copy_without(part, folder):
    """Copy the package without a part; return the folder of the copy."""
    place = folder / (part or "whole")
    ignored = shutil.ignore_patterns(part) if part else None
    shutil.copytree(PACKAGE, place / PACKAGE.name, ignore=ignored, dirs_exist_ok=True)
    for path in (
        *map(Path, ("package.xml", "trees", "examples", "schemas", "config", "docs", "search_and_rescue")),
        *Path().glob("*.so"),
    ):
        (place / path).symlink_to(path.resolve())
    return place


@pytest.mark.costly
def test_commands_without_a_part_work_or_name_the_missing_part(files):
    places = {part: copy_without(part, files) for part in ("", *sorted(PARTS))}
    modules = {command: module for command, (module, _) in COMMANDS.items()}
    asked = [{part: str(place) for part, place in places.items()}, [*CORE], modules]
    done = subprocess.run(
        [sys.executable, "-c", _PROGRAM, *map(json.dumps, asked)],
        capture_output=True,
        text=True,
        cwd=files,
        timeout=600.0,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    results = {part: json.loads((place / "results.json").read_text()) for part, place in places.items()}
    whole = results.pop("")
    assert {command: said for command, (status, said) in whole.items() if status} == {}
    for part, of_part in results.items():
        assert {command for command, (_, takes) in COMMANDS.items() if part in takes} <= of_part.keys()
        for command, (status, said) in of_part.items():
            _, takes = COMMANDS[command]
            if part in takes:
                assert status == 2, (part, command, said)
                assert MISSING.format(part) in said
                assert "Traceback" not in said
            else:
                assert (part, command, status, said) == (part, command, *whole[command])
