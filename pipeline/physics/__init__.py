"""Relative motion, attitude, light and sight: vectors and quaternions in SI, nothing else."""
