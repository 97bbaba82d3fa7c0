"""Fuzzy systems as bounded vectors of numbers, and back."""
