import importlib.util

import pytest

# An extra (`lsp`).
collect_ignore_glob = [] if importlib.util.find_spec("pygls") else ["test_*.py"]


@pytest.fixture(scope="module")
def editor():
    from tests.lsp.editor import Editor

    editor = Editor()
    yield editor
    editor.close()
