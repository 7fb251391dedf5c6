"""STEP files that carry their ridge features, in millimetres.

OCP only: without cadquery a command line starts twice as fast.
"""

from __future__ import annotations

import os
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

from OCP.APIHeaderSection import APIHeaderSection_MakeHeader
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.gp import gp_Trsf
from OCP.IFSelect import IFSelect_RetDone
from OCP.STEPCAFControl import STEPCAFControl_Controller, STEPCAFControl_Writer
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Reader
from OCP.StepShape import StepShape_FaceSurface
from OCP.TCollection import TCollection_HAsciiString
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Compound, TopoDS_Shape

from cad_export.carried import attach, faces_of
from cad_export.fold_warning import checked_surface
from cad_export.geometry import RidgeLike, make_face, topods
from cad_export.occt_session import quiet
from cad_export.record import UNMOVED, Carried, record_of
from cad_export.step_document import assembly_document, document, features_of, is_assembly
from cad_export.step_model import add_properties, name_faces, name_products, named
from cad_export.step_properties import items, records_in
from cad_export.step_text import directives
from ridgefeature.bspline import Surface
from ridgefeature.io.target import naming
from ridgefeature.ridge import Ridge

SCHEMAS = {
    "AP203": "AP203",
    "AP214": "AP214IS",
    "AP214IS": "AP214IS",
    "AP242": "AP242DIS",
    "AP242DIS": "AP242DIS",
}
"""Names that `step` takes, and OCCT's name for each."""


def step(
    ridge_or_shape: Any, path: str | os.PathLike[str], schema: str = "AP242DIS", h: float = 1, w: float = 1
) -> Path:
    """Write a STEP file in millimetres and return its path.

    Takes a Ridge: its exact face at rates h and w, scaled from its unit to millimetres. Or, in millimetres,
    a Surface, a cq.Shape, a Workplane, an Assembly or anything whose `.wrapped` is a TopoDS_Shape.
    Products bear the file's name; an Assembly keeps its own names, colours, parts and places. Ridge faces are
    named "ridge", "ridge 2", ... or as they were pasted, and coloured where their part has no colour. Every
    feature that the shape carries (`carried_by`) goes with it as a user property, for `load` to get back.
    The schema is one of SCHEMAS. OCCT writes 13 digits. The file is written beside the path and renamed, so
    it is never half there. Warns where a ridge's surface folds over itself.
    Raises ValueError for an unknown schema or suffix or something that is no shape, OSError when the file
    cannot be written.
    """
    target = Path(path)
    if target.suffix.lower() not in (".step", ".stp"):
        raise ValueError(f"expected a file name that ends in .step or .stp, got {target.name!r}; rename it")
    if not isinstance(schema, str) or schema.upper() not in SCHEMAS:
        raise ValueError(f"expected a schema of {', '.join(SCHEMAS)}, got {schema!r}; choose one")
    # an assembly keeps its structure; at rates it is refused as any other shape
    whole = is_assembly(ridge_or_shape) and h == 1 and w == 1
    source = ridge_or_shape if whole else shape_in_mm(ridge_or_shape, h, w)
    if not target.parent.is_dir():
        raise FileNotFoundError(f"expected a folder to write to, got {str(target.parent)!r}; create it first")
    beside = target.with_name(f".{target.stem}.{os.getpid()}-{threading.get_ident()}.step")
    with naming(target):
        try:
            beside.touch()  # OCCT says only that it failed; this says why
            _write(source, beside, SCHEMAS[schema.upper()], target.stem)
            os.replace(beside, target)
        finally:
            beside.unlink(missing_ok=True)
    return target


def read_step(path: str | os.PathLike[str]) -> TopoDS_Shape:
    """The shape in a STEP file, in millimetres; several are one compound. Its faces carry their features.

    Raises OSError when the file cannot be read; ValueError when it is cut off, holds no shape, or when a
    feature in it is damaged.
    """
    source = Path(path)
    records = {record.name: record for record in records_in(source)}
    with quiet({"xstep.cascade.unit": "MM"}):
        reader = STEPControl_Reader()
        if reader.ReadFile(str(source)) != IFSelect_RetDone:  # going on would crash the process
            raise ValueError(f"expected a STEP file, OCCT cannot read {source.name!r}; export it again")
        reader.TransferRoots()
        shape = reader.OneShape()
    if shape.IsNull():
        raise ValueError(f"expected a shape in the STEP file, got none in {source.name!r}; export it again")
    _attach_by_name(shape, records, reader.WS().TransferReader())
    return shape


def _attach_by_name(shape: TopoDS_Shape, records: dict[str, Carried], transfer: Any) -> None:
    """Give faces their records back: the name is that of the STEP entity that a face came from."""
    done: list[Any] = []
    for face in faces_of(shape) if records else []:
        entity = transfer.EntityFromShapeResult(face, 1)
        if entity is None:  # of an instance, which is known where its part is
            entity = transfer.EntityFromShapeResult(face.Located(TopLoc_Location()), 1)
        if not isinstance(entity, StepShape_FaceSurface) or entity.Name() is None:
            continue
        record, surface = records.get(entity.Name().ToCString()), BRep_Tool.Surface_s(face, TopLoc_Location())
        # the first of several instances: the others follow by their locations
        if record is not None and not any(surface is other for other in done):
            attach(face, record)
            done.append(surface)


def shape_in_mm(source: Any, h: float = 1, w: float = 1) -> TopoDS_Shape:
    """The shape of anything that `step` takes, in millimetres; a Ridge's face carries its feature."""
    if isinstance(source, (Surface, RidgeLike)):
        surface = checked_surface(source, h, w)
        factor = _mm(getattr(source, "unit", "mm"))
        face = make_face(surface if factor == 1 else replace(surface, poles=surface.poles * factor))
        attach(face, record_of(source, h, w))
        return face
    if h != 1 or w != 1:
        raise ValueError(
            f"expected a Ridge for rates h={h:g}, w={w:g}, got {type(source).__name__}; leave both 1"
        )
    if is_assembly(source):
        return topods(source.toCompound())
    if not hasattr(source, "vals"):
        return topods(source)
    shapes = [topods(value) for value in source.vals()]  # a cq.Workplane
    if not shapes:
        raise ValueError(
            "expected a Workplane with a shape on its stack, got an empty one; make a shape first"
        )
    return shapes[0] if len(shapes) == 1 else _compound(shapes)


def moved_face(ridge: Ridge, record: Carried, h: float, w: float) -> TopoDS_Shape:
    """The ridge's face in millimetres at rates h and w, where the record's motion puts it."""
    face, move = shape_in_mm(ridge, h, w), gp_Trsf()
    if record.motion == UNMOVED:
        return face
    move.SetValues(*(x for row in record.motion for x in row))
    return face.Moved(TopLoc_Location(move))


def _compound(shapes: list[TopoDS_Shape]) -> TopoDS_Shape:
    compound, builder = TopoDS_Compound(), BRep_Builder()
    builder.MakeCompound(compound)
    for shape in shapes:
        builder.Add(compound, shape)
    return compound


def _write(source: Any, path: Path, schema: str, name: str) -> None:
    """Write a TopoDS_Shape, or an Assembly with its structure."""
    text, whole = directives(name), is_assembly(source)
    settings = {
        "write.step.schema": schema,
        "write.step.unit": "MM",
        "xstep.cascade.unit": "MM",
        "write.stepcaf.subshapes.name": "On" if whole else "Off",
    }
    STEPCAFControl_Controller.Init_s()  # defines the last of them
    with quiet(settings):
        made = assembly_document(source) if whole else document(source, text)
        features = named(features_of(made))
        writer = STEPCAFControl_Writer()
        if not writer.Transfer(made, STEPControl_AsIs):
            raise ValueError(
                "expected a shape that STEP can hold, OCCT cannot translate it; check that it is valid"
            )
        inner = writer.ChangeWriter()
        model = inner.Model()
        name_products(model, None if whole else text)
        name_faces(inner.WS().TransferWriter().FinderProcess(), features)
        # faces of one feature, which was cut in two, have one record
        records = list({record.name: record for _, record in features}.values())
        if records:
            add_properties(model, items(records))
        header = APIHeaderSection_MakeHeader(model)
        header.SetName(TCollection_HAsciiString(text))
        header.SetOriginatingSystem(TCollection_HAsciiString("ridgefeature"))
        if writer.Write(str(path)) != IFSelect_RetDone:
            raise OSError(f"OCCT could not write {path.name!r}; check the space left on the disk")


def _mm(unit: str) -> float:
    """Millimetres in one unit."""
    if unit == "mm":
        return 1.0
    from ridgefeature.scan import millimetres_per  # brings compiled code, which most exports do without

    return millimetres_per(unit)
