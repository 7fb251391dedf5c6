"""Register a ridge in a 3D scan as a feature with a height and a width."""
