"""Benchmarks: one command for each figure in the README; ratios are measured in one run."""
