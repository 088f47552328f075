"""What the tests of faults share."""

from tests.e2e.conftest import start, witness
from tests.ros.conftest import make_ros, ros, said

__all__ = ["make_ros", "ros", "said", "start", "witness"]
