"""Recordings as files: written, read, rescued, compared, turned into tables."""
