"""Sources of controllers."""
