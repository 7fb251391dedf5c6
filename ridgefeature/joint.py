"""The joint refit: path, base, height and width along the whole ridge together, against all of its points."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ridgefeature.grid import Grid, points_in_box
from ridgefeature.improve import loss_of
from ridgefeature.kernels.strip import A, B, C, E, H, TERMS, W, information, mixture, offsets, rectified
from ridgefeature.section import Section
from ridgefeature.settings import Settings
from ridgefeature.smoothing import Smooth, basis_at, smoothest
from ridgefeature.stations import Stations
from ridgefeature.merge import along

Array = NDArray[np.float64]

_NODES_A_WIDTH = 10
_KNOTS_A_WIDTH = 2.0
_STRETCH = 8
"""Nodes of which the points are looked up together."""
_ROUNDS = 3
_PATHS = 2


@dataclass(frozen=True, eq=False)
class Reference:
    """The path that coordinates are measured from, at nodes (n, ...) evenly spaced in local widths."""

    at: Array
    """(n,) arc length."""
    knots: Array
    """(n,) place among the splines' knots, from 0."""
    origin: Array
    tangent: Array
    left: Array
    normal: Array
    curvature: Array
    height: Array
    width: Array


def unit(x: Array) -> Array:
    return x / np.linalg.norm(x, axis=1, keepdims=True)


def reference(stations: Stations) -> Reference:
    s, w = stations.arc_length, stations.width
    fine = np.linspace(0.0, s[-1], 20 * len(s))
    local = np.interp(fine, s, w)
    widths = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(fine) * (1 / local[1:] + 1 / local[:-1]))])
    count = max(int(np.ceil(_NODES_A_WIDTH * widths[-1])), 16) + 1
    even = np.linspace(0.0, widths[-1], count)
    at = np.interp(even, widths, fine)
    spans = max(int(np.ceil(_KNOTS_A_WIDTH * widths[-1])), 4)
    place = even / widths[-1] * spans
    spread = along(s, np.eye(len(s)), at)
    def of(x): return spread @ x
    tangent = unit(along(s, stations.spine, at, derivative=1))
    normal = of(stations.normal)
    normal = unit(normal - tangent * (normal * tangent).sum(1, keepdims=True))
    return Reference(at, place, of(stations.spine), tangent, np.cross(normal, tangent), normal, of(stations.curvature), of(stations.height), np.maximum(of(stations.width), 0.3 * w.min()))


def strip(grid: Grid, ref: Reference, flank: float) -> Array:
    """Coordinates (m, 3) of the points along the path; s in nodes."""
    parts = []
    n = len(ref.at)
    reach = (0.5 + flank) * ref.width
    tall = 2.0 * np.abs(ref.height) + 0.25 * ref.width
    low, high = -tall, tall
    for i in range(0, n - 1, _STRETCH):
        own = slice(i, min(i + _STRETCH + 1, n))
        mid = (i + own.stop - 1) // 2
        axes = np.stack([ref.tangent[mid], ref.left[mid], ref.normal[mid]])
        local = (ref.origin[own] - ref.origin[mid]) @ axes.T
        t, l, m = ref.tangent[own] @ axes.T, ref.left[own] @ axes.T, ref.normal[own] @ axes.T
        bend = ref.curvature[own]
        corners = []
        for y in (-1.0, 0.0, 1.0):
            for z in (-1.0, 1.0):
                yy, zz = y * reach[own], z * tall[own]
                rise = 0.5 * bend * yy * yy
                corners.append(local + (yy * (1 - zz * bend))[:, None] * l + (zz + rise)[:, None] * m)
        corners = np.concatenate(corners)
        lo, hi = corners.min(0), corners.max(0)
        centre = 0.5 * (lo + hi)
        found = points_in_box(grid, ref.origin[mid] + centre @ axes, axes, 0.5 * (hi - lo) * 1.01 + 1e-12, check=False)
        parts.append(rectified(found, local - centre, t, l, m, bend, reach[own], low[own], high[own], i))
    return np.concatenate(parts)


@dataclass(frozen=True, eq=False)
class Joint:
    reference: Reference
    smooth: Smooth
    points: Array
    scale: float
    inflation: float
    terms: Array


def _wanted(ref: Reference, n: int) -> Array:
    """What the differences of the coefficients should be so that path and base are smooth with the reference."""
    out = np.zeros((TERMS, n))
    s = ref.at
    def d(x): return np.gradient(x, s, axis=0)
    turn = d(ref.tangent)
    geodesic = d((turn * ref.left).sum(1))
    bow = d((turn * ref.normal).sum(1))
    twist = d(-(d(ref.normal) * ref.left).sum(1))
    step = np.gradient(s, ref.knots)
    for term, order, rate in ((A, 3, bow), (E, 3, geodesic), (B, 2, twist)):
        places = np.arange(n - order) + 0.5 * (order - 3)  # middle of the coefficients that a difference spans
        # coefficient i is centred at i - 1 knots
        mid = np.clip(np.arange(n - order) + 0.5 * order - 1.0, 0, n - 3)
        out[term, : n - order] = -np.interp(mid, ref.knots, rate * step**order)
    g = np.clip(np.arange(n) - 1.0, 0, n - 3)
    half = 0.5 * np.interp(g, ref.knots, ref.curvature)
    out[C, : n - 1] = -np.diff(half)
    return out


def fit(grid: Grid, stations: Stations, section: Section, settings: Settings, flank: float, start=None) -> Joint:
    ref = reference(stations)
    points = strip(grid, ref, flank)
    nodes = len(ref.at)
    n = int(round(ref.knots[-1])) + 3
    terms = np.zeros((nodes, TERMS))
    terms[:, H], terms[:, W] = ref.height, ref.width
    first, basis = basis_at(n, ref.knots)
    middle = 0.5 * (ref.knots[1:] + ref.knots[:-1])
    wanted = _wanted(ref, n)
    loss = loss_of(settings)
    weights = None
    w0, h0 = float(np.median(ref.width)), float(np.median(np.abs(ref.height)))
    inflation = 1.0
    for round_ in range(6):
        r = offsets(points, terms, section.table)
        scale = max(1.4826 * float(np.median(np.abs(r))), 1e-4 * h0)
        scale, share, stray = mixture(r, scale, 0.05, 4 * h0 + 0.5 * w0, 20)
        noise = scale, stray, _evenness(points, terms, section)
        matrix, right, sums = information(points, terms, section.table, *noise)
        gain = sums[3] ** 2 / (sums[2] * sums[1])
        at = 0.5 * (terms[1:] + terms[:-1])
        if weights is None:
            sizes = np.array([h0, h0 / w0, h0 / w0**2, w0, h0, w0])
            weights = (0.02 * sizes) ** -2.0
        smooth = smoothest(gain / inflation * matrix, gain / inflation * right, at, middle, n, wanted, weights)
        weights = smooth.weights
        new = (basis[:, :, None] * smooth.coefficients[first[:, None] + np.arange(4)]).sum(1)
        new[:, W] = np.clip(new[:, W], 0.5 * ref.width, 2 * ref.width)
        change = np.abs(new - terms).max(0)
        terms = new
        if round_ >= 2:
            inflation = _inflation(points, terms, section, noise, gain)
    return Joint(ref, smooth, points, scale, inflation, terms)


def _evenness(points, terms, section):
    """0 where points are spread evenly over the base, 1 where evenly over the surface, flanks too."""
    h, w = np.median(np.abs(terms[:, H])), np.median(terms[:, W])
    def q(eta): return np.sqrt(1 + (h / w * section(eta, 1)) ** 2)
    local = w * points[:, 1] / np.interp(points[:, 0], np.arange(len(terms)), terms[:, W]) / w
    local = local[np.abs(local) < 0.5]
    eta = np.linspace(-0.5, 0.5, 201)
    on_base, on_surface = (1 / q(eta)).mean(), 1 / q(eta).mean()
    return float(np.clip((on_base - (1 / q(local)).mean()) / (on_base - on_surface), 0, 1)) if on_base > on_surface else 0.0


def _inflation(points, terms, section, noise, gain, nodes=5):
    matrix, right, sums = information(points, terms, section.table, *noise)
    k = len(matrix) // nodes * nodes
    m = matrix[:k].reshape(-1, nodes, TERMS, TERMS).sum(1) * gain
    r = right[:k].reshape(-1, nodes, TERMS).sum(1) * gain
    q = []
    for a, b in zip(m, r):
        d = np.sqrt(np.diag(a))
        if not (d > 0).all(): continue
        q.append(b @ np.linalg.lstsq(a, b, rcond=1e-9)[0] / TERMS)
    return max(1.0, float(np.median(q)) / 0.89) if q else 1.0
