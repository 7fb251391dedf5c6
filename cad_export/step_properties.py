"""Ridge features as user properties of a STEP file: their values, and reading them from the file's text.

The text is JSON, packed by zlib (RFC 1950) and base64 (RFC 4648), and cut in pieces. Every piece is the value
of a property's DESCRIPTIVE_REPRESENTATION_ITEM (ISO 10303-45), and one more holds a header, as JSON: the
number of pieces and a checksum. Read without OCCT, which takes a second to start.
"""

from __future__ import annotations

import base64
import hashlib
import json
import os
import re
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from cad_export.record import Carried

FORMAT = "ridgefeature.step"
VERSION = 1
PROPERTY = "ridgefeature"
"""First word of the properties' names."""
PIECE = 8000
"""Characters of one string: OCCT cannot read a file with a string of more than about 16,000."""

_ITEM = re.compile(
    rf"DESCRIPTIVE_REPRESENTATION_ITEM\s*\(\s*'{PROPERTY} (\w+)(?: (\d+))?'\s*,\s*'((?:[^']|'')*)'\s*\)"
)


def items(records: Sequence[Carried]) -> list[tuple[str, str]]:
    """Names and values of the properties that hold these records; ASCII, values of at most PIECE characters.

    Raises ValueError where a placement or host is not plain JSON, or has numbers that are not finite.
    """
    features: dict[str, int] = {}
    hosts: dict[str, int] = {}
    rows = [
        {
            "name": record.name,
            "feature": features.setdefault(_json(record.feature), len(features)),
            "h": record.h,
            "w": record.w,
            "placement": record.placement,
            "host": None if record.host is None else hosts.setdefault(_json(record.host), len(hosts)),
            "motion": record.motion,
        }
        for record in records
    ]
    text = (
        f'{{"format":"{FORMAT}","version":{VERSION},"records":{_json(rows)},'
        f'"features":[{",".join(features)}],"hosts":[{",".join(hosts)}]}}'
    )
    packed = base64.b64encode(zlib.compress(text.encode("ascii"), 6)).decode("ascii")
    pieces = [packed[i : i + PIECE] for i in range(0, len(packed), PIECE)]
    checksum = hashlib.sha256(packed.encode("ascii")).hexdigest()
    header = {"format": FORMAT, "version": VERSION, "pieces": len(pieces), "sha256": checksum}
    name = f"{PROPERTY} {checksum[:12]}"
    return [(name, json.dumps(header)), *((f"{name} {i}", piece) for i, piece in enumerate(pieces, 1))]


def records_in(path: str | os.PathLike[str]) -> list[Carried]:
    """The records that a STEP file carries, in order; none if it has no such property.

    Raises OSError when it cannot be read, ValueError when it is no STEP file or cut off, or when the property
    is damaged or of a later version.
    """
    text = step_text(path)
    headers: dict[str, str] = {}
    pieces: dict[str, dict[int, str]] = {}
    for key, number, value in _ITEM.findall(text):
        if number:
            pieces.setdefault(key, {})[int(number)] = value
        else:
            headers[key] = value
    name = Path(path).name
    if pieces.keys() - headers.keys():
        raise _damaged(name, "its header is missing")
    return [
        record for key, header in headers.items() for record in _unpacked(header, pieces.get(key, {}), name)
    ]


def step_text(path: str | os.PathLike[str]) -> str:
    """The text of a whole STEP file without line breaks, which may stand anywhere in it.

    Raises OSError when it cannot be read, ValueError when it is no STEP file or cut off.
    """
    name, data = Path(path).name, Path(path).read_bytes()
    if not data[:1024].lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"ISO-10303-21"):
        raise ValueError(
            f"{name}: expected a STEP file, which starts with ISO-10303-21, got something else; "
            "check the file's name"
        )
    if not re.search(rb"END-ISO-10303-21\s*;", data[-4096:]):
        raise ValueError(
            f"{name}: expected a STEP file that ends with END-ISO-10303-21, got one that is cut off or "
            "damaged; copy or export it again"
        )
    return data.translate(None, b"\r\n").decode("latin-1")


def _unpacked(header: str, pieces: dict[int, str], name: str) -> Iterator[Carried]:
    try:
        head = json.loads(header)
        version, count, checksum = head["version"], head["pieces"], head["sha256"]
    except (ValueError, KeyError, TypeError) as error:
        raise _damaged(name, "its header cannot be read") from error
    if version != VERSION:
        raise ValueError(
            f"{name}: expected version {VERSION} of the ridge feature in STEP, got {version!r}; "
            "read it with the release that wrote it, or update ridgefeature"
        )
    if sorted(pieces) != list(range(1, len(pieces) + 1)) or len(pieces) != count:
        raise _damaged(name, f"expected {count} pieces, got {len(pieces)}")
    packed = "".join(pieces[i] for i in range(1, count + 1))
    if hashlib.sha256(packed.encode("latin-1")).hexdigest() != checksum:
        raise _damaged(name, "its checksum is another")
    try:
        document = json.loads(zlib.decompress(base64.b64decode(packed, validate=True)))
        if document["format"] != FORMAT or document["version"] != VERSION:
            raise ValueError("of another format")
        return iter([_record(row, document["features"], document["hosts"]) for row in document["records"]])
    except (ValueError, KeyError, TypeError, IndexError, zlib.error) as error:
        raise _damaged(name, f"{type(error).__name__}: {error}") from error


def _record(row: dict[str, Any], features: list[Any], hosts: list[Any]) -> Carried:
    return Carried(
        name=str(row["name"]),
        feature=features[row["feature"]],
        h=float(row["h"]),
        w=float(row["w"]),
        placement=row["placement"],
        host=None if row["host"] is None else hosts[row["host"]],
        motion=tuple(tuple(float(x) for x in line) for line in row["motion"]),
    )


def _damaged(name: str, why: str) -> ValueError:
    return ValueError(
        f"{name}: expected a whole ridge feature in the STEP file, got a damaged one ({why}); export it again"
    )


def _json(value: Any) -> str:
    try:
        return json.dumps(value, separators=(",", ":"), allow_nan=False)
    except (TypeError, ValueError) as error:
        raise ValueError(
            f"expected plain, finite JSON data to carry, got {error}; convert it first"
        ) from error
