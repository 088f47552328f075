"""Tests of areas files: GeoJSON polygons become zones in metres, and errors are reported."""

import json
import math
from pathlib import Path
from typing import Any

import pytest

from sar_compiler import load
from sar_compiler.journal.georeference import Georeference
from sar_compiler.missions import ParameterError, ParameterReader
from sar_compiler.missions.mission_start import begin_run
from search_and_rescue.plugin import MISSION
from search_and_rescue.search import Search

PLACE = Georeference(48.1, 11.5, 30.0)
CORNERS = [(10.0, 5.0), (30.0, 5.0), (30.0, 20.0), (10.0, 20.0)]


def ring(corners: list[tuple[float, float]] = CORNERS) -> list[list[float]]:
    """Return corners in metres as a GeoJSON ring: longitude, latitude, closed."""
    turned = [PLACE.to_coordinates(*corner)[::-1] for corner in corners]
    return [list(each) for each in (*turned, turned[0])]


def feature(
    name: str = "north", rings: Any = None, kind: str = "Polygon", **properties: Any
) -> dict[str, Any]:
    given = {"name": name, "poa": 0.4, "pod": 0.7, "detection_range": 3.0, "stroke": "#FF0000", **properties}
    geometry = {"type": kind, "coordinates": [ring()] if rings is None else rings}
    return {"type": "Feature", "properties": given, "geometry": geometry}


def begun(folder: Path, content: Any, **changed: object) -> Search:
    """Begin a search with an areas file; content that is not a string is written as features."""
    text = (
        content
        if isinstance(content, str)
        else json.dumps({"type": "FeatureCollection", "features": content})
    )
    (folder / "areas.geojson").write_text(text, encoding="utf-8")
    given: dict[str, object] = {f"georeference.{key}": value for key, value in PLACE._asdict().items()}
    given |= {"areas_file": str(folder / "areas.geojson"), **changed}
    reader = ParameterReader({key: value for key, value in given.items() if value is not None})
    search = MISSION.begin(reader)
    reader.complain()
    return search


def test_polygons_become_zones_with_their_properties(tmp_path: Path) -> None:
    search = begun(tmp_path, [feature(), feature("south", poa=0.2, sweep_width=2.0)])
    grounds = search.sweeps.grounds
    assert list(grounds) == ["north", "south"]
    for found, drawn in zip(grounds["north"].polygon, CORNERS, strict=True):
        assert math.dist(found, drawn) < 0.002
    assert (grounds["south"].sweep_width, grounds["south"].detection_range) == (2.0, 3.0)
    assert [search.zones.areas[name].poa for name in ("north", "south")] == [0.4, 0.2]
    zone = search.zones.remaining_zones()[0]
    assert 10.0 < zone["x"] < 30.0
    assert 5.0 < zone["y"] < 20.0


def test_caltopo_title_names_zone_and_parameters_set_pose_and_order(tmp_path: Path) -> None:
    titled = feature("", title="south")
    poses = {"zones.south.x": 12.0, "zones.south.y": 6.0, "zones.south.yaw": 1.0}
    search = begun(tmp_path, [feature(), titled], zone_order=["south", "north"], **poses)
    first = search.zones.current_zone()
    assert (first["id"], first["x"]) == ("south", 12.0)


def test_areas_path_is_relative_to_parameter_file(tmp_path: Path) -> None:
    (tmp_path / "areas.geojson").write_text(
        json.dumps({"type": "FeatureCollection", "features": [feature()]}), encoding="utf-8"
    )
    params = tmp_path / "params.yaml"
    place = ", ".join(f"{key}: {value}" for key, value in PLACE._asdict().items())
    params.write_text(
        f"/**:\n  ros__parameters:\n    areas_file: areas.geojson\n    georeference: {{{place}}}\n",
        encoding="utf-8",
    )
    flat = {f"georeference.{key}": value for key, value in PLACE._asdict().items()}
    reader = ParameterReader.from_files(
        {**flat, "areas_file": "areas.geojson"}, [params], "/search_and_rescue"
    )
    assert [zone["id"] for zone in MISSION.begin(reader).zones.remaining_zones()] == ["north"]
    assert reader.problems == []


def problems_of(folder: Path, value: str) -> list[str]:
    """Return the problems of an areas file that a parameter file names."""
    params = folder / "params.yaml"
    place = ", ".join(f"{key}: {each}" for key, each in PLACE._asdict().items())
    params.write_text(
        f"/**:\n  ros__parameters:\n    areas_file: {json.dumps(value)}\n    georeference: {{{place}}}\n",
        encoding="utf-8",
    )
    flat = {f"georeference.{key}": each for key, each in PLACE._asdict().items()}
    reader = ParameterReader.from_files({**flat, "areas_file": value}, [params], "/search_and_rescue")
    with pytest.raises(ParameterError):
        MISSION.begin(reader)
    return [problem.text for problem in reader.problems]


@pytest.mark.parametrize("path", ["../secret", "{above}/secret", "link"])
def test_areas_outside_folder_of_parameter_file_are_rejected(tmp_path: Path, path: str) -> None:
    folder = tmp_path / "mission"
    folder.mkdir()
    (tmp_path / "secret").write_text("never shown", encoding="utf-8")
    (folder / "link").symlink_to(tmp_path / "secret")
    [problem] = problems_of(folder, path.format(above=tmp_path))
    assert f"cannot be read: it is outside {folder}. Move the file next to " in problem
    assert problem.endswith("or pass its path on the command line with -p areas_file:=PATH")


def test_symlinked_parameter_file_can_name_symlinked_areas_file(
    tmp_path: Path,
) -> None:
    """`colcon build --symlink-install` installs both files as links."""
    (tmp_path / "sources").mkdir()
    (tmp_path / "installed").mkdir()
    text = json.dumps({"type": "FeatureCollection", "features": [feature()]})
    (tmp_path / "sources" / "areas.geojson").write_text(text, encoding="utf-8")
    place = ", ".join(f"{key}: {value}" for key, value in PLACE._asdict().items())
    (tmp_path / "sources" / "params.yaml").write_text(
        f"/**:\n  ros__parameters:\n    areas_file: areas.geojson\n    georeference: {{{place}}}\n",
        encoding="utf-8",
    )
    for name in ("areas.geojson", "params.yaml"):
        (tmp_path / "installed" / name).symlink_to(tmp_path / "sources" / name)
    flat = {f"georeference.{key}": value for key, value in PLACE._asdict().items()}
    given = {**flat, "areas_file": "areas.geojson"}
    reader = ParameterReader.from_files(given, [tmp_path / "installed" / "params.yaml"], "/search_and_rescue")
    assert [zone["id"] for zone in MISSION.begin(reader).zones.remaining_zones()] == ["north"]
    assert reader.files["areas_file"].real_path == tmp_path / "sources" / "areas.geojson"


def test_mission_that_reads_file_must_list_its_parameter(tmp_path: Path) -> None:
    """Otherwise a goal of `sar-run --serve` could set the path."""

    class Unlisted(type(MISSION)):  # type: ignore[misc]
        path_parameters = ()

    (tmp_path / "areas.geojson").write_text(
        json.dumps({"type": "FeatureCollection", "features": [feature()]}), encoding="utf-8"
    )
    given: dict[str, object] = {f"georeference.{key}": value for key, value in PLACE._asdict().items()}
    given["areas_file"] = str(tmp_path / "areas.geojson")
    binding = load("search_and_rescue").binding()
    assert begin_run(MISSION, ParameterReader(given), binding).notes == ()
    with pytest.raises(
        TypeError,
        match=r"reads the file that the parameter areas_file names\. Add this parameter to path_parameters",
    ):
        begin_run(Unlisted(), ParameterReader(given), binding)


def test_too_many_areas_are_rejected_before_parsing(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="areas_file: has 10,001 areas: write at most 10,000"):
        begun(tmp_path, [{"geometry": {"type": "Polygon"}}] * 10_001)


def test_open_rings_and_multipolygons_keep_all_corners(tmp_path: Path) -> None:
    layer = feature("layer", rings=[[ring()]], kind="MultiPolygon", poa=0.1)
    search = begun(tmp_path, [feature(rings=[ring()[:-1]]), layer])
    for name in ("north", "layer"):
        for found, drawn in zip(search.sweeps.grounds[name].polygon, CORNERS, strict=True):
            assert math.dist(found, drawn) < 0.002


def test_features_that_are_not_polygons_are_skipped_with_note(tmp_path: Path) -> None:
    """CalTopo exports the whole map into one file."""
    mark = feature("last seen here", rings=[10.0, 48.1], kind="Point")
    folder = {"type": "Feature", "properties": {"title": "Sector 1", "class": "Folder"}, "geometry": None}
    text = json.dumps({"type": "FeatureCollection", "features": [folder, mark, feature()]})
    (tmp_path / "areas.geojson").write_text(text, encoding="utf-8")
    flat: dict[str, object] = {f"georeference.{key}": value for key, value in PLACE._asdict().items()}
    reader = ParameterReader({**flat, "areas_file": str(tmp_path / "areas.geojson")})
    assert list(MISSION.begin(reader).sweeps.grounds) == ["north"]
    assert reader.notes == ["areas_file: skipped 2 of 3 features, which are not polygons"]


def test_layer_in_wgs_84_is_accepted(tmp_path: Path) -> None:
    crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}}
    assert list(begun(tmp_path, json.dumps({"crs": crs, "features": [feature()]})).sweeps.grounds) == [
        "north"
    ]


SWAPPED = [[corner[::-1] for corner in ring()]]


@pytest.mark.parametrize(
    ("content", "changed", "said"),
    [
        ("no json", {}, "areas_file: is not a valid GeoJSON file: "),
        ("[" * 100_000, {}, "areas_file: is not a valid GeoJSON file: "),
        ("[]", {}, "areas_file: is not a GeoJSON FeatureCollection: export polygons"),
        ('{"features": [1]}', {}, "areas_file: is not a GeoJSON FeatureCollection"),
        ([feature("")], {}, "areas_file: feature 1 needs a property `name` without a dot"),
        ([feature("a.b")], {}, "areas_file: feature 1 ('a.b') needs a property `name` without a dot"),
        ([feature(), feature()], {}, "areas_file: feature 2 ('north') has the same name as another feature"),
        ([feature(kind="Point")], {}, "zone_order: is empty"),
        ([feature(rings=[[ring()], [ring()]], kind="MultiPolygon")], {}, "areas_file: feature 1 ('north') is a MultiPolygon: draw"),
        ([{**feature(), "properties": "none"}], {}, "areas_file: feature 1 needs a property `name` without a dot"),
        ('{"crs": {"properties": {"name": "urn:ogc:def:crs:EPSG::25832"}}, "features": []}', {}, "areas_file: uses the coordinate system 'urn:ogc:def:crs:EPSG::25832': export the file in WGS 84"),
        ([feature(rings=[5])], {}, "areas_file: feature 1 ('north') is a Polygon without corners"),
        ([feature(rings=[])], {}, "areas_file: feature 1 ('north') is a Polygon without corners"),
        ([feature(rings=[ring(), ring()])], {}, "areas_file: feature 1 ('north') has holes"),
        ([feature(rings=[[[10, "a"], [1, 2]]])], {}, "areas_file: feature 1 ('north') has the corner [10, 'a']: write"),
        ([feature(rings=[[[500, 10], [1, 2]]])], {}, "areas_file: feature 1 ('north') has corners that are not in degrees"),
        ([feature(rings=SWAPPED)], {}, "areas_file: feature 1 ('north') has a corner "),
        ([feature()], {"georeference.lat": None}, "areas_file: contains degrees, which need the georeference of the map"),
        ([feature()], {"areas_file": 3}, "areas_file: must be the path of a GeoJSON file, but is 3"),
        ([feature()], {"areas_file": "/nowhere/areas.geojson"}, "areas_file: /nowhere/areas.geojson cannot be read"),
        ([feature(poa=1.5)], {}, "zones.north.poa: must be a share from 0 to 1, but is 1.5"),
        ([feature(rings=[ring(CORNERS[:2])])], {}, "zones.north.polygon: must contain x and y of three or more corners"),
        ([feature(rings=[[]])], {}, "areas_file: feature 1 ('north') is a Polygon without corners"),
    ],
)  # fmt: skip
def test_areas_file_error_is_reported_before_run(
    tmp_path: Path, content: Any, changed: dict[str, Any], said: str
) -> None:
    with pytest.raises(ParameterError) as raised:
        begun(tmp_path, content, **changed)
    [problem] = raised.value.problems
    assert f"{problem.key}: {problem.text}".startswith(said)


def test_corner_at_maximum_distance_is_accepted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from pyproj import Geod

    inverse = Geod(ellps="WGS84").inv
    farthest = max(inverse(PLACE.lon, PLACE.lat, lon, lat)[2] for lon, lat in ring())
    monkeypatch.setattr("search_and_rescue.areas_file._MAX_DISTANCE_M", farthest)
    assert list(begun(tmp_path, [feature()]).sweeps.grounds) == ["north"]
