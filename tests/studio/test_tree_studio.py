"""Tests of the responses to the page's requests, and of the edited file."""

import http.client
import json
import shutil
import subprocess
import sys
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from sar_compiler.studio.edited_document import EditedDocument, create_document
from sar_compiler.studio.tree_studio import Studio
from sar_compiler.testing import assert_scenario_holds
from sar_compiler.web.edit_page import edit_app
from sar_compiler.web.page_server import AppServer
from sar_compiler.writing import WriteError
from tests.trees import document

SHIPPED = Path("trees/search_and_rescue.xml")
TEXT = SHIPPED.read_text(encoding="utf-8")


def ask(question, text=TEXT, **values) -> Any:
    return Studio(SHIPPED).answer_question(question, {"text": text, **values})


def names_in(drawing):
    """Return the names in a drawing, in the order of its nodes. A title has location, tag, name and attributes."""
    titles = [part.partition("</title>")[0] for part in drawing.split('<g class="node ')[1:]]
    return [title.partition("&gt; ")[2].split(" ")[0] for title in titles]


def test_typo_and_fix_are_located_in_utf_16_units():
    wide = TEXT.replace("Search and rescue:", "\U0001f600:", 1).replace("<AdvanceZone", "<AdvnceZone")
    [finding] = ask("look", wide)["findings"]
    units = wide.encode("utf-16-le")
    assert units[2 * finding["from"] : 2 * finding["to"]].decode("utf-16-le") == "<AdvnceZone"
    assert finding["fix"] == {"from": finding["from"] + 1, "to": finding["to"], "insert": "AdvanceZone"}


def test_malformed_text_has_findings_and_no_drawing():
    looked = ask("look", TEXT[:500])
    assert (looked.keys(), looked["findings"][0]["code"]) == ({"findings"}, "malformed-xml")


def test_file_without_tree_has_finding_and_no_drawing():
    looked = ask("look", '<root BTCPP_format="4"><TreeNodesModel/></root>')
    assert ("svg" in looked, [each["code"] for each in looked["findings"]]) == (False, ["no-tree"])


def test_each_drawn_node_has_number_of_its_element():
    looked = ask("look")
    named = [looked["elements"][number]["attributes"] for number in looked["nodes"]]
    names = names_in(looked["svg"])
    assert [each["name"] for each in named if "name" in each] == [
        name for name, each in zip(names, named, strict=True) if "name" in each
    ]


def test_each_event_of_run_points_to_its_leaf_in_drawing():
    names = names_in(ask("look")["svg"])
    runs = [each["run"] for each in ask("verify")["verdicts"] if each["run"]]
    events = [event for run in (*runs, ask("play")) for tick in run["ticks"] for event in tick["events"]]
    assert {event["leaf"] for event in events} >= {"NavigateToZone", "NavigateToBase"}
    assert [event for event in events if names[event["way"][-1]] != event["leaf"]] == []
    assert {"success", "failure", "running", "halted"} == {event["status"] for event in events}


def test_endless_run_names_its_repeated_ticks():
    [endless] = [each for each in ask("verify")["verdicts"] if each["question"] == "every run ends"]
    assert (endless["verdict"], endless["loop"], len(endless["run"]["ticks"])) == ("does not hold", 2, 3)


def test_rules_run_without_schema_in_browser_without_lxml(monkeypatch):
    monkeypatch.setitem(sys.modules, "sar_compiler.checks.schema_validation", None)
    monkeypatch.setattr(sys, "platform", "emscripten")
    assert ask("look")["findings"] == []


def test_missing_schema_validation_raises_outside_browser(monkeypatch):
    monkeypatch.setitem(sys.modules, "sar_compiler.checks.schema_validation", None)
    with pytest.raises(ImportError):
        ask("look", TEXT.replace("<root ", '<root _note="a&#10;b" '))


def test_folded_element_is_drawn_without_children_and_numbers_stay():
    whole = ask("look")
    patrol = next(each for each in whole["elements"] if each["attributes"].get("name") == "Patrol")
    looked = ask("look", folded=[patrol["from"]])
    assert names_in(looked["svg"]) == [
        "MissionOrReturnToBase",
        "Patrol",
        "NavigateToBaseOneShot",
        "NavigateToBase",
    ]
    assert [whole["nodes"][place] for place in looked["places"]] == looked["nodes"]


def test_folded_element_with_condition_is_drawn():
    text = document('<Sequence _skipIf="false"><AlwaysSuccess/></Sequence>')
    folded = ask("look", text)["elements"][2]["from"]
    assert names_in(ask("look", text, folded=[folded])["svg"])[-1] == "Sequence"


def test_key_is_listed_with_its_writers_and_readers():
    text = document('<Script code="a := 1"/><Fallback _skipIf="a == 2"><AlwaysSuccess/></Fallback>')
    looked = ask("look", text)
    users = [(looked["elements"][number]["tag"], kind) for number, kind in looked["keys"]["a"]]
    assert users == [("Script", "write"), ("Fallback", "read")]


def test_drawing_is_exported_with_its_style():
    exported = ask("export")
    assert exported["name"] == "SearchAndRescue.svg"
    assert "<style>" in exported["text"]


def test_facts_and_keys_are_reported_after_each_tick_with_changes():
    [first, *_, last] = ask("play", ticks=3)["ticks"]
    assert (first["values"]["zones_left"], last["values"]["zones_left"]) == ("2", "0")
    assert "zones_left" in first["changed"]


def test_played_run_is_saved_as_passing_scenario(tmp_path):
    path = Path(shutil.copy(SHIPPED, tmp_path))
    studio = Studio(path)
    studio.answer_question(
        "play", {"text": TEXT, "ticks": 4, "leaves": {"NavigateToZone": ["driving", "aborted"]}}
    )
    saved: Any = studio.answer_question("record", {"name": "../aborted.yaml"})
    assert saved["name"] == "aborted.yaml"
    assert "NavigateToZone aborted" in saved["text"]
    assert_scenario_holds(path, tmp_path / "aborted.yaml")
    assert "already exists" in str(studio.answer_question("record", {"name": "aborted.yaml"}))
    assert "does not end with .yaml" in str(studio.answer_question("record", {"name": "other.xml"}))


def test_proof_reports_number_of_states_and_can_be_stopped():
    seen: list[int] = []
    text = document(f"<Sequence>{'<NavigateToZone/><DetectSurvivor/>' * 40}</Sequence>")

    def stop(states):
        seen.append(states)
        studio.answer_question("stop", {})

    studio = Studio(SHIPPED, on_progress=stop)
    proof: Any = studio.answer_question("verify", {"text": text})
    assert (proof["stopped"], proof["complete"]) == ("stopped", False)
    assert studio.answer_question("progress", {}) == {"states": seen[-1]}
    assert {each["verdict"] for each in proof["verdicts"]} == {"not decided"}


def test_prediction_names_probability_of_success():
    assert "success:" in ask("predict")["text"]


def test_prediction_without_numpy_names_the_command(monkeypatch):
    monkeypatch.setitem(sys.modules, "sar_compiler.analysis.prediction_view", None)
    assert "run sar-compile predict" in ask("predict")["error"]


@pytest.fixture
def project(tmp_path):
    """Return the studio of a file that includes another file, and the text of the file."""
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts/leave.xml").write_text(document("<AlwaysSuccess/>", main="Leave"))
    main = tmp_path / "main.xml"
    text = document('<SubTree ID="Leave"/>').replace(
        "<BehaviorTree", '<include path="parts/leave.xml"/><BehaviorTree', 1
    )
    main.write_text(text)
    return Studio(main), text


def test_only_listed_project_files_can_be_opened(project):
    studio, text = project
    looked: Any = studio.answer_question("look", {"text": text})
    assert looked["files"] == ["main.xml", "parts/leave.xml"]
    opened: Any = studio.answer_question("open", {"file": "parts/leave.xml"})
    assert (opened["name"], "Leave" in opened["text"]) == ("leave.xml", True)
    assert studio.answer_question("open", {"file": "../secret.xml"}) == {
        "error": "the project has no file '../secret.xml'"
    }


def test_changed_included_file_is_read_again(project, tmp_path):
    studio, text = project
    version = studio.document.load()["version"]
    assert studio.answer_question("look", {"text": text})["findings"] == []
    assert studio.answer_question("compare", {"version": version}) == {
        "has_changed": False,
        "others_have_changed": False,
    }
    part = tmp_path / "parts/leave.xml"
    part.write_text(part.read_text().replace("AlwaysSuccess", "AlwaysSucess"))
    assert studio.answer_question("compare", {"version": version})["others_have_changed"]
    assert [each["file"] for each in studio.answer_question("look", {"text": text})["findings"]] == [
        str(part)
    ]


def test_leaf_returns_chosen_outcomes():
    [first, *_] = ask("play", leaves={"NavigateToZone": ["aborted"]}, ticks=1)["ticks"]
    assert ("NavigateToZone", "aborted") in {(each["leaf"], each["does"]) for each in first["events"]}


def test_tree_is_renamed_everywhere_in_file():
    edits = ask("rename", element=1, name="Other")["edits"]
    assert [each["insert"] for each in edits] == ["Other"] * TEXT.count('"SearchAndRescue"')


def test_tree_is_renamed_after_wide_characters_and_similar_text():
    text = document('<SubTree name="\U0001f600 ID of I" ID="I"/>').replace(
        "</root>", '<BehaviorTree ID="I"><AlwaysSuccess/></BehaviorTree></root>'
    )
    first, second = ask("rename", text, element=2, name="J")["edits"]
    units = text.encode("utf-16-le")
    assert [units[2 * each["from"] - 4 : 2 * each["to"]].decode("utf-16-le") for each in (first, second)] == [
        '="I'
    ] * 2


def test_renaming_tree_to_its_own_name_makes_no_edit():
    assert ask("rename", element=1, name="SearchAndRescue") == {"edits": []}


@pytest.mark.parametrize(
    ("question", "values", "error"),
    [
        ("burn", {}, "unknown request 'burn'"),
        ("edit", {"operation": "delete", "arguments": {"element": 0}}, "contains the whole file"),
        ("verify", {"text": "<root"}, "not well-formed"),
        ("rename", {"element": 0, "name": "A"}, "does not name a tree"),
    ],
)
def test_invalid_request_returns_an_error(question, values, error):
    assert error in ask(question, **{"text": TEXT, **values})["error"]


@pytest.mark.parametrize("name", ["new.xml", "new.yaml"])
def test_new_file_has_an_empty_tree(tmp_path, name):
    path = tmp_path / name
    create_document(path)
    text = path.read_text()
    studio = Studio(path)
    looked: Any = studio.answer_question("look", {"text": text})
    assert [each["code"] for each in looked["findings"]] == ["missing-child"]
    assert [looked["elements"][number]["tag"] for number in looked["nodes"]] == ["BehaviorTree"]
    with pytest.raises(WriteError, match="already exists"):
        create_document(path)
    with pytest.raises(WriteError, match="does not end with"):
        create_document(tmp_path / "new.txt")


def test_file_with_main_tree_of_another_file_shows_its_first_tree(tmp_path):
    (tmp_path / "main.xml").write_text(document("<AlwaysSuccess/>", main="Main"))
    path = tmp_path / "part.xml"
    text = '<root BTCPP_format="4" main_tree_to_execute="Main"><BehaviorTree ID="Part"><AlwaysSuccess/></BehaviorTree></root>'
    path.write_text(text)
    looked: Any = Studio(path).answer_question("look", {"text": text})
    assert (looked["tree"], looked["nodes"]) == ("Part", [2])


@pytest.fixture
def edited(tmp_path):
    return EditedDocument(Path(shutil.copy(SHIPPED, tmp_path)))


@pytest.mark.parametrize(
    "data", [TEXT.replace("\n", "\r\n").encode("utf-8-sig"), TEXT.replace("\n", "\r\n", 3).encode()]
)
def test_saving_unchanged_file_keeps_its_bytes(edited, data):
    edited.path.write_bytes(data)
    opened = edited.load()
    edited.save_text(opened["text"], opened["version"])
    assert edited.path.read_bytes() == data


def test_file_changed_meanwhile_is_overwritten_only_on_request(edited):
    opened = edited.load()
    edited.path.write_bytes(b"<root/>")
    assert edited.is_changed(opened["version"])
    assert edited.save_text(TEXT, opened["version"]) == {"has_changed": True}
    assert edited.path.read_bytes() == b"<root/>"
    edited.save_text(TEXT, opened["version"], overwrite=True)
    assert edited.path.read_text() == TEXT


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({}, 200),
        ({"Authorization": "Bearer guessed"}, 403),
        ({"Host": "example.org"}, 403),
        ({"Origin": "http://example.org"}, 403),
    ],
)
def test_only_page_with_token_reads_the_file(edited, headers, status):
    with closing(AppServer(partial(edit_app, Studio(edited.path)), 0)) as server:
        server.start()
        connection = http.client.HTTPConnection("127.0.0.1", server.port)
        known = {"Authorization": f"Bearer {server.token}", "Content-Type": "application/json"}
        connection.request("POST", "/ask/open", "{}", {**known, **headers})
        answer = connection.getresponse()
        assert answer.status == status
        assert status != 200 or json.loads(answer.read())["text"] == TEXT
        assert "script-src 'self'" in answer.headers["Content-Security-Policy"]


_PLACES = """
import { dropPlace, dropSide, keyPlace, resultOf } from "./sar_compiler/studio/static/places.js";
const elements = [
  { tag: "root", parent: null, index: 0, children: [1] },
  { tag: "BehaviorTree", parent: 0, index: 0, children: [2] },
  { tag: "Sequence", parent: 1, index: 0, children: [3, 4] },
  { tag: "A", parent: 2, index: 0, children: [] },
  { tag: "B", parent: 2, index: 1, children: [] },
];
console.log(JSON.stringify([
  [0.1, 0.5, 0.9].map((each) => dropSide(each, true)), [0.4, 0.6].map((each) => dropSide(each, false)),
  dropPlace(elements, 2, "in"), dropPlace(elements, 3, "after"), dropPlace(elements, 0, "before"), dropPlace(elements, 1, "after"),
  ["ArrowUp", "ArrowDown", "ArrowLeft", "ArrowRight"].map((key) => keyPlace(elements, 4, key)), keyPlace(elements, 2, "ArrowLeft"),
  [
    ["insert", { parent: 2, index: 1 }], ["insert", { parent: 2, index: 2 }], ["move", { element: 4, parent: 2, index: 0 }],
    ["move", { element: 3, parent: 2, index: 2 }], ["duplicate", { element: 2 }], ["wrap", { element: 4 }],
    ["delete", { element: 3 }], ["delete", { element: 4 }], ["delete", { element: 2 }],
  ].map(([operation, values]) => resultOf(elements, operation, values)),
]));
"""


def test_places_of_dropped_key_moved_and_resulting_nodes():
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
        None,
        [{"parent": 2, "index": 0}, None, None, {"parent": 3, "index": 0}],
        None,
        [4, 5, 3, 4, 5, 4, 3, 3, 1],
    ]
