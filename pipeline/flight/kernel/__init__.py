"""The compiled flight, many deputies side by side; twin of `pipeline.flight.reference`."""
