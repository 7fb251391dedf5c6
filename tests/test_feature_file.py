"""The feature file: exact to the last bit, refused if it is not whole, never half written."""

from __future__ import annotations

import json
import os
from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import apex, spiral_points, spiral_ridge

import ridgefeature as rf
from ridgefeature.io.feature import FLAT, VERSION, from_document, to_document
from ridgefeature.scan import Source


@pytest.fixture(scope="module")
def ridge() -> rf.Ridge:
    """One with all that JSON has no word for: inf and None among the deviations, NaN among the distances."""
    found = rf.register(
        rf.Scan(spiral_points(), "in", Source("clay.ply", "ab" * 32)), at=apex(), max_templates=4
    )
    first, second, *rest = found.templates
    std = first.std.copy()
    std[3] = np.inf
    templates = (replace(first, std=std), replace(second, std=None, M=np.nan), *rest)
    height_std = found.height_std.copy()
    height_std[-1] = np.inf
    return replace(found, templates=templates, height_std=height_std, closed=True, settings=rf.Settings(k=3))


@pytest.fixture()
def saved(ridge, tmp_path):
    path = tmp_path / "clay.ridge.json"
    ridge.save(path)
    return path


def assert_equal(a, b) -> None:
    """Every field, to the last bit."""
    assert type(a) is type(b)
    for f in fields(a):
        left, right = getattr(a, f.name), getattr(b, f.name)
        if isinstance(left, np.ndarray):
            assert left.dtype == right.dtype and left.shape == right.shape
            assert left.tobytes() == right.tobytes(), f.name
        elif f.name == "templates":
            assert len(left) == len(right)
            for one, other in zip(left, right, strict=True):
                assert_equal(one, other)
        elif f.name == "section":
            assert_equal(left, right)
        else:
            assert left == right or (left != left and right != right), f.name
            assert type(left) is type(right), f.name


# There and back


def test_a_loaded_ridge_is_the_saved_one_to_the_last_bit(ridge, saved):
    assert_equal(rf.load(saved), ridge)


def test_a_loaded_ridge_makes_the_same_surface(ridge, saved):
    loaded = rf.load(str(saved))
    assert loaded.surface().poles.tobytes() == ridge.surface().poles.tobytes()
    assert loaded.resized(h=1.5).surface().poles.tobytes() == ridge.resized(h=1.5).surface().poles.tobytes()


def test_saving_again_gives_the_same_bytes(saved, tmp_path):
    rf.load(saved).save(tmp_path / "again.ridge.json")
    assert (tmp_path / "again.ridge.json").read_bytes() == saved.read_bytes()


def test_a_resized_ridge_is_saved_as_it_is(ridge, tmp_path):
    slim = ridge.resized(h=1.5, w=0.7, between=(5.0, 20.0))
    slim.save(tmp_path / "slim.ridge.json")
    assert_equal(rf.load(tmp_path / "slim.ridge.json"), slim)


def test_a_whole_spiral_goes_there_and_back(tmp_path):
    spiral_ridge().save(tmp_path / "spiral.ridge.json")
    assert_equal(rf.load(tmp_path / "spiral.ridge.json"), spiral_ridge())


def test_templates_keep_the_section_that_they_were_fitted_with(ridge, tmp_path):
    learned = rf.Section(np.array([0.4, 1.0, 0.9, 0.3]), "learned")
    other = replace(ridge, section=learned)
    assert other.templates[0].section.name == "bell"
    other.save(tmp_path / "other.ridge.json")
    assert_equal(rf.load(tmp_path / "other.ridge.json"), other)


def test_the_file_is_strict_json_with_a_version(saved):
    def refuse(word):
        raise AssertionError(f"{word} is not JSON")

    document = json.loads(saved.read_text(encoding="ascii"), parse_constant=refuse)
    assert (document["format"], document["version"]) == ("ridgefeature.ridge", FLAT)
    assert document["source"] == {"name": "clay.ply", "sha256": "ab" * 32}
    assert document["unit"] == "in"


# Refused


@pytest.mark.parametrize("version", [VERSION + 1, 0, None, "1", "x"])
def test_another_version_is_refused_with_what_to_do(ridge, tmp_path, version):
    path = tmp_path / "future.ridge.json"
    path.write_text(json.dumps({**to_document(ridge), "version": version}))
    with pytest.raises(
        ValueError, match=rf"future.*expected version {FLAT} or {VERSION} .*got {version!r}.*update"
    ):
        rf.load(path)


@pytest.mark.parametrize("text", ["{}", "[]", "3", "null", '"ridge"', '{"format": "other"}'])
def test_another_format_is_refused(tmp_path, text):
    path = tmp_path / "other.json"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"other\.json: expected a ridge feature"):
        rf.load(path)


@pytest.mark.parametrize("content", [b"", b"\xff\xfe\x00\x01", b"ply\nformat ascii 1.0\n", b"\x00" * 100])
def test_what_is_no_json_is_refused(tmp_path, content):
    path = tmp_path / "odd.ridge.json"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r"expected a ridge feature as JSON.*damaged or cut short"):
        rf.load(path)


def test_a_file_cut_short_anywhere_is_refused(saved, tmp_path):
    content, path = saved.read_bytes(), tmp_path / "cut.ridge.json"
    for length in np.unique(np.linspace(0, len(content) - 1, 80).astype(int)):
        path.write_bytes(content[:length])
        with pytest.raises(ValueError, match="cut short"):
            rf.load(path)


def test_a_missing_file_is_an_os_error(tmp_path):
    with pytest.raises(FileNotFoundError):
        rf.load(tmp_path / "none.ridge.json")


def top_keys() -> list[str]:
    return [k for k in to_document(spiral_ridge()) if k not in ("format", "version")]


def test_a_file_without_one_of_its_parts_is_refused(ridge):
    for key in top_keys():
        document = to_document(ridge)
        del document[key]
        with pytest.raises(ValueError, match=f"whole ridge feature.*{key}"):
            from_document(document)


@pytest.mark.parametrize("part", ["stations", "templates", "section"])
def test_a_part_without_one_of_its_fields_is_refused(ridge, part):
    whole = to_document(ridge)
    for key in whole["templates"][0] if part == "templates" else whole[part]:
        document = json.loads(json.dumps(whole))
        inner = document[part][1] if part == "templates" else document[part]
        del inner[key]
        with pytest.raises(ValueError, match=f"whole ridge feature.*{key}"):
            from_document(document)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("spine", [[0.0, 0.0]] * 17),
        ("height", [1.0] * 3),
        ("normal", [1.0] * 17),
        ("width", 3.0),
        ("border", []),
    ],
)
def test_arrays_of_the_wrong_shape_are_refused(ridge, name, value):
    document = to_document(ridge)
    document["stations"][name] = value
    with pytest.raises(ValueError, match=f"expected {name} of shape"):
        from_document(document)


def test_numbers_that_are_not_finite_are_refused_where_shape_depends_on_them(ridge):
    for name in ("spine", "height", "width", "arc_length"):
        document = to_document(replace(ridge, **{name: np.full_like(getattr(ridge, name), np.nan)}))
        with pytest.raises(ValueError, match=f"expected {name} of shape .* finite"):
            from_document(document)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("width", -2.0, "width above 0, got -2"),
        ("width", 0.0, "width above 0, got 0"),
        ("border", -1.0, "border above 0, got -1"),
        ("arc_length", 0.0, "arc_length to ascend"),
    ],
)
def test_values_that_no_ridge_has_are_refused(ridge, name, value, message):
    document = to_document(ridge)
    document["stations"][name][3] = value
    with pytest.raises(ValueError, match=f"expected {message}.*save the feature again"):
        from_document(document)


@pytest.mark.parametrize(
    ("name", "value"), [("position", 7), ("rotation", [1, 2]), ("std", [1.0]), ("scale", None), ("M", "x")]
)
def test_templates_of_the_wrong_shape_are_refused(ridge, name, value):
    document = to_document(ridge)
    document["templates"][0][name] = value
    with pytest.raises(ValueError, match=name):
        from_document(document)


def test_a_feature_without_templates_is_refused(ridge):
    with pytest.raises(ValueError, match="templates"):
        from_document({**to_document(ridge), "templates": []})


def paths(node, at=()):
    yield at
    items = node.items() if isinstance(node, dict) else enumerate(node[:2]) if isinstance(node, list) else ()
    for key, value in items:
        yield from paths(value, (*at, key))


@given(st.data())
@settings(max_examples=150, deadline=None, derandomize=True)
def test_any_damage_is_a_value_error_or_still_a_ridge(data):
    document = json.loads(json.dumps(to_document(spiral_ridge())))
    where = data.draw(st.sampled_from([p for p in paths(document) if p]))
    value = data.draw(
        st.sampled_from([None, "x", 7, -1.5, [], {}, [1, 2], {"float": "nan"}, {"float": "x"}, True])
    )
    node = document
    for key in where[:-1]:
        node = node[key]
    node[where[-1]] = value
    try:
        loaded = from_document(document)
    except ValueError:
        return
    assert isinstance(loaded, rf.Ridge)
    assert np.isfinite(loaded.surface().poles).all()


# Never half written


def test_a_save_that_fails_leaves_the_old_file_and_nothing_else(ridge, saved, monkeypatch):
    before = saved.read_bytes()

    def fail(*_):
        raise OSError("no space left")

    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(OSError, match="no space left"):
        ridge.resized(h=2.0).save(saved)
    assert saved.read_bytes() == before
    assert os.listdir(saved.parent) == [saved.name]


def test_an_interrupt_while_saving_leaves_nothing(ridge, tmp_path, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", interrupt)
    with pytest.raises(KeyboardInterrupt):
        ridge.save(tmp_path / "new.ridge.json")
    assert os.listdir(tmp_path) == []


def test_a_folder_that_is_not_there_is_an_os_error(ridge, tmp_path):
    with pytest.raises(OSError, match="none"):
        ridge.save(tmp_path / "none" / "clay.ridge.json")


def test_saving_replaces_an_older_file_in_one_step(ridge, saved):
    ridge.resized(h=2.0).save(saved)
    np.testing.assert_array_equal(rf.load(saved).height, 2 * ridge.height)
    assert os.listdir(saved.parent) == [saved.name]
