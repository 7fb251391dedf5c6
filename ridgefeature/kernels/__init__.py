"""Compiled kernels: arrays and scalars in, arrays and scalars out. Nothing here knows a class of the project."""
