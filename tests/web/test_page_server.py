"""Tests of the page server: access to the page, permission for commands, and the state that a late browser receives."""

import itertools
import json
import re
import selectors
import socket
import urllib.error
import urllib.request
from concurrent.futures import Future
from contextlib import ExitStack, closing, suppress
from typing import Any

import pytest

from sar_compiler.errors import SarError
from sar_compiler.journal.journal_entries import Ending, JournalEntry
from sar_compiler.web import feed as feed_module
from sar_compiler.web import page_server
from sar_compiler.web.feed import ReplayFeed
from sar_compiler.web.page_server import PORT, PageError, PageQuery, PageServer
from sar_compiler.web.replay import Replay
from tests.processes import listening_addresses
from tests.waiting import SILENCE_SEC, News
from tests.web.folding import folded


class Operator:
    """Accepts the command `pause`, and refuses all others."""

    def __init__(self):
        self.given = []
        self.givers = []

    def send(self, verb, values, giver):
        if verb != "pause":
            message = f"there is no order '{verb}'"
            raise SarError(message)
        self.given.append((verb, values))
        self.givers.append(giver)
        answer: Future[tuple[bool, str]] = Future()
        answer.set_result((True, "done"))
        return answer


def events(run, enough):
    """Read the events of a page until `enough` returns true; return them as pairs of name and values."""
    with closing(
        urllib.request.urlopen(f"http://127.0.0.1:{run.server.port}/events", timeout=SILENCE_SEC)
    ) as answer:
        found: list[tuple[str, Any]] = []
        while not enough(found):
            name = answer.readline().decode()
            if not name:
                return found
            found.append((name.removeprefix("event: ").strip(), json.loads(answer.readline()[6:])))
            answer.readline()
    return found


def page_state(found):
    """Return the state of a page after events."""
    state: dict[str, Any] = {}
    for name, changes in found:
        for change in changes if name == "changes" else ():
            state = folded(state, change)
    return state


def log_lines(found):
    """Return the log lines after events."""
    return [line[-1] for line in page_state(found).get("log", ())]


def test_tool_needs_token_unless_it_is_read_only(live):
    tools = {"look": PageQuery(lambda values: {"seen": values}), "set": PageQuery(lambda _: 1, is_free=False)}
    run = live(tools=tools)
    assert "#" in run.server.url
    known = {"Authorization": f"Bearer {run.server.token}"}

    def ask(name, body="{}", content="application/json", **headers):
        status, text, _ = run.ask(f"/tools/{name}", "POST", body, Content_Type=content, **headers)
        return status, text

    assert ask("look", '{"a": 1}') == (200, '{"seen":{"a":1}}')
    assert ask("set")[0] == 403
    assert ask("set", **known) == (200, "1")
    assert ask("nothing", **known)[0] == 404
    assert ask("look", "[]")[0] == 400
    assert ask("look", content="text/plain")[0] == 415
    assert ask("look", Origin="http://elsewhere")[0] == 403


def test_report_is_served_as_page_with_inline_style(live):
    run = live(tools={"report": PageQuery(lambda values: f"<p>{values['robot']}</p>")})
    status, text, headers = run.ask("/report?robot=1")
    assert (status, text) == (200, "<p>1</p>")
    assert "style-src 'unsafe-inline'" in headers["Content-Security-Policy"]
    assert "script-src" not in headers["Content-Security-Policy"]
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert run.ask("/report")[1] == "<p>0</p>"
    assert run.ask("/report?robot=x")[0] == 400


def test_missing_report_is_reported(live):
    def fail(_):
        message = "the run goes on"
        raise SarError(message)

    assert live().ask("/report")[0] == 404
    assert live(tools={"report": PageQuery(fail)}).ask("/report")[:2] == (
        409,
        "There is no report: the run goes on.\n",
    )


def test_page_is_served_with_strict_security_headers(live):
    run = live()
    status, text, headers = run.ask("/")
    assert (status, "<title>mission</title>" in text) == (200, True)
    policy = headers["Content-Security-Policy"]
    assert policy.startswith("default-src 'none'; script-src 'self'; style-src 'self'")
    assert "unsafe" not in policy
    assert (headers["X-Content-Type-Options"], headers["Referrer-Policy"]) == ("nosniff", "no-referrer")
    assert (headers["Cross-Origin-Opener-Policy"], headers["Cross-Origin-Resource-Policy"]) == (
        "same-origin",
        "same-origin",
    )
    # A browser must not show the page of another mission or of an older version from its cache.
    assert headers["Cache-Control"] == "no-store"


@pytest.mark.parametrize("page", ["/", "/tree"])
def test_pages_refer_only_to_own_files(live, page):
    _, text, _ = live().ask(page)
    named = re.findall(r'(?:src|href)="([^"]*)"', text)
    assert len(named) > 1
    assert [each for each in named if not each.startswith("static/") and each not in ("tree", "./")] == []


@pytest.mark.parametrize(
    "path",
    [
        "/nothing",
        "/static/",
        "/static/nothing.js",
        "/static/..%2fpage_server.py",
        "/static/../feed.py",
        "//etc/passwd",
    ],
)
def test_unknown_path_is_not_found(live, path):
    status, text, headers = live().ask(path)
    assert (status, text) == (404, "page not found\n")
    assert "Content-Security-Policy" in headers


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE"])
def test_write_methods_are_not_allowed(live, method):
    assert live().ask("/", method)[0] == 405


@pytest.mark.parametrize(
    "host", ["example.org", "example.org:8043", "127.0.0.1.example.org", "", "[::1].x", "localhost:x"]
)
@pytest.mark.parametrize("path", ["/", "/events"])
def test_foreign_host_name_is_refused(live, host, path):
    assert live().ask(path, Host=host)[0] == 403


@pytest.mark.parametrize("host", ["localhost", "127.0.0.1:9000", "[::1]:8043"])
def test_local_host_names_with_any_port_are_accepted(live, host):
    assert live().ask("/", Host=host)[0] == 200


@pytest.mark.parametrize("origin", ["http://example.org", "http://127.0.0.1:1", "https://127.0.0.1", "null"])
def test_foreign_origin_is_refused(live, origin):
    run = live(orders=Operator())
    assert run.ask("/events", Origin=origin)[0] == 403
    assert run.order("pause", {}, Origin=origin)[0] == 403


@pytest.mark.parametrize("name", ["localhost", "127.0.0.1", "[::1]"])
def test_own_origin_is_accepted_under_each_local_name(live, name):
    run = live(orders=Operator())
    assert run.ask("/", Origin=f"http://{name}:{run.server.port}")[0] == 200
    assert run.order("pause", {"why": "rest"}, Origin=f"http://{name}:{run.server.port}")[0] == 200
    for other in (
        f"http://{name}:{run.server.port + 1}",
        f"https://{name}:{run.server.port}",
        f"http://{name}",
    ):
        assert run.ask("/", Origin=other)[0] == 403


def test_command_with_token_is_accepted(live):
    operator = Operator()
    run = live(orders=operator)
    own = f"http://127.0.0.1:{run.server.port}"
    assert run.order("pause", {"why": "rest"}, Origin=own) == (200, '{"accepted":true,"message":"done"}')
    assert operator.given == [("pause", {"why": "rest"})]
    assert run.server.url == f"{own}/#{run.server.token}"


@pytest.mark.parametrize(
    ("sent", "reason"),
    [
        ("smoke%20in%20the%20corridor", "smoke in the corridor"),
        ("sm%0Aok%1B%5B2Je%E2%80%AE", "smok[2Je"),
        ("x" * 999, "x" * 200),
        ("%FF%FE", "\ufffd\ufffd"),
        ("", ""),
    ],
)
def test_reason_header_becomes_short_clean_line(live, sent, reason):
    operator = Operator()
    assert live(orders=operator).order("pause", {}, **{"X-Operator": "Ada", "X-Reason": sent})[0] == 200
    (giver,) = operator.givers
    assert giver.author("page, 127.0.0.1") == ("Ada (page, 127.0.0.1)", reason)


@pytest.mark.parametrize(
    "said", ["", "Bearer ", "Bearer wrong", "Basic {token}", "{token}", "Bearer {token}x"]
)
def test_command_without_token_is_refused(live, said):
    operator = Operator()
    run = live(orders=operator)
    status, text = run.order("pause", {}, Authorization=said.format(token=run.server.token))
    assert (status, operator.given) == (403, [])
    assert "Open the complete address that the run has printed" in text


def test_each_run_has_its_own_token(live):
    assert live(orders=Operator()).server.token != live(orders=Operator()).server.token


@pytest.mark.parametrize(
    ("body", "kind", "status"),
    [
        ("{", "application/json", 400),
        ("[]", "application/json", 400),
        ("[" * 9_000, "application/json", 400),
        (json.dumps({"x": "y" * 10_000}), "application/json", 413),
        ("{}", "text/plain", 415),
    ],
)
def test_malformed_command_is_refused(live, body, kind, status):
    run = live(orders=Operator())
    said = {"Authorization": f"Bearer {run.server.token}", "Content_Type": kind}
    assert run.ask("/orders/pause", "POST", body, **said)[0] == status


def test_unknown_command_is_refused_with_reason(live):
    run = live(orders=Operator())
    assert run.order("dance", {}) == (400, '{"accepted":false,"message":"there is no order \'dance\'"}')


@pytest.mark.parametrize(
    ("is_sent", "status", "said"),
    [(False, 503, "The command was not sent"), (True, 504, "the command was sent, but has no response yet")],
)
def test_timeout_response_states_if_command_was_sent(live, monkeypatch, is_sent, status, said):
    monkeypatch.setattr(page_server, "_COMMAND_SEC", 0.01)
    order: Future[tuple[bool, str]] = Future()
    if is_sent:
        order.set_running_or_notify_cancel()

    class Slow(Operator):
        def send(self, *_):
            return order

    found, text = live(orders=Slow()).order("pause", {})
    assert (found, order.cancelled()) == (status, not is_sent)
    assert said in text


def test_page_without_commands_accepts_none(live):
    run = live()
    assert run.order("pause", {})[0] == 404
    assert "#" not in run.server.url


def test_late_browser_receives_past_state_and_later_changes(live):
    run = live().begin()
    run.journal.record_event("point_reached", point="north")
    run.status(1, "RUNNING", "3 m left")
    early = events(run, lambda found: page_state(found).get("states"))
    run.status(1, "RUNNING", "2 m left")
    late = events(run, lambda found: "2 m left" in page_state(found).get("states", {}).get("1", ()))
    assert [name for name, _ in early][:2] == ["hello", "changes"]
    assert early[0][1]["mode"] == "live"
    assert log_lines(late) == ["The run began.", "reached north"]
    assert page_state(late)["landmarks"]["point/north"]["state"] == "visited"


def test_browser_that_does_not_read_is_disconnected_and_can_return(live, monkeypatch):
    monkeypatch.setattr(feed_module, "_MAX_WAITING", 100_000)
    run = live().begin()
    with socket.create_connection(("127.0.0.1", run.server.port)) as mute:
        mute.sendall(b"GET /events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        with closing(mute.makefile("rb")) as read:
            # The listener is registered when the first event arrives, after the headers.
            assert any(line.startswith(b"event: hello") for line in read)
        news, numbers = News(), iter(range(400))

        def is_let_go():
            # One plan at a time, because only the last plan between two transmissions is sent.
            if not run.feed._queue and (number := next(numbers, None)) is not None:
                run.journal.record_observation("plan", frame="map", points=[[number, 0.0]] * 20_000)
                news.tell()
            return not run.feed._listeners

        with news:
            news.wait_until(is_let_go, lambda: "nobody was let go")
        run.journal.record_observation("plan", frame="map", points=[[399, 0.0]])
        told = events(run, lambda found: [399.0, 0.0] in page_state(found).get("plan", ()))
    assert log_lines(told) == ["The run began."]


def test_server_listens_only_on_localhost(live):
    assert listening_addresses(live().begin().server.port) == {"127.0.0.1"}


def test_number_of_connections_is_limited(live):
    run = live().begin()
    with ExitStack() as stack, selectors.DefaultSelector() as let_go:
        for _ in range(48):
            opened = socket.create_connection(("127.0.0.1", run.server.port), timeout=SILENCE_SEC)
            let_go.register(stack.enter_context(opened), selectors.EVENT_READ)
        for _ in range(16):
            (key, _), *_ = let_go.select(timeout=SILENCE_SEC)
            let_go.unregister(key.fileobj)
        assert let_go.select(timeout=0.0) == []


def test_slow_request_is_closed_and_listener_is_kept(live, monkeypatch):
    monkeypatch.setattr(page_server, "_REQUEST_SEC", 0.2)
    run = live().begin()
    listener = next(filter(None, (open_listener(run) for _ in range(100))))
    with ExitStack() as stack:
        slow = [
            stack.enter_context(socket.create_connection(("127.0.0.1", run.server.port), timeout=SILENCE_SEC))
            for _ in range(31)
        ]
        for each in slow[1:]:
            each.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Slow: ")
        dripping = slow[-1]
        dripping.settimeout(0.01)
        assert any(has_ended(dripping) for _ in range(int(SILENCE_SEC * 100)))
        assert all(has_ended(each) for each in slow[:-1])
    monkeypatch.setattr(page_server, "_REQUEST_SEC", SILENCE_SEC)
    assert run.ask("/")[0] == 200
    run.journal.record_event("point_reached", point="north")
    assert any(b"reached north" in line for line in itertools.islice(listener, 300))
    listener.close()


def open_listener(run):
    """Return an open event stream of a page, or None if the request was too slow."""
    with suppress(OSError):
        answer = urllib.request.urlopen(f"http://127.0.0.1:{run.server.port}/events", timeout=SILENCE_SEC)
        if answer.readline() == b"event: hello\n":
            return answer
    return None


def has_ended(connection):
    """Send one more byte; return whether the server has closed the connection."""
    try:
        connection.sendall(b"x")
        return connection.recv(1) == b""
    except TimeoutError:
        return False
    except ConnectionError:
        return True


def test_end_of_run_is_sent_before_server_closes(live):
    run = live().begin()
    answer = urllib.request.urlopen(f"http://127.0.0.1:{run.server.port}/events", timeout=SILENCE_SEC)
    assert answer.readline() == b"event: hello\n"
    run.journal.end_run(Ending.OVER, 0, "Complete.")
    run.close()
    rest = answer.read().decode()
    assert '"reason":"Complete."' in rest
    assert rest.endswith("event: bye\ndata: {}\n\n")


def test_non_finite_numbers_are_sent_as_null(live):
    run = live().begin()
    run.journal.record_observation("map", png="", x=float("nan"), y=float("inf"), yaw=[1.0, float("-inf")])
    told = events(run, lambda found: page_state(found).get("map"))
    assert page_state(told)["map"] == {"png": "", "x": None, "y": None, "yaw": [1.0, None]}


def circular_list():
    found: list[Any] = []
    found.append(found)
    return found


@pytest.mark.parametrize("value", [{1, 2}, {("a", "b"): 1}, circular_list(), object()])
def test_entry_that_is_not_json_does_not_break_page(live, value):
    run = live().begin()
    run.feed.add_entry(JournalEntry(9, 1, 0.0, 0.0, "odd", {"value": value}))
    run.journal.record_event("docked")
    began, odd, docked = log_lines(events(run, lambda found: "docked" in log_lines(found)))
    assert (began, docked) == ("The run began.", "docked")
    assert odd.startswith("unreadable: kind: odd, reason: ")


@pytest.mark.parametrize("query", ["", "?time=", "?time=x", "?time=nan", "?time=1&since=x", "?since=1"])
def test_invalid_replay_request_is_rejected(query):
    with closing(PageServer(ReplayFeed(Replay([]), {}), 0)) as server:
        server.start()
        with pytest.raises(urllib.error.HTTPError, match="400"):
            urllib.request.urlopen(f"http://127.0.0.1:{server.port}/moment{query}", timeout=SILENCE_SEC)


def test_live_run_has_no_replay_requests(live):
    assert live().ask("/moment?time=1")[0] == 404


def test_used_port_is_named_in_error():
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        with pytest.raises(
            PageError,
            match=rf"port {port} cannot be used for the page \(Address already in use\)\. .*--web-port",
        ):
            PageServer(ReplayFeed(Replay([]), {}), port)


def test_other_port_is_chosen_if_default_is_used():
    with (
        closing(PageServer(ReplayFeed(Replay([]), {}))) as first,
        closing(PageServer(ReplayFeed(Replay([]), {}))) as second,
    ):
        assert first.port != second.port
        assert second.port != PORT


def test_commands_are_sent_once_they_are_known(live):
    run = live().begin()
    verb = {"name": "pause", "label": "Pause"}
    run.feed.offer([verb])

    def is_told(found):
        return bool(found) and (found[-1][0] == "verbs" or found[0][1]["verbs"] == [[verb]])

    told = events(run, is_told)
    assert told[-1][1] == [[verb]] or told[0][1]["verbs"] == [[verb]]
    ((name, late),) = events(run, lambda found: len(found) == 1)
    assert (name, late["verbs"]) == ("hello", [[verb]])


@pytest.mark.parametrize("seen", ["", "zone_a", "[]", '{"object": 1}'])
def test_command_without_displayed_state_is_refused(live, seen):
    operator = Operator()
    status, text = live(orders=operator).order("pause", {}, **{"X-Seen": seen})
    assert status == 400
    assert "the header X-Seen is wrong: expected a JSON object" in text
    assert operator.given == []
