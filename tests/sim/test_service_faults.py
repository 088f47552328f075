"""Tests of service servers with faults, over real DDS."""

from collections.abc import Callable
from typing import Any

import pytest

from sar_compiler.missions.faults import FaultPlan, create_service, parse_fault
from tests.sim.conftest import Client

pytestmark = pytest.mark.ros

NAME = "report_survivor"
TARGETS = {NAME: ("drop", "delay", "refuse")}


@pytest.fixture
def serve(client: Client) -> Callable[..., Any]:
    """Serve `report_survivor` with faults and return a function that calls it."""
    from sar_interfaces.srv import ReportSurvivor

    def answer(_: Any, response: Any) -> Any:
        response.acknowledged = True
        return response

    def refuse(_: Any, response: Any) -> Any:
        response.acknowledged = False
        return response

    def start(*specs: str) -> Callable[[], Any]:
        faults = (
            FaultPlan([parse_fault(spec, TARGETS) for spec in specs]).for_service(NAME) if specs else None
        )
        create_service(client.node, ReportSurvivor, NAME, answer, refuse=refuse, faults=faults)
        caller = client.node.create_client(ReportSurvivor, NAME)
        client.wait(caller.service_is_ready, f"service {NAME}")
        return lambda: caller.call_async(ReportSurvivor.Request())

    return start


def test_server_without_faults_responds(serve: Callable[..., Any], client: Client) -> None:
    assert client.result(serve()(), "an answer").acknowledged


def test_only_dropped_calls_get_no_response(serve: Callable[..., Any], client: Client) -> None:
    call = serve("report_survivor:drop=2")
    dropped = [call(), call()]
    assert client.result(call(), "the third answer").acknowledged
    assert client.result(call(), "the fourth answer").acknowledged
    assert not any(future.done() for future in dropped)
    # The dropped calls leave no task in the executor.
    client.wait(lambda: all(task.done() for task, _, _ in client.executor._tasks), "the end of all tasks")


def test_refused_call_gets_negative_response(serve: Callable[..., Any], client: Client) -> None:
    call = serve("report_survivor:refuse=1")
    assert not client.result(call(), "the first answer").acknowledged
    assert client.result(call(), "the second answer").acknowledged


def test_delayed_response_does_not_block_executor(serve: Callable[..., Any], client: Client) -> None:
    call = serve("report_survivor:delay=0.4")
    began = client.node.get_clock().now()
    first = call()
    fired: list[int] = []
    timer = client.node.create_timer(0.05, lambda: fired.append(1))
    assert client.result(first, "the late answer").acknowledged
    assert (client.node.get_clock().now() - began).nanoseconds >= 0.4e9
    assert len(fired) >= 4
    client.node.destroy_timer(timer)
    assert client.result(call(), "the next late answer").acknowledged
    assert not list(client.node.timers)
