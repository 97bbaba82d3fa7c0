"""Minimum-fuel plans, computed with the whole flight known in advance."""
