"""The extension point of commands, by its published interface."""


class CommandExtension:
    """A command of `ros2`."""
