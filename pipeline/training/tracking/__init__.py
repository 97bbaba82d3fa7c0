"""Who else is told of a training, besides its own folder."""
