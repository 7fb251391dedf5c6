"""STEP files, in millimetres. OCP only: without cadquery a command line starts twice as fast."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from OCP.APIHeaderSection import APIHeaderSection_MakeHeader
from OCP.BRep import BRep_Builder
from OCP.IFSelect import IFSelect_RetDone
from OCP.Interface import Interface_Static
from OCP.Message import Message
from OCP.StepBasic import StepBasic_Product
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Controller, STEPControl_Reader, STEPControl_Writer
from OCP.TCollection import TCollection_HAsciiString
from OCP.TopoDS import TopoDS_Compound, TopoDS_Shape

from cad_export.geometry import RidgeLike, make_face, surface_for, topods
from ridgefeature.bspline import Surface

SCHEMAS = {
    "AP203": "AP203",
    "AP214": "AP214IS",
    "AP214IS": "AP214IS",
    "AP242": "AP242DIS",
    "AP242DIS": "AP242DIS",
}
"""Names that `step` takes, and OCCT's name for each."""

_LOCK = threading.Lock()  # OCCT's settings are global


def step(
    ridge_or_shape: Any, path: str | os.PathLike[str], schema: str = "AP242DIS", h: float = 1, w: float = 1
) -> Path:
    """Write a STEP file in millimetres and return its path.

    Takes a Ridge: its exact face at rates h and w, scaled from its unit to millimetres. Or, in millimetres,
    a Surface, a cq.Shape, a Workplane, an Assembly or anything whose `.wrapped` is a TopoDS_Shape.
    The schema is one of SCHEMAS. OCCT writes 13 digits. The file is written beside the path and renamed, so
    it is never half there.
    Raises ValueError for an unknown schema or suffix or something that is no shape, OSError when the file
    cannot be written.
    """
    target = Path(path)
    if target.suffix.lower() not in (".step", ".stp"):
        raise ValueError(f"expected a file name that ends in .step or .stp, got {target.name!r}; rename it")
    if not isinstance(schema, str) or schema.upper() not in SCHEMAS:
        raise ValueError(f"expected a schema of {', '.join(SCHEMAS)}, got {schema!r}; choose one")
    shape = _shape_in_mm(ridge_or_shape, h, w)
    if not target.parent.is_dir():
        raise FileNotFoundError(f"expected a folder to write to, got {str(target.parent)!r}; create it first")
    beside = target.with_name(f".{target.stem}.{os.getpid()}-{threading.get_ident()}.step")
    try:
        beside.touch()  # OCCT says only that it failed; this says why
        _write(shape, beside, SCHEMAS[schema.upper()], target.stem)
        os.replace(beside, target)
    finally:
        beside.unlink(missing_ok=True)
    return target


def read_step(path: str | os.PathLike[str]) -> TopoDS_Shape:
    """The shape in a STEP file, in millimetres; several are one compound.

    Raises OSError when the file cannot be read, ValueError when it holds no shape.
    """
    source = Path(path)
    with source.open("rb"):
        pass
    with _quiet({"xstep.cascade.unit": "MM"}):
        reader = STEPControl_Reader()
        if reader.ReadFile(str(source)) != IFSelect_RetDone:
            raise ValueError(f"expected a STEP file, OCCT cannot read {source.name!r}; export it again")
        reader.TransferRoots()
        shape = reader.OneShape()
    if shape.IsNull():
        raise ValueError(f"expected a shape in the STEP file, got none in {source.name!r}; export it again")
    return shape


def _shape_in_mm(source: Any, h: float, w: float) -> TopoDS_Shape:
    if isinstance(source, (Surface, RidgeLike)):
        surface = surface_for(source, h, w)
        factor = _mm(getattr(source, "unit", "mm"))
        return make_face(surface if factor == 1 else replace(surface, poles=surface.poles * factor))
    if h != 1 or w != 1:
        raise ValueError(
            f"expected a Ridge for rates h={h:g}, w={w:g}, got {type(source).__name__}; leave both 1"
        )
    if hasattr(source, "toCompound"):  # a cq.Assembly
        return topods(source.toCompound())
    if not hasattr(source, "vals"):
        return topods(source)
    shapes = [topods(value) for value in source.vals()]  # a cq.Workplane
    if not shapes:
        raise ValueError(
            "expected a Workplane with a shape on its stack, got an empty one; make a shape first"
        )
    return shapes[0] if len(shapes) == 1 else _compound(shapes)


def _compound(shapes: list[TopoDS_Shape]) -> TopoDS_Shape:
    compound, builder = TopoDS_Compound(), BRep_Builder()
    builder.MakeCompound(compound)
    for shape in shapes:
        builder.Add(compound, shape)
    return compound


def _write(shape: TopoDS_Shape, path: Path, schema: str, name: str) -> None:
    text = name.encode("ascii", "replace").decode()  # OCCT writes names as they are
    settings = {"write.step.schema": schema, "write.step.unit": "MM", "xstep.cascade.unit": "MM"}
    with _quiet(settings):
        writer = STEPControl_Writer()
        if writer.Transfer(shape, STEPControl_AsIs) != IFSelect_RetDone:
            raise ValueError(
                "expected a shape that STEP can hold, OCCT cannot translate it; check that it is valid"
            )
        model = writer.Model()
        _name_products(model, text)
        header = APIHeaderSection_MakeHeader(model)
        header.SetName(TCollection_HAsciiString(text))
        header.SetOriginatingSystem(TCollection_HAsciiString("ridgefeature"))
        if writer.Write(str(path)) != IFSelect_RetDone:
            raise OSError(f"OCCT could not write {path.name!r}; check the space left on the disk")


def _name_products(model: Any, name: str) -> None:
    """Name the products after the file: OCCT numbers them through the session, so no two files are alike."""
    entities = (model.Value(i) for i in range(1, model.NbEntities() + 1))
    products = [entity for entity in entities if isinstance(entity, StepBasic_Product)]
    for n, product in enumerate(products, 1):
        text = TCollection_HAsciiString(name if len(products) == 1 else f"{name} {n}")
        product.SetId(text)
        product.SetName(text)


@contextmanager
def _quiet(settings: dict[str, str]) -> Iterator[None]:
    """OCCT with these settings and without its chatter; both as they were afterwards."""
    with _LOCK:
        STEPControl_Controller.Init_s()  # defines the settings
        before = {key: Interface_Static.CVal_s(key) for key in settings}
        messenger = Message.DefaultMessenger_s()
        printers = list(messenger.Printers())
        try:
            for printer in printers:
                messenger.RemovePrinter(printer)
            for key, value in settings.items():
                if not Interface_Static.SetCVal_s(key, value):
                    raise ValueError(f"OCCT does not take {value!r} for {key}")
            yield
        finally:
            for key, value in before.items():
                Interface_Static.SetCVal_s(key, value)
            for printer in printers:
                messenger.AddPrinter(printer)


def _mm(unit: str) -> float:
    """Millimetres in one unit."""
    if unit == "mm":
        return 1.0
    from ridgefeature.scan import millimetres_per  # brings compiled code, which most exports do without

    return millimetres_per(unit)
