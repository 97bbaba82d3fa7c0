"""The page of evidence: what was required, what was tried, and what it shows."""
