"""What flights are for: how those that must reach a goal are judged."""
