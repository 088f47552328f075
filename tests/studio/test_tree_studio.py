"""The answers to the page's questions, and the file behind the page."""

import http.client
import json
import shutil
import subprocess
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from sar_compiler.studio.tree_studio import Studio
from sar_compiler.web.edit_page import EditedDocument, edit_app
from sar_compiler.web.page_server import AppServer

SHIPPED = Path("trees/search_and_rescue.xml")
TEXT = SHIPPED.read_text(encoding="utf-8")


def ask(question, text=TEXT, **values) -> Any:
    return Studio(SHIPPED).answer(question, {"text": text, **values})


def names_in(drawing):
    """The names in a drawing, in the order of its nodes; a title is the location, the tag, the name and the attributes."""
    titles = [part.partition("</title>")[0] for part in drawing.split('<g class="node ')[1:]]
    return [title.partition("&gt; ")[2].split(" ")[0] for title in titles]


def test_a_typo_is_found_where_it_is_with_its_fix_in_the_units_of_the_browser():
    wide = TEXT.replace("Search and rescue:", "\U0001f600:", 1).replace("<AdvanceZone", "<AdvnceZone")
    [finding] = ask("look", wide)["findings"]
    units = wide.encode("utf-16-le")
    assert units[2 * finding["from"] : 2 * finding["to"]].decode("utf-16-le") == "<AdvnceZone"
    assert finding["fix"] == {"from": finding["from"] + 1, "to": finding["to"], "insert": "AdvanceZone"}


def test_of_a_text_that_cannot_be_parsed_there_are_findings_and_no_drawing():
    looked = ask("look", TEXT[:500])
    assert (looked.keys(), looked["findings"][0]["code"]) == ({"findings"}, "malformed-xml")


def test_each_node_of_the_drawing_has_the_number_of_its_element():
    looked = ask("look")
    named = [looked["elements"][number]["attributes"] for number in looked["nodes"]]
    names = names_in(looked["svg"])
    assert [each["name"] for each in named if "name" in each] == [
        name for name, each in zip(names, named, strict=True) if "name" in each
    ]


def test_each_event_of_a_run_leads_to_its_leaf_in_the_drawing_whatever_is_put_around_it():
    names = names_in(ask("look")["svg"])
    runs = [each["ticks"] for each in ask("verify")["verdicts"] if each["ticks"]]
    events = [event for ticks in (*runs, ask("play")["ticks"]) for tick in ticks for event in tick["events"]]
    assert {event["leaf"] for event in events} >= {"NavigateToZone", "NavigateToBase"}
    assert [event for event in events if names[event["way"][-1]] != event["leaf"]] == []
    assert {"success", "failure", "running", "halted"} == {event["status"] for event in events}


def test_a_leaf_has_the_outcomes_that_are_chosen_for_it():
    [first, *_] = ask("play", leaves={"NavigateToZone": ["aborted"]}, ticks=1)["ticks"]
    assert ("NavigateToZone", "aborted") in {(each["leaf"], each["does"]) for each in first["events"]}


def test_a_tree_is_renamed_wherever_the_file_names_it():
    edits = ask("rename", offset=TEXT.index('"SearchAndRescue"') + 1, name="Other")["edits"]
    assert [each["insert"] for each in edits] == ["Other"] * TEXT.count('"SearchAndRescue"')


@pytest.mark.parametrize(
    ("question", "values", "error"),
    [
        ("burn", {}, "there is no question 'burn'"),
        ("edit", {"operation": "delete", "arguments": {"element": 0}}, "contains the whole file"),
        ("verify", {"text": "<root"}, "not well-formed"),
        ("rename", {"offset": 3, "name": "A"}, "there is no name"),
    ],
)
def test_a_question_without_an_answer_says_why(question, values, error):
    assert error in ask(question, **{"text": TEXT, **values})["error"]


@pytest.fixture
def document(tmp_path):
    return EditedDocument(Path(shutil.copy(SHIPPED, tmp_path)))


@pytest.mark.parametrize(
    "data", [TEXT.replace("\n", "\r\n").encode("utf-8-sig"), TEXT.replace("\n", "\r\n", 3).encode()]
)
def test_a_file_that_is_saved_unchanged_has_the_same_bytes(document, data):
    document.path.write_bytes(data)
    opened = document.load()
    document.save_text(opened["text"], opened["version"])
    assert document.path.read_bytes() == data


def test_a_file_that_has_changed_meanwhile_is_overwritten_only_if_that_is_wanted(document):
    opened = document.load()
    document.path.write_bytes(b"<root/>")
    assert document.is_changed(opened["version"])["has_changed"]
    assert document.save_text(TEXT, opened["version"]) == {"has_changed": True}
    assert document.path.read_bytes() == b"<root/>"
    document.save_text(TEXT, opened["version"], overwrite=True)
    assert document.path.read_text() == TEXT


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({}, 200),
        ({"Authorization": "Bearer guessed"}, 403),
        ({"Host": "example.org"}, 403),
        ({"Origin": "http://example.org"}, 403),
    ],
)
def test_only_the_page_with_its_token_reads_the_file(document, headers, status):
    with closing(AppServer(partial(edit_app, document, Studio(document.path)), 0)) as server:
        server.start()
        connection = http.client.HTTPConnection("127.0.0.1", server.port)
        known = {"Authorization": f"Bearer {server.token}", "Content-Type": "application/json"}
        connection.request("POST", "/ask/open", "{}", {**known, **headers})
        answer = connection.getresponse()
        assert answer.status == status
        assert status != 200 or json.loads(answer.read())["text"] == TEXT
        assert "script-src 'self'" in answer.headers["Content-Security-Policy"]


_PLACES = """
import { dropPlace, dropSide, keyPlace } from "./sar_compiler/studio/static/places.js";
const elements = [
  { tag: "root", parent: null, index: 0, children: [1] },
  { tag: "BehaviorTree", parent: 0, index: 0, children: [2] },
  { tag: "Sequence", parent: 1, index: 0, children: [3, 4] },
  { tag: "A", parent: 2, index: 0, children: [] },
  { tag: "B", parent: 2, index: 1, children: [] },
];
console.log(JSON.stringify([
  [0.1, 0.5, 0.9].map((each) => dropSide(each, true)), [0.4, 0.6].map((each) => dropSide(each, false)),
  dropPlace(elements, 2, "in"), dropPlace(elements, 3, "after"), dropPlace(elements, 0, "before"),
  ["ArrowUp", "ArrowDown", "ArrowLeft", "ArrowRight"].map((key) => keyPlace(elements, 4, key)), keyPlace(elements, 2, "ArrowLeft"),
]));
"""


def test_a_dropped_node_and_one_that_is_moved_by_a_key_have_their_place():
    node = shutil.which("node")
    if node is None:
        pytest.skip("there is no node here (apt install nodejs)")
    command = (node, "--input-type=module", "-e", _PLACES)
    told = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert json.loads(told) == [
        ["before", "in", "after"],
        ["before", "after"],
        {"parent": 2, "index": 2},
        {"parent": 2, "index": 1},
        None,
        [{"parent": 2, "index": 0}, None, None, {"parent": 3, "index": 0}],
        None,
    ]
