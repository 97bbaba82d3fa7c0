"""Our own controller files, JSON and YAML: read without executing anything."""
