"""A stand-in for the used part of `ros2cli`, which is not on PyPI."""
