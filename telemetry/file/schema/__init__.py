"""The protobuf schemas of a recording; CONTRIBUTING.md says how the Python module is made of the `.proto`."""
