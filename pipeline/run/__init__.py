"""A run's folder: names of its files, atomic writes, the manifest, and the stages that run in it."""
