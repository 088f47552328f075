"""Specs of controls, decorators and leaves: registration, binding to tree files, schemas and models."""
