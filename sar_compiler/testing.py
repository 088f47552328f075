"""For tests of your own trees.

A golden test holds a compiled tree against a file that was committed, so that a change of the tree, of
the registry or of the compiler shows in a review::

    from sar_compiler.testing import assert_matches_golden

    def test_my_mission_compiles_as_reviewed():
        assert_matches_golden("trees/my_mission.xml", "tests/golden/my_mission.json")

`SAR_RENEW_GOLDEN=1 pytest` writes the files anew.
"""

import difflib
import json
import os
from pathlib import Path

from sar_compiler.compiler import CompiledTree, bind_main, preview_tree
from sar_compiler.nodes.registry import Registry, default_registry
from sar_compiler.tree.forest import load_forest
from sar_compiler.tree.reading import read_tree_file
from sar_compiler.views.outline import outline
from sar_compiler.views.text import ascii_tree

RENEW = "SAR_RENEW_GOLDEN"
"""The environment variable that makes golden tests write their files."""


def compiled(tree: str | Path, tree_id: str | None = None, registry: Registry | None = None) -> CompiledTree:
    """Compile a tree file with stand-ins for what only a mission has.

    Args:
        tree: The file.
        tree_id: The tree in it; by default the one that the file executes.
        registry: What tags mean; by default everything installed.

    Raises:
        TreeError: If the tree is not valid.
    """
    return preview_tree(
        bind_main(load_forest(Path(tree), read_tree_file), registry or default_registry(), tree_id)
    )


def assert_matches_golden(
    tree: str | Path, golden: str | Path, tree_id: str | None = None, registry: Registry | None = None
) -> None:
    """Compare a compiled tree with a committed file.

    Args:
        tree: The tree file.
        golden: The committed file: `.json` holds what `sar-compile show --format json` prints, any other
            ending what `--format ascii` prints.
        tree_id: The tree in the file; by default the one that the file executes.
        registry: What tags mean; by default everything installed.

    Raises:
        AssertionError: If they differ, with the difference; or if there is no committed file yet.
    """
    result = compiled(tree, tree_id, registry)
    as_json = Path(golden).suffix == ".json"
    text = (
        json.dumps(outline(result), indent=2, ensure_ascii=False) + "\n"
        if as_json
        else ascii_tree(result.root)
    )
    path = Path(golden)
    if os.environ.get(RENEW):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        return
    if not path.is_file():
        message = f"there is no golden file {path} yet: run with {RENEW}=1, then review and commit it"
        raise AssertionError(message)
    expected = path.read_text(encoding="utf-8")
    if text != expected:
        difference = difflib.unified_diff(
            expected.splitlines(),
            text.splitlines(),
            f"{path} (committed)",
            f"{tree} (compiled now)",
            lineterm="",
        )
        advice = f"If this is meant, run with {RENEW}=1 and review the change."
        message = "\n".join(["the compiled tree is not the committed one:", *difference, advice])
        raise AssertionError(message)
