"""Tests of the pages of the site: all are in the menu, and internal links stay within the site."""

import importlib
import os
import re
import runpy
from pathlib import Path

import pytest
import yaml

from tests.docs.markdown import links

SITE = runpy.run_path("docs/site/pages.py")


class _Menu(yaml.SafeLoader):
    """Ignores the YAML tags that only the site builder understands."""


_Menu.add_multi_constructor("tag:yaml.org,2002:python/", lambda *_: None)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return the folder of the generated pages."""
    folder = tmp_path_factory.mktemp("site") / "pages"
    SITE["write_pages"](folder)
    return folder


def menu(entry):
    """Return the pages in an entry of the menu."""
    if isinstance(entry, str):
        return [entry]
    values = entry.values() if isinstance(entry, dict) else entry
    return [page for value in values for page in menu(value)]


def test_every_page_is_in_the_menu(folder):
    settings = yaml.load(Path("mkdocs.yml").read_text(encoding="utf-8"), _Menu)  # noqa: S506 - derived from the safe one
    listed = menu(settings["nav"])
    assert sorted(listed) == sorted(set(listed))
    pages = {SITE["place"](path) for path in SITE["DOCS"].rglob("*.md")}
    pages |= {path.relative_to(folder).as_posix() for path in folder.glob("api/*.md")}
    assert {page for page in pages - set(listed) if not page.startswith("findings/")} == set()
    assert [name for name in listed if not (folder / name).is_file()] == []


def test_internal_links_stay_within_the_site(folder):
    out = [
        f"{page.relative_to(folder)}:{line} {target}"
        for page in sorted(folder.rglob("*.md"))
        for line, target in links(page)
        if not re.match("https?:|mailto:|#", target)
        if not (page.parent / target.partition("#")[0]).is_file()
        or not Path(os.path.normpath(page.parent / target.partition("#")[0])).is_relative_to(folder)
    ]
    assert out == []


@pytest.mark.parametrize("group", SITE["GROUPS"])
def test_every_public_name_is_on_an_api_page(folder, group):
    names = set(importlib.import_module(group).__all__)
    text = "".join(path.read_text(encoding="utf-8") for path in (folder / "api").glob("*.md"))
    assert set(re.findall(rf"heading: {group}\.(\w+)\n", text)) == names


def test_linked_source_file_becomes_a_page_with_its_text(folder):
    text = (folder / "trees/search_and_rescue.xml.md").read_text(encoding="utf-8")
    assert Path("trees/search_and_rescue.xml").read_text(encoding="utf-8") in text
    assert "\n# trees/search_and_rescue.xml\n\n````xml\n" in text


def test_links_in_code_are_not_rewritten(tmp_path):
    with_links = SITE["_with_links"]
    line = "`[a](../../trees/failsafes.xml)` and [b](../../trees/failsafes.xml#x)\n"
    page = SITE["DOCS"] / "reference/properties.md"
    assert with_links(line, page) == "`[a](../../trees/failsafes.xml)` and [b](../trees/failsafes.xml.md#x)\n"
