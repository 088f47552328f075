"""The service `detect_survivor`: returns whether, and where, there is a survivor in a zone."""

from typing import Any

from sar_interfaces.srv import DetectSurvivor

from sar_compiler.missions.search_and_rescue.parameters import read_survivors
from sar_compiler.ros.faults import ServiceFaults, create_service
from sar_compiler.ros.parameter_reader import lookalikes
from sar_compiler.ros.parameters import DataNode, flat_parameters
from sar_compiler.tree.showing import in_one_line, shortened

SURVIVORS = {"zone_a": (-2.5, 3.2), "zone_c": (4.1, -2.5)}
"""The survivors' default positions: x and y in metres in the frame `map`, by zone."""


class DetectSurvivorServer(DataNode):
    """Answers from a table of survivors: its parameters `survivors.<zone>.{x,y}`, or the default one.

    Args:
        faults: The faults to inject.
        options: Keyword arguments of `DataNode`: `context`, `cli_args` and so on.

    Raises:
        ParameterError: If the table in the parameters is invalid.
        RosArgumentError: If a name or a value in its arguments is not allowed for a node.
    """

    def __init__(self, faults: ServiceFaults | None = None, **options: Any) -> None:
        super().__init__("detect_survivor_server", **options)
        parameters = flat_parameters(self)
        self._survivors = read_survivors(parameters, SURVIVORS)
        for note in lookalikes(parameters, ["survivors"]):
            self.get_logger().warning(note)
        create_service(self, DetectSurvivor, "detect_survivor", self._answer, faults=faults)
        self.get_logger().info("DetectSurvivor service ready.")

    def _answer(self, request: Any, response: Any) -> Any:
        survivor, zone = self._survivors.get(request.zone_id), in_one_line(shortened(request.zone_id))
        if survivor is None:
            self.get_logger().info(f"Detection request for {zone}: NOT FOUND")
            return response
        response.found = True
        response.survivor_x, response.survivor_y = x, y = survivor
        self.get_logger().info(f"Detection request for {zone}: FOUND at ({x:.2f}, {y:.2f})")
        return response
