"""What this project uses of `ros2doctor`, which is not on PyPI."""
