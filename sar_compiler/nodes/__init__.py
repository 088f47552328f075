"""Specs of controls, decorators and leaves: their registration, binding to tree files, schemas and models."""
