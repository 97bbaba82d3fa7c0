"""Inference: the plain definition, the compiled engines, and interval inference."""
