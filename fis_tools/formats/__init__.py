"""Readers and writers of fuzzy exchange formats, one file a format."""
