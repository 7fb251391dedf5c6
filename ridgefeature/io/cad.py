"""CAD shapes, through OCCT: .step, .iges and .brep."""

import re
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ridgefeature.io.problems import BadFile, require_text
from ridgefeature.io.sampling import areas, blend, spread

Array = NDArray[np.float64]

# Triangles only place the samples on the exact faces, so they may be coarse.
_CHORD = 1e-3  # of the bounding box's diagonal
_ANGLE = 0.2


@dataclass(frozen=True)
class Face:
    """One face: corners (m, 3, 3) of its triangles, their surface parameters (m, 3, 2), if it has any,
    and the surface as a function (k, 2) -> (k, 3)."""

    corners: Array
    parameters: Array | None
    surface: Callable[[Array], Array]


@dataclass(frozen=True)
class Shape:
    """The faces of a CAD shape, in mm."""

    faces: list[Face]

    def sample(self, n: int) -> Array:
        """n points on the exact faces, evenly by area: (n, 3)."""
        which, weights = spread(areas(np.concatenate([face.corners for face in self.faces])), n)
        ends = np.cumsum([len(face.corners) for face in self.faces])
        cuts = np.searchsorted(which, [0, *ends])
        points = np.empty((n, 3))
        for face, low, high, start in zip(self.faces, cuts, cuts[1:], [0, *ends], strict=False):
            part = slice(low, high)
            corners = face.corners if face.parameters is None else face.parameters
            places = blend(corners[which[part] - start], weights[part])
            points[part] = places if face.parameters is None else face.surface(places)
        return points

    def vertices(self) -> Array:
        """A CAD shape has no measured vertices: BadFile."""
        raise BadFile("a CAD shape has no measured vertices: leave out vertices=True, set sample=")


def read_step(path: Path) -> Shape:
    """The faces of a STEP file."""
    from OCP.STEPControl import STEPControl_Reader

    require_text(path, "a STEP file")
    if b"END-ISO-10303-21" not in _tail(path):
        raise BadFile("expected a STEP file that ends with END-ISO-10303-21: it is cut off, or not STEP")
    return _transfer(path, STEPControl_Reader)


def read_iges(path: Path) -> Shape:
    """The faces of an IGES file."""
    from OCP.IGESControl import IGESControl_Reader

    require_text(path, "an IGES file")
    # The last line is the terminate section, marked by a T in column 73.
    if not re.search(rb"(^|[\r\n]).{72}T *\d+\s*$", _tail(path)):
        raise BadFile("expected an IGES file that ends with a terminate section: it is cut off, or not IGES")
    return _transfer(path, IGESControl_Reader)


def read_brep(path: Path) -> Shape:
    """The faces of a .brep file as OCCT writes it in text."""
    from OCP.BRep import BRep_Builder
    from OCP.BRepTools import BRepTools
    from OCP.TopoDS import TopoDS_Shape

    _check_brep(path)
    shape = TopoDS_Shape()
    with _quiet():
        read = BRepTools.Read_s(shape, str(path), BRep_Builder())
    if not read or shape.IsNull():
        raise BadFile("expected a BREP file with a shape; OCCT finds none in it")
    return _faces(shape)


def _check_brep(path: Path) -> None:
    """BadFile unless the text is whole: OCCT loops for ever on one that is cut off."""
    require_text(path, "a BREP file")
    data = path.read_bytes()
    head, _, shapes = data.partition(b"\nTShapes ")
    if b"CASCADE Topology V" not in head[:200]:
        raise BadFile("expected a BREP file; it does not start with 'CASCADE Topology'")
    # Each shape's record ends with a star; the last line refers to the outermost one.
    count = re.match(rb"\d+", shapes)
    if not count or shapes.count(b"*") < int(count.group()) or not re.search(rb"[+-]\d+ \d+\s*$", shapes):
        raise BadFile("its list of shapes is incomplete: the file is cut off or damaged")


def _tail(path: Path) -> bytes:
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - 4096))
        return file.read()


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep OCCT's messages off standard output, which belongs to the caller."""
    from OCP.Message import Message, Message_Gravity

    printers = list(Message.DefaultMessenger_s().Printers())
    levels = [printer.GetTraceLevel() for printer in printers]
    for printer in printers:
        printer.SetTraceLevel(Message_Gravity.Message_Fail)
    try:
        yield
    finally:
        for printer, level in zip(printers, levels, strict=True):
            printer.SetTraceLevel(level)


def _transfer(path: Path, reader_type: Callable[[], Any]) -> Shape:
    from OCP.IFSelect import IFSelect_ReturnStatus

    with _quiet():
        reader = reader_type()
        # Going on after a failed read would crash the process.
        if reader.ReadFile(str(path)) != IFSelect_ReturnStatus.IFSelect_RetDone:
            raise BadFile("OCCT cannot read it: the file is damaged, or not what its suffix says")
        reader.TransferRoots()
        shape = reader.OneShape()
    if shape.IsNull():
        raise BadFile("expected a shape; OCCT finds none in it")
    return _faces(shape)


def _faces(shape: Any) -> Shape:
    from OCP.Bnd import Bnd_Box
    from OCP.BRepBndLib import BRepBndLib
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    box = Bnd_Box()
    BRepBndLib.Add_s(shape, box)
    if box.IsVoid():
        raise BadFile("expected faces; the shape is empty")
    with _quiet():
        BRepMesh_IncrementalMesh(shape, _CHORD * np.sqrt(box.SquareExtent()), False, _ANGLE, False)
    faces, left_out = [], 0
    explorer = TopExp_Explorer(shape, TopAbs_ShapeEnum.TopAbs_FACE)
    while explorer.More():
        face = _face(TopoDS.Face_s(explorer.Current()))
        left_out += face is None
        faces += [face] if face else []
        explorer.Next()
    if not faces:
        raise BadFile("expected faces; the shape has none that can be sampled")
    if left_out:
        warnings.warn(f"left out {left_out} faces that OCCT cannot triangulate", UserWarning, stacklevel=2)
    return Shape(faces)


def _face(face: Any) -> Face | None:
    from OCP.BRep import BRep_Tool
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.gp import gp_Pnt
    from OCP.TopLoc import TopLoc_Location

    location = TopLoc_Location()
    mesh = BRep_Tool.Triangulation_s(face, location)
    if mesh is None or not mesh.NbTriangles():
        return None
    move = location.Transformation()
    nodes = range(1, mesh.NbNodes() + 1)
    positions = np.array([mesh.Node(i).Transformed(move).Coord() for i in nodes])
    triangles = np.array([mesh.Triangle(i).Get() for i in range(1, mesh.NbTriangles() + 1)]) - 1
    # A face of triangles only has neither parameters nor a surface.
    if not mesh.HasUVNodes():
        return Face(positions[triangles], None, np.asarray)
    parameters = np.array([mesh.UVNode(i).Coord() for i in nodes])
    adaptor = BRepAdaptor_Surface(face)

    def surface(places: Array) -> Array:
        point = gp_Pnt()
        found = np.empty((len(places), 3))
        for i, (u, v) in enumerate(places.tolist()):
            adaptor.D0(u, v, point)
            found[i] = point.Coord()
        return found

    return Face(positions[triangles], parameters[triangles], surface)
