"""Draw the pictures of trees: `python docs/pictures/trees.py` in the project's folder writes them beside this file."""

from pathlib import Path
from typing import NamedTuple

from sar_compiler.testing import compiled
from sar_compiler.views.drawing import svg


class Drawn(NamedTuple):
    """What a picture is of: a file, the tree in it (None for the one that it executes), whether folded, the modules of its leaves."""

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
}
"""What is drawn, by the name of the picture."""


def pictures() -> dict[Path, str]:
    """Return what each picture is to be, by its path."""
    folder = Path(__file__).parent
    return {
        folder / f"{name}.svg": svg(
            compiled(Path(drawn.file), drawn.tree, nodes=drawn.nodes), folded=drawn.folded
        )
        for name, drawn in TREES.items()
    }


if __name__ == "__main__":
    for path, text in pictures().items():
        path.write_text(text, encoding="utf-8")
