"""Compiled kernels: arrays and scalars in and out. Nothing here knows a class of the project."""
