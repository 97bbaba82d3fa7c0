"""Inference: the plain definition, the compiled engines, and inference with intervals."""
