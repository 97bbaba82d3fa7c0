"""What the controller senses, and the force that it commands."""
