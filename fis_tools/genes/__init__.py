"""Fuzzy systems to bounded vectors of numbers and back."""
