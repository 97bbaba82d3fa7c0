"""The report of a run: what it tells, its pictures, its page."""
