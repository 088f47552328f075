"""Schemas for editors and validators, generated from a registry."""
