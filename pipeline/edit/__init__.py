"""The mission beside the editor: a thousand flights for every touch of a controller."""
