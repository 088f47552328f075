"""What a client of `sar-run --serve` is told of a run, and what its payload means."""

import pytest

from sar_compiler.cli.serve import ended_run
from sar_compiler.ros.served_runs import EndedRun, PayloadError, parameters_of

STOPPED = "it was stopped before its end"


@pytest.mark.parametrize(
    ("status", "last", "ended"),
    [
        (0, '{"status": 0, "reason": ""}', EndedRun("SUCCESS", '{"status": 0, "reason": ""}')),
        (1, '{"status": 1, "reason": "a place was given up"}', EndedRun("FAILURE", "a place was given up")),
        (4, '{"status": 4, "reason": "a goal may be active"}', EndedRun("IDLE", "a goal may be active")),
        (130, '{"status": 130, "reason": ""}', EndedRun("IDLE", "it was stopped")),
        (2, "", EndedRun("IDLE", "line 3: unknown-node")),
        (3, "waiting for Nav2", EndedRun("IDLE", "line 3: unknown-node")),
        (143, "waiting for Nav2", EndedRun("IDLE", STOPPED)),
        # Killed while it was writing.
        (-9, '{"status": 0, "rea', EndedRun("IDLE", STOPPED)),
    ],
)
def test_how_a_run_has_ended_is_told_by_its_status_and_its_summary(status, last, ended):
    assert ended_run(status, last, "line 3: unknown-node") == ended


def test_a_payload_names_parameters_one_below_the_other():
    assert parameters_of('{"a": {"b": {"c": [1, 2]}, "d": "x"}, "e": true}') == {
        "a.b.c": [1, 2],
        "a.d": "x",
        "e": True,
    }


@pytest.mark.parametrize("payload", ["", "  \n", "{}"])
def test_without_a_payload_there_are_no_parameters(payload):
    assert parameters_of(payload) == {}


@pytest.mark.parametrize(
    ("payload", "said"),
    [
        ("a: 3", "the payload is no JSON"),
        ("[" * 100_000, "the payload is no JSON"),
        ("[1]", "the payload is a JSON object"),
        ('{"a": ' * 900 + "1" + "}" * 900, "the payload is nested too deeply"),
    ],
)
def test_a_payload_that_is_none_is_refused(payload, said):
    with pytest.raises(PayloadError, match=said):
        parameters_of(payload)
