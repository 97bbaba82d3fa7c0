"""The protobuf schemas of a flight recording; `generate` makes the Python module from the `.proto`."""
