"""A scan with one straight ridge, and the ridge as it is registered: what a page has open."""

from __future__ import annotations

from functools import cache

import numpy as np

import ridgefeature as rf
from ridgefeature.scan import Source
from ridgefeature.section import bell

LENGTH, HEIGHT, WIDTH = 60.0, 3.0, 8.0
PICK = (30.0, 0.0, HEIGHT)


@cache
def scan(n: int = 12_000, length: float = LENGTH) -> rf.Scan:
    """n points, in centimetres, of a plain with a ridge along x from 0 to its length; it goes on about it."""
    rng = np.random.default_rng(0)
    x, y = rng.uniform([-15.0, -20.0], [length + 15.0, 20.0], (n, 2)).T
    inside = (x > 0) & (x < length)
    z = np.where(inside, HEIGHT * bell()(y / WIDTH), 0.0) + rng.normal(0.0, 0.05, n)
    return rf.Scan(np.column_stack([x, y, z]), "cm", Source("clay.ply", "0" * 64))


@cache
def registered() -> rf.Ridge:
    return rf.register(scan(), at=PICK)
