"""A stand-in for the used part of `ros2doctor`, which is not on PyPI."""
