"""A declarative experiment pipeline for fuzzy spacecraft inspection."""
