"""Ridges on curved bases: seen as flat, how curved they are found to be, and what is fitted there."""

from __future__ import annotations

import json
from functools import lru_cache

import numpy as np
import pytest
from oracles import LOSSES, NO_TREND, residual, section_values, template_at
from scipy.optimize import least_squares
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

import ridgefeature as rf
from ridgefeature.continuation import append
from ridgefeature.curvature import Found, curved
from ridgefeature.io.feature import from_document, to_document
from ridgefeature.kernels.base import flattened, on_base, standing
from ridgefeature.kernels.base_terms import found_terms, smoothed
from ridgefeature.section import bell, plateau

H, W, NOISE = 3.0, 10.0, 0.06
TUKEY = LOSSES["tukey"], 5.0
MIXED = np.array([-0.02, 0.012, 0.03])


# Bases of which everything is known: (s, y, height over it) to points, s along the path, y across within it.


def cylinder_along(s, y, z, radius):
    return np.column_stack([s, (radius + z) * np.sin(y / radius), (radius + z) * np.cos(y / radius) - radius])


def cylinder_across(s, y, z, radius):
    return np.column_stack([(radius + z) * np.sin(s / radius), y, (radius + z) * np.cos(s / radius) - radius])


def sphere(s, y, z, radius):
    out = (radius + z)[:, None] * np.column_stack(
        [np.cos(y / radius) * np.sin(s / radius), np.sin(y / radius), np.cos(y / radius) * np.cos(s / radius)]
    )
    return out - [0, 0, radius]


def saddle(s, y, z, radius):
    """The inner equator of a torus of radii 2 r and r: curved by 1/r along, by -1/r across."""
    from_axis = 2 * radius - (radius + z) * np.cos(y / radius)
    a = s / radius
    return np.column_stack(
        [from_axis * np.sin(a), (radius + z) * np.sin(y / radius), radius - from_axis * np.cos(a)]
    )


def helix(s, y, z, radius):
    """A cylinder, the path at 45 degrees to its axis."""
    a, b = (s + y) / np.sqrt(2), (y - s) / np.sqrt(2)
    x, v, w = cylinder_along(a, b, z, radius).T
    return np.column_stack([x - v, x + v, np.sqrt(2) * w]) / np.sqrt(2)


def plane(s, y, z, radius):
    return np.column_stack([s, y, z])


BASES = {
    "along": (cylinder_along, (0, 0, -1)),
    "across": (cylinder_across, (-1, 0, 0)),
    "sphere": (sphere, (-1, 0, -1)),
    "saddle": (saddle, (1, 0, -1)),
    "helix": (helix, (-0.5, 0.5, -0.5)),
}
"""Maps, and their curvature along, twist and curvature across at radius 1."""


def scan(place, radius, seed=0, length=70.0, half=14.0, n=12000, noise=NOISE, section=None):
    """Points (n, 3) on a ridge of height H and width W between s = -length / 2 and length / 2."""
    random = np.random.default_rng(seed)
    s, y = random.uniform(-0.5 * length - 10, 0.5 * length + 10, n), random.uniform(-half, half, n)
    z = np.where(np.abs(s) < 0.5 * length, H * (section or bell())(y / W), 0.0)
    return place(s, y, z, radius) + random.normal(0, noise, (n, 3))


@lru_cache(maxsize=16)
def registered(name, rate, seed=0) -> rf.Ridge:
    place = BASES[name][0] if name in BASES else plane
    return rf.register(scan(place, rate * W, seed), at=(0.0, 0.0, H))


def errors(ridge):
    """Errors of h and w where the ridge's ends are one width away, in parts, and over their deviations."""
    inner = (ridge.arc_length > W) & (ridge.arc_length < ridge.length - W)
    h, w = (ridge.height - H)[inner], (ridge.half_height_width / bell().half_height_width - W)[inner]
    return h / H, w / W, h / ridge.height_std[inner], w / ridge.width_std[inner]


# Seen as flat


@pytest.mark.parametrize("name", BASES)
@pytest.mark.parametrize("side", [1, -1], ids=["outside", "inside"])
def test_points_on_a_curved_base_are_seen_as_if_it_was_flat(name, side):
    place, terms = BASES[name]
    x, y, z = flat = np.random.default_rng(1).uniform([-4, -8, -1], [4, 8, 3], (400, 3)).T
    for rate, off in ((10, 1e-4), (5, 6e-4), (3, 3e-3)):
        points = place(x, side * y, side * z, rate * W) * [1, side, side]
        found = flattened(points, side * np.array(terms) * [1, side, 1] / (rate * W))
        assert np.abs(found - flat.T).max() < off * W


def test_a_flat_base_changes_nothing():
    points = np.random.default_rng(2).normal(0, 5, (50, 3))
    np.testing.assert_array_equal(flattened(points, np.zeros(3)), points)
    np.testing.assert_array_equal(on_base(points, np.zeros(3)), points)


def test_there_and_back():
    flat = np.random.default_rng(3).uniform([-4, -6, -1], [4, 6, 3], (200, 3))
    np.testing.assert_allclose(flattened(on_base(flat, MIXED), MIXED), flat, atol=1e-6)


def test_heights_are_distances_from_the_base():
    """Against a search for the nearest point of the base."""
    terms = np.array([-0.03, 0.01, 0.04])

    def base(x, y):
        a, b = terms[0] * x + terms[1] * y, terms[1] * x + terms[2] * y
        return np.array([x, y, 0.5 * (a * x + b * y) * (1 + 0.25 * (a * a + b * b))])

    for point in np.random.default_rng(4).uniform([-4, -6, -1], [4, 6, 3], (12, 3)):
        nearest = least_squares(lambda q, p=point: base(*q) - p, point[:2], xtol=1e-12)
        assert abs(flattened(point[None], terms)[0, 2]) == pytest.approx(
            np.linalg.norm(nearest.fun), rel=5e-3, abs=1e-3
        )


def test_what_stands_on_a_base_has_its_normal():
    place, axes = standing(np.array([2.0, -3.0, 0.0]), np.eye(3), MIXED)
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    step = 1e-4
    around = on_base(np.array([2.0, -3.0, 0.0]) + step * np.eye(3)[[0, 1]], MIXED) - place
    assert np.abs(around @ axes[:, 2]).max() < 1e-2 * step
    above = on_base(np.array([[2.0, -3.0, 1.0]]), MIXED)[0]
    np.testing.assert_allclose(above - place, axes[:, 2], atol=1e-9)


# Found


def window(terms=(0, 0, 0), seed=0, n=1500, noise=NOISE, section=None, half=(4, 8)):
    """Points in the frame of a template that stands right on a base with such terms."""
    random = np.random.default_rng(seed)
    x, y = random.uniform(-1, 1, (n, 2)).T * np.reshape(half, (2, 1))
    flat = np.column_stack([x, y, H * (section or bell())(y / W)])
    return on_base(flat, np.array(terms, dtype=float)) + random.normal(0, noise, (n, 3))


def asked(points, height=H, width=W, section=None, loss=TUKEY):
    return found_terms(points, height, width, NO_TREND, (section or bell()).table, 1e-9, *loss)


def oracle_rows(points, section):
    """Derivatives of the residual by terms of the base, by differences of points flattened by them."""
    step = 1e-6
    rows = [
        (residual(flattened(points, d), H, W, NO_TREND, section) - residual(points, H, W, NO_TREND, section))
        / step
        for d in step * np.eye(3)
    ]
    return np.array(rows).T


def test_found_terms_are_those_of_plain_least_squares():
    """Without noise in height over the base but what the terms make, and all parameters by differences."""
    points = window(noise=0.0, n=600)
    eta = points[:, 1] / W
    slope = H * section_values(bell(), eta, 1) / W
    length = np.sqrt(1 + slope**2)
    x, y, z = points.T
    r_y, r_z = -slope / length, 1 / length
    bump = (1 - np.minimum(4 * eta * eta, 1)) ** 2 / length
    placed = [-r_y, -r_z, r_y * z - r_z * y, r_z * x, -r_y * x]
    shape = [bump * (4 * eta * eta) ** k for k in range(4)]
    rows = np.column_stack([*placed, oracle_rows(points, bell()), *shape])
    bent = points + np.random.default_rng(5).normal(0, 0.01, 600)[:, None] * [0, 0, 1]
    r = residual(bent, H, W, NO_TREND, bell())
    fit, *_ = np.linalg.lstsq(rows, -r, rcond=None)
    step, information, _ = asked(bent, loss=(LOSSES["square"], 5.0))
    np.testing.assert_allclose(step, fit[5:8], atol=2e-2 * np.abs(fit[5:8]).max())
    spread = np.linalg.inv(rows.T @ rows)[5:8, 5:8]
    scale = np.linalg.inv(information) / spread
    np.testing.assert_allclose(scale, scale[0, 0], rtol=0.05)


@pytest.mark.parametrize("noise", [0.06, 0.3])
def test_terms_found_are_right_on_average_and_as_far_off_as_they_say(noise):
    """Noise along the normal moves nothing in its own favour, however large."""
    pulls = []
    for seed in range(80):
        step, information, _ = asked(window(seed=seed, noise=noise))
        pulls.append(step * np.diag(np.linalg.inv(information)) ** -0.5)
    assert np.abs(np.mean(pulls, axis=0)).max() < 4 / np.sqrt(80)
    assert 0.75 < np.std(pulls) < 1.15


@pytest.mark.parametrize("terms", [(0.02, 0, 0), (0, 0.01, 0), (0, 0, -0.02), (-0.01, 0.005, 0.01)])
def test_terms_are_found_also_where_outliers_are(terms):
    points = window(terms, n=3000)
    points[:300, 2] = np.random.default_rng(6).uniform(-4, 8, 300)
    for start in (asked(points), asked(flattened(points, np.array(terms)))):
        assert np.isfinite(start[0]).all()
    step, information, _ = asked(flattened(points, np.array(terms)))
    assert step @ information @ step < 20
    np.testing.assert_allclose(asked(points)[0], terms, atol=1.5e-3)


def test_a_wrong_section_is_not_taken_for_a_curved_base():
    points = window(section=plateau(), n=4000, noise=0.03)
    step, information, _ = asked(points, width=W * 0.98)
    assert abs(step[2]) < 4 * np.linalg.inv(information)[2, 2] ** 0.5


def test_points_that_do_not_tell_give_no_information():
    whole = window()
    one_flank, no_flank = whole[whole[:, 1] < 0.4 * W], whole[np.abs(whole[:, 1]) < 0.4 * W]
    for points in (window(n=10), window(n=200) * [0, 1, 1], np.empty((0, 3)), one_flank, no_flank):
        step, information, _ = asked(points)
        assert not information.any()
        assert not step.any()


def test_the_effect_of_given_terms_is_what_a_fit_does_with_them():
    """Fit height and width, with terms a little off: they move as the derivatives say."""
    points, off = window(noise=0.0, n=3000), np.array([0.0, 0.0, 1e-4])
    effect = asked(points + np.random.default_rng(7).normal(0, 1e-6, (3000, 3)))[2]

    def r(p):
        turn = Rotation.from_rotvec(p[2:5]).as_matrix()
        return residual((flattened(points, off) - [0, p[0], p[1]]) @ turn, p[5], p[6], NO_TREND, bell())

    fit = least_squares(r, [0, 0, 0, 0, 0, H, W], x_scale=[1, 1, 0.1, 0.1, 0.1, 1, 1]).x
    np.testing.assert_allclose((fit[5:] - [H, W]) / 1e-4, effect[:, 2], rtol=0.03)


# Along the chain


def dense_smoothing(at, found, information, drift):
    """The same by one dense system."""
    n = len(at)
    matrix, right = np.zeros((3 * n, 3 * n)), np.zeros(3 * n)
    for i in range(n):
        matrix[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] += information[i]
        right[3 * i : 3 * i + 3] = information[i] @ found[i]
    for i in range(1, n):
        d = np.zeros((3, 3 * n))
        d[:, 3 * i : 3 * i + 3], d[:, 3 * i - 3 : 3 * i] = np.eye(3), -np.eye(3)
        matrix += d.T @ d / (drift * (at[i] - at[i - 1]))
    return np.linalg.solve(matrix, right).reshape(n, 3), np.diag(np.linalg.inv(matrix)).reshape(n, 3), matrix


def chain_of_terms(n=9, seed=0, wander=0.0):
    random = np.random.default_rng(seed)
    at = np.concatenate([[0.0], np.cumsum(random.uniform(4, 9, n - 1))])
    roots = random.normal(0, 300, (n, 3, 3))
    information = np.einsum("nij,nkj->nik", roots, roots) + 1e4 * np.eye(3)
    truth = np.array([0.01, 0, -0.02]) + wander * np.sin(at / 20)[:, None]
    noise = [np.linalg.cholesky(np.linalg.inv(i)) @ random.normal(0, 1, 3) for i in information]
    return at, truth + noise, information, truth


@pytest.mark.parametrize("drift", [1e-12, 1e-7, 1e-3])
def test_smoothing_is_that_of_one_dense_system(drift):
    at, found, information, _ = chain_of_terms()
    information[3] = 0
    terms, variance, _ = smoothed(at, found, information, drift)
    dense, spread, _ = dense_smoothing(at, found, information, drift)
    np.testing.assert_allclose(terms, dense, rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(variance, spread, rtol=1e-4)


def test_the_likelihood_is_that_of_a_normal_distribution():
    at, found, information, _ = chain_of_terms(wander=0.01)
    values = []
    for drift in (1e-8, 1e-6, 1e-4):
        terms, _, likelihood = smoothed(at, found, information, drift)
        _, _, matrix = dense_smoothing(at, found, information, drift)
        fit = np.einsum("ni,nij,nj", found - terms, information, found - terms)
        walk = (np.diff(terms, axis=0) ** 2 / (drift * np.diff(at))[:, None]).sum()
        ties = 3 * np.log(drift * np.diff(at)).sum()
        values.append(likelihood + 0.5 * (fit + walk + np.linalg.slogdet(matrix)[1] + ties))
    np.testing.assert_allclose(values, values[0], atol=1e-6)


@pytest.mark.parametrize("wander", [0.0, 0.02])
def test_terms_are_smoothed_as_much_as_they_do_not_change(wander):
    """Where they do not, all templates share one mean; where they do, deviations stay honest."""
    pulls, spread = [], []
    for seed in range(20):
        at, found, information, truth = chain_of_terms(20, seed, wander)
        templates = tuple(template_at(H, W, (x, 0, 0)) for x in at)
        fitted = curved(templates, Found(found, information, np.full(20, 1e6)))
        terms, std = np.array([t.base for t in fitted]), np.array([t.base_std for t in fitted])
        pulls.append((terms - truth) / std)
        spread.append(np.ptp(terms, axis=0).max())
    assert np.sqrt(np.mean(np.square(pulls))) < 1.25
    assert (np.median(spread) > 0.01) == (wander > 0)


@pytest.mark.parametrize("points", [40, 1500])
def test_flat_bases_are_taken_for_curved_as_rarely_as_asked(points):
    found = []
    for seed in range(150):
        one = [asked(window(seed=7 * seed + k, n=points)) for k in range(3)]
        whole = Found(np.array([f[0] for f in one]), np.array([f[1] for f in one]), np.full(3, float(points)))
        found.append(whole.significant(0.05))
    assert sum(found) <= 16
    assert not whole.significant(0.5)


# Registered


@pytest.mark.parametrize("name", BASES)
@pytest.mark.parametrize("rate", [10, 3])
def test_height_and_width_are_those_of_the_ridge_whatever_the_base(name, rate):
    ridge = registered(name, rate)
    h, w, h_std, w_std = errors(ridge)
    assert ridge.length == pytest.approx(70.0, abs=0.5)
    assert abs(h.mean()) < 0.004
    assert abs(w.mean()) < 0.006
    assert np.sqrt(np.mean(h_std**2)) < 2
    assert np.sqrt(np.mean(w_std**2)) < 2
    terms = np.median([t.base for t in ridge.templates], axis=0)
    np.testing.assert_allclose(
        terms * rate * W,
        np.array(BASES[name][1]) * [1, np.sign(terms[1]) or 1, 1] * ([1, np.sign(BASES[name][1][1]) or 1, 1]),
        atol=0.1 * rate / 3,
    )


def test_errors_are_as_large_as_their_standard_deviations():
    pulls = [errors(registered("sphere", 5, seed))[2:] for seed in range(20)]
    for values in zip(*pulls, strict=True):
        assert 0.75 < np.sqrt(np.mean(np.concatenate(values) ** 2)) < 1.3


@pytest.mark.parametrize("name", BASES)
def test_the_surface_lies_on_the_curved_base(name):
    """Points beside the feet are no further from it than their noise."""
    points = scan(BASES[name][0], 5 * W)
    ridge = registered(name, 5)
    far = ridge.distance(points)
    away, at = cKDTree(ridge.spine).query(points)
    beside = np.isfinite(far) & (away > 0.6 * W) & (away < 0.9 * W) & (at > 3) & (at < len(ridge.spine) - 4)
    assert beside.sum() > 500
    assert np.sqrt(np.mean(far[beside] ** 2)) < 1.1 * NOISE
    assert abs(far[beside].mean()) < 0.25 * NOISE


def test_a_flat_base_has_no_terms():
    ridge = registered("plane", 1)
    assert not any(t.base.any() or t.base_std.any() for t in ridge.templates)
    assert not ridge.curvature.any()


def test_bases_are_flat_where_that_is_asked():
    points = scan(cylinder_along, 20 * W)
    flat = rf.register(points, at=(0, 0, H), settings=rf.Settings(base_chance=0.5))
    assert not flat.curvature.any()
    assert errors(flat)[0].mean() > 0.02


def test_feet_may_lie_at_different_levels():
    place = Rotation.from_rotvec([0.35, 0, 0])
    ridge = rf.register(place.apply(scan(plane, 1)), at=place.apply([0, 0, H]))
    h, w, *_ = errors(ridge)
    assert abs(h.mean()) < 0.003
    assert abs(w.mean()) < 0.005
    assert not ridge.curvature.any()


@pytest.mark.parametrize("scale", [1.0, 1e3])
def test_the_base_is_the_same_however_the_scan_is_moved_and_scaled(scale):
    ridge, turn = registered("helix", 5), Rotation.from_rotvec([0.4, -1.0, 2.0])
    shift = np.array([5.0, -80.0, 30.0])
    moved = rf.register(
        scale * (turn.apply(scan(helix, 5 * W)) + shift),
        at=scale * (turn.apply([0, 0, H]) + shift),
    )
    np.testing.assert_allclose(moved.curvature * scale, ridge.curvature, atol=1e-5)
    np.testing.assert_allclose(moved.height / scale, ridge.height, rtol=1e-4)
    np.testing.assert_allclose(moved.width / scale, ridge.width, rtol=1e-4)


def test_the_order_of_the_points_does_not_matter():
    points = scan(sphere, 5 * W)
    again = rf.register(points[np.random.default_rng(8).permutation(len(points))], at=(0, 0, H))
    for name in ("height", "width", "height_std", "curvature", "spine"):
        assert getattr(again, name).tobytes() == getattr(registered("sphere", 5), name).tobytes()


def test_a_march_lays_its_next_template_on_the_base():
    radius = 4 * W
    last = template_at(H, W, base=np.array([-1 / radius, 0.0, 0.0]))
    start = append([last], rf.Settings())[0]
    turn = start.rotation[:, 2]
    assert np.degrees(np.arctan2(turn[0], turn[2])) == pytest.approx(np.degrees(8 / radius), abs=0.2)
    assert np.linalg.norm(start.position - np.array([0, 0, -radius])) == pytest.approx(radius, rel=1e-3)


# Kept


def test_a_resized_ridge_keeps_its_base():
    ridge = registered("along", 5)
    taller = ridge.resized(h=2.0, w=0.7)
    np.testing.assert_array_equal(taller.curvature, ridge.curvature)
    s = np.linspace(0, ridge.length, 30)
    border, taller_border = (r.surface()(s, r.surface().domain[1][0]) for r in (ridge, taller))
    np.testing.assert_allclose(taller_border, border, atol=1e-4)


@pytest.mark.parametrize("fit", ["length", "scale"])
def test_a_stretched_ridge_stands_on_a_base_as_much_flatter(fit):
    ridge = registered("sphere", 5)
    np.testing.assert_allclose(ridge.stretched(140.0, fit).curvature * 140.0, ridge.curvature * ridge.length)


def test_a_trimmed_ridge_keeps_its_base():
    ridge = registered("sphere", 5)
    np.testing.assert_allclose(ridge.stretched(30.0, "trim").curvature, -1 / (5 * W), rtol=0.15)


def test_the_base_is_saved_and_loaded(tmp_path):
    ridge = registered("saddle", 5)
    ridge.save(tmp_path / "saddle.ridge.json")
    loaded = rf.load(tmp_path / "saddle.ridge.json")
    assert loaded.curvature.tobytes() == ridge.curvature.tobytes()
    assert loaded.surface().poles.tobytes() == ridge.surface().poles.tobytes()
    for a, b in zip(loaded.templates, ridge.templates, strict=True):
        np.testing.assert_array_equal(a.base, b.base)
        np.testing.assert_array_equal(a.base_std, b.base_std)


def test_a_flat_ridge_is_saved_without_a_base_and_an_older_file_loads():
    document = json.loads(json.dumps(to_document(registered("plane", 1))))
    assert document["version"] == 1
    assert "curvature" not in document["stations"]
    assert not {"base", "base_std"} & set(document["templates"][0])
    loaded = from_document(document)
    assert not loaded.curvature.any()
    assert not loaded.templates[0].base.any()


def test_a_base_of_the_wrong_shape_is_refused():
    document = to_document(registered("saddle", 5))
    assert document["version"] == 2
    document["templates"][0]["base"] = [1.0, 2.0]
    with pytest.raises(ValueError, match=r"template's base of shape \(3,\).*got \(2,\).*save"):
        from_document(document)


def test_a_chance_of_next_to_none_still_tells_a_flat_base():
    random = np.random.default_rng(2)
    x, y = random.uniform(0, 60, 4000), random.uniform(-12, 12, 4000)
    points = np.column_stack([x, y, H * bell()(y / W) + NOISE * random.normal(size=4000)])
    ridge = rf.register(points, at=(30.0, 0.0, H), settings=rf.Settings(base_chance=1e-40))
    assert not ridge.curvature.any()
    assert np.median(ridge.height) == pytest.approx(H, rel=0.02)
