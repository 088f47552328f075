"""Tests of `nodes --from-use`, which makes a palette of the undescribed nodes that trees use."""

from pathlib import Path

import pytest

from sar_compiler.tree.xml import parse_xml
from tests.cli import command_runner
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
    return command_runner.run(capsys, *arguments)


def models(capsys, *options):
    """Return the palette of the folder: the kind of each ID, and the direction and type of each port."""
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


def test_node_kind_follows_from_explicit_form_or_children(capsys):
    kinds = {tag: kind for tag, (kind, _) in models(capsys).items()}
    assert kinds == {
        "Either": "Control",
        "FindObject": "Action",
        "Grasp": "Action",
        "IsHeld": "Condition",
        "Retrying": "Decorator",
    }


def test_port_type_fits_all_written_values(capsys):
    _, ports = models(capsys)["Grasp"]
    types = {name: type_name for name, (_, type_name) in ports.items()}
    assert types == {"at": None, "strength": "double", "gentle": "bool", "tool": "std::string"}


def test_key_that_is_first_used_by_node_and_read_later_is_output(capsys):
    found = models(capsys)
    assert found["FindObject"][1]["pose"][0] == "output_port"
    assert found["Grasp"][1]["at"][0] == "input_port"


def test_key_passed_to_tree_is_input_of_first_reader(capsys):
    inner = (
        '<BehaviorTree ID="Inner"><Sequence><Lift at="{pose}"/><Lower at="{pose}"/></Sequence></BehaviorTree>'
    )
    outer = document('<SubTree ID="Inner" pose="{p}"/>')
    write("ws/two.xml", outer.replace("</root>", f"{inner}</root>"))
    assert models(capsys)["Lift"][1]["at"][0] == "input_port"


def test_described_and_installed_nodes_are_not_in_palette(capsys):
    write("ws/arm_tree_nodes.xml", run(capsys, "nodes", "--from-use", "ws", "Grasp")[1])
    assert set(models(capsys)) == {"Either", "FindObject", "IsHeld", "Retrying"}


def test_palette_of_named_node_contains_only_that_node(capsys):
    assert set(models(capsys, "Grasp")) == {"Grasp"}


def test_palette_describes_all_unknown_nodes(capsys):
    assert run(capsys, "validate", "ws")[0] == 1
    write("palette.xml", run(capsys, "nodes", "--from-use", "ws")[1])
    status, out, _ = run(capsys, "validate", "ws", "--model", "palette.xml")
    assert (status, "unknown" in out) == (0, False)


def test_trees_missing_from_folder_are_in_palette_without_ports(capsys):
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


def test_malformed_file_is_skipped_and_named(capsys):
    write("ws/broken.xml", document("<Sequence>"))
    status, out, err = run(capsys, "nodes", "--from-use", "ws")
    assert (status, "Grasp" in out) == (0, True)
    assert "ws/broken.xml is not a well-formed tree file" in err


def test_json_format_is_rejected(capsys):
    status, _, err = run(capsys, "nodes", "--from-use", "ws", "--format", "json")
    assert (status, "remove --format json" in err) == (2, True)


def test_port_has_type_of_known_port_with_same_key(capsys):
    body = '<Sequence><Measure time="{t}" goal="{g}" word="{w}"/><Sleep msec="{t}"/><ComputePathToPose goal="{g}" path="{p}"/></Sequence>'
    write("ws/arm.xml", document(body))
    _, ports = models(capsys, "--model", "nav2:jazzy")["Measure"]
    assert ports == {
        "time": ("output_port", "unsigned int"),
        "goal": ("output_port", "geometry_msgs::msg::PoseStamped"),
        "word": ("input_port", None),
    }
