"""The steps of an experiment: each reads files, calls one worker and writes files."""
