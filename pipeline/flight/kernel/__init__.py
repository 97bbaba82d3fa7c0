"""The compiled flight, many deputies at once; twin of `pipeline.flight.reference`."""
