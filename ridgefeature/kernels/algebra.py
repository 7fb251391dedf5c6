"""Small dense algebra and rotations for one template: no LAPACK call, so nothing is loaded for it."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@njit(cache=True)
def copy_into(target: Floats, values: Floats) -> None:
    """Write values (n,) over target (n,): numba takes seconds to compile the assignment of a slice."""
    for i in range(target.shape[0]):
        target[i] = values[i]


@njit(cache=True)
def cholesky_in_place(a: Floats) -> bool:
    """Lower Cholesky factor in the lower triangle of a (n, n); False where a is not positive definite."""
    n = a.shape[0]
    for j in range(n):
        d = a[j, j]
        least = 1e-14 * d
        for k in range(j):
            d -= a[j, k] * a[j, k]
        if not d > least:
            return False
        a[j, j] = math.sqrt(d)
        for i in range(j + 1, n):
            s = a[i, j]
            for k in range(j):
                s -= a[i, k] * a[j, k]
            a[i, j] = s / a[j, j]
    return True


@njit(cache=True)
def solve_in_place(a: Floats, b: Floats) -> bool:
    """Solve a x = b for symmetric positive definite a (lower triangle read, overwritten); x replaces b."""
    if not cholesky_in_place(a):
        return False
    n = b.size
    for i in range(n):
        for k in range(i):
            b[i] -= a[i, k] * b[k]
        b[i] /= a[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            b[i] -= a[k, i] * b[k]
        b[i] /= a[i, i]
    return True


@njit(cache=True)
def whitening(normal: Floats) -> Floats:
    """(8, 7) transform whose Hessian is near unity, height and width each an axis of their own.

    The first parameter (sliding) stays fixed. The other five placements are whitened by the Cholesky factor
    of their block and follow height and width along the valley floor, so that bounds on height and width stay
    simple bounds. normal (8, 8) of the mean loss.
    """
    lower = normal[1:, 1:].copy()
    for i in range(7):
        # Relative to each parameter's own unit, so that scaling the scan changes nothing.
        lower[i, i] += 1e-9 * lower[i, i] + 1e-300
    transform = np.zeros((8, 7))
    if not cholesky_in_place(lower):
        for i in range(7):
            transform[i + 1, i] = 1.0 / math.sqrt(normal[i + 1, i + 1] + 1e-300)
        return transform
    for j in range(5):
        for i in range(j, -1, -1):
            s = 1.0 if i == j else 0.0
            for k in range(i + 1, j + 1):
                s -= lower[k, i] * transform[k + 1, j]
            transform[i + 1, j] = s / lower[i, i]
    for column in range(5, 7):
        own = lower[column, column] ** 2
        if column == 6:
            own += lower[6, 5] ** 2
        step = 1.0 / math.sqrt(own)
        for i in range(4, -1, -1):
            s = -lower[column, i] * step
            for k in range(i + 1, 5):
                s -= lower[k, i] * transform[k + 1, column]
            transform[i + 1, column] = s / lower[i, i]
        transform[column + 1, column] = step
    return transform


@njit(cache=True)
def moved(
    position: Floats, rotation: Floats, height: float, width: float, transform: Floats, q: Floats
) -> tuple[Floats, Floats, float, float]:
    """Position (3,), rotation (3, 3), height and width, changed by transform @ q in their own frame."""
    p = np.zeros(8)
    p[6], p[7] = height, width
    for i in range(8):
        for j in range(q.size):
            p[i] += transform[i, j] * q[j]
    turn, _ = rotation_of(p[3:6])
    turned_axes = np.zeros((3, 3))
    place = position.copy()
    for i in range(3):
        for j in range(3):
            place[i] += rotation[i, j] * p[j]
            for k in range(3):
                turned_axes[i, j] += rotation[i, k] * turn[k, j]
    return place, orthonormal(turned_axes), p[6], p[7]


@njit(cache=True)
def orthonormal(axes: Floats) -> Floats:
    """Axes (3, 3), columns, made orthonormal (Gram and Schmidt).

    Errors of rounding double with each frame that is told from the last one's transpose: at the end of a long
    chain of them nothing else would be left.
    """
    out = np.empty((3, 3))
    for j in range(3):
        column = axes[:, j].copy()
        for k in range(j):
            dot = column[0] * out[0, k] + column[1] * out[1, k] + column[2] * out[2, k]
            for i in range(3):
                column[i] -= dot * out[i, k]
        size = math.sqrt(column[0] ** 2 + column[1] ** 2 + column[2] ** 2)
        for i in range(3):
            out[i, j] = column[i] / size
    return out


@njit(cache=True)
def rotation_of(vector: Floats) -> tuple[Floats, Floats]:
    """Rotation matrix (columns: new axes in the old frame) and right Jacobian of a rotation vector."""
    x, y, z = vector[0], vector[1], vector[2]
    square = x * x + y * y + z * z
    angle = math.sqrt(square)
    if angle < 1e-4:
        a = 1.0 - square / 6.0
        b = 0.5 - square / 24.0
        c = 1.0 / 6.0 - square / 120.0
    else:
        a = math.sin(angle) / angle
        b = (1.0 - math.cos(angle)) / square
        c = (1.0 - a) / square
    rotation, jacobian = np.empty((3, 3)), np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            # The square of the skew matrix is v v' - |v|^2 I.
            outer = vector[i] * vector[j] - (square if i == j else 0.0)
            one = 1.0 if i == j else 0.0
            rotation[i, j] = one + b * outer
            jacobian[i, j] = one + c * outer
    for i, j, v in ((1, 0, z), (0, 2, y), (2, 1, x)):
        rotation[i, j] += a * v
        rotation[j, i] -= a * v
        jacobian[i, j] -= b * v
        jacobian[j, i] += b * v
    return rotation, jacobian


@njit(cache=True)
def turned(direction: Floats, normal: Floats, angle: float) -> Floats:
    """A direction (3,) turned about the unit normal (Rodrigues)."""
    cosine, sine = math.cos(angle), math.sin(angle)
    along = (1.0 - cosine) * (normal[0] * direction[0] + normal[1] * direction[1] + normal[2] * direction[2])
    return cosine * direction + sine * cross(normal, direction) + along * normal


@njit(cache=True)
def facing(normal: Floats, direction: Floats) -> Floats:
    """The frame (columns) with this unit normal that faces along the direction, as far as the base allows."""
    x = direction - normal * (normal[0] * direction[0] + normal[1] * direction[1] + normal[2] * direction[2])
    x /= math.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
    out = np.empty((3, 3))
    copy_into(out[:, 0], x)
    copy_into(out[:, 1], cross(normal, x))
    copy_into(out[:, 2], normal)
    return out


@njit(cache=True)
def walk(
    joint: Floats, normal: Floats, direction: Floats, bend: float, first: float, second: float
) -> tuple[Floats, Floats]:
    """Position and frame of a straight patch of half length `second` that begins at the joint.

    direction: that of the path half a patch, `first`, before the joint; the path bends by `bend` per length
    about the normal, but by no more than a radian from patch to patch.
    """
    angle = max(-1.0, min(1.0, (first + second) * bend))
    frame = facing(normal, turned(direction, normal, angle))
    return joint + second * frame[:, 0], frame


@njit(cache=True)
def cross(a: Floats, b: Floats) -> Floats:
    """Vector product of a (3,) and b (3,)."""
    out = np.empty(3)
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]
    return out
