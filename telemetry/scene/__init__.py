"""What the viewer shows: flights, evaluations and trainings."""
