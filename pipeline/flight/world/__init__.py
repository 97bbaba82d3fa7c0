"""A mission as numbers: the chief, its surface, mesh, light and course."""
