"""XCAF documents of shapes and assemblies, and the ridge features in them at their places."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from OCP.Quantity import Quantity_Color, Quantity_TOC_sRGB
from OCP.TCollection import TCollection_ExtendedString
from OCP.TDataStd import TDataStd_Name
from OCP.TDF import TDF_Label
from OCP.TDocStd import TDocStd_Document
from OCP.TopAbs import TopAbs_COMPOUND
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape
from OCP.XCAFDoc import (
    XCAFDoc_ColorCurv,
    XCAFDoc_ColorGen,
    XCAFDoc_ColorSurf,
    XCAFDoc_ColorTool,
    XCAFDoc_DocumentTool,
    XCAFDoc_ShapeTool,
)

from cad_export.carried import carried_by, faces_of
from cad_export.occt_arrays import label_sequence
from cad_export.record import Carried
from cad_export.step_text import directives

COLOUR = Quantity_Color(0.85, 0.45, 0.10, Quantity_TOC_sRGB)
"""Of ridge faces."""


def document(shape: TopoDS_Shape, name: str) -> TDocStd_Document:
    """An XCAF document of one shape, its name, and a colour for ridge faces; a compound is an assembly."""
    made = TDocStd_Document(TCollection_ExtendedString("XmlXCAF"))
    shapes = XCAFDoc_DocumentTool.ShapeTool_s(made.Main())
    top = shapes.AddShape(shape, shape.ShapeType() == TopAbs_COMPOUND)
    TDataStd_Name.Set_s(top, TCollection_ExtendedString(name))
    _colour_ridges(made)
    return made


def is_assembly(source: Any) -> bool:
    """Whether this is a cq.Assembly; told by what it can do, so that cadquery need not be there."""
    return hasattr(source, "toCompound") and hasattr(source, "children")


def assembly_document(assembly: Any) -> TDocStd_Document:
    """An XCAF document of a cq.Assembly as CadQuery's own export makes it, and a colour for ridge faces.

    Parts and faces that the assembly colours keep their colours. Names are as STEP has them in ASCII. Raises
    ValueError for an assembly without a shape.
    """
    from cadquery.occ_impl.assembly import toCAF

    if not faces_of(assembly.toCompound().wrapped):
        raise ValueError("expected an assembly with a shape that has faces, got none; add one first")
    naming = XCAFDoc_ShapeTool.AutoNaming_s()
    try:  # it turns this off for the whole process
        _, made = toCAF(assembly, True, binary=False)
    finally:
        XCAFDoc_ShapeTool.SetAutoNaming_s(naming)
    _name_labels(made)
    _colour_ridges(made)
    return made


def features_of(made: TDocStd_Document) -> list[tuple[TopoDS_Face, Carried]]:
    """The faces of the document's parts that carry a feature, once for every place of the part.

    Faces are in the frame of their part, the records' motions in that of the document.
    """
    shapes = XCAFDoc_DocumentTool.ShapeTool_s(made.Main())
    labels = label_sequence()
    shapes.GetFreeShapes(labels)
    found: list[tuple[TopoDS_Face, Carried]] = []
    for label in _items(labels):
        for part, place in _parts(label, TopLoc_Location()):
            here = carried_by(part)
            # asked again at its place: what has not moved is then told to the last bit
            there = carried_by(part.Moved(place)) if here else []
            found += [(face, record) for (face, _), (_, record) in zip(here, there, strict=True)]
    return found


def _parts(label: TDF_Label, place: TopLoc_Location) -> Iterator[tuple[TopoDS_Shape, TopLoc_Location]]:
    """Shapes of the parts under a label, in their own frames, with their places; in the file's order."""
    if XCAFDoc_ShapeTool.IsReference_s(label):
        yield from _parts(_part_of(label), place.Multiplied(XCAFDoc_ShapeTool.GetLocation_s(label)))
    elif XCAFDoc_ShapeTool.IsAssembly_s(label):
        components = label_sequence()
        XCAFDoc_ShapeTool.GetComponents_s(label, components)
        for component in _items(components):
            yield from _parts(component, place)
    else:
        yield XCAFDoc_ShapeTool.GetShape_s(label), place


def _colour_ridges(made: TDocStd_Document) -> None:
    """Colour the faces that carry a feature, where neither they nor their part have a colour."""
    shapes = XCAFDoc_DocumentTool.ShapeTool_s(made.Main())
    colours = XCAFDoc_DocumentTool.ColorTool_s(made.Main())
    labels = label_sequence()
    shapes.GetShapes(labels)
    for label in _items(labels):
        if not shapes.IsSimpleShape_s(label) or _has_colour(label):
            continue
        part = shapes.GetShape_s(label)
        for face, _ in carried_by(part):
            place = label if face.IsSame(part) else shapes.AddSubShape(label, face)
            if not place.IsNull() and not _has_colour(place):
                colours.SetColor(place, COLOUR, XCAFDoc_ColorSurf)


def _has_colour(label: TDF_Label) -> bool:
    kinds = XCAFDoc_ColorGen, XCAFDoc_ColorSurf, XCAFDoc_ColorCurv
    return any(XCAFDoc_ColorTool.GetColor_s(label, kind, Quantity_Color()) for kind in kinds)


def _name_labels(made: TDocStd_Document) -> None:
    """Write names as STEP has them.

    A component without a name gets that of its part, and what holds a lone part gets that part's: CadQuery
    leaves the first of them out for assemblies in assemblies, the second for an assembly of its own shape.
    """
    shapes = XCAFDoc_DocumentTool.ShapeTool_s(made.Main())
    labels = label_sequence()
    shapes.GetShapes(labels)
    for label in _items(labels):
        inner, components = label_sequence(), label_sequence()
        XCAFDoc_ShapeTool.GetSubShapes_s(label, inner)
        XCAFDoc_ShapeTool.GetComponents_s(label, components)
        for part in _items(inner):
            _set_name(part, _name(part))
        for component in _items(components):
            _set_name(component, _name(component) or _name(_part_of(component)))
    for label in _items(labels):  # last, since components were named after them
        components = label_sequence()
        XCAFDoc_ShapeTool.GetComponents_s(label, components)
        first = _name(components.Value(1)) if components.Length() else ""
        _set_name(label, _name(label) or first)


def _part_of(component: TDF_Label) -> TDF_Label:
    part = TDF_Label()
    XCAFDoc_ShapeTool.GetReferredShape_s(component, part)
    return part


def _set_name(label: TDF_Label, name: str) -> None:
    if name:
        TDataStd_Name.Set_s(label, TCollection_ExtendedString(directives(name)))


def _name(label: TDF_Label) -> str:
    if not label.IsAttribute(TDataStd_Name.GetID_s()):  # asking for one that is not there crashes OCP
        return ""
    attribute = TDataStd_Name()
    label.FindAttribute(TDataStd_Name.GetID_s(), attribute)
    name = str(attribute.Get().ToExtString())
    try:  # CadQuery's names come as the bytes of UTF-8, one a character
        return name.encode("latin-1").decode("utf-8")
    except UnicodeError:
        return name


def _items(labels: Any) -> list[TDF_Label]:
    return [labels.Value(i) for i in range(1, labels.Length() + 1)]
