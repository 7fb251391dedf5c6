"""CAD and mesh files by suffix. A new format is one function, and one line in FORMATS."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from OCP.Bnd import Bnd_Box
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.BRepTools import BRepTools
from OCP.IGESControl import IGESControl_Controller, IGESControl_Writer
from OCP.Message import Message_ProgressRange
from OCP.RWGltf import RWGltf_CafWriter
from OCP.RWMesh import RWMesh_CoordinateSystem
from OCP.StlAPI import StlAPI_Writer
from OCP.TCollection import TCollection_AsciiString
from OCP.TColStd import TColStd_IndexedDataMapOfStringString
from OCP.TopoDS import TopoDS_Shape

from cad_export.occt_session import quiet
from cad_export.step_document import document
from cad_export.step_file import shape_in_mm, step
from ridgefeature.io.target import naming
from ridgefeature.ridge import Ridge

_CHORD = 1e-4  # of the diagonal: triangles closer to the surface than a scan's noise
_ANGLE = 0.1


def write(ridge_or_shape: Any, path: str | os.PathLike[str], h: float = 1, w: float = 1) -> Path:
    """Write a CAD or mesh file, as its suffix says, and return its path.

    Takes what `step` takes: a Ridge, its face at rates h and w, from its unit to millimetres; or a shape in
    millimetres. Suffixes: those of FORMATS. All files are in millimetres but glTF, which is in metres with y
    up by its standard. STEP alone carries the feature. An .FCMacro, which makes the ridge in FreeCAD, takes a
    Ridge only. The file is written elsewhere in the folder and renamed.
    Raises ValueError for an unknown suffix or something that is no shape, OSError when it cannot be written.
    """
    target = checked_target(path)
    writer = FORMATS[target.suffix.lower()]
    if writer is step:
        return step(ridge_or_shape, target, h=h, w=w)
    with naming(target):
        beside = tempfile.TemporaryDirectory(dir=target.parent, prefix=f".{target.stem}.")
    with beside as folder:
        made = Path(folder) / target.name
        if writer is _macro:
            _macro(_ridge(ridge_or_shape, h, w), made)
        else:
            writer(shape_in_mm(ridge_or_shape, h, w), made)
        if not made.is_file() or made.stat().st_size == 0:
            raise OSError(f"{target.name}: it could not be written; check the space left on the disk")
        # what the file refers to first, itself last
        for file in sorted(Path(folder).iterdir(), key=lambda file: file == made):
            os.replace(file, target.parent / file.name)
    return target


def checked_target(path: str | os.PathLike[str]) -> Path:
    """The path, which `write` can write to as far as can be told beforehand; raises as `write` does."""
    target = Path(path)
    if target.suffix.lower() not in FORMATS:
        known = " ".join(FORMATS).replace(".fcmacro", ".FCMacro")
        raise ValueError(
            f"{target.name}: expected one of the suffixes {known}; got {target.suffix!r}; choose one"
        )
    if not target.parent.is_dir():
        raise FileNotFoundError(f"{target.parent}: there is no such folder to write to: create it first")
    if target.is_dir():
        raise IsADirectoryError(f"{target}: expected a file to write, this is a folder: remove it")
    return target


def _iges(shape: TopoDS_Shape, path: Path) -> None:
    IGESControl_Controller.Init_s()  # defines the settings
    with quiet({"write.iges.unit": "MM", "xstep.cascade.unit": "MM"}):
        writer = IGESControl_Writer("MM", 1)  # 1: solids and faces as such
        if not writer.AddShape(shape):
            raise ValueError(
                "expected a shape that IGES can hold, OCCT cannot translate it; check that it is valid"
            )
        writer.ComputeModel()
        if not writer.Write(str(path)):
            raise OSError(f"OCCT could not write {path.name!r}; check the space left on the disk")


def _brep(shape: TopoDS_Shape, path: Path) -> None:
    with quiet({}):
        BRepTools.Write_s(shape, str(path))


def _stl(shape: TopoDS_Shape, path: Path) -> None:
    with quiet({}):
        writer = StlAPI_Writer()
        writer.ASCIIMode = False
        writer.Write(_meshed(shape), str(path))


def _3mf(shape: TopoDS_Shape, path: Path) -> None:
    import cadquery as cq
    from cadquery.occ_impl.exporters.threemf import ThreeMFWriter

    with path.open("wb") as file:
        ThreeMFWriter(cq.Shape.cast(shape), _chord(shape), _ANGLE).write3mf(file)


def _gltf(shape: TopoDS_Shape, path: Path) -> None:
    meshed = _meshed(shape)
    with quiet({}):
        writer = RWGltf_CafWriter(TCollection_AsciiString(str(path)), path.suffix.lower() == ".glb")
        converter = writer.ChangeCoordinateSystemConverter()
        converter.SetInputLengthUnit(0.001)
        converter.SetInputCoordinateSystem(RWMesh_CoordinateSystem.RWMesh_CoordinateSystem_Zup)
        writer.Perform(
            document(meshed, path.stem),
            TColStd_IndexedDataMapOfStringString(),
            Message_ProgressRange(),
        )


def _macro(ridge: Any, path: Path) -> None:
    from cad_export import freecad

    freecad.write_macro(ridge, path)


def _ridge(source: Any, h: float, w: float) -> Ridge:
    if not isinstance(source, Ridge):
        raise ValueError(f"expected a Ridge for a FreeCAD macro, got {type(source).__name__}; give the ridge")
    return source if h == 1 and w == 1 else source.resized(h=h, w=w)


def _meshed(shape: TopoDS_Shape) -> TopoDS_Shape:
    """A copy with triangles; the shape itself keeps those that it has. Geometry is shared."""
    copy = BRepBuilderAPI_Copy(shape, False, False).Shape()
    with quiet({}):
        BRepMesh_IncrementalMesh(copy, _chord(shape), False, _ANGLE, False)
    return copy


def _chord(shape: TopoDS_Shape) -> float:
    box = Bnd_Box()
    BRepBndLib.AddOptimal_s(shape, box, False, False)
    if box.IsVoid():
        raise ValueError("expected a shape with faces, got an empty one; make a shape first")
    return float(_CHORD * box.SquareExtent() ** 0.5)


FORMATS: dict[str, Callable[..., Any]] = {
    ".step": step,
    ".stp": step,
    ".iges": _iges,
    ".igs": _iges,
    ".brep": _brep,
    ".stl": _stl,
    ".3mf": _3mf,
    ".glb": _gltf,
    ".gltf": _gltf,
    ".fcmacro": _macro,
}
"""Suffixes that `write` takes, in small letters."""
