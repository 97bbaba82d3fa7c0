"""Findings for a reviewer: audit, explanation, difference, simplification."""
