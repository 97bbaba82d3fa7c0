"""Flown episodes as recordings, and what happened in them in words."""
