"""The whole state of a page in one file: the scan, all ridges and how they were changed.

A zip archive: `page.json` with names, rates and picks, one feature file for each ridge, the scan's points.
"""

from __future__ import annotations

import io
import json
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from ridgefeature.io.feature import from_document, to_document
from ridgefeature.scan import Scan, Source
from ridgefeature.viewer.session import Feature, Session

SUFFIX = ".ridgepage"
_VERSION = 1
_LARGEST = 8 * 1024**3
"""Bytes that an archive may unpack to."""


def save(path: Path, scan: Scan | None, session: Session) -> None:
    """Write the state of a page; raises OSError where it cannot."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.writestr("page.json", json.dumps(_document(scan, session), indent=1))
        if scan is not None:
            with archive.open("points.npy", "w", force_zip64=True) as file:
                np.lib.format.write_array(file, np.asarray(scan.points), allow_pickle=False)
        for k, feature in enumerate(session.features):
            archive.writestr(f"{k}.ridge.json", json.dumps(to_document(feature.registered)))
            if feature.before is not None:
                archive.writestr(f"{k}.before.json", json.dumps(to_document(feature.before)))


def load(path: Path) -> tuple[Scan | None, Session]:
    """The scan and the session of a saved page. Raises ValueError where it is none, or damaged."""
    try:
        with zipfile.ZipFile(path) as archive:
            if sum(entry.file_size for entry in archive.infolist()) > _LARGEST:
                raise ValueError(f"unpacks to more than {_LARGEST:,} bytes")
            told = json.loads(archive.read("page.json"))
            if told["version"] != _VERSION:
                raise ValueError(f"version {told['version']}")
            return _scan(archive, told["scan"]), _session(archive, told)
    except (zipfile.BadZipFile, zlib.error, KeyError, TypeError, EOFError, ValueError) as error:
        raise ValueError(
            f"{path.name}: expected a page saved by ridgefeature, version {_VERSION}, got none "
            f"({error}); save it again"
        ) from error


def _document(scan: Scan | None, session: Session) -> dict[str, Any]:
    source = None if scan is None or scan.source is None else [scan.source.name, scan.source.sha256]
    return {
        "version": _VERSION,
        "scan": None if scan is None else {"unit": scan.unit, "source": source},
        "chosen": session.chosen,
        "ridges": [
            {"name": f.name, "pick": f.pick, "h": f.h, "w": f.w, "between": f.between, "shown": f.shown}
            for f in session.features
        ],
    }


def _scan(archive: zipfile.ZipFile, told: dict[str, Any] | None) -> Scan | None:
    if told is None:
        return None
    points = np.load(io.BytesIO(archive.read("points.npy")), allow_pickle=False)
    source = None if told["source"] is None else Source(*map(str, told["source"]))
    return Scan(points, str(told["unit"]), source)


def _session(archive: zipfile.ZipFile, told: dict[str, Any]) -> Session:
    features = []
    for k, own in enumerate(told["ridges"]):
        ridge = from_document(json.loads(archive.read(f"{k}.ridge.json")))
        x, y, z = map(float, own["pick"])
        between = None if own["between"] is None else (float(own["between"][0]), float(own["between"][1]))
        rates: dict[str, Any] = {"h": float(own["h"]), "w": float(own["w"]), "between": between}
        rates["shown"] = bool(own["shown"])
        if f"{k}.before.json" in archive.namelist():
            rates["before"] = from_document(json.loads(archive.read(f"{k}.before.json")))
        name = str(own["name"])
        unchanged = Session((Feature(name, ridge, (x, y, z)),))
        features.append(unchanged.changed(name, **rates)[name])
    session = Session(tuple(features))
    return session if told["chosen"] is None else session.choosing(str(told["chosen"]))
