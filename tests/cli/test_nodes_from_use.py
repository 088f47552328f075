"""`nodes --from-use` makes a palette of what trees use and nobody describes."""

from pathlib import Path

import pytest

from sar_compiler.tree.xml import parse_xml
from tests.cli import running
from tests.trees import document

ARM = """
<Sequence>
  <FindObject name="find" confidence="0.5" pose="{pose}" _skipIf="false"/>
  <Grasp at="{pose}" strength="3" gentle="true"/>
  <Grasp at="{pose}" strength="0.5" gentle="false" tool="claw"/>
  <Retrying times="3"><AlwaysSuccess/></Retrying>
  <Condition ID="IsHeld" object="{pose}"/>
  <Either><AlwaysSuccess/><AlwaysFailure/></Either>
</Sequence>
"""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write("ws/arm.xml", document(ARM))


def write(name, text):
    Path(name).parent.mkdir(parents=True, exist_ok=True)
    Path(name).write_text(text, encoding="utf-8")


def run(capsys, *arguments):
    return running.run(capsys, *arguments)


def models(capsys, *options):
    """Return the palette of the folder: of each ID the kind, and of each port its direction and type."""
    _, out, _ = run(capsys, "nodes", "--from-use", "ws", *options)
    (described,) = parse_xml(out, "palette.xml").root.children
    return {
        node.attributes["ID"]: (
            node.tag,
            {
                port.attributes["name"]: (port.tag, port.attributes.get("type"))
                for port in node.children
                if "name" in port.attributes
            },
        )
        for node in described.children
    }


def test_the_kind_of_a_node_is_that_of_its_explicit_form_or_of_its_children(capsys):
    kinds = {tag: kind for tag, (kind, _) in models(capsys).items()}
    assert kinds == {
        "Either": "Control",
        "FindObject": "Action",
        "Grasp": "Action",
        "IsHeld": "Condition",
        "Retrying": "Decorator",
    }


def test_the_types_of_ports_are_those_of_all_values_that_are_written(capsys):
    _, ports = models(capsys)["Grasp"]
    types = {name: type_name for name, (_, type_name) in ports.items()}
    assert types == {"at": None, "strength": "double", "gentle": "bool", "tool": "std::string"}


def test_a_key_that_nothing_has_before_and_something_has_after_is_taken_for_an_output(capsys):
    found = models(capsys)
    assert found["FindObject"][1]["pose"][0] == "output_port"
    assert found["Grasp"][1]["at"][0] == "input_port"


def test_a_key_that_a_tree_is_handed_is_no_output_of_its_first_reader(capsys):
    inner = (
        '<BehaviorTree ID="Inner"><Sequence><Lift at="{pose}"/><Lower at="{pose}"/></Sequence></BehaviorTree>'
    )
    outer = document('<SubTree ID="Inner" pose="{p}"/>')
    write("ws/two.xml", outer.replace("</root>", f"{inner}</root>"))
    assert models(capsys)["Lift"][1]["at"][0] == "input_port"


def test_a_node_that_is_described_or_installed_is_not_in_the_palette(capsys):
    write("ws/arm_tree_nodes.xml", run(capsys, "nodes", "--from-use", "ws", "Grasp")[1])
    assert set(models(capsys)) == {"Either", "FindObject", "IsHeld", "Retrying"}


def test_one_node_alone_can_be_asked_for(capsys):
    assert set(models(capsys, "Grasp")) == {"Grasp"}


def test_with_the_palette_nothing_is_unknown_any_more(capsys):
    assert run(capsys, "validate", "ws")[0] == 1
    write("palette.xml", run(capsys, "nodes", "--from-use", "ws")[1])
    status, out, _ = run(capsys, "validate", "ws", "--model", "palette.xml")
    assert (status, "unknown" in out) == (0, False)


def test_trees_that_are_in_no_file_of_the_folder_are_in_the_palette_without_ports(capsys):
    uses = (
        '<SubTree ID="Go there" at="{pose}"/><SubTree ID="Go there"/><SubTree ID="Held"/><SubTree ID="Rest"/>'
    )
    write("ws/uses.xml", document(f"<Sequence>{uses}</Sequence>"))
    write(
        "ws/rest.xml", '<root BTCPP_format="4"><BehaviorTree ID="Rest"><AlwaysSuccess/></BehaviorTree></root>'
    )
    write("held.xml", '<root BTCPP_format="4"><TreeNodesModel><SubTree ID="Held"/></TreeNodesModel></root>')
    assert models(capsys, "--model", "held.xml")["Go there"] == ("SubTree", {})
    assert not {"Held", "Rest"} & models(capsys, "--model", "held.xml").keys()
    Path("palette.xml").write_text(run(capsys, "nodes", "--from-use", "ws")[1], encoding="utf-8")
    status, out, _ = run(capsys, "validate", "--model", "palette.xml", "ws")
    assert (status, "unknown-tree" in out) == (0, False)


def test_a_file_that_cannot_be_read_is_passed_over_and_named(capsys):
    write("ws/broken.xml", document("<Sequence>"))
    status, out, err = run(capsys, "nodes", "--from-use", "ws")
    assert (status, "Grasp" in out) == (0, True)
    assert "ws/broken.xml is not a well-formed tree file" in err


def test_json_is_no_form_of_a_palette(capsys):
    status, _, err = run(capsys, "nodes", "--from-use", "ws", "--format", "json")
    assert (status, "remove --format json" in err) == (2, True)


def test_a_port_has_the_type_of_a_known_port_that_shares_its_key(capsys):
    body = '<Sequence><Measure time="{t}" goal="{g}" word="{w}"/><Sleep msec="{t}"/><ComputePathToPose goal="{g}" path="{p}"/></Sequence>'
    write("ws/arm.xml", document(body))
    _, ports = models(capsys, "--model", "nav2:jazzy")["Measure"]
    assert ports == {
        "time": ("output_port", "unsigned int"),
        "goal": ("output_port", "geometry_msgs::msg::PoseStamped"),
        "word": ("input_port", None),
    }
