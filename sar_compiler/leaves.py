"""Base classes, ports and registration for your own leaves, controls and decorators.

::

    @register("DriveTo", kind=Kind.ACTION, uses=[Use.action("navigate_to_pose"), Use.nav2()])
    class DriveTo(ActionLeaf): ...
"""

from typing import TYPE_CHECKING

from sar_compiler.lazy_exports import lazy

if TYPE_CHECKING:
    from sar_compiler.nodes.declared import declared_leaves as declared_leaves
    from sar_compiler.nodes.register import register as register
    from sar_compiler.nodes.semantics import Semantics as Semantics
    from sar_compiler.nodes.spec import Kind as Kind
    from sar_compiler.nodes.spec import RegistrationError as RegistrationError
    from sar_compiler.nodes.spec import Use as Use
    from sar_compiler.nodes.values import Milliseconds as Milliseconds
    from sar_compiler.nodes.values import Seconds as Seconds
    from sar_compiler.nodes.values import at_least as at_least
    from sar_compiler.nodes.values import plausible_number as plausible_number
    from sar_compiler.ros.clock import Deadline as Deadline
    from sar_compiler.ros.leaves.action_leaf import ActionLeaf as ActionLeaf
    from sar_compiler.ros.leaves.action_questions import ActionQueries as ActionQueries
    from sar_compiler.ros.leaves.client_leaf import ServiceLeaf as ServiceLeaf
    from sar_compiler.ros.leaves.goals import SUCCEEDED as SUCCEEDED
    from sar_compiler.ros.leaves.goals import describe_status as describe_status
    from sar_compiler.ros.leaves.leaf import LeafDefinitionError as LeafDefinitionError
    from sar_compiler.ros.leaves.leaf import RosLeaf as RosLeaf
    from sar_compiler.ros.leaves.leaf import find_interface as find_interface
    from sar_compiler.ros.leaves.leaf import is_node_valid as is_node_valid
    from sar_compiler.ros.leaves.leaf import of_node as of_node
    from sar_compiler.ros.leaves.leaf import qos_profile as qos_profile
    from sar_compiler.ros.leaves.topic_leaf import TopicLeaf as TopicLeaf
    from sar_compiler.ros.message_values import GridGeometry as GridGeometry
    from sar_compiler.ros.message_values import UnusableValueError as UnusableValueError
    from sar_compiler.ros.message_values import battery_share as battery_share
    from sar_compiler.ros.message_values import check_position as check_position
    from sar_compiler.ros.message_values import grid_geometry as grid_geometry
    from sar_compiler.ros.message_values import path_points as path_points
    from sar_compiler.ros.message_values import planar_outline as planar_outline
    from sar_compiler.ros.message_values import planar_point as planar_point
    from sar_compiler.ros.message_values import planar_pose as planar_pose
    from sar_compiler.ros.message_values import read_field as read_field
    from sar_compiler.ros.message_values import remaining_drive as remaining_drive
    from sar_compiler.ros.message_values import remaining_poses as remaining_poses
    from sar_compiler.ros.message_values import stamped_pose as stamped_pose
    from sar_compiler.ros.message_values import value_reports as value_reports
    from sar_compiler.ros.nav2_log import nav2_log as nav2_log
    from sar_compiler.ros.poses import turn_by as turn_by
    from sar_compiler.ros.poses import yaw_of as yaw_of
    from sar_compiler.ros.robot_estimate import RobotEstimate as RobotEstimate
    from sar_compiler.ros.robot_estimate import Standstill as Standstill
    from sar_compiler.ros.robot_estimate import robot_estimate as robot_estimate
    from sar_compiler.runtime.clock import Clock as Clock
    from sar_compiler.runtime.clock import WallClock as WallClock
    from sar_compiler.runtime.kernel.user_nodes import Tick as Tick
    from sar_compiler.runtime.outcomes import Outcome as Outcome
    from sar_compiler.runtime.ports import InOut as InOut
    from sar_compiler.runtime.ports import Input as Input
    from sar_compiler.runtime.ports import Output as Output
    from sar_compiler.runtime.skipping import SKIPPED as SKIPPED
    from sar_compiler.runtime.skipping import SkippableLeaf as SkippableLeaf
    from sar_compiler.runtime.ticking import Control as Control
    from sar_compiler.runtime.ticking import Decorator as Decorator
if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy(__name__)
