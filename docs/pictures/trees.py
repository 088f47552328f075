"""Draw the pictures of trees: `python docs/pictures/trees.py` in the project's folder writes them beside this file."""

import re
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

from sar_compiler.testing import compile_for_test
from sar_compiler.views.drawing import svg


class Drawn(NamedTuple):
    """The tree of a picture.

    Attributes:
        file: The tree file, or `PAGE:FILE` for a file that a page shows.
        tree: The ID of the tree; None for the main tree.
        folded: Whether each subtree is drawn as one node.
        nodes: The modules of the leaves.
    """

    file: str
    tree: str | None = None
    folded: bool = False
    nodes: tuple[str, ...] = ()


TREES = {
    "search_and_rescue": Drawn("trees/search_and_rescue.xml"),
    "search_and_rescue_resilient": Drawn("trees/search_and_rescue_resilient.xml", folded=True),
    "search_zone": Drawn("trees/search_and_rescue_resilient.xml", "SearchZone", folded=True),
    "failsafes": Drawn("trees/search_and_rescue_guarded.xml", "Failsafes", folded=True),
    "retry": Drawn("examples/decorators/retry.xml", nodes=("examples.decorators.leaves",)),
    "errand": Drawn("docs/concepts/behaviour-trees.md:errand.xml"),
    "reactive": Drawn("docs/concepts/statuses.md:reactive.xml"),
    "measure": Drawn("docs/concepts/blackboard.md:measure.xml", folded=True),
    "search": Drawn("docs/concepts/facts.md:search.xml"),
    "patrol": Drawn("docs/concepts/proofs.md:patrol.xml"),
    "first_tree": Drawn("docs/tutorial/1-first-tree.md:search.xml"),
    "corrected_tree": Drawn("docs/tutorial/4-simulate.md:search.xml", nodes=("rescue_time",)),
    "mission_tree": Drawn("docs/tutorial/5-verify.md:search.xml", nodes=("rescue_time",)),
}
"""The tree of each picture, by the name of the picture."""
LEAVES = "docs/tutorial/3-leaf.md", "rescue_time.py"
"""The page and the name of the module with the tutorial's leaf."""
_SHOWN = r"^`{}`:\n\n```\w+\n(.*?)^```$"


def shown(page: str, name: str) -> str:
    """Return the content of a file that a page shows.

    Raises:
        ValueError: If the page does not show exactly one file of this name.
    """
    text = Path(page).read_text(encoding="utf-8")
    [found] = re.findall(_SHOWN.format(re.escape(name)), text, re.MULTILINE | re.DOTALL)
    return str(found)


def pictures() -> dict[Path, str]:
    """Return the SVG of each picture, by its path."""
    folder = Path(__file__).parent
    with tempfile.TemporaryDirectory() as made:
        (Path(made) / LEAVES[1]).write_text(shown(*LEAVES), encoding="utf-8")
        sys.path.insert(0, made)
        try:
            return {folder / f"{name}.svg": _drawn(drawn, Path(made)) for name, drawn in TREES.items()}
        finally:
            sys.path.remove(made)


def _drawn(drawn: Drawn, folder: Path) -> str:
    page, _, name = drawn.file.partition(":")
    path = folder / name if name else Path(page)
    if name:
        path.write_text(shown(page, name), encoding="utf-8")
    return svg(compile_for_test(path, drawn.tree, nodes=drawn.nodes), folded=drawn.folded).replace(
        f"{folder}/", ""
    )


if __name__ == "__main__":
    for path, text in pictures().items():
        path.write_text(text, encoding="utf-8")
