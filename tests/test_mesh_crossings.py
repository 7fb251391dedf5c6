"""Meshes that run through themselves, and those that do not."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from cad_export.mesh_crossings import crosses_itself, welded
from ridgefeature.kernels.algebra import rotation_of

Array = NDArray[np.float64]
Mesh = tuple[Array, NDArray[np.int64]]


def torus(radius: float, tube: float, n: int = 60, m: int = 30) -> Mesh:
    """A closed grid: its first row and column are its last."""
    a, b = np.meshgrid(np.linspace(0, 2 * np.pi, n), np.linspace(0, 2 * np.pi, m), indexing="ij")
    out = radius + tube * np.cos(b)
    return welded([np.stack([out * np.cos(a), out * np.sin(a), tube * np.sin(b)], axis=-1)])


def joined(one: Mesh, other: Mesh) -> Mesh:
    return np.concatenate([one[0], other[0]]), np.concatenate([one[1], other[1] + len(one[0])])


@pytest.mark.parametrize(("tube", "crosses"), [(0.2, False), (0.95, False), (1.1, True)])
def test_a_torus_crosses_itself_where_its_tube_is_wider_than_its_ring(tube: float, crosses: bool) -> None:
    vertices, triangles = torus(1.0, tube)
    assert len(vertices) == 59 * 29 and len(triangles) == 2 * 59 * 29
    assert crosses_itself(vertices, triangles) is crosses


@pytest.mark.parametrize(("apart", "crosses"), [(3.0, False), (1.0, True), (9.0, False)])
def test_two_rings(apart: float, crosses: bool) -> None:
    """Linked like a chain at 3, through each other at 1, apart at 9."""
    one = torus(3.0, 0.8)
    turned = one[0][:, [0, 2, 1]] * [1, -1, 1] + [apart, 0, 0]
    assert crosses_itself(*joined(one, (turned, one[1]))) is crosses


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4])
@pytest.mark.parametrize("turn", [(0.0, 0, 0), (0.3, -1.2, 0.7)])
def test_neither_place_nor_size_matters(scale: float, turn: tuple[float, float, float]) -> None:
    rotation, _ = rotation_of(np.array(turn))
    for tube, crosses in ((0.9, False), (1.2, True)):
        vertices, triangles = torus(1.0, tube)
        assert crosses_itself(scale * (vertices @ rotation.T + [5.0, -3, 2]), triangles) is crosses


def test_flat_faces_and_neighbours_are_no_crossings() -> None:
    """A box of many cells: edges in the planes of other triangles, at all its corners."""
    t = np.linspace(0, 1, 8)
    a, b = np.meshgrid(t, t, indexing="ij")
    sides = [np.stack(parts, -1) for c in (0 * a, 0 * a + 1) for parts in ((a, b, c), (a, c, b), (c, a, b))]
    vertices, triangles = welded(sides)
    assert len(vertices) == 8**3 - 6**3
    assert not crosses_itself(vertices, triangles)


def test_a_row_that_is_one_point_makes_no_empty_triangles() -> None:
    fan = np.linspace(0, 1, 5)[:, None, None] * np.array([[[1.0, y, 0.0] for y in (-1.0, 0.0, 1.0)]])
    _, triangles = welded([fan])
    assert len(triangles) == 2 * 4 * 2 - 2
    assert all(len(set(t)) == 3 for t in triangles.tolist())
