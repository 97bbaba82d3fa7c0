"""The least fuel that an inspection can do with, for somebody who knows its whole course beforehand."""
