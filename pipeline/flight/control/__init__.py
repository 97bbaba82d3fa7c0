"""A controller as numbers: its systems, constants, plans and tours."""
