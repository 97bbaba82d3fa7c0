"""The script and style by which a page shows a flight in three dimensions."""
