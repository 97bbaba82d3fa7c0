"""The protobuf schemas of a recording; `generate` builds the Python module from the `.proto`."""
