"""Trees with a typo, and the result of applying the suggestions of their findings.

The trees are shipped trees in XML and YAML with one typing error: a letter omitted, doubled, changed, or swapped with the next one, in a tag, in
the name of an attribute or in its value. Names of nodes and numbers have no typos, because any name or number is valid.
"""

import random
import re
import string
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree as ET

from sar_compiler.agent.suggestion_fixes import apply_suggestions
from sar_compiler.project import Workspace
from sar_compiler.tree.conversion import convert
from sar_compiler.tree.diagnostic import Diagnostic, Form, Severity
from sar_compiler.tree.xml import parse_xml
from sar_compiler.tree.yaml import parse_yaml
from sar_compiler.views.difference import difference

TREES = sorted(Path("trees").glob("*.xml"))
_SEED = 30


class Typo(NamedTuple):
    """A tree with a typo.

    Attributes:
        where: The kind of location: a tag, an attribute or a value.
        right: The text of the tree without it.
        wrong: The text with it.
        form: The form of both.
    """

    where: str
    right: str
    wrong: str
    form: Form


def typo(chance: random.Random, word: str) -> str:
    """Return a word with a letter omitted, doubled, changed, or swapped with the next one."""
    place = chance.randrange(len(word))
    before, letter, after = word[:place], word[place], word[place + 1 :]
    other = chance.choice(string.ascii_letters)
    return chance.choice(
        [
            f"{before}{after}",
            f"{before}{letter}{letter}{after}",
            f"{before}{other}{after}",
            f"{before}{after[:1]}{letter}{after[1:]}",
        ]
    )


def typos(count: int) -> Iterator[Typo]:
    """Yield a number of trees with a typo, the same ones each time."""
    chance = random.Random(_SEED)  # noqa: S311 - the same in every run
    while count:
        path, form = chance.choice(TREES), (Form.XML, Form.YAML)[count % 2]
        root = ET.parse(path).getroot()  # noqa: S314 - it is ours
        right = ET.tostring(root, encoding="unicode")
        where = _make_typo(chance, root)
        wrong = ET.tostring(root, encoding="unicode")
        if where is not None and wrong != right:
            count -= 1
            right, wrong = (
                text if form is Form.XML else convert(parse_xml(text), form).text for text in (right, wrong)
            )
            yield Typo(where, right, wrong, form)


def _make_typo(chance: random.Random, root: ET.Element) -> str | None:
    """Insert a typo into a tree, and return the kind of its location, or None if the tree has no such location."""
    element, where = chance.choice([*root.iter()][1:]), chance.choice(("tag", "attribute", "value"))
    if where == "tag":
        element.tag = typo(chance, element.tag)
        return where if re.fullmatch("[A-Za-z]+", element.tag) else None
    named = [
        name for name, value in element.attrib.items() if name != "name" and re.search("[A-Za-z]", value)
    ]
    if not named:
        return None
    name = chance.choice(named)
    if where == "value":
        element.attrib[name] = typo(chance, element.attrib[name])
    else:
        element.attrib = {
            typo(chance, each) if each == name else each: value for each, value in element.attrib.items()
        }
    return where


class Fixed(NamedTuple):
    """The result of fixing a tree with a typo.

    Attributes:
        is_as_before: Whether the tree equals the original.
        has_errors: Whether errors remain.
    """

    is_as_before: bool
    has_errors: bool


def fixed(each: Typo, folder: Path, is_meant: Callable[[Diagnostic], bool]) -> Fixed:
    """Apply the suggestions of the findings to a tree with a typo."""
    parse, ending = (parse_xml, "xml") if each.form is Form.XML else (parse_yaml, "yaml")
    path = folder / f"typo.{ending}"
    path.write_text(each.wrong, encoding="utf-8")
    tree = apply_suggestions(path, lambda read: Workspace(read=read).load_file(path), is_meant)
    is_as_before = not tree.is_malformed and not difference(parse(each.right), tree.forest.main)
    return Fixed(is_as_before, any(finding.severity is Severity.ERROR for finding in tree.findings))
