"""What is open on the page, without a page: ridges, rates, undo and redo."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_ridges import made_ridge

from ridgefeature.viewer.session import PAUSE, History, Session

PICK = (0.0, 0.0, 0.0)


@pytest.fixture
def session() -> Session:
    return Session().added(made_ridge(), PICK).added(made_ridge().resized(h=-1), PICK)


def test_ridges_get_free_names_and_the_last_is_chosen(session: Session) -> None:
    assert [f.name for f in session.features] == ["ridge 1", "groove 1"]
    assert session.chosen == "groove 1"
    again = session.without("ridge 1").added(made_ridge(), PICK)
    assert again.chosen == "ridge 1"


def test_rates_change_the_ridge_and_not_what_was_registered(session: Session) -> None:
    taller = session.changed("ridge 1", h=1.5, w=0.8)["ridge 1"]
    np.testing.assert_allclose(taller.ridge.height, 1.5 * taller.registered.height)
    np.testing.assert_allclose(taller.ridge.width, 0.8 * taller.registered.width)
    whole = taller.registered.length
    part = session.changed("ridge 1", h=2.0, between=(0.4 * whole, 0.6 * whole))["ridge 1"].ridge
    middle = len(part.height) // 2
    assert part.height[0] == taller.registered.height[0]
    assert part.height[middle] == pytest.approx(2.0 * taller.registered.height[middle])
    assert session["ridge 1"].h == 1.0


def test_one_left_out_is_not_chosen_any_more(session: Session) -> None:
    assert session.without("groove 1").chosen == "ridge 1"
    assert session.without("ridge 1").chosen == "groove 1"
    assert session.without("ridge 1").without("groove 1").chosen is None
    assert session.choosing("ridge 1").chosen == "ridge 1"
    assert session.choosing(None).chosen is None


def test_names_are_free_or_refused(session: Session) -> None:
    renamed = session.renamed("groove 1", " seam ")
    assert renamed.chosen == "seam" and renamed["seam"].ridge.groove
    assert session.renamed("groove 1", "groove 1").chosen == "groove 1"
    for name in ("", "  ", "ridge 1"):
        with pytest.raises(ValueError, match="name: expected one"):
            session.renamed("groove 1", name)
    with pytest.raises(ValueError, match="expected one of ridge 1, groove 1, got 'x'"):
        session.choosing("x")


@pytest.mark.parametrize("rate", [0.0, -1.0, 3.1, float("nan"), float("inf")])
def test_rates_out_of_reach_are_refused(session: Session, rate: float) -> None:
    with pytest.raises(ValueError, match="expected a rate from"):
        session.changed("ridge 1", h=rate)


def test_undo_and_redo_go_back_and_forth(session: Session) -> None:
    history = History()
    one = Session().added(made_ridge(), PICK)
    history.do(one)
    history.do(session)
    assert history.undo() and history.now is one
    assert history.redo() and history.now is session
    assert not history.redo()
    assert history.undo() and history.undo() and not history.undo()
    assert history.now.features == ()
    history.redo()
    history.do(one.changed("ridge 1", h=2.0))
    assert not history.redo(), "what is done anew has nothing after it"


def test_values_that_are_typed_one_after_the_other_are_steps_of_their_own(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    history, seconds = History(session), iter([10.0, 14.0, 14.0 + 0.5 * PAUSE, 30.0])
    monkeypatch.setattr("ridgefeature.viewer.session.time.monotonic", lambda: next(seconds))
    for h in (1.5, 2.0, 2.1, 0.5):
        history.do(history.now.changed("ridge 1", h=h), "h of ridge 1")
    found = []
    while history.undo():
        found.append(history.now["ridge 1"].h)
    assert found == [2.1, 1.5, 1.0]


def test_a_ridge_that_was_found_before_is_known_by_its_path(session: Session) -> None:
    ridge = made_ridge()
    assert session.without("groove 1").again(ridge) == "ridge 1"
    assert session.without("groove 1").again(ridge.stretched(0.6 * ridge.length, "trim")) == "ridge 1"
    aside = replace(ridge, spine=ridge.spine + 2.0 * ridge.width.max() * ridge.across)
    assert session.again(aside) is None
    assert session.without("groove 1").changed("ridge 1", shown=False).again(ridge) is None
    assert Session().again(ridge) is None
    slim = ridge.resized(w=0.3)
    assert session.without("groove 1").again(slim) is None, "another one on the same path"
    assert session.without("groove 1").again(ridge.resized(h=-1)) is None


def test_a_slider_is_one_step(session: Session) -> None:
    history = History(session)
    for h in np.linspace(1, 2, 20):
        history.do(history.now.changed("ridge 1", h=float(h)), "h of ridge 1")
    history.do(history.now.changed("ridge 1", w=0.5), "w of ridge 1")
    assert history.undo() and history.now["ridge 1"].h == 2.0
    assert history.undo() and history.now is session
