"""The whole fit chooses among the sections that have a name, whichever it begins with."""

from __future__ import annotations

import numpy as np
import pytest

from ridgefeature.free_section import SPANS, WIDER, by_means
from ridgefeature.kernels.strip import TERMS, A, H, W
from ridgefeature.named_section import best_named
from ridgefeature.noise import Noise
from ridgefeature.section import SECTIONS
from ridgefeature.shaping import shaped
from ridgefeature.smearing import smear

NODES, HEIGHT, WIDTH, SCATTER = 101, 2.0, 8.0, 0.1
NOISE = Noise(SCATTER, 0.001, 1e-4, 4 * HEIGHT, 0.0, SCATTER)


def scan(name: str, scatter: float = SCATTER) -> np.ndarray:
    random = np.random.default_rng(0)
    n = 12000
    s, y = random.uniform(0, NODES - 1, n), random.uniform(-WIDTH, WIDTH, n)
    z = HEIGHT * SECTIONS[name]()(y / WIDTH) + random.normal(0, scatter, n)
    return np.column_stack([s, y, z])


def terms(width: float) -> np.ndarray:
    out = np.zeros((NODES, TERMS))
    out[:, H], out[:, W] = HEIGHT, width
    return out


def half_width(name: str) -> float:
    return SECTIONS[name]().half_height_width


@pytest.mark.parametrize("begun", SECTIONS)
@pytest.mark.parametrize("true", SECTIONS)
def test_the_true_section_is_found_from_any_other(true, begun):
    """At the same width at half height, which a march knows. Further rounds of the fit tell sizes better."""
    width = WIDTH * half_width(true) / half_width(begun)
    before = SECTIONS[begun]()
    seen = smear(before, terms(width), NOISE.blur, NOISE.even)
    told = by_means(scan(true), terms(width), seen, NOISE.told)
    own, best = best_named(*told(SPANS, WIDER), before, SPANS, WIDER)
    assert best.section.name == true
    assert best.loss <= own.loss
    found = best.applied(terms(width))
    assert found[:, W] == pytest.approx(WIDTH, rel=0.06)
    assert found[:, H] == pytest.approx(HEIGHT, rel=0.03)
    assert found[:, A] == pytest.approx(0.0, abs=0.03 * HEIGHT)


def test_the_section_stays_where_it_is_the_true_one():
    seen = smear(SECTIONS["dome"](), terms(WIDTH), NOISE.blur, NOISE.even)
    section, found = shaped(scan("dome"), terms(WIDTH), seen, NOISE, 1.0)
    assert section.name == "dome"
    assert (found == terms(WIDTH)).all()


def test_another_named_section_is_taken_before_a_free_one():
    width = WIDTH * half_width("dome") / half_width("plateau")
    seen = smear(SECTIONS["plateau"](), terms(width), NOISE.blur, NOISE.even)
    section, found = shaped(scan("dome"), terms(width), seen, NOISE, 1.0)
    assert section.name == "dome"
    assert found[:, W] == pytest.approx(WIDTH, rel=0.03)


def test_where_no_points_tell_of_it_the_section_stays():
    before = SECTIONS["bell"]()
    n = SPANS + 6
    own, best = best_named(np.zeros((n, n)), np.zeros(n), before, SPANS, WIDER)
    assert best is own and own.section is before and own.loss == 0
    terms = np.ones((4, TERMS))
    np.testing.assert_array_equal(own.applied(terms)[:, [A, H]], terms[:, [A, H]])
