"""A numpy surface as an OCCT surface, fast: OCCT reads the poles from memory. OCP only."""

from __future__ import annotations

from collections import OrderedDict
from io import BytesIO

import numpy as np
from OCP.BinTools import BinTools
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.Geom import Geom_BSplineSurface
from OCP.TopoDS import TopoDS, TopoDS_Face, TopoDS_Shape

from cad_export import occt_arrays
from ridgefeature.bspline import Surface

_Key = tuple[bytes, bytes, int, int]
_FORMS: OrderedDict[_Key, tuple[bytes, bytes] | None] = OrderedDict()
"""What OCCT's binary format has before and after the poles of surfaces with given knots; None: not found."""
_KEPT = 16
_WORTH = 400
"""From so many poles on; setting one from Python takes about a microsecond."""


def to_occt(surface: Surface) -> Geom_BSplineSurface:
    """The same poles and knots as a Geom_BSplineSurface, neither rational nor periodic."""
    poles = np.ascontiguousarray(surface.poles, dtype=np.float64)
    if poles.shape[0] * poles.shape[1] < _WORTH:
        return _pole_by_pole(surface)
    key = surface.knots_u.tobytes(), surface.knots_v.tobytes(), surface.degree_u, surface.degree_v
    if key in _FORMS:
        form = _FORMS[key]
        return _pole_by_pole(surface) if form is None else _read(form[0] + poles.tobytes() + form[1])
    made = _pole_by_pole(surface)
    before, found, after = _written(made).partition(poles.tobytes())
    _FORMS[key] = (before, after) if found else None
    while len(_FORMS) > _KEPT:
        _FORMS.popitem(last=False)
    return made


def _written(geometry: Geom_BSplineSurface) -> bytes:
    """A face on the surface in OCCT's binary format, which holds the poles row by row as doubles."""
    face, out = TopoDS_Face(), BytesIO()
    BRep_Builder().MakeFace(face, geometry, 1e-7)
    BinTools.Write_s(face, out)
    return out.getvalue()


def _read(data: bytes) -> Geom_BSplineSurface:
    shape = TopoDS_Shape()
    BinTools.Read_s(shape, BytesIO(data))
    return BRep_Tool.Surface_s(TopoDS.Face_s(shape))


def _pole_by_pole(surface: Surface) -> Geom_BSplineSurface:
    knots_u, counts_u = occt_arrays.knots(surface.knots_u.tobytes())
    knots_v, counts_v = occt_arrays.knots(surface.knots_v.tobytes())
    return Geom_BSplineSurface(
        occt_arrays.points2(surface.poles),
        knots_u,
        knots_v,
        counts_u,
        counts_v,
        int(surface.degree_u),
        int(surface.degree_v),
    )
