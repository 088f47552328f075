"""The world without a robot: what a mission meets when `--sim` is given.

The core (world, robot, lidar, map, planner, navigator) is plain Python and numpy, deterministic and seeded;
:mod:`sar_compiler.sim.simulation` puts it on ROS 2, and nothing else in here needs ROS to be imported.
"""
