"""The records of the shipped nodes as data: the same as what their classes say, and never in the place of other classes."""

import importlib
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from py_trees.version import __version__

from sar_compiler.nodes import records
from sar_compiler.nodes.imports import Deferred
from sar_compiler.nodes.records import FILE, RecordedSpec, recorded
from sar_compiler.nodes.registry import Registry, RegistryError, load_registry
from sar_compiler.nodes.spec import Kind, NodeSpec
from sar_compiler.testing import RENEW
from tests.nodes.recording import recording_of, records_text

MODULES = ("sar_compiler.nodes.language", "sar_compiler.missions.search_and_rescue")
LEAVES = "sar_compiler.missions.search_and_rescue"
# An older one has other files, and the records are not used with it.
of_this_py_trees = pytest.mark.skipif(__version__ < "2.6", reason="the records are of a newer py_trees")


def file_of(module):
    return Path(*module.split("."), FILE)


def known(module):
    found = recorded(module)
    assert found is not None
    return found


def validated(*, folder=Path(), of="search_and_rescue"):
    """Validate a shipped tree in a process of its own; return its output, and the modules that it imported."""
    program = (
        "import sys; from sar_compiler.cli.compile import main; status = main(sys.argv[1:]); "
        "print(*sorted(sys.modules), file=sys.stderr); sys.exit(status)"
    )
    command = [sys.executable, "-c", program, "validate", str(Path(f"trees/{of}.xml").resolve())]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=folder)
    return done.stdout, set(done.stderr.split())


@of_this_py_trees
@pytest.mark.parametrize("module", MODULES)
def test_the_records_are_what_was_reviewed(module):
    text = records_text(module)
    if os.environ.get(RENEW):
        file_of(module).write_text(text, encoding="utf-8")
    hint = "the classes say something else: renew with `make schemas`"
    assert file_of(module).read_text(encoding="utf-8").splitlines() == text.splitlines(), hint


@of_this_py_trees
@pytest.mark.parametrize("module", MODULES)
def test_what_is_read_from_the_records_is_what_the_classes_say(module):
    originals = records.specs_of(importlib.import_module(module))
    records._imported.cache_clear()  # what was imported meanwhile is the function itself
    restored = [record.spec() for record in known(module)]
    assert len(restored) == len(originals)
    for spec in originals:
        (found,) = (each for each in restored if (each.tag, each.variant) == (spec.tag, spec.variant))
        assert isinstance(found, RecordedSpec)
        assert recording_of(found) == recording_of(spec)
        assert (found.cls, found.maker, found.skipping.replacement) == (
            spec.cls,
            spec.maker,
            spec.skipping.replacement,
        )
        targets = {name: parameter.target for name, parameter in found.parameters.items()}
        assert targets == {name: parameter.target for name, parameter in spec.parameters.items()}


@of_this_py_trees
def test_a_type_of_an_enumeration_imports_it_when_a_text_is_read():
    (record,) = (each for each in known(MODULES[0]) if each.tag == "Precondition")
    outcomes: Any = record.spec().parameters["else"].value_type
    assert outcomes.choices == ("SUCCESS", "FAILURE", "RUNNING", "SKIPPED")
    assert outcomes.convert("SKIPPED") is outcomes.python.SKIPPED


def test_what_is_deferred_is_imported_when_it_is_called():
    path = Deferred("pathlib:Path")
    assert path("a") == Path("a")
    assert path.load() is Path


@pytest.mark.parametrize(
    "changed", ["missions/search_and_rescue/conditions.py", "nodes/constructors.py", "ros/leaves/leaf.py"]
)
def test_a_changed_file_counts_at_once_and_not_what_was_recorded_of_it(tmp_path, changed):
    shutil.copytree("sar_compiler", tmp_path / "sar_compiler", ignore=shutil.ignore_patterns("__pycache__"))
    source = tmp_path / "sar_compiler" / changed
    source.write_text(source.read_text(encoding="utf-8") + "# changed\n", encoding="utf-8")
    output, modules = validated(folder=tmp_path)
    assert "no findings" in output
    assert f"{LEAVES}.conditions" in modules


@of_this_py_trees
@pytest.mark.parametrize("of", ["search_and_rescue", "search_and_rescue_resilient"])
def test_a_tree_of_shipped_nodes_is_checked_without_an_import_of_them(of):
    output, modules = validated(of=of)
    assert "no findings" in output
    heavy = (
        "py_trees",
        LEAVES,
        "sar_compiler.ros",
        "sar_compiler.compiler",
        "importlib.metadata",
        "jsonschema",
    )
    assert {name for name in modules if name.startswith(heavy)} == set()
    assert sum(name.startswith("sar_compiler") for name in modules) < 100


@of_this_py_trees
def test_no_node_of_the_language_is_imported_to_be_checked(tmp_path):
    tree = tmp_path / "tree.xml"
    tags = sorted({record.tag for record in known(MODULES[0])} - {"SubTree"})
    inside = "".join(f"<{tag}/>" for tag in tags)
    tree.write_text(
        f'<root BTCPP_format="4"><BehaviorTree ID="A"><Sequence>{inside}</Sequence></BehaviorTree></root>'
    )
    program = f"import sys; from sar_compiler import load; load({str(tree)!r}).check(); print('py_trees' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"


def test_leaves_that_are_recorded_may_be_named_as_well():
    registry = load_registry([LEAVES])
    assert len(registry.variants("NavigateToZone")) == 1


def test_no_other_class_takes_the_tag_of_a_recorded_one():
    class Other:
        def __init__(self, name: str) -> None: ...

    registry = Registry(load_registry().specs())
    with pytest.raises(
        RegistryError, match=r"two classes are registered as <NavigateToZone>: .*NavigateToZone and .*Other"
    ):
        registry.add(NodeSpec("NavigateToZone", Other, Kind.ACTION))


def test_only_packages_of_this_distribution_are_recorded():
    assert recorded("tests.nodes.leaves") is None
    assert recorded("sar_compiler.nodes") is None


def test_what_cannot_be_imported_by_its_name_is_not_recorded():
    class Inside:
        def __init__(self, name: str) -> None: ...

    with pytest.raises(TypeError, match="Inside cannot be imported by its name"):
        recording_of(NodeSpec("Inside", Inside, Kind.ACTION))
