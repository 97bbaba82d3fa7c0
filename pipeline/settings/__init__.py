"""Every key of the configuration as checked, frozen data."""
