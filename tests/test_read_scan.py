import hashlib
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from reading import POINTS, refused, rows, write

from ridgefeature.io import read_scan
from ridgefeature.io.read import FORMATS

# NumPy files


def test_npy(tmp_path):
    np.save(tmp_path / "a.npy", POINTS)
    scan = read_scan(tmp_path / "a.npy")
    np.testing.assert_array_equal(scan.points, POINTS)
    assert scan.unit == "mm"
    assert scan.source.name == "a.npy"
    assert scan.source.sha256 == hashlib.sha256((tmp_path / "a.npy").read_bytes()).hexdigest()


def test_suffix_case_and_string_paths(tmp_path):
    np.save(tmp_path / "a.npy", POINTS)
    (tmp_path / "a.npy").rename(tmp_path / "B.NPY")
    assert len(read_scan(str(tmp_path / "B.NPY"), unit="in")) == 300
    assert read_scan(tmp_path / "B.NPY", unit="in").unit == "in"


def test_npz_takes_points_or_the_only_table(tmp_path):
    np.savez(tmp_path / "a.npz", points=POINTS, normals=POINTS + 1)
    np.savez_compressed(tmp_path / "b.npz", xyz=POINTS, colour=np.zeros(300))
    for name in "ab":
        np.testing.assert_array_equal(read_scan(tmp_path / f"{name}.npz").points, POINTS)


def test_npz_that_is_ambiguous_names_its_keys(tmp_path):
    np.savez(tmp_path / "a.npz", first=POINTS, second=POINTS)
    refused(tmp_path / "a.npz", "first (300, 3)", "second (300, 3)", "points")
    np.savez(tmp_path / "b.npz")
    refused(tmp_path / "b.npz", "no array")


def test_numpy_files_that_are_wrong(tmp_path):
    np.save(tmp_path / "flat.npy", POINTS.ravel())
    refused(tmp_path / "flat.npy", "(900,)")
    np.save(tmp_path / "object.npy", np.array([None, {}], object), allow_pickle=True)
    refused(tmp_path / "object.npy")
    refused(write(tmp_path / "words.npy", "hello"), "NumPy")
    refused(write(tmp_path / "words.npz", "hello"), "NumPy")


def test_rows_with_nan_are_dropped(tmp_path):
    np.save(tmp_path / "a.npy", np.vstack([POINTS, [[np.nan, 0, 0]]]))
    with pytest.warns(UserWarning, match="dropped 1 of 301"):
        scan = read_scan(tmp_path / "a.npy")
    np.testing.assert_array_equal(scan.points, POINTS)


# Text tables

EXTRA = np.column_stack([POINTS, np.arange(300)])
SHUFFLED = np.column_stack([np.arange(300), POINTS[:, 2], POINTS[:, 0], POINTS[:, 1]])


@pytest.mark.parametrize(
    "content",
    [
        rows(POINTS),
        rows(POINTS, ","),
        rows(POINTS, ", "),
        rows(POINTS, ";"),
        rows(POINTS, "\t"),
        rows(POINTS, "   "),
        rows(EXTRA),
        rows(EXTRA, ","),
        rows(POINTS, ",").replace("\n", ",\n"),
        rows(POINTS, ";").replace(".", ","),
        rows(POINTS).replace(".", ","),
        rows(POINTS).replace("\n", "\r\n"),
        rows(POINTS).replace("\n", "\n\n"),
        "# made by hand\n# x y z\n" + rows(POINTS),
        "\ufeffx,y,z\n" + rows(POINTS, ","),
        "x,y,z,intensity\n" + rows(EXTRA, ","),
        'intensity,"Z","X","Y"\n' + rows(SHUFFLED, ","),
        "intensity z x y\n" + rows(SHUFFLED),
        "# intensity, z, x, y\n" + rows(SHUFFLED),
        "i;Z [mm];X [mm];Y [mm]\n" + rows(SHUFFLED, ";"),
        "//X,Y,Z,Intensity\n300\n" + rows(EXTRA, ","),
        "300\n" + rows(EXTRA),
        "scan of a clay model\nx y z\n" + rows(POINTS),
        "easting northing height\n" + rows(POINTS),
        rows(POINTS[:150]) + "# half way\n" + rows(POINTS[150:]),
        "x,y,z,label\n" + "".join(f"{p[0]!r},{p[1]!r},{p[2]!r},clay\n" for p in POINTS.tolist()),
        "label,x,y,z\n" + "".join(f"a,{p[0]!r},{p[1]!r},{p[2]!r}\n" for p in POINTS.tolist()),
    ],
)
def test_text_tables(tmp_path, content):
    scan = read_scan(write(tmp_path / "a.txt", content))
    np.testing.assert_array_equal(scan.points, POINTS)


@pytest.mark.parametrize("suffix", [".xyz", ".txt", ".asc", ".csv", ".pts"])
def test_text_suffixes(tmp_path, suffix):
    assert len(read_scan(write(tmp_path / f"a{suffix}", rows(POINTS)))) == 300


@given(
    st.lists(st.tuples(*[st.floats(-1e6, 1e6)] * 3), min_size=5, max_size=20),
    st.sampled_from([" ", ",", ";", "\t", ", "]),
    st.booleans(),
)
@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_text_keeps_every_bit(tmp_path, some, separator, named):
    points = np.concatenate([some, POINTS[:20]])
    content = ("x y z\n".replace(" ", separator) if named else "") + rows(points, separator)
    np.testing.assert_array_equal(read_scan(write(tmp_path / "a.xyz", content)).points, points)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("these are words\nand nothing else\n", "these are words"),
        ("1 2\n3 4\n", "three numbers"),
        ("# only a comment\n", "three numbers"),
        ("\n\n\n", "three numbers"),
        ("t,px,py,pz\n" + rows(EXTRA, ","), "t, px, py, pz"),
        ("301\n" + rows(POINTS), "promises 301 points, it holds 300"),
        (rows(POINTS) + "and then words\n", "could not read"),
        (rows(POINTS) + "1 2\n", "could not read"),
        (rows(POINTS[:5]), "16"),
        (POINTS.tobytes(), "binary"),
        ("x" * 100_000, "three numbers"),
    ],
)
def test_text_that_is_wrong(tmp_path, content, words):
    refused(write(tmp_path / "a.xyz", content), words)


# Any file

SUFFIXES = sorted(FORMATS)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_missing_directory_and_empty(tmp_path, suffix):
    with pytest.raises(FileNotFoundError, match="no such file"):
        read_scan(tmp_path / f"none{suffix}")
    (tmp_path / f"dir{suffix}").mkdir()
    with pytest.raises(IsADirectoryError, match="directory"):
        read_scan(tmp_path / f"dir{suffix}")
    refused(write(tmp_path / f"empty{suffix}", b""), "empty")


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize(
    "content",
    [b"hello there\nthis is not a scan\n" * 40, bytes(range(256)) * 40, b"\x00", b"\n", POINTS.tobytes()],
    ids=["words", "bytes", "nul", "newline", "floats"],
)
def test_other_content_is_refused(tmp_path, suffix, content, capfd):
    refused(write(tmp_path / f"a{suffix}", content))
    assert capfd.readouterr() == ("", "")


@given(
    st.sampled_from([s for s in SUFFIXES if s not in (".e57", ".brep")]), st.binary(min_size=1, max_size=400)
)
@settings(deadline=None, max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_random_bytes_end_in_a_value_error(tmp_path, suffix, content):
    refused(write(tmp_path / f"a{suffix}", content))


def test_unknown_suffix_lists_the_known_ones(tmp_path):
    for name in ("a.docx", "a"):
        message = refused(write(tmp_path / name, "x"))
        assert all(suffix in message for suffix in SUFFIXES)


@pytest.mark.parametrize("path", [None, 3, "", [], b"a.npy"])
def test_what_is_no_path_is_refused(path):
    with pytest.raises(ValueError, match="path of a file"):
        read_scan(path)


@pytest.mark.parametrize("sample", [0, 15, -1, 2.5, "many", None, True])
def test_bad_sample_is_refused(tmp_path, sample):
    path = write(tmp_path / "a.xyz", rows(POINTS))
    with pytest.raises(ValueError, match="sample"):
        read_scan(path, sample=sample)


def test_unknown_unit_is_refused(tmp_path):
    with pytest.raises(ValueError, match="length unit"):
        read_scan(write(tmp_path / "a.xyz", rows(POINTS)), unit="parsec")


# Imports

HEAVY = ["trimesh", "OCP", "cadquery", "matplotlib", "laspy", "lazrs", "pye57", "pypcd4", "cad_export"]


def test_importing_and_reading_a_table_load_no_format_library(tmp_path):
    write(tmp_path / "a.csv", rows(POINTS, ","))
    code = f"""
import sys
import ridgefeature.io, ridgefeature.scan
print([m for m in {HEAVY} if m in sys.modules])
ridgefeature.io.read_scan({str(tmp_path / "a.csv")!r})
print([m for m in {HEAVY} if m in sys.modules])
"""
    done = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["[]", "[]"]
