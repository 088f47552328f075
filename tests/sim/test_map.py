"""Tests of making, writing and reading maps."""

import itertools
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from sar_compiler.cli.sim import main
from sar_compiler.opener import UnreadableFileError
from sar_compiler.sim.geometry import Pose2D
from sar_compiler.sim.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyMap, map_files, read_map
from sar_compiler.sim.survey import Mapper, SurveyError, survey
from sar_compiler.sim.world import Lidar, World, find_world
from sar_compiler.tree.diagnostic import TreeError


@pytest.mark.parametrize("name", ["disaster_zone", pytest.param("offices", marks=pytest.mark.slow)])
def test_shipped_map_equals_survey(name: str, tmp_path: Path) -> None:
    assert main(["map", name, "-o", str(tmp_path / name)]) == 0
    shipped = find_world(name).map_path
    assert shipped is not None
    for made in sorted(tmp_path.iterdir()):
        assert made.read_bytes() == (shipped.parent / made.name).read_bytes(), (
            f"{made.name}: renew with `sar-sim map {name} -o maps/{name}`"
        )


def test_shipped_map_has_grey_values_of_map_saver(disaster_zone: World) -> None:
    assert disaster_zone.map_path is not None
    pixels = np.asarray(Image.open(disaster_zone.map_path.with_suffix(".pgm")))
    assert set(np.unique(pixels)) == {0, 205, 254}


def test_map_agrees_with_world(disaster_zone: World, shipped_map: OccupancyMap) -> None:
    for value, near, far in ((FREE, 0.0, np.inf), (OCCUPIED, 0.0, 0.08)):
        cells = np.argwhere(shipped_map.cells == value)
        centres = shipped_map.centre_of(cells[:, 0], cells[:, 1])
        clearances = np.array([disaster_zone.obstacle_arrays.clearance(x, y) for x, y in centres])
        assert ((near <= clearances) & (clearances <= far)).all()
    inside = [cell for x, y, _ in disaster_zone.obstacle_arrays.discs if (cell := shipped_map.cell_at(x, y))]
    assert [shipped_map.cells[cell] for cell in inside] == [UNKNOWN]


def test_zones_and_base_are_on_free_ground(disaster_zone: World, shipped_map: OccupancyMap) -> None:
    for x, y in [*disaster_zone.places.values(), (0.0, 0.0)]:
        cell = shipped_map.cell_at(x, y)
        assert cell is not None
        assert shipped_map.cells[cell] == FREE


def test_other_seed_gives_other_map(disaster_zone: World, shipped_map: OccupancyMap) -> None:
    # The shipped map is the map of seed 0.
    assert survey(disaster_zone, seed=1).cells.tobytes() != shipped_map.cells.tobytes()


def test_world_without_survey_route_cannot_be_mapped() -> None:
    with pytest.raises(SurveyError, match="'empty' has no survey route"):
        survey(find_world("empty"))


def test_survey_beyond_map_limit_is_rejected() -> None:
    world = World("w", Pose2D(0.0, 0.0), 0.22, survey=((20.0, 3.0), (20.0, -400_000.0)))
    with pytest.raises(
        SurveyError, match=r"point 2 of the survey .* differ from the robot's start by at most 25 m"
    ):
        survey(world)


def test_survey_through_wall_gets_stuck(disaster_zone: World) -> None:
    world = World("w", Pose2D(-3.0, 3.0), 0.22, boxes=disaster_zone.boxes, survey=((-3.0, -3.0),))
    with pytest.raises(SurveyError, match="got stuck at"):
        survey(world)


def test_mapper_without_scans_leaves_all_cells_unknown() -> None:
    assert (Mapper(Lidar(), Pose2D(0.0, 0.0)).result().cells == UNKNOWN).all()


def test_scans_free_crossed_cells_and_mark_wall() -> None:
    lidar = Lidar(beams=4)
    mapper = Mapper(lidar, Pose2D(0.0, 0.0))
    for _ in range(3):
        mapper.integrate(Pose2D(0.02, 0.02), np.array([np.inf, np.inf, 2.0, np.inf]))
    grid = mapper.result()
    values = [grid.cells[cell] for x in (1.0, 2.02, 2.2) if (cell := grid.cell_at(x, 0.02))]
    assert values == [FREE, OCCUPIED, UNKNOWN]


def some_map() -> OccupancyMap:
    cells = np.array([[FREE, OCCUPIED, UNKNOWN], [UNKNOWN, FREE, FREE]], dtype=np.int8)
    return OccupancyMap(cells, 0.05, -1.5, 2.25)


def save(occupancy: OccupancyMap, prefix: Path) -> tuple[Path, Path]:
    files = map_files(occupancy, prefix)
    for path, content in files.items():
        path.write_bytes(content)
    image, description = files
    return image, description


def test_map_is_unchanged_after_writing_and_reading(tmp_path: Path) -> None:
    written = some_map()
    _, description = save(written, tmp_path / "m")
    again = read_map(description)
    assert np.array_equal(again.cells, written.cells)
    assert (again.resolution, again.origin_x, again.origin_y) == (0.05, -1.5, 2.25)


def test_first_pixel_is_upper_left_cell(tmp_path: Path) -> None:
    image, _ = save(some_map(), tmp_path / "m")
    assert image.read_bytes() == b"P5\n3 2\n255\n" + bytes([205, 254, 254, 254, 0, 205])


def write(tmp_path: Path, **changes: str) -> Path:
    save(some_map(), tmp_path / "m")
    keys = {"image": "m.pgm", "mode": "trinary", "resolution": "0.05", "origin": "[0, 0, 0]", "negate": "0"}
    keys |= {"occupied_thresh": "0.65", "free_thresh": "0.196"} | changes
    path = tmp_path / "m.yaml"
    path.write_text("".join(f"{key}: {value}\n" for key, value in keys.items() if value), encoding="utf-8")
    return path


def test_negate_inverts_black_and_white(tmp_path: Path) -> None:
    again = read_map(write(tmp_path, negate="1"))
    assert again.cells[0, 0] == OCCUPIED
    assert again.cells[0, 1] == FREE


def test_free_threshold_decides_between_free_and_unknown(tmp_path: Path) -> None:
    again = read_map(write(tmp_path, free_thresh="0.25"))
    assert again.cells[0, 2] == FREE


def test_image_with_transparency_is_averaged(tmp_path: Path) -> None:
    Image.new("RGBA", (2, 2), (0, 0, 0, 0)).save(tmp_path / "c.png")
    assert (read_map(write(tmp_path, image="c.png")).cells == OCCUPIED).all()


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        (
            {"origin": "[0, 0, 1]"},
            r"m.yaml:4:16: error\[wrong-value\]: an item of 'origin' must be a yaw of 0",
        ),
        ({"origin": "[0, 0]"}, r"m.yaml:4:9: .*'origin' must be \[x, y, yaw\], but is a list"),
        ({"mode": "scale"}, "m.yaml:2:7: .*'mode' must be one of trinary, but is 'scale'"),
        ({"negate": "maybe"}, "m.yaml:5:9: .*'negate' must be one of 0, 1, false, true, but is 'maybe'"),
        ({"resolution": "0"}, "m.yaml:3:13: .*'resolution' must be a number from 0.001 to 1000, but is '0'"),
        ({"free_thresh": ""}, "the description of a map needs 'free_thresh'"),
    ],
)
def test_error_in_map_description_is_reported(tmp_path: Path, changes: dict[str, str], problem: str) -> None:
    with pytest.raises(TreeError, match=problem):
        read_map(write(tmp_path, **changes))


def test_invalid_image_is_reported(tmp_path: Path) -> None:
    (tmp_path / "no.pgm").write_text("no image")
    with pytest.raises(
        TreeError, match=r"m.yaml:1:8: error\[wrong-value\]: .*no\.pgm: the file is not a readable image"
    ):
        read_map(write(tmp_path, image="no.pgm"))


def test_missing_map_is_reported(tmp_path: Path) -> None:
    with pytest.raises(UnreadableFileError, match=r"cannot read .*gone\.yaml"):
        read_map(tmp_path / "gone.yaml")


def test_unwritable_map_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["map", "-o", str(tmp_path / "no" / "m")]) == 2
    assert "m.pgm: No such file or directory" in capsys.readouterr().err


@pytest.mark.ros
def test_published_map_is_read_unchanged(shipped_map: OccupancyMap) -> None:
    from sar_compiler.sim.messages import from_grid, to_grid

    message = to_grid(shipped_map)
    read = from_grid(message)
    assert read is not None
    assert message.header.frame_id == "map"
    assert np.array_equal(read.cells, shipped_map.cells)
    place = (read.resolution, read.origin_x, read.origin_y)
    assert place == pytest.approx((shipped_map.resolution, shipped_map.origin_x, shipped_map.origin_y))


def test_survey_reports_progress(disaster_zone: World) -> None:
    told: list[float] = []
    survey(disaster_zone, on_progress=told.append)
    assert all(later > earlier - 0.01 for earlier, later in itertools.pairwise(told))
    assert 0.0 <= told[0] < 0.05
    assert told[-1] > 0.95
