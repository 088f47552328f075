"""The registry of controls, decorators and leaves: the meanings of tags."""
