"""What this project uses of `ros2cli`, which is not on PyPI."""
