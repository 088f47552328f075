"""What every test shares: a ROS domain of its own for each test process."""

import os

# Before anything imports rclpy. Consecutive process numbers (the workers of one run) give different
# domains; LOCALHOST keeps rclpy from listening on every interface.
os.environ["ROS_DOMAIN_ID"] = str(1 + os.getpid() % 100)
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
