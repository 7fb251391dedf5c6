"""Which ridge is meant by a pick: the one whose crest it is on, where that is at the foot of another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from oracles import spiral_ridge

import ridgefeature as rf
from ridgefeature.attempts import RefusedError, ridge_meant
from ridgefeature.march import INTERRUPTED
from ridgefeature.starts import LADDER, Hints

EXTENT = 100.0


def aside(share: float, height: float = 0.0, length: float | None = None) -> rf.Ridge:
    """A ridge that is picked so many widths aside of its spine, and so many heights over its surface."""
    ridge = spiral_ridge()
    if length is not None:
        ridge = ridge.stretched(length, "trim")
    k = len(ridge.arc_length) // 2
    z = (float(ridge.section(np.array(share))) + height) * ridge.height[k]
    return replace(
        ridge, pick=ridge.spine[k] + share * ridge.width[k] * ridge.across[k] + z * ridge.normal[k]
    )


def past(share: float) -> rf.Ridge:
    """The ridge, picked so many widths past its end."""
    ridge = spiral_ridge()
    return replace(ridge, pick=ridge.spine[-1] + share * ridge.width[-1] * ridge.tangent[-1])


class Attempts:
    """Answers in turn; what was asked is kept."""

    def __init__(self, *answers: rf.Ridge | Exception) -> None:
        self.answers, self.asked = list(answers), []

    def __call__(self, hints: Hints, reach: float, aimed: bool = True, high: bool = False) -> rf.Ridge:
        self.asked.append((hints.width, aimed, high))
        answer = self.answers.pop(0) if self.answers else rf.NoRidgeError("nothing else there")
        if isinstance(answer, Exception):
            raise answer
        return answer


@pytest.mark.parametrize("found", [aside(0.0), aside(0.2), aside(-0.4), past(0.4)])
def test_a_pick_on_crest_or_flank_or_just_past_an_end_means_what_is_found(found):
    tried = Attempts(found)
    assert ridge_meant(tried, EXTENT, Hints()) is found
    assert tried.asked == [(None, True, False)]


@pytest.mark.parametrize("first", [aside(0.5), aside(-0.7), aside(0.1, height=0.5), past(0.6)])
def test_at_a_foot_off_the_surface_or_further_past_an_end_another_ridge_is_looked_for(first):
    meant = aside(0.1)
    tried = Attempts(first, rf.NoRidgeError("too slim"), aside(0.4), meant)
    assert ridge_meant(tried, EXTENT, Hints()) is meant
    width = np.median(first.width)
    assert [w for w, *_ in tried.asked[1:]] == pytest.approx(
        [width / LADDER, width * LADDER, width / LADDER**0.5]
    )


def test_what_is_found_stays_where_nothing_better_is():
    found = aside(0.5)
    short = aside(0.0, length=0.4 * found.length)
    for others in ((), (short,), (found, found, aside(0.0)), (aside(0.45),)):
        tried = Attempts(found, *others)
        assert ridge_meant(tried, EXTENT, Hints()) is found


def test_a_width_that_is_given_or_an_interrupt_ends_the_search():
    found = aside(0.5)
    tried = Attempts(found, aside(0.0))
    assert ridge_meant(tried, EXTENT, Hints(width=3.0)) is found and len(tried.asked) == 1
    stopped = replace(aside(0.4), stop=(INTERRUPTED, INTERRUPTED))
    tried = Attempts(found, stopped, aside(0.0))
    assert ridge_meant(tried, EXTENT, Hints()) is found and len(tried.asked) == 2
    there = replace(aside(0.0), stop=(INTERRUPTED, INTERRUPTED))
    assert ridge_meant(Attempts(found, there), EXTENT, Hints()) is found, "what is whole is kept"
    stopped = replace(aside(0.7), stop=("an end", INTERRUPTED))
    tried = Attempts(stopped, aside(0.0))
    assert ridge_meant(tried, EXTENT, Hints()) is stopped and len(tried.asked) == 1


def test_where_there_is_none_all_is_tried_and_the_reason_is_the_widest_searchs():
    tried = Attempts(rf.NoRidgeError("nearest"), RefusedError("refused", 4.0))
    with pytest.raises(rf.NoRidgeError, match="refused"):
        ridge_meant(tried, EXTENT, Hints())
    assert tried.asked[:3] == [(None, True, False), (None, False, False), (None, True, True)]
    assert len({w for w, *_ in tried.asked[3:]}) == 6


def test_a_groove_is_found_between_two_ridges_that_explain_more():
    """As on a shoe's sole: two blocks, and a slim groove between them that was clicked."""
    random = np.random.default_rng(4)
    x, y = random.uniform([[-40.0], [-30.0]], [[40.0], [30.0]], (2, 30_000))
    flank = 1.0 / (1.0 + np.exp(-(np.abs(y) - 3.0) / 0.5)) / (1.0 + np.exp((np.abs(y) - 17.0) / 0.5))
    points = np.column_stack([x, y, 3.0 * flank + random.normal(0.0, 0.05, len(x))])
    ridge = rf.register(points, at=(0.0, 0.5, 0.0), kind="auto")
    assert np.abs(ridge.spine[:, 1]).max() < 1.0
    assert ridge.length > 75.0
