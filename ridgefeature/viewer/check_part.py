"""The thorough checks of a part, in a process of their own: they may take a minute, and cannot be stopped.

    python -m ridgefeature.viewer.check_part part.brep

Prints what is wrong with it, or nothing.
"""

from __future__ import annotations

import sys


def main(path: str) -> None:
    """Print what is wrong with the part in a .brep file."""
    import cadquery as cq

    from cad_export.certificate import check_shape

    try:
        check_shape(cq.Shape.importBrep(path).wrapped)
    except ValueError as error:
        print(error)


if __name__ == "__main__":
    main(sys.argv[1])
