"""Recordings as files: write, read, recover, compare, and export to tables."""
