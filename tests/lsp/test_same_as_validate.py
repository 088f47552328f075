"""Tests that an editor shows the findings of `validate` at the same locations."""

import json
from pathlib import Path

import pytest

from sar_compiler.cli.compile import main
from tests.checks.test_file_errors import HEAD, IN_XML, IN_YAML
from tests.checks.test_tree_errors import IN_A_FILE, IN_A_TREE
from tests.docs.test_findings import CODES, page_of
from tests.docs.test_findings import write as write_files
from tests.trees import document

_SEVERITIES = {1: "error", 2: "warning", 3: "info"}


def validated(path, capsys):
    """Return the findings of `validate` in the file itself."""
    main(["validate", str(path), "--no-deep", "--format", "json"])
    found = json.loads(capsys.readouterr().out)
    return sorted(
        (each["code"], each["severity"], each["line"], each["column"], each["end_line"], each["end_column"], each["message"])
        for each in found
        if Path(each["file"]).resolve() == path.resolve()
    )  # fmt: skip


def shown(published):
    """Return the shown findings, with locations counted like those of `validate`."""
    return sorted(
        (
            each.code,
            _SEVERITIES[each.severity],
            each.range.start.line + 1,
            each.range.start.character + 1,
            each.range.end.line + 1,
            each.range.end.character + 1,
            each.message.rpartition("\n")[0] if "\n" in each.message else each.message,
        )
        for each in published.diagnostics
    )


def text_of(mistake):
    return mistake[0] if isinstance(mistake, tuple) else mistake


WRITTEN = {
    **{f"in a tree: {name}": (document(text_of(IN_A_TREE[name])), ".xml") for name in IN_A_TREE},
    **{f"in a file: {name}": (text_of(IN_A_FILE[name]), ".xml") for name in IN_A_FILE},
    **{f"in XML: {name}": (text_of(IN_XML[name]), ".xml") for name in IN_XML},
    **{f"in YAML: {name}": (text_of(IN_YAML[name]), ".yaml") for name in IN_YAML},
}


@pytest.mark.parametrize("name", WRITTEN)
def test_typed_error_is_shown_as_validate_reports_it(name, editor, capsys, tmp_path):
    text, ending = WRITTEN[name]
    text = text if isinstance(text, str) else text.decode("utf-8", "replace")
    path = tmp_path / f"tree{ending}"
    path.write_text(text, encoding="utf-8", newline="")
    editor.open(path, document("<Success/>") if ending == ".xml" else f"{HEAD}      - Success\n")
    *_, checked = editor.replace(path, 2, text)
    assert shown(checked) == validated(path, capsys)


def is_plain(page):
    """Return whether the bad example of a page is only validated."""
    return page.commands("Bad") is None and page.commands("Finding") is None


SHOWN = [code for code in CODES if is_plain(page_of(code))]


@pytest.mark.parametrize("code", SHOWN)
def test_bad_example_is_shown_as_validate_reports_it(code, editor, capsys, tmp_path):
    path = tmp_path / write_files(page_of(code).sections["Bad"], tmp_path, "bad")
    assert shown(editor.open(path, path.read_bytes().decode())) == validated(path, capsys)
