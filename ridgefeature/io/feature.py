"""The feature file: a ridge as versioned JSON, every number exact to the last bit."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Container, Iterable
from dataclasses import Field, asdict, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ridgefeature.io.target import naming
from ridgefeature.section import Section
from ridgefeature.settings import Settings
from ridgefeature.stations import Stations
from ridgefeature.template import Template

if TYPE_CHECKING:
    from ridgefeature.ridge import Ridge

FORMAT = "ridgefeature.ridge"
VERSION, FLAT = 2, 1
"""Newest version, and that of a ridge whose base is flat across, which holds no curvature."""
_OF_CURVED = ("curvature", "base", "base_std")
SUFFIX = ".ridge.json"


def to_document(ridge: Ridge) -> dict[str, Any]:
    """The ridge as plain lists, numbers and words."""
    return {
        "format": FORMAT,
        "version": VERSION if _is_curved(ridge) else FLAT,
        "unit": ridge.unit,
        "source": None if ridge.source is None else asdict(ridge.source),
        "pick": ridge.pick.tolist(),
        "settings": asdict(ridge.settings),
        "closed": ridge.closed,
        "stop": list(ridge.stop),
        "end_interval": None if ridge.end_interval is None else _plain(ridge.end_interval),
        "section": _section(ridge.section),
        "stations": _values(ridge, fields(Stations), () if _is_curved(ridge) else _OF_CURVED),
        "templates": [
            _values(t, fields(Template), {"section", *(() if _is_curved(ridge) else _OF_CURVED)})
            | ({} if _alike(t.section, ridge.section) else {"section": _section(t.section)})
            for t in ridge.templates
        ],
    }


def _section(section: Section) -> dict[str, Any]:
    return {"name": section.name, "coefficients": section.coefficients.tolist()}


def _alike(one: Section, other: Section) -> bool:
    """Whether a template has the ridge's own section, which is then not written again."""
    return one.name == other.name and np.array_equal(one.coefficients, other.coefficients)


def _section_in(document: dict[str, Any]) -> Section:
    return Section(np.array(document["coefficients"], dtype=np.float64), document["name"])


def _is_curved(ridge: Ridge) -> bool:
    return bool(ridge.curvature.any() or any(t.curved for t in ridge.templates))


def _values(of: Any, named: Iterable[Field[Any]], without: Container[str]) -> dict[str, Any]:
    return {f.name: _plain(getattr(of, f.name)) for f in named if f.name not in without}


def from_document(document: Any) -> Ridge:
    """The ridge of a document made by `to_document`. Raises ValueError for anything else."""
    from ridgefeature.ridge import Ridge
    from ridgefeature.scan import Source

    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise ValueError(f"expected a ridge feature (format {FORMAT!r}); this is something else")
    if document.get("version") not in (FLAT, VERSION):
        raise ValueError(
            f"expected version {FLAT} or {VERSION} of the feature format, got {document.get('version')!r}; "
            "read it with the release that wrote it, or update ridgefeature"
        )
    try:
        section = _section_in(document["section"])
        without = _OF_CURVED if document["version"] == FLAT else ()
        stations = {
            f.name: _array(document["stations"][f.name]) for f in fields(Stations) if f.name not in without
        }
        ridge = Ridge(
            **stations,
            section=section,
            templates=tuple(_template(t, section, without) for t in document["templates"]),
            stop=(str(document["stop"][0]), str(document["stop"][1])),
            closed=bool(document["closed"]),
            end_interval=None if document["end_interval"] is None else _array(document["end_interval"]),
            unit=str(document["unit"]),
            pick=_array(document["pick"]),
            settings=Settings(**document["settings"]),
            source=None if document["source"] is None else Source(**document["source"]),
        )
    except (KeyError, TypeError, IndexError, AttributeError) as error:
        raise ValueError(
            f"expected a whole ridge feature, got one with {error!r} missing or wrong; save it again"
        ) from error
    _check_shapes(ridge)
    return ridge


def write_feature(ridge: Ridge, path: str | os.PathLike[str]) -> Path:
    """Write the ridge beside `path`, then rename it. Raises OSError if the folder cannot be written."""
    path = Path(path)
    text = json.dumps(to_document(ridge), indent=1)
    with naming(path):
        descriptor, name = tempfile.mkstemp(dir=path.parent, prefix=path.name, suffix=".part")
    try:
        with os.fdopen(descriptor, "w", encoding="ascii") as file:
            file.write(text)
        os.chmod(name, 0o666 & ~_umask())
        os.replace(name, path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
    return path


def load(path: str | os.PathLike[str]) -> Ridge:
    """Read a ridge feature that `Ridge.save` wrote; equal to it to the last bit.

    Raises OSError if the file cannot be read, ValueError if it is no feature file, cut short or of another
    version.
    """
    path = Path(path)
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise ValueError(
            f"{path}: expected a ridge feature as JSON, got a file that is damaged or cut short ({error})"
        ) from error
    try:
        return from_document(document)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _plain(value: Any) -> Any:
    """Lists for arrays; None for what JSON has no word for, in numbers that were never fitted."""
    if isinstance(value, np.ndarray):
        return [_plain(x) for x in value.tolist()] if value.dtype == np.float64 else value.tolist()
    if isinstance(value, list):
        return [_plain(x) for x in value]
    if isinstance(value, float) and not np.isfinite(value):
        return {"float": repr(value)}
    return value


def _array(value: Any) -> np.ndarray[Any, Any]:
    array = np.array(_number(value), dtype=np.float64)
    array.setflags(write=False)
    return array


def _number(value: Any) -> Any:
    if isinstance(value, list):
        return [_number(x) for x in value]
    return float(value["float"]) if isinstance(value, dict) else value


_TEMPLATE_ARRAYS = {
    "position": (3,),
    "rotation": (3, 3),
    "trend": (3,),
    "base": (3,),
    "base_std": (3,),
    "std": (8,),
}


def _template(document: dict[str, Any], section: Section, without: Container[str]) -> Template:
    values: dict[str, Any] = {
        "section": _section_in(document["section"]) if "section" in document else section
    }
    for name in (f.name for f in fields(Template) if f.name != "section" and f.name not in without):
        value = document[name]
        if name in _TEMPLATE_ARRAYS and not (name == "std" and value is None):
            values[name] = _array(value)
            if values[name].shape != _TEMPLATE_ARRAYS[name]:
                raise ValueError(
                    f"expected a template's {name} of shape {_TEMPLATE_ARRAYS[name]}, "
                    f"got {values[name].shape}; save the feature again"
                )
        elif name in ("status", "std"):
            values[name] = value
        else:
            values[name] = _number(value)
            if isinstance(values[name], bool) or not isinstance(values[name], (int, float)):
                raise ValueError(
                    f"expected a template's {name} to be a number, got {value!r}; save the feature again"
                )
    return Template(**values)


def _check_shapes(ridge: Ridge) -> None:
    if not ridge.templates:
        raise ValueError("expected a feature with templates, got none; save the feature again")
    if ridge.end_interval is not None and ridge.end_interval.shape != (2, 2):
        raise ValueError(f"expected end_interval of shape (2, 2), got {ridge.end_interval.shape}; save again")
    k = ridge.arc_length.shape
    for f in fields(Stations):
        want = (*k, 3) if f.name in ("spine", "tangent", "normal") else k
        array = getattr(ridge, f.name)
        if (
            array.ndim == 0
            or array.shape != want
            or len(array) < 5
            or not (np.isfinite(array).all() or f.name.endswith("_std"))
        ):
            raise ValueError(
                f"expected {f.name} of shape {want} and finite, got shape {array.shape}; "
                "save the feature again"
            )
    for name in ("width", "border"):
        least = float(getattr(ridge, name).min())
        if not least > 0:
            raise ValueError(f"expected {name} above 0, got {least:g}; save the feature again")
    if not (np.diff(ridge.arc_length) > 0).all():
        raise ValueError("expected arc_length to ascend, it does not; save the feature again")
