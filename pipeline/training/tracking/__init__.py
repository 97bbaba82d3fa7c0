"""Where a training is logged besides its own folder."""
