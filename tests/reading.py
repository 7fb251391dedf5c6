"""What the tests of reading share."""

import numpy as np
import pytest

from ridgefeature.io import read_scan

POINTS = np.random.default_rng(5).normal(size=(300, 3)) * 10


def rows(points, separator=" "):
    return "".join(separator.join(repr(float(c)) for c in p) + "\n" for p in points)


def write(path, content):
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def refused(path, *words, **options):
    """The one-line message with which `path` is refused."""
    with pytest.raises((ValueError, OSError)) as caught:
        read_scan(path, **options)
    message = str(caught.value)
    assert str(path) in message and "\n" not in message
    for word in words:
        assert word in message
    return message
