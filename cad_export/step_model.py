"""What STEP files of ours hold beside the geometry: names, a colour, the feature as a user property."""

from __future__ import annotations

from dataclasses import replace
from itertools import count
from typing import Any

from OCP.BRep import BRep_Tool
from OCP.Quantity import Quantity_Color, Quantity_TOC_sRGB
from OCP.StepBasic import (
    StepBasic_GeneralProperty,
    StepBasic_GeneralPropertyAssociation,
    StepBasic_Product,
    StepBasic_ProductDefinition,
)
from OCP.STEPConstruct import STEPConstruct
from OCP.StepRepr import (
    StepRepr_CharacterizedDefinition,
    StepRepr_DescriptiveRepresentationItem,
    StepRepr_NextAssemblyUsageOccurrence,
    StepRepr_PropertyDefinition,
    StepRepr_PropertyDefinitionRepresentation,
    StepRepr_Representation,
    StepRepr_RepresentationContext,
    StepRepr_RepresentedDefinition,
)
from OCP.TCollection import TCollection_ExtendedString, TCollection_HAsciiString
from OCP.TDataStd import TDataStd_Name
from OCP.TDocStd import TDocStd_Document
from OCP.TopAbs import TopAbs_COMPOUND
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape
from OCP.XCAFDoc import XCAFDoc_ColorSurf, XCAFDoc_DocumentTool

from cad_export.carried import carried_by
from cad_export.occt_arrays import label_sequence, representation_items
from cad_export.record import Carried

COLOUR = Quantity_Color(0.85, 0.45, 0.10, Quantity_TOC_sRGB)
"""Of ridge faces."""


def named(found: list[tuple[TopoDS_Face, Carried]]) -> list[tuple[TopoDS_Face, Carried]]:
    """The same with a name of its own for each feature: "ridge", "ridge 2", ... as they come.

    Faces of one surface at one place are one feature that was cut.
    """
    surfaces = [BRep_Tool.Surface_s(face, TopLoc_Location()) for face, _ in found]  # held: see id() below
    names: dict[object, str] = {}
    out = []
    for (face, record), surface in zip(found, surfaces, strict=True):
        key = id(surface), tuple(round(x, 9) for row in record.motion for x in row)
        if key not in names:
            plain = ascii_name(record.name) or "ridge"
            choices = (plain if n == 1 else f"{plain} {n}" for n in count(1))
            names[key] = next(name for name in choices if name not in names.values())
        out.append((face, replace(record, name=names[key])))
    return out


def document(shape: TopoDS_Shape, name: str) -> TDocStd_Document:
    """An XCAF document of one shape, its name, and a colour for ridge faces; a compound is an assembly."""
    made = TDocStd_Document(TCollection_ExtendedString("XmlXCAF"))
    shapes = XCAFDoc_DocumentTool.ShapeTool_s(made.Main())
    colours = XCAFDoc_DocumentTool.ColorTool_s(made.Main())
    top = shapes.AddShape(shape, shape.ShapeType() == TopAbs_COMPOUND)
    TDataStd_Name.Set_s(top, TCollection_ExtendedString(name))
    labels = label_sequence()
    shapes.GetShapes(labels)
    for label in [labels.Value(i) for i in range(1, labels.Length() + 1)]:
        if not shapes.IsSimpleShape_s(label):
            continue
        part = shapes.GetShape_s(label)
        for face, _ in carried_by(part):
            place = label if face.IsSame(part) else shapes.AddSubShape(label, face)
            if not place.IsNull():
                colours.SetColor(place, COLOUR, XCAFDoc_ColorSurf)
    return made


def name_faces(process: Any, features: list[tuple[TopoDS_Face, Carried]]) -> None:
    """Name the STEP faces after their features; `process` is the finder process of the writer.

    Instances of one part share their faces: the first one's name stays.
    """
    for face, record in features:
        found = [STEPConstruct.FindEntity_s(process, f) for f in (face, face.Located(TopLoc_Location()))]
        for entity in found:
            if entity is not None and (entity.Name() is None or not entity.Name().ToCString()):
                entity.SetName(TCollection_HAsciiString(record.name))


def add_properties(model: Any, values: list[tuple[str, str]]) -> None:
    """Give the first product user properties with these names and values, as ISO 10303-41 and -43 have them.

    One property each: STEPCAFControl_Reader takes only the last item of a property.
    """
    entities = [model.Value(i) for i in range(1, model.NbEntities() + 1)]
    product = next(entity for entity in entities if isinstance(entity, StepBasic_ProductDefinition))
    context = next(entity for entity in entities if isinstance(entity, StepRepr_RepresentationContext))
    target = StepRepr_CharacterizedDefinition()
    target.SetValue(product)
    for name, value in values:
        text, kind = TCollection_HAsciiString(name), TCollection_HAsciiString("user defined attribute")
        definition, general = StepRepr_PropertyDefinition(), StepBasic_GeneralProperty()
        definition.Init(text, True, kind, target)
        general.Init(text, text, True, kind)
        link = StepBasic_GeneralPropertyAssociation()
        link.Init(text, kind, general, definition)
        item, representation = StepRepr_DescriptiveRepresentationItem(), StepRepr_Representation()
        item.Init(text, TCollection_HAsciiString(value))
        representation.Init(text, representation_items([item]), context)
        represented, whole = StepRepr_RepresentedDefinition(), StepRepr_PropertyDefinitionRepresentation()
        represented.SetValue(definition)
        whole.Init(represented, representation)
        for entity in (whole, link):  # with what they refer to; every call takes OCP about 3 ms
            model.AddWithRefs(entity)


def name_products(model: Any, name: str) -> None:
    """Name products and instances after the file: OCCT numbers them through the session."""
    entities = [model.Value(i) for i in range(1, model.NbEntities() + 1)]
    products = [entity for entity in entities if isinstance(entity, StepBasic_Product)]
    for n, product in enumerate(products, 1):
        text = TCollection_HAsciiString(name if len(products) == 1 else f"{name} {n}")
        product.SetId(text)
        product.SetName(text)
    uses = [entity for entity in entities if isinstance(entity, StepRepr_NextAssemblyUsageOccurrence)]
    for n, use in enumerate(uses, 1):
        use.SetId(TCollection_HAsciiString(str(n)))
        use.SetName(TCollection_HAsciiString(str(n)))


def ascii_name(name: str) -> str:
    """The name as OCCT can write it: it puts strings in the file as they are."""
    return "".join(c if " " <= c <= "~" and c not in "\\'" else "?" for c in name)
