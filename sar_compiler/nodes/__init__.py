"""The registry of controls, decorators and leaves."""
