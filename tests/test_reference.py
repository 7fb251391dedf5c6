"""The reference ridges are exact and the same for the same seed; the scorer gives the figures it should."""

from __future__ import annotations

import csv
import json
import runpy
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial import cKDTree

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))

from reference import paths
from reference.flat import SURFACES, ridge_free
from reference.hosts import Array, Cylinder, Host, Plane, Saddle, Sphere
from reference.make import HOSTS, PATHS, Case, clicks, draw, kinds_of, write
from reference.measure import registered
from reference.paths import Path as RidgePath
from reference.score import Found, from_ridge, read_answer, score
from reference.sections import FLANK, LEAN, PROFILES, level_crossings
from reference.truth import Truth

RUN = Path(__file__).resolve().parents[1] / "benchmarks" / "reference" / "run.py"
ALL_HOSTS: list[Host] = [
    Plane(),
    Cylinder(5.0),
    Cylinder(-5.0),
    Sphere(6.0),
    Sphere(-6.0),
    Saddle(6.0),
    Saddle(-6.0),
]


def name(host: object) -> str:
    return str(host)


def answer(truth: Truth, k: int = 161) -> Found:
    """The truth itself as an answer, on its visible stretch."""
    s = np.linspace(*truth.visible, k)
    if truth.closed:
        s = s[:-1]
    return Found(
        spine=truth.spine(s),
        height=truth.height(s),
        width=truth.width(s),
        half_height_width=truth.half_height_width(s),
        closed=truth.closed,
    )


@pytest.fixture(scope="module")
def straight() -> Case:
    return draw(1, path="straight", host="plane", section="bell", start="abrupt", end="abrupt", gap="none")


@pytest.mark.parametrize("host", ALL_HOSTS, ids=name)
def test_geodesics_stay_on_the_host_bend_with_it_alone_and_have_their_length(host: Host) -> None:
    random = np.random.default_rng(0)
    p = host.place(random.uniform(-2, 2, (40, 2)))
    n = host.normal(p)
    d = np.cross(n, random.normal(size=n.shape))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    np.testing.assert_allclose(np.linalg.norm(n, axis=1), 1, atol=1e-14)
    line = np.array([host.geodesic(p, d, np.full(40, y)) for y in np.linspace(0, 0.8, 101)])
    np.testing.assert_allclose(host.place(host.chart(line.reshape(-1, 3))), line.reshape(-1, 3), atol=1e-12)
    length = np.linalg.norm(np.diff(line, axis=0), axis=2).sum(axis=0)
    np.testing.assert_allclose(length, 0.8, atol=2e-7)  # chords of 0.008 are shorter than arcs by that
    bend = (line[2:] - 2 * line[1:-1] + line[:-2])[50] / 0.008**2
    at = line[51]
    across = bend - host.normal(at) * (bend * host.normal(at)).sum(axis=1, keepdims=True)
    np.testing.assert_allclose(across, 0, atol=1e-5)
    np.testing.assert_allclose(
        (bend * host.normal(at)).sum(axis=1), host.bend(at, (line[52] - line[50]) / 0.016), atol=1e-5
    )


def test_a_saddles_geodesics_are_those_of_its_christoffel_symbols() -> None:
    host = Saddle(6.0)

    def rate(_: float, q: Array) -> Array:
        x, y, dx, dy = q
        # z = (y^2 - x^2) / 12: z_x = -x / 6, z_y = y / 6, z_xx = -1 / 6 = -z_yy.
        pull = (-(dx**2) + dy**2) / 6 / (1 + (x * x + y * y) / 36)
        return np.array([dx, dy, x / 6 * pull, -y / 6 * pull])

    p = host.place(np.array([[1.0, -2.0]]))
    d = np.array([[0.6, 0.8, 0.0]])
    d[0, 2] = d[0] @ [-1.0 / 6, -2.0 / 6, 0.0]
    d /= np.linalg.norm(d)
    there = solve_ivp(rate, (0, 0.8), [1.0, -2.0, d[0, 0], d[0, 1]], rtol=1e-12, atol=1e-12).y[:2, -1]
    np.testing.assert_allclose(host.geodesic(p, d, np.array([0.8]))[0, :2], there, atol=1e-10)


@pytest.mark.parametrize("host", ALL_HOSTS, ids=name)
@pytest.mark.parametrize(
    "bends",
    [paths.winding(6.0, 1.0), paths.spiral(2.5, 1.2, 2.3, -1.0), paths.kink(5.0, 2.0, 1.2)],
    ids=["S", "spiral", "kink"],
)
def test_paths_run_at_unit_speed_with_the_geodesic_curvature_that_was_asked_for(
    host: Host, bends: paths.Bends
) -> None:
    path = RidgePath(host, bends, 0.3)
    s, step = np.linspace(0.1, bends.length - 0.1, 57), 1e-4
    s = s[[all(abs(x - b) > 2 * step for b in bends.breaks) for x in s]]
    before, (p, t, n), after = (path.frames(s + x) for x in (-step, 0, step))
    np.testing.assert_allclose((after[0] - before[0]) / (2 * step), t, atol=1e-7)
    turn = ((after[1] - before[1]) / (2 * step) * np.cross(n, t)).sum(axis=1)
    np.testing.assert_allclose(turn, path.curvature(s), atol=1e-6)
    np.testing.assert_allclose(host.place(host.chart(p)), p, atol=1e-12)


def test_a_kink_turns_by_its_angle_and_rings_close() -> None:
    bent = RidgePath(Plane(), paths.kink(8.0, 3.0, np.radians(70)))
    _, t, _ = bent.frames(np.array([0.0, 8.0]))
    assert np.degrees(np.arccos(t[0] @ t[1])) == pytest.approx(70, abs=1e-8)
    for host, bends in (
        (Plane(), paths.ring(3.0, 0.3)),
        (Cylinder(4.0), paths.ring(2.0, 0.2)),
        (Sphere(-6.0), paths.small_circle(3.0, 6.0)),
    ):
        path = RidgePath(host, bends)
        (p, q), t, _ = path.frames(np.array([0.0, bends.length - 1e-9]))
        np.testing.assert_allclose(p, q, atol=3e-9)
        np.testing.assert_allclose(t[0], t[1], atol=3e-9)


@pytest.mark.parametrize("host", HOSTS)
def test_points_without_noise_lie_on_the_true_surface(host: str) -> None:
    case = draw(3, path="S", host=host, start="abrupt", end="abrupt")
    truth, drawn = case.truth, case.sample
    near = ~np.isnan(drawn.s)
    assert 0.05 < near.mean() < 0.95
    scale = truth.pose.scale
    surface = truth.surface(drawn.s[near] * scale, drawn.y[near] * scale)
    np.testing.assert_allclose(truth.pose.points(drawn.exact[near]), surface, rtol=0, atol=1e-9 * scale)
    feet = truth.base.place(truth.base.chart(drawn.exact[~near]))
    np.testing.assert_allclose(drawn.exact[~near], feet, atol=1e-9)
    # None of those that are called flat lies between the feet.
    away = cKDTree(truth.path.frames(np.linspace(0, truth.path.bends.length, 4000))[0]).query(feet)[0]
    assert away.min() > 0.5


def closed_form(host: Host, points: Array) -> tuple[Array, Array, Array]:
    """Coordinates along x, across and up (n,) of points (n, 3) about a plane, cylinder or sphere.

    On a plane and a developed cylinder x and y; on a sphere arcs from the great circle over the x axis.
    """
    if isinstance(host, Plane):
        return points[:, 0], points[:, 1], points[:, 2]
    r = host.radius  # type: ignore[attr-defined]
    from_middle = points + np.array([0, 0, r])
    if isinstance(host, Cylinder):
        from_middle[:, 0] = 0
    out = np.sign(r) * from_middle / np.linalg.norm(from_middle, axis=1, keepdims=True)
    up = (from_middle * out).sum(axis=1) - r
    if isinstance(host, Cylinder):
        return points[:, 0], r * np.arctan2(out[:, 1], out[:, 2]), up
    return r * np.arctan2(out[:, 0], out[:, 2]), r * np.arcsin(out[:, 1]), up


@pytest.mark.parametrize("host", ["plane", "cylinder along", "cylinder across", "sphere"])
def test_straight_ridges_have_their_height_at_geodesic_distances_in_closed_form(host: str) -> None:
    case = draw(12, path="straight", host=host, section="bell", start="abrupt", end="fading", kind="ridge")
    truth, exact = case.truth, case.sample.exact
    scale, length = truth.pose.scale, truth.path.bends.length
    c, s = np.cos(truth.path.heading), np.sin(truth.path.heading)
    if isinstance(truth.base, Sphere):
        exact = exact @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    x, y, up = closed_form(truth.base, exact)
    if not isinstance(truth.base, Sphere):
        x, y = c * x + s * y, c * y - s * x
    x = x + length / 2
    expected = truth.height(scale * x) / scale * truth.section(y / (truth.width(scale * x) / scale))
    on = (x >= 0) & (x <= length)
    np.testing.assert_allclose(up, np.where(on, expected, 0), rtol=0, atol=1e-9)
    assert (up > 0.9 * expected.max()).any()


def test_heights_on_a_plane_and_on_a_cylinder_are_those_of_the_distance_to_the_path() -> None:
    for host in ("plane", "cylinder across"):
        case = draw(
            11, path="kink", host=host, section="asymmetric", start="abrupt", end="abrupt", kind="ridge"
        )
        truth, exact = case.truth, case.sample.exact[::9]
        path = truth.path
        r = getattr(path.host, "radius", 1.0)
        angle = np.arctan2(exact[:, 1] / r, exact[:, 2] / r + 1)
        radial = np.hypot(exact[:, 1], exact[:, 2] + r)
        flat = exact[:, :2] if host == "plane" else np.column_stack([exact[:, 0], r * angle])
        height = exact[:, 2] if host == "plane" else np.sign(r) * (radial - abs(r))
        s = np.linspace(0, path.bends.length, 8_001)
        p, t, n = path.frames(s)
        left = np.cross(n, t)
        if host != "plane":
            around = np.column_stack([0 * s, np.cos(path.host._angle(p)), -np.sin(path.host._angle(p))])
            left = np.column_stack([left[:, 0], (left * around).sum(axis=1)])
        away, k = cKDTree(path.host.chart(p)).query(flat)
        inside = (k > 0) & (k < len(s) - 1)
        side = ((flat - path.host.chart(p)[k]) * left[k, :2]).sum(axis=1)
        x = s[k]
        expected = truth.height(x * truth.pose.scale) / truth.pose.scale
        expected *= truth.section(
            np.copysign(away, side) / (truth.width(x * truth.pose.scale) / truth.pose.scale)
        )
        np.testing.assert_allclose(height[inside], expected[inside], atol=1e-3 * np.abs(expected).max())


@pytest.mark.parametrize("section", PROFILES.values(), ids=PROFILES.keys())
def test_sections_are_0_at_the_feet_and_1_at_most(section: object) -> None:
    profile = PROFILES[section.name]
    eta = np.linspace(-0.5, 0.5, 20_001)
    assert profile(eta).max() == pytest.approx(1, abs=1e-6)
    assert profile(eta).min() >= -0.02
    np.testing.assert_allclose(profile([-0.5, 0.5, -0.7, 3.0]), 0, atol=1e-12)
    low, high = level_crossings(profile, 0.5)
    np.testing.assert_allclose(profile([low, high]), 0.5, atol=1e-9)
    steepest = np.abs(np.diff(profile(eta))).max() / (eta[1] - eta[0])
    if profile.name == "steep":
        assert np.degrees(np.arctan(2 * steepest)) > 85 and high == pytest.approx(0.5 - FLANK / 2, abs=0.01)
    assert (profile.apex > LEAN / 2) == (profile.name == "asymmetric")


def test_random_points_are_even_by_area_also_on_steep_flanks() -> None:
    case = draw(
        5, path="straight", host="plane", section="steep", sampling="random", outliers="none", gap="none"
    )
    truth, drawn = case.truth, case.sample
    tree = cKDTree(drawn.exact)
    spacing = case.scanner.spacing
    on = np.flatnonzero((drawn.s > 2) & (drawn.s < truth.path.bends.length - 2))
    eta = np.abs(drawn.y[on] / truth.widths(drawn.s[on]))
    counts = np.array([len(x) for x in tree.query_ball_point(drawn.exact[on], 2 * spacing)])
    flank, top = counts[(eta > 0.41) & (eta < 0.47)].mean(), counts[eta < 0.3].mean()
    expected = 4 * np.pi + 1
    assert top == pytest.approx(expected, rel=0.15)
    assert flank == pytest.approx(expected, rel=0.3)


def test_the_same_seed_gives_the_same_bytes_and_every_kind_is_drawn() -> None:
    one, again, other = draw(2), draw(2), draw(4)
    assert one.points.tobytes() == again.points.tobytes() and one.click.tobytes() == again.click.tobytes()
    assert one.points.shape != other.points.shape or not np.array_equal(one.points, other.points)
    np.testing.assert_array_equal(clicks(one, 5, 0), clicks(again, 5, 0))
    assert {kinds_of(seed)["path"] for seed in range(40)} == set(PATHS)
    assert kinds_of(2) == {key: one.kinds[key] for key in kinds_of(2)}
    assert draw(2, section="steep").kinds["section"] == "steep"
    with pytest.raises(ValueError, match="colour=blue: expected one of path, host"):
        draw(0, colour="blue")
    with pytest.raises(ValueError, match="expected one of ridge, groove"):
        draw(0, kind="bump")


@pytest.mark.parametrize("path", PATHS)
def test_cases_keep_to_what_the_set_promises(path: str) -> None:
    case = draw(6, path=path, outliers="10 to 20 %")
    truth, scanner = case.truth, case.scanner
    tallest = np.abs(truth.height(np.linspace(0, truth.length, 500))).max() / truth.pose.scale
    assert np.hypot(scanner.noise, scanner.banding) <= 0.08 * tallest * (1 + 1e-9)
    narrowest = truth.half_height_width(np.linspace(0, truth.length, 500)).min() / truth.pose.scale
    assert narrowest / scanner.spacing >= 6 * (1 - 1e-3)
    assert 0.1 <= 1 - case.sample.good.mean() <= 0.2
    assert truth.path.clear(1.6, 2.5)
    s, offset = truth.nearest(case.click[None])
    assert truth.visible[0] <= s[0] <= truth.visible[1]
    assert np.linalg.norm(offset) < 2.5 * tallest * truth.pose.scale + truth.width(s)[0]
    assert (np.linalg.norm(case.points - case.click, axis=1) == 0).any()


@pytest.mark.parametrize("seed", [0, 1, 5, 8])
def test_the_truth_itself_has_full_marks_either_way_round(seed: int) -> None:
    truth = draw(seed).truth
    found = answer(truth, 801)
    for one in (found, replace(found, spine=found.spine[::-1], height=found.height[::-1],
                               width=None, half_height_width=found.half_height_width[::-1])):  # fmt: skip
        got = score(truth, one)
        assert got.passed and got.failed == ()
        assert got.length == 1 and got.spine_rms < 1e-6 and got.height_good == got.half_width_good == 1
        # The apex of the asymmetric section runs beside the path: in bends it is longer or shorter.
        assert got.overshoot < 1e-4 and got.doubled == pytest.approx(1, abs=0.05)


def test_what_is_shifted_or_scaled_scores_by_how_much(straight: Case) -> None:
    truth = straight.truth
    found = answer(truth)
    s, _ = truth.nearest(found.spine)
    _, left, up = truth.frame(s)
    aside = replace(found, spine=found.spine + (0.2 * truth.width(s))[:, None] * left)
    assert score(truth, aside).spine_rms == pytest.approx(0.2, rel=1e-6)
    assert score(truth, aside).failed == ("spine",)
    raised = replace(found, spine=found.spine + (0.05 * truth.width(s))[:, None] * up)
    assert score(truth, raised).spine_rms == pytest.approx(0.05, rel=1e-6)
    taller = replace(found, height=1.04 * found.height)
    assert score(truth, taller).failed == ("height",)
    assert score(truth, taller).height_error == pytest.approx(0.04)
    known = replace(taller, height_std=np.abs(0.04 * truth.height(s)) / 2.9)
    assert score(truth, known).passed
    half = replace(
        found, half_height_width=np.where(s < 0.9 * truth.length, 1, 1.1) * truth.half_height_width(s)
    )
    assert score(truth, half).half_width_good == pytest.approx(0.9, abs=0.01)
    assert score(truth, half).failed == ("half-height width",)
    assert score(truth, replace(found, closed=True)).failed[-1] == "closed"


def test_what_is_cut_goes_too_far_or_turns_back_scores_by_how_much(straight: Case) -> None:
    truth = straight.truth
    found = answer(truth, 401)

    def part(rows: Array) -> Found:
        k = rows.astype(np.intp)
        return Found(found.spine[k], found.height[k], half_height_width=found.half_height_width[k])

    cut = score(truth, part(np.arange(0, 321)))
    assert cut.length == pytest.approx(0.8, abs=0.01) and cut.failed == ("length",)
    short = 0.2 * truth.length / truth.width(np.array([truth.length]))[0]
    assert cut.ends == pytest.approx((0, -short), abs=1e-3)
    back = score(truth, part(np.concatenate([np.arange(0, 401), np.arange(400, 199, -1)])))
    assert back.doubled == pytest.approx(1.5, abs=0.02) and back.failed == ("doubled",)
    end = np.array([truth.length])
    beyond = found.spine[-1] + 1.5 * truth.width(end)[0] * truth.frame(end)[0][0]
    longer = replace(
        part(np.arange(401)),
        spine=np.vstack([found.spine, beyond]),
        height=np.append(found.height, 1.0),
        half_height_width=np.append(found.half_height_width, 1.0),
    )
    over = score(truth, longer)
    assert over.overshoot == pytest.approx(1.5, abs=1e-3) and over.failed == ("overshoot",)
    assert over.ends[1] == pytest.approx(1.5, abs=1e-3)


def test_bands_and_intervals_are_counted(straight: Case) -> None:
    truth = straight.truth
    found = answer(truth)
    s, _ = truth.nearest(found.spine)
    k, w = len(s), truth.width(s)
    error = np.abs(0.01 * truth.height(s))
    stated = replace(
        found,
        height=found.height + error,
        height_std=error / np.where(np.arange(k) < k // 4, 2.1, 1.9),
        spine_std=0 * w + 1,
        end_interval=np.array([[-0.1, 0.1], [truth.length - 0.5, truth.length - 0.2]]),
    )
    got = score(truth, stated)
    assert got.bands == ((k, k - k // 4), (0, 0), (0, 0), (k, k))
    assert got.end_holds == (True, False) and got.end_exact == (True, False)


def test_nothing_found_is_no_success(straight: Case) -> None:
    got = score(straight.truth, None)
    assert not got.passed and not got.found and got.length == 0 and got.failed == ("nothing found",)


def test_a_ring_must_be_closed() -> None:
    truth = draw(5, path="ring").truth
    found = answer(truth)
    assert score(truth, found).passed and score(truth, found).closed
    assert score(truth, replace(found, closed=False)).failed == ("not closed",)


def test_other_methods_read_cases_and_hand_in_answers(straight: Case, tmp_path: Path) -> None:
    write(straight, tmp_path)
    with (
        np.load(tmp_path / f"{straight.name}.npz") as case,
        np.load(tmp_path / f"{straight.name}.truth.npz") as true,
    ):
        np.testing.assert_array_equal(case["points"], straight.points)
        rows = {n: true[n][::10] for n in ("spine", "height", "half_height_width")}
    np.savez(tmp_path / "answer.npz", **rows)
    (tmp_path / "answer.json").write_text(
        json.dumps({n: x.tolist() for n, x in rows.items()} | {"closed": False})
    )
    for suffix in (".npz", ".json"):
        assert score(straight.truth, read_answer(tmp_path / f"answer{suffix}")).passed
    (tmp_path / "none.json").write_text('{"spine": []}')
    assert read_answer(tmp_path / "none.json") is None
    (tmp_path / "bad.json").write_text('{"spine": [[0, 0, 0], [1, 0, 0]], "height": [1, 1]}')
    with pytest.raises(ValueError, match="expected height, and width or half_height_width"):
        read_answer(tmp_path / "bad.json")
    (tmp_path / "bad.json").write_text('{"spine": [[0, 0, 0], [1, 0, 0]], "height": [1, 1], "width": [1]}')
    with pytest.raises(ValueError, match=r"expected width of shape \(2,\)"):
        read_answer(tmp_path / "bad.json")


@pytest.mark.parametrize("surface", SURFACES)
def test_surfaces_without_a_ridge_are_the_same_for_the_same_seed(surface: str) -> None:
    points, click = ridge_free(surface, 3)
    again, _ = ridge_free(surface, 3)
    assert points.tobytes() == again.tobytes() and np.isfinite(points).all() and len(points) > 4000
    assert (points == click).all(axis=1).any()


def test_the_campaign_prints_its_figures_and_writes_its_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [str(RUN), "--cases", "2", "--jobs", "1", "--only"]
    monkeypatch.setattr(sys, "argv", [*words, "path=straight", "--table", str(tmp_path / "t.csv")])
    monkeypatch.syspath_prepend(RUN.parent)
    runpy.run_path(str(RUN), run_name="__main__")
    printed = capsys.readouterr().out
    assert "2 random ridges: found whole, right and no more [%]" in printed
    assert "| path = straight | 2 |" in printed
    with (tmp_path / "t.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert [row["seed"] for row in rows] == ["0", "1"] and {row["path"] for row in rows} == {"straight"}
    wrong = subprocess.run([sys.executable, *words, "nonsense"], capture_output=True, text=True)
    assert wrong.returncode == 2 and "expected campaign, flat, clicks, rings or KIND=VALUE" in wrong.stderr


@pytest.mark.parametrize(
    "seed",
    [
        pytest.param(1768, id="behind the bend of its end a bell misses the flat top by more than the noise"),
        pytest.param(2119, id="the same of a higher ridge, by more"),
        pytest.param(2041, id="what explains most about the pick is as wide as the ridge, and leads nowhere"),
        pytest.param(2310, id="what explains most about the pick is wider than the ridge"),
    ],
)
def test_a_ridge_is_found_whole_although(seed: int) -> None:
    case = draw(seed)
    ridge, seconds, _ = registered(case)
    assert ridge is not None
    assert score(case.truth, from_ridge(ridge, seconds)).failed == ()


def test_a_section_that_is_learned_in_the_last_fit_ends_at_its_feet() -> None:
    case = draw(100)
    ridge, _, _ = registered(case)
    assert ridge is not None and ridge.section.name == "learned"
    true = case.truth.section.half_height_width
    assert ridge.section.half_height_width == pytest.approx(true, rel=0.05)  # in widths between the feet
    stations, inside = score(case.truth, from_ridge(ridge, 0)).bands[0]
    assert inside >= 0.9 * stations
