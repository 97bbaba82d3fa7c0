"""Compiled code: vectors, the decorator of every compiled function, and its cache."""
