"""Who may look at a page, who may give orders, and what a late browser is told."""

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
    """Heeds orders, but for those that it was told to refuse."""

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
    """Read the events of a page until there are enough; return them as pairs of a name and values."""
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


def known(found):
    """Return what a page knows after events."""
    state: dict[str, Any] = {}
    for name, changes in found:
        for change in changes if name == "changes" else ():
            state = folded(state, change)
    return state


def lines(found):
    """Return what the log says after events."""
    return [line[-1] for line in known(found).get("log", ())]


def test_a_tool_that_changes_something_needs_the_token_and_what_only_looks_does_not(live):
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


def test_the_report_of_a_robot_is_a_page_of_its_own_whose_style_is_its_own(live):
    run = live(tools={"report": PageQuery(lambda values: f"<p>{values['robot']}</p>")})
    status, text, headers = run.ask("/report?robot=1")
    assert (status, text) == (200, "<p>1</p>")
    assert "style-src 'unsafe-inline'" in headers["Content-Security-Policy"]
    assert "script-src" not in headers["Content-Security-Policy"]
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert run.ask("/report")[1] == "<p>0</p>"
    assert run.ask("/report?robot=x")[0] == 400


def test_that_there_is_no_report_is_said(live):
    def fail(_):
        message = "the run goes on"
        raise SarError(message)

    assert live().ask("/report")[0] == 404
    assert live(tools={"report": PageQuery(fail)}).ask("/report")[:2] == (
        409,
        "There is no report: the run goes on.\n",
    )


def test_the_page_is_served_with_a_policy_that_lets_nothing_else_in(live):
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
    # No browser shows the page of another mission, or of an older version, from its store.
    assert headers["Cache-Control"] == "no-store"


@pytest.mark.parametrize("page", ["/", "/tree"])
def test_the_pages_name_nothing_outside_themselves(live, page):
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
def test_nothing_else_can_be_reached(live, path):
    status, text, headers = live().ask(path)
    assert (status, text) == (404, "page not found\n")
    assert "Content-Security-Policy" in headers


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE"])
def test_nothing_can_be_written(live, method):
    assert live().ask("/", method)[0] == 405


@pytest.mark.parametrize(
    "host", ["example.org", "example.org:8043", "127.0.0.1.example.org", "", "[::1].x", "localhost:x"]
)
@pytest.mark.parametrize("path", ["/", "/events"])
def test_a_name_that_is_not_this_machine_s_is_refused(live, host, path):
    assert live().ask(path, Host=host)[0] == 403


@pytest.mark.parametrize("host", ["localhost", "127.0.0.1:9000", "[::1]:8043"])
def test_this_machine_has_several_names_and_tunnels_other_ports(live, host):
    assert live().ask("/", Host=host)[0] == 200


@pytest.mark.parametrize("origin", ["http://example.org", "http://127.0.0.1:1", "https://127.0.0.1", "null"])
def test_another_page_of_the_browser_is_refused(live, origin):
    run = live(orders=Operator())
    assert run.ask("/events", Origin=origin)[0] == 403
    assert run.order("pause", {}, Origin=origin)[0] == 403


@pytest.mark.parametrize("name", ["localhost", "127.0.0.1", "[::1]"])
def test_the_page_is_its_own_by_each_name_of_this_machine(live, name):
    run = live(orders=Operator())
    assert run.ask("/", Origin=f"http://{name}:{run.server.port}")[0] == 200
    assert run.order("pause", {"why": "rest"}, Origin=f"http://{name}:{run.server.port}")[0] == 200
    for other in (
        f"http://{name}:{run.server.port + 1}",
        f"https://{name}:{run.server.port}",
        f"http://{name}",
    ):
        assert run.ask("/", Origin=other)[0] == 403


def test_who_has_the_address_gives_orders(live):
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
def test_an_order_has_the_reason_of_its_header_as_a_short_line(live, sent, reason):
    operator = Operator()
    assert live(orders=operator).order("pause", {}, **{"X-Operator": "Ada", "X-Reason": sent})[0] == 200
    (giver,) = operator.givers
    assert giver.author("page, 127.0.0.1") == ("Ada (page, 127.0.0.1)", reason)


@pytest.mark.parametrize(
    "said", ["", "Bearer ", "Bearer wrong", "Basic {token}", "{token}", "Bearer {token}x"]
)
def test_without_the_token_nobody_gives_orders(live, said):
    operator = Operator()
    run = live(orders=operator)
    status, text = run.order("pause", {}, Authorization=said.format(token=run.server.token))
    assert (status, operator.given) == (403, [])
    assert "Open the complete address that the run has printed" in text


def test_each_run_has_a_token_of_its_own(live):
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
def test_what_is_no_order_is_refused(live, body, kind, status):
    run = live(orders=Operator())
    said = {"Authorization": f"Bearer {run.server.token}", "Content_Type": kind}
    assert run.ask("/orders/pause", "POST", body, **said)[0] == status


def test_what_is_wrong_with_an_order_is_said(live):
    run = live(orders=Operator())
    assert run.order("dance", {}) == (400, '{"accepted":false,"message":"there is no order \'dance\'"}')


@pytest.mark.parametrize(
    ("is_sent", "status", "said"),
    [(False, 503, "The command was not sent"), (True, 504, "the command was sent, but has no response yet")],
)
def test_of_an_order_without_an_answer_it_is_said_whether_it_was_given(
    live, monkeypatch, is_sent, status, said
):
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


def test_a_page_without_orders_takes_none(live):
    run = live()
    assert run.order("pause", {})[0] == 404
    assert "#" not in run.server.url


def test_a_late_browser_is_told_what_has_happened_and_then_the_news(live):
    run = live().begin()
    run.journal.record_event("point_reached", point="north")
    run.status(1, "RUNNING", "3 m left")
    early = events(run, lambda found: known(found).get("states"))
    run.status(1, "RUNNING", "2 m left")
    late = events(run, lambda found: "2 m left" in known(found).get("states", {}).get("1", ()))
    assert [name for name, _ in early][:2] == ["hello", "changes"]
    assert early[0][1]["mode"] == "live"
    assert lines(late) == ["The run began.", "reached north"]
    assert known(late)["landmarks"]["point/north"]["state"] == "visited"


def test_a_browser_that_does_not_read_is_let_go_and_comes_again(live, monkeypatch):
    monkeypatch.setattr(feed_module, "_MAX_WAITING", 100_000)
    run = live().begin()
    with socket.create_connection(("127.0.0.1", run.server.port)) as mute:
        mute.sendall(b"GET /events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        with closing(mute.makefile("rb")) as read:
            # By its first event it is listened to; its headers come before.
            assert any(line.startswith(b"event: hello") for line in read)
        news, numbers = News(), iter(range(400))

        def is_let_go():
            # One plan after the other: of those that come between two tellings only the last is told.
            if not run.feed._queue and (number := next(numbers, None)) is not None:
                run.journal.record_observation("plan", frame="map", points=[[number, 0.0]] * 20_000)
                news.tell()
            return not run.feed._listeners

        with news:
            news.wait_until(is_let_go, lambda: "nobody was let go")
        run.journal.record_observation("plan", frame="map", points=[[399, 0.0]])
        told = events(run, lambda found: [399.0, 0.0] in known(found).get("plan", ()))
    assert lines(told) == ["The run began."]


def test_the_page_listens_on_this_machine_alone(live):
    assert listening_addresses(live().begin().server.port) == {"127.0.0.1"}


def test_connections_take_few_of_the_file_descriptors_of_the_mission(live):
    run = live().begin()
    with ExitStack() as stack, selectors.DefaultSelector() as let_go:
        for _ in range(48):
            opened = socket.create_connection(("127.0.0.1", run.server.port), timeout=SILENCE_SEC)
            let_go.register(stack.enter_context(opened), selectors.EVENT_READ)
        for _ in range(16):
            (key, _), *_ = let_go.select(timeout=SILENCE_SEC)
            let_go.unregister(key.fileobj)
        assert let_go.select(timeout=0.0) == []


def test_who_does_not_come_to_the_end_of_a_request_is_let_go_and_who_listens_is_not(live, monkeypatch):
    monkeypatch.setattr(page_server, "_REQUEST_SEC", 0.2)
    run = live().begin()
    listener = next(filter(None, (listening(run) for _ in range(100))))
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


def listening(run):
    """Return what listens to a page; None if this process was too slow to ask."""
    with suppress(OSError):
        answer = urllib.request.urlopen(f"http://127.0.0.1:{run.server.port}/events", timeout=SILENCE_SEC)
        if answer.readline() == b"event: hello\n":
            return answer
    return None


def has_ended(connection):
    """Send a byte more, and return whether the other side has ended the connection."""
    try:
        connection.sendall(b"x")
        return connection.recv(1) == b""
    except TimeoutError:
        return False
    except ConnectionError:
        return True


def test_the_end_of_a_run_is_told_before_the_server_goes(live):
    run = live().begin()
    answer = urllib.request.urlopen(f"http://127.0.0.1:{run.server.port}/events", timeout=SILENCE_SEC)
    assert answer.readline() == b"event: hello\n"
    run.journal.end_run(Ending.OVER, 0, "Complete.")
    run.close()
    rest = answer.read().decode()
    assert '"reason":"Complete."' in rest
    assert rest.endswith("event: bye\ndata: {}\n\n")


def test_numbers_that_are_none_are_told_as_null(live):
    run = live().begin()
    run.journal.record_observation("map", png="", x=float("nan"), y=float("inf"), yaw=[1.0, float("-inf")])
    told = events(run, lambda found: known(found).get("map"))
    assert known(told)["map"] == {"png": "", "x": None, "y": None, "yaw": [1.0, None]}


def circle():
    found: list[Any] = []
    found.append(found)
    return found


@pytest.mark.parametrize("value", [{1, 2}, {("a", "b"): 1}, circle(), object()])
def test_an_entry_that_is_no_json_is_not_the_end_of_the_page(live, value):
    run = live().begin()
    run.feed.add_entry(JournalEntry(9, 1, 0.0, 0.0, "odd", {"value": value}))
    run.journal.record_event("docked")
    began, odd, docked = lines(events(run, lambda found: "docked" in lines(found)))
    assert (began, docked) == ("The run began.", "docked")
    assert odd.startswith("unreadable: kind: odd, reason: ")


@pytest.mark.parametrize("query", ["", "?time=", "?time=x", "?time=nan", "?time=1&since=x", "?since=1"])
def test_a_moment_has_a_time(query):
    with closing(PageServer(ReplayFeed(Replay([]), {}), 0)) as server:
        server.start()
        with pytest.raises(urllib.error.HTTPError, match="400"):
            urllib.request.urlopen(f"http://127.0.0.1:{server.port}/moment{query}", timeout=SILENCE_SEC)


def test_a_live_run_has_no_other_moment_than_now(live):
    assert live().ask("/moment?time=1")[0] == 404


def test_a_port_that_is_taken_is_named():
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        with pytest.raises(
            PageError,
            match=rf"port {port} cannot be used for the page \(Address already in use\)\. .*--web-port",
        ):
            PageServer(ReplayFeed(Replay([]), {}), port)


def test_beside_the_usual_port_another_one_is_taken():
    with (
        closing(PageServer(ReplayFeed(Replay([]), {}))) as first,
        closing(PageServer(ReplayFeed(Replay([]), {}))) as second,
    ):
        assert first.port != second.port
        assert second.port != PORT


def test_what_can_be_ordered_of_a_robot_is_told_once_it_is_known(live):
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
def test_an_order_that_does_not_state_what_its_sender_saw_is_refused(live, seen):
    operator = Operator()
    status, text = live(orders=operator).order("pause", {}, **{"X-Seen": seen})
    assert status == 400
    assert "the header X-Seen is wrong: expected a JSON object" in text
    assert operator.given == []
