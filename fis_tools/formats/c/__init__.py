"""C99 source that infers without any library."""
