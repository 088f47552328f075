"""Tests of the server's limits: a slow check is aborted, and a cancelled request ends with its processes."""

import asyncio

import pytest
from lsprotocol import types as lsp
from pygls.exceptions import JsonRpcRequestCancelled

from tests.lsp.editor import Editor
from tests.processes import children_of
from tests.trees import write
from tests.waiting import News

WIDE = [
    '<BehaviorTree ID="Main">',
    "<Sequence>",
    *(f'<Script code="a{number} := a{number - 1} + 1"/>' for number in range(40_000)),
    "</Sequence>",
    "</BehaviorTree>",
]
SMALL = ['<BehaviorTree ID="Main">', "<Sleep/>", "</BehaviorTree>"]
ENDLESS = [
    '<BehaviorTree ID="Main">',
    '<Sequence><Script code="n := 0"/><KeepRunningUntilFailure><Sequence><Script code="n += 1"/>',
    '<ScriptCondition code="n &lt; 1000000000"/><Sleep msec="10"/></Sequence></KeepRunningUntilFailure></Sequence>',
    "</BehaviorTree>",
]


@pytest.fixture(scope="module")
def editor_with_short_limit():
    editor = Editor("--max-seconds", "0.5")
    yield editor
    editor.close()


def wait_until(wanted, complaint):
    news = News()
    with news:
        return news.wait_until(wanted, complaint)


def error_after_cancel(editor, method, params, begun=lambda: True):
    """Cancel a request after it has begun; return the exception that it raises."""

    async def ask():
        return editor.client.protocol.send_request(method, params, msg_id="to cancel")

    answer = editor.ask(ask())
    wait_until(begun, lambda: f"{method} does not begin")
    editor.say(editor.client.cancel_request, lsp.CancelParams("to cancel"))

    async def get():
        return await asyncio.wrap_future(answer)

    with pytest.raises(Exception) as raised:  # noqa: PT011 - its type is looked at
        editor.ask(get())
    return raised.value


def test_check_over_time_limit_is_reported_and_next_file_is_checked(editor_with_short_limit, tmp_path):
    wide, small = tmp_path / "wide.xml", tmp_path / "small.xml"
    write(wide, *WIDE, main="Main")
    write(small, *SMALL, main="Main")
    assert not editor_with_short_limit.open(wide).diagnostics
    reason = f"{wide} was not checked: stopped after 0.5 s. Raise the limit with --max-seconds"
    editor_with_short_limit.wait_until(
        lambda: [each for each in editor_with_short_limit.messages if each.message == reason], "no message"
    )
    (finding,) = editor_with_short_limit.open(small).diagnostics
    assert finding.code == "missing-attribute"


def test_cancelled_command_leaves_no_process(editor, tmp_path):
    path = tmp_path / "endless.xml"
    write(path, *ENDLESS, main="Main")
    editor.open(path)
    server = editor.client._server.pid

    def verify_processes():
        return children_of(server, "verify")

    params = lsp.ExecuteCommandParams("sar.verify", arguments=[path.as_uri(), None])
    assert isinstance(
        error_after_cancel(editor, lsp.WORKSPACE_EXECUTE_COMMAND, params, verify_processes),
        JsonRpcRequestCancelled,
    )
    wait_until(lambda: not verify_processes(), lambda: "it goes on")


def test_request_waiting_for_a_check_can_be_cancelled(editor, tmp_path):
    path = tmp_path / "wide.xml"
    write(path, *WIDE, main="Main")
    item = lsp.TextDocumentItem(path.as_uri(), "xml", 1, path.read_text(encoding="utf-8"))
    editor.say(editor.client.text_document_did_open, lsp.DidOpenTextDocumentParams(item))
    params = lsp.HoverParams(lsp.TextDocumentIdentifier(path.as_uri()), lsp.Position(1, 2))
    assert isinstance(error_after_cancel(editor, lsp.TEXT_DOCUMENT_HOVER, params), JsonRpcRequestCancelled)
    whose = lsp.TextDocumentIdentifier(path.as_uri())
    editor.say(editor.client.text_document_did_close, lsp.DidCloseTextDocumentParams(whose))


@pytest.mark.costly
def test_tree_name_from_editor_is_never_parsed_as_option(editor, tmp_path):
    path = tmp_path / "small.xml"
    write(path, '<BehaviorTree ID="Main">', "<AlwaysSuccess/>", "</BehaviorTree>", main="Main")
    (tmp_path / "strange.py").write_text("open('imported', 'w')", encoding="utf-8")
    editor.open(path)
    for name in ("--nodes=strange", "--output=imported", "-"):
        params = lsp.ExecuteCommandParams("sar.simulate", arguments=[path.as_uri(), name])
        assert editor.ask(editor.client.workspace_execute_command_async(params)) is False
    assert not (tmp_path / "imported").exists()
    assert any("tree '--nodes=strange'" in each.message for each in editor.logged), editor.logged
