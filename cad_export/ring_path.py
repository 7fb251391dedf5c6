"""The path of a ring that is developed onto a face: closed where its ends meet there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cad_export.face_path import FacePath
from cad_export.host_surface import Host

_MEETS = 2e-3
"""Distance of the ends, in widths, up to which they meet but for errors of the ridge's curvature."""
_STRAIGHT_ON = 1e-2
"""The same for their directions, in radians."""


def closed_path(host: Host, path: FacePath, width: float) -> FacePath:
    """The path closed, its gap spread evenly along it, where its ends meet; else as it is.

    On a plane those of a ring do, but for the error of curvatures known at stations; on a curved face they
    need not. width: of the ridge.
    """
    gap, twist = path.x[-1] - path.x[0], path.rate[-1] - path.rate[0]
    _, pu, pv = host.jet(path.x[:1, 0], path.x[:1, 1], 1)[:3]
    to_space = np.stack([pu[0], pv[0]])
    if np.linalg.norm(gap @ to_space) > _MEETS * width or np.linalg.norm(twist @ to_space) > _STRAIGHT_ON:
        return path
    share = (path.s / path.length - 0.5)[:, None]
    x, rate = path.x - share * gap, path.rate - gap / path.length - share * twist
    x[-1], rate[-1] = x[0], rate[0]
    return replace(path, x=x, rate=rate, closed=True)
