"""What STEP files of ours hold beside the geometry: names, and the feature as a user property."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from itertools import count
from typing import Any

from OCP.BRep import BRep_Tool
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
from OCP.TCollection import TCollection_HAsciiString
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Face

from cad_export.occt_arrays import representation_items
from cad_export.record import Carried
from cad_export.step_text import directives


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
            plain = "".join(c for c in record.name if c.isprintable()) or "ridge"
            names[key] = unused(plain, names.values())
        out.append((face, replace(record, name=names[key])))
    return out


def name_faces(process: Any, features: list[tuple[TopoDS_Face, Carried]]) -> None:
    """Name the STEP faces after their features; `process` is the finder process of the writer.

    Instances of one part share their faces: the first one's name stays.
    """
    done: list[Any] = []
    for face, record in features:
        found = [STEPConstruct.FindEntity_s(process, f) for f in (face, face.Located(TopLoc_Location()))]
        for entity in found:
            if entity is not None and not any(entity is other for other in done):
                entity.SetName(TCollection_HAsciiString(directives(record.name)))
                done.append(entity)


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


def name_products(model: Any, name: str | None) -> None:
    """Name products and instances after the file; with None they keep the names they have.

    Either way they are numbered here: OCCT counts them through the session.
    """
    entities = [model.Value(i) for i in range(1, model.NbEntities() + 1)]
    products = [entity for entity in entities if isinstance(entity, StepBasic_Product)]
    names: list[str] = []
    for n, product in enumerate(products, 1):
        own = product.Name().ToCString() if name is None else name
        kept = own if name is None or len(products) == 1 else f"{name} {n}"
        product.SetName(TCollection_HAsciiString(kept))
        names.append(unused(kept, names))
        product.SetId(TCollection_HAsciiString(names[-1]))  # one of its own, by ISO 10303-41
    uses = [entity for entity in entities if isinstance(entity, StepRepr_NextAssemblyUsageOccurrence)]
    for n, use in enumerate(uses, 1):
        use.SetId(TCollection_HAsciiString(str(n)))
        if name is not None:
            use.SetName(TCollection_HAsciiString(str(n)))


def unused(name: str, used: Collection[str]) -> str:
    """The name, or the first of "name 2", "name 3", ... that is not used yet."""
    choices = (name if n == 1 else f"{name} {n}" for n in count(1))
    return next(choice for choice in choices if choice not in used)
