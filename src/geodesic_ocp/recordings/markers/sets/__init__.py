"""Where markers are on a person or a model."""
