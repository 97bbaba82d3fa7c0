"""Benchmarks: each figure of the README by one command, ratios measured in one run."""
