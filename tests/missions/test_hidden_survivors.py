"""Tests of the hidden survivor of simulated searches: location and detection match the planned probabilities."""

import json
import math
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

from sar_compiler.cli.compile import main
from sar_compiler.missions import ParameterReader
from sar_compiler.missions.parameter_reader import ParameterError
from search_and_rescue.hiding import HiddenSurvivor, read_hidden_survivor
from search_and_rescue.search_theory import Ground, SearchExpectation, TourInputs
from search_and_rescue.zone_manager import MapPose
from search_and_rescue.zone_order import order_areas
from tests.missions.test_offices import begun
from tests.random_inputs import rounds

SIGMAS = 4
TREE = "trees/search_areas.xml"
FOUND = "found_by_DetectSurvivor = true; named_by_DetectSurvivor = false; somebody = true"
AREAS = {
    "hall": SearchExpectation(0.5, 0.8),
    "attic": SearchExpectation(0.3, 0.5),
    "yard": SearchExpectation(0.0, 1.0),
}
POSES = {name: MapPose(x=float(at), y=2.0, yaw=math.pi / 2) for at, name in enumerate(AREAS)}


def planned_search() -> tuple[list[str], list[float], list[float], TourInputs, list[int]]:
    """Return the optimal search of the offices: names, end times and detection probabilities in order, the tour, and the order."""
    zones = begun()[0].zones
    tour = zones.tour(zones.remaining_zones())
    order = order_areas("expected_find", tour)
    names = [zones.remaining_zones()[area]["id"] for area in order]
    return names, tour.ends(order), [tour.finds[area] for area in order], tour, order


def test_survivor_hides_in_each_area_with_its_probability() -> None:
    count = rounds(10_000)
    where = Counter(HiddenSurvivor(POSES, AREAS, seed).area for seed in range(count))
    for area, share in (("hall", 0.5), ("attic", 0.3), ("yard", 0.0), (None, 0.2)):
        assert abs(where[area] / count - share) <= SIGMAS * math.sqrt(share * (1 - share) / count), area


@pytest.mark.unmeasured
def test_simulated_searches_match_planned_time_and_pos() -> None:
    names, ends, finds, tour, order = planned_search()
    search, _ = begun()
    poses = {zone["id"]: zone for zone in search.zones.remaining_zones()}
    times, count = [], rounds(10_000)
    for seed in range(count):
        hiding = HiddenSurvivor(poses, search.zones.areas, seed)
        times += [end for name, end in zip(names, ends, strict=True) if hiding.search(name)]
    mean, pos = sum(times) / len(times), sum(finds)
    error = math.sqrt(sum((time - mean) ** 2 for time in times) / len(times) / len(times))
    assert abs(mean - tour.expected_find(order)) < SIGMAS * error
    assert abs(len(times) / count - pos) < SIGMAS * math.sqrt(pos * (1 - pos) / count)


def scenario_outcomes(finds: list[float]) -> dict[str, object]:
    """Return outcomes of the tree's leaves without failures, where each search has its planned probability of the first detection."""
    begins = [max(0.0, 1 - sum(finds[:looks])) for looks in range(len(finds))]
    # Only outcomes that are possible at a search are considered, in proportion to their probability.
    share = 1 / (len(finds) + 1)
    nothing = {"status": "SUCCESS", "label": "nothing", "then": "found_by_DetectSurvivor = false"}
    found = {"status": "SUCCESS", "label": "found", "then": FOUND}
    looks = [
        {**answer, "when": f"zones_left == {len(finds) - done} && !somebody", "p": share * chance}
        for done, find in enumerate(finds)
        for answer, chance in ((found, find / begins[done]), (nothing, 1 - find / begins[done]))
    ]
    usual = {
        "FullBatterySuffices": "suffices",
        "ReturnInReach": "in reach",
        "NavigateToZone": "arrived",
        "NavigateToBase": "arrived",
        "NavigateToCharge": "arrived",
        "NotifyBase": "acknowledged",
        "DeliverReports": "nothing kept",
    }
    return {
        **{leaf: [{"outcome": answer, "p": 1.0}] for leaf, answer in usual.items()},
        "DetectSurvivor": [*looks, {**nothing, "when": "somebody", "p": share}],
    }


@pytest.fixture
def plan_file(tmp_path: Path) -> Callable[..., tuple[Path, float]]:
    """Return a function that writes the planned outcomes of the offices to a file; it returns the path and the POS."""

    def write(**more: object) -> tuple[Path, float]:
        finds = planned_search()[2]
        said = {
            "facts": {"zones_left": len(finds), "somebody": False},
            "outcomes": scenario_outcomes(finds),
            **more,
        }
        path = tmp_path / "looks.yaml"
        path.write_text(yaml.safe_dump(said), encoding="utf-8")
        return path, sum(finds)

    return write


def test_predicted_success_probability_is_planned_pos(
    plan_file: Callable[..., tuple[Path, float]], capsys: pytest.CaptureFixture[str]
) -> None:
    path, pos = plan_file(properties={"somebody is found": {"at_end": "somebody"}})
    options = ("--properties", str(path), "--set", "zones_left=10", "--format", "json")
    assert main(["predict", TREE, *options]) == 0
    said = json.loads(capsys.readouterr().out)["properties"]["somebody is found"]
    assert said == {"low": pytest.approx(pos, abs=1e-9), "high": pytest.approx(pos, abs=1e-9)}


@pytest.mark.unmeasured
def test_simulated_runs_succeed_with_planned_pos(
    plan_file: Callable[..., tuple[Path, float]], capsys: pytest.CaptureFixture[str]
) -> None:
    path, pos = plan_file(expect={"root": "SUCCESS", "facts": {"somebody": True}})
    count = rounds(1000)
    options = ("--runs", str(count), "--half-width", "0", "--jobs", "1", "--format", "json")
    assert main(["sweep", TREE, "--scenario", str(path), *options]) == 1
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    assert abs(row["successes"] / count - pos) < SIGMAS * math.sqrt(pos * (1 - pos) / count)


def test_found_survivor_is_one_metre_ahead_of_robot() -> None:
    seed = next(seed for seed in range(99) if HiddenSurvivor(POSES, AREAS, seed).search("attic"))
    assert HiddenSurvivor(POSES, AREAS, seed).search("attic") == pytest.approx((1.0, 3.0))


def test_result_of_seed_is_independent_of_area_order_and_other_searches() -> None:
    turned = dict(reversed(AREAS.items()))
    for seed in range(50):
        one, other = HiddenSurvivor(POSES, AREAS, seed), HiddenSurvivor(POSES, turned, seed)
        looks = [one.search("attic") for _ in range(3)]
        others = []
        for _ in range(3):
            assert other.search("unknown") is None
            others.append(other.search("attic"))
        assert (one.area, looks) == (other.area, others)


def survivor_in_hall(seed: int, pod: float = 1.0, reach: float = 99.0) -> HiddenSurvivor:
    """Return a survivor who certainly hides in the polygon of the hall: a triangle with two sides of 8 m."""
    ground = Ground(((0.0, 0.0), (8.0, 0.0), (8.0, 8.0)), sweep_width=4.0, detection_range=reach)
    return HiddenSurvivor(POSES, {"hall": SearchExpectation(1.0, pod)}, seed, {"hall": ground})


def survivor_position(seed: int) -> tuple[float, float]:
    found = survivor_in_hall(seed).search("hall", (4.0, 4.0))
    assert found is not None
    return found


def test_survivor_in_polygon_is_uniformly_distributed() -> None:
    count = rounds(2000)
    places = [survivor_position(seed) for seed in range(count)]
    assert all(0.0 <= y <= x <= 8.0 for x, y in places)
    share = sum(x < 4.0 for x, _ in places) / count
    assert abs(share - 0.25) <= SIGMAS * math.sqrt(0.25 * 0.75 / count)


def test_survivor_in_polygon_is_found_only_within_detection_range() -> None:
    x, y = survivor_position(0)
    near, far = (x - 2.4, y), (x - 2.6, y)
    assert survivor_in_hall(0, reach=2.5).search("hall", near) == (x, y)
    assert survivor_in_hall(0, reach=2.5).search("hall", far) is None
    assert survivor_in_hall(0, reach=2.5).search("hall") is None
    assert survivor_in_hall(0, reach=2.5).search("attic", near) is None


def test_searches_from_too_far_do_not_change_later_results() -> None:
    def looks(seed: int, *, with_far_ones: bool) -> list[bool]:
        hiding, found = survivor_in_hall(seed, pod=0.5), []
        for _ in range(6):
            if with_far_ones:
                assert hiding.search("hall", (199.0, 199.0)) is None
            found.append(hiding.search("hall", (4.0, 4.0)) is not None)
        return found

    without = [looks(seed, with_far_ones=False) for seed in range(20)]
    assert without == [looks(seed, with_far_ones=True) for seed in range(20)]
    assert {True, False} == {each for results in without for each in results}


def read(**parameters: object) -> bool:
    reader = ParameterReader(parameters)
    hides = read_hidden_survivor(reader, AREAS if "zones.hall.poa" in parameters else {})
    reader.complain()
    return hides


def test_survivor_hides_only_on_request() -> None:
    assert not read()
    assert read(hidden_survivor=True, **{"zones.hall.poa": 0.5})


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({}, "hidden_survivor: needs probabilities to place the survivor: add poa and pod"),
        (
            {"zones.hall.poa": 0.5, "survivors.hall.x": 1.0},
            "hidden_survivor: .* remove hidden_survivor or survivors",
        ),
        ({"zones.hall.poa": 0.5, "hidden_survivor": 1}, "must be true or false"),
    ],
)
def test_parameters_that_conflict_with_hiding_are_rejected(parameters: dict[str, object], words: str) -> None:
    with pytest.raises(ParameterError, match=words):
        read(**{"hidden_survivor": True, **parameters})
