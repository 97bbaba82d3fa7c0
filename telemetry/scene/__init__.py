"""Scenes in the viewer: flights, evaluations and trainings."""
