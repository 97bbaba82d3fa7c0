"""Where controllers come from."""
