import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from ridgefeature.io.sampling import Mesh, spread

# A square plate of 10 x 10 in the plane z = 2.
PLATE = np.array([[0, 0, 2], [10, 0, 2], [10, 10, 2], [0, 10, 2]], float)


@given(
    st.lists(st.floats(0, 1e3), min_size=1, max_size=30).filter(lambda a: sum(a) > 1e-3), st.integers(1, 500)
)
@settings(deadline=None)
def test_each_triangle_gets_its_share(area, n):
    which, weights = spread(np.array(area), n)
    share = n * np.array(area) / sum(area)
    assert (np.abs(np.bincount(which, minlength=len(area)) - share) <= 1 + 1e-6).all()
    assert (np.diff(which) >= 0).all()
    assert (weights >= 0).all()
    np.testing.assert_allclose(weights.sum(axis=1), 1)


def test_samples_leave_no_holes_and_no_clumps():
    from scipy.spatial import cKDTree

    corners = np.array([PLATE[[0, 1, 2]], PLATE[[0, 2, 3]]])
    points = Mesh(corners, PLATE).sample(2500)
    assert (points[:, 2] == 2).all()
    assert points.min() >= 0 and points.max() <= 10
    # Mean spacing is 0.2. Random points would leave holes of radius 0.35 and more.
    x, y = np.meshgrid(np.linspace(0, 10, 200), np.linspace(0, 10, 200))
    grid = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 2.0)])
    assert cKDTree(points).query(grid)[0].max() < 0.35
    counts, _, _ = np.histogram2d(points[:, 0], points[:, 1], bins=10, range=[(0, 10)] * 2)
    assert counts.min() >= 20 and counts.max() <= 30


def test_faces_with_nan_corners_are_left_out():
    corners = np.array([PLATE[[0, 1, 2]], PLATE[[0, 2, 3]]])
    corners[1, 0, 0] = np.nan
    points = Mesh(corners, PLATE).sample(100)
    assert (points[:, 0] >= points[:, 1]).all()
