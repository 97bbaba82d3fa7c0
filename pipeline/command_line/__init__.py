"""The command line and the composition of its configuration; the only place that imports Hydra."""
