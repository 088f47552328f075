"""Tests of the node library pages: they match the registry and have every node."""

import re
import runpy

from sar_compiler.nodes.palettes import palette_names
from sar_compiler.nodes.registry import load_registry

LIBRARY = runpy.run_path("docs/site/node_library.py")


def test_node_library_pages_match_registry():
    made = LIBRARY["pages"]()
    old = [path.name for path, text in made.items() if path.read_text(encoding="utf-8") != text]
    assert old == [], "make schemas renews them"
    assert {*LIBRARY["FOLDER"].glob("*.md")} == made.keys()


def test_every_node_has_a_section_about_its_return_status():
    sections = "".join(path.read_text(encoding="utf-8") for path in LIBRARY["FOLDER"].glob("[a-z]*.md"))
    found = re.findall(r"^## (\w+)\n(.*?)(?=^## |\Z)", sections, re.MULTILINE | re.DOTALL)
    registries = [load_registry(palettes=[palette]) for palette in palette_names()]
    assert {tag for tag, _ in found} == {spec.tag for registry in registries for spec in registry}
    silent = [
        tag for tag, text in found if not re.search(r"^Returns |[Cc]hild(ren)? return", text, re.MULTILINE)
    ]
    assert silent == [f"Switch{number}" for number in range(2, 7)]
