"""Scenes in the viewer: flights and evaluations."""
