"""What every test shares: a ROS domain of its own for each test process."""

import os

# Before anything imports rclpy. Consecutive process numbers (the workers of one run) give different
# domains; LOCALHOST keeps rclpy from listening on every interface.
os.environ["ROS_DOMAIN_ID"] = str(1 + os.getpid() % 100)
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

from hypothesis import HealthCheck, settings

# How long an example takes depends on the machine, which is no property of the code.
settings.register_profile("untimed", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("untimed")
