"""The reference ridges: drawn at random from a seed, with exact answers, never stored.

    python benchmarks/reference/make.py --out DIR [--cases 20] [--first 0]

writes each case as NAME.npz (points, click, kind) and its answer, sampled densely, as NAME.truth.npz.
"""

from __future__ import annotations

import sys
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from dataclasses import dataclass, replace
from pathlib import Path as File

import numpy as np
from numpy.typing import NDArray

if __name__ == "__main__":
    sys.path.insert(0, str(File(__file__).resolve().parents[1]))

from reference import paths
from reference.hosts import Array, Cylinder, Host, Plane, Saddle, Sphere
from reference.paths import Bends, Path
from reference.sampling import Sample, Scanner, sample
from reference.sections import PROFILES
from reference.truth import Pose, Truth, Wave, seen

VERSION = 2
"""Changes with every change of the drawn cases. Since 1 spirals no longer begin at a border, which cut the
winding beside it too; all other cases are the same."""
_SEED = 1
PATHS = ("straight", "S", "spiral", "kink", "ring")
HOSTS = ("plane", "cylinder along", "cylinder across", "sphere", "saddle")
CHOICES = {
    "path": PATHS,
    "host": HOSTS,
    "section": tuple(PROFILES),
    "sampling": ("grid", "random"),
    "start": ("abrupt", "abrupt", "fading", "border"),
    "end": ("abrupt", "abrupt", "fading", "border"),
    "gap": ("none", "none", "none", "gap"),
    "outliers": ("none", "none", "below 10 %", "10 to 20 %"),
    "banding": ("none", "none", "none", "banding"),
    "kind": ("ridge",) * 9 + ("groove",),
}
"""The kinds of a case and their values, each as often as it stands here."""
_MOST_POINTS = 150_000


@dataclass(frozen=True, eq=False)
class Case:
    """One scan: points (n, 3) and click (3,), its answer, and what kind of case it is, by key."""

    seed: int
    points: Array
    click: Array
    truth: Truth
    scanner: Scanner
    kinds: dict[str, str]
    sample: Sample

    @property
    def name(self) -> str:
        return f"case_{self.seed:04d}"

    @property
    def kind(self) -> str:
        """ "ridge" or "groove": what may be told to a method."""
        return "groove" if self.truth.heights.size < 0 else "ridge"


def draw(seed: int, **fixed: str) -> Case:
    """The reference case of a seed. fixed: kinds to hold, such as path="ring" or outliers="none".

    Raises ValueError for kinds that are not in CHOICES.
    """
    random = _random(seed)
    kinds = _kinds(random, fixed)
    path = _path(random, kinds)
    truth = _truth(random, kinds, path)
    scanner = _scanner(random, kinds, truth)
    tallest = abs(truth.heights.size) * (1 + truth.heights.swing)
    truth = replace(
        truth, visible=seen(truth, float(np.hypot(scanner.noise, scanner.banding)), scanner.spacing)
    )
    drawn = sample(truth, scanner, random)
    click = int(random.choice(_clickable(truth, drawn)))
    kinds["noise"] = _band(scanner.noise / tallest, (0.02, 0.05), ("below 2 %", "2 to 5 %", "5 to 8 %"))
    points = truth.pose.points(drawn.points)
    return Case(seed, points, points[click], truth, scanner, kinds, drawn)


def kinds_of(seed: int, **fixed: str) -> dict[str, str]:
    """What kind of case a seed gives, without making it."""
    return _kinds(_random(seed), fixed)


def _random(seed: int) -> np.random.Generator:
    return np.random.default_rng([_SEED, seed])


def _kinds(random: np.random.Generator, fixed: dict[str, str]) -> dict[str, str]:
    """The kinds of a case; each is drawn whether it is held or not, so that holding one changes no other."""

    drawn = {key: str(names[int(random.integers(len(names)))]) for key, names in CHOICES.items()}
    for key, value in fixed.items():
        if value not in CHOICES.get(key, ()):
            known = dict.fromkeys(CHOICES.get(key, CHOICES))
            raise ValueError(f"kind {key}={value}: expected one of {', '.join(known)}")
    drawn |= fixed
    if drawn["path"] == "ring":
        # A curve of constant curvature does not close on a saddle.
        drawn |= {"start": "none", "end": "none"}
        drawn["host"] = "plane" if drawn["host"] == "saddle" else drawn["host"]
    elif drawn["path"] == "spiral":
        # The border of the data would cut the winding beside it.
        drawn |= {end: "abrupt" for end in ("start", "end") if drawn[end] == "border"}
    return drawn


def _path(random: np.random.Generator, kinds: dict[str, str]) -> Path:
    """A path on a host that it neither leaves nor comes near itself on."""
    side = float(random.choice([-1.0, 1.0]))
    heading = float(random.uniform(-0.3, 0.3)) + (np.pi / 2 if kinds["host"] == "cylinder across" else 0.0)
    bends = _bends(random, kinds["path"], side)
    flat = Path(Plane(), bends).tree.data
    size = float(np.hypot(*(flat.max(axis=0) - flat.min(axis=0))[:2]))
    least = max(4.0, 0.5 * size)
    radius = (
        least * float(np.exp(random.uniform(0.0, np.log(4.0)))) * (-1.0 if random.uniform() < 0.3 else 1.0)
    )
    for _ in range(12):
        host = _host(kinds["host"], radius)
        if kinds["path"] == "ring" and isinstance(host, Sphere):
            bends = paths.small_circle(bends.length / (2 * np.pi), abs(radius))
        path = Path(host, bends, heading)
        if path.clear(1.6, 2.5):
            return path
        radius *= 1.5
    raise ValueError(f"expected a path clear of itself; got none: draw another than {kinds}")


def _bends(random: np.random.Generator, name: str, side: float) -> Bends:
    if name == "straight":
        return paths.straight(float(random.uniform(10, 22)))
    if name == "S":
        return paths.winding(float(random.uniform(12, 24)), side * float(random.uniform(0.6, 2.2)))
    if name == "spiral":
        return paths.spiral(float(random.uniform(3.0, 4.2)), float(random.uniform(1.2, 1.8)), 2.3, side)
    if name == "kink":
        length = float(random.uniform(12, 20))
        angle = side * np.radians(float(random.uniform(20, 90)))
        return paths.kink(length, float(random.uniform(0.3, 0.7)) * length, angle)
    return paths.ring(float(random.uniform(2.0, 4.2)), float(random.uniform(0.0, 0.3)))


def _host(name: str, radius: float) -> Host:
    if name == "plane":
        return Plane()
    if name.startswith("cylinder"):
        return Cylinder(radius)
    return Sphere(radius) if name == "sphere" else Saddle(radius)


def _truth(random: np.random.Generator, kinds: dict[str, str], path: Path) -> Truth:
    length = path.bends.length
    steep = kinds["section"] == "steep"
    ratio = float(random.uniform(0.6, 2.0) if steep else random.uniform(0.1, 0.6))
    swings = random.uniform(0.0, 1.0, 2) * (0.5, 0.25)
    waves = random.uniform(6.0, 25.0, 2)
    if path.bends.closed:
        waves = length / np.maximum(np.floor(length / waves), 1.0)
    phases = random.uniform(0.0, 1.0, 2)
    widths = Wave(1 / (1 + swings[1]), float(swings[1]), float(waves[1]), float(phases[1]))
    sign = -1.0 if kinds["kind"] == "groove" else 1.0
    heights = Wave(sign * ratio / (1 + swings[0]), float(swings[0]), float(waves[0]), float(phases[0]))
    longest = random.uniform(2.0, 5.0, 2)
    fades = tuple(
        float(min(fade, 0.3 * length)) if kinds[end] == "fading" else 0.0
        for fade, end in zip(longest, ("start", "end"), strict=True)
    )
    pose = Pose(_rotation(random), random.uniform(-50.0, 50.0, 3), float(10 ** random.uniform(-1.0, 2.0)))
    ends = (kinds["start"], kinds["end"])
    return Truth(path, PROFILES[kinds["section"]], heights, widths, pose, ends, (fades[0], fades[1]))


def _rotation(random: np.random.Generator) -> Array:
    """A rotation drawn evenly: from a unit quaternion."""
    q = random.normal(0.0, 1.0, 4)
    w, x, y, z = q / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def _scanner(random: np.random.Generator, kinds: dict[str, str], truth: Truth) -> Scanner:
    """At least 6 points by the smallest half-height width; noise up to 8 % of the largest height, in all."""
    length = truth.path.bends.length
    tallest = abs(truth.heights.size) * (1 + truth.heights.swing)
    narrowest = truth.widths.size * (1 - truth.widths.swing) * truth.section.half_height_width
    across = 6.0 * float(np.exp(random.uniform(0.0, np.log(2.5))))
    uv = truth.base.chart(truth.path.tree.data)
    area = float(np.prod(uv.max(axis=0) - uv.min(axis=0) + 3.2))
    spacing = max(narrowest / across, min(float(np.sqrt(area / _MOST_POINTS)), narrowest / 6.0))
    share = {"none": (0.0, 0.0), "below 10 %": (0.01, 0.1), "10 to 20 %": (0.1, 0.2)}[kinds["outliers"]]
    noise, band = float(random.uniform(0.0, 0.08)) * tallest, float(random.uniform(0.3, 0.7))
    banding = band * noise if kinds["banding"] == "banding" else 0.0
    at, gap = float(random.uniform(0.25, 0.7)) * length, float(random.uniform(0.3, 1.0))
    return Scanner(
        spacing,
        grid=kinds["sampling"] == "grid",
        turn=float(random.uniform(0.0, np.pi)),
        noise=float(np.sqrt(noise**2 - banding**2)),
        outliers=float(random.uniform(*share)),
        banding=banding,
        gap=(at, at + gap * truth.widths.size) if kinds["gap"] == "gap" else None,
    )


def clicks(case: Case, count: int, seed: int) -> Array:
    """(count, 3) other places to click on the case's ridge."""
    random = np.random.default_rng([_SEED, case.seed, seed])
    return np.asarray(case.points[random.choice(_clickable(case.truth, case.sample), count)])


def _clickable(truth: Truth, drawn: Sample) -> NDArray[np.intp]:
    """Rows of the points of the visible ridge, crest or flank, at a fifth of the height at least."""
    s, y = np.nan_to_num(drawn.s, nan=-9.0), np.nan_to_num(drawn.y)
    s = np.mod(s, truth.path.bends.length) if truth.closed else s
    low, high = (end / truth.pose.scale for end in truth.visible)
    on = drawn.good & ~np.isnan(drawn.s) & (s >= low) & (s <= high)
    height = np.abs(truth.height(s * truth.pose.scale))
    on &= height > 0.2 * np.abs(truth.height(np.linspace(0, truth.length, 200))).max()
    return np.flatnonzero(on & (truth.section(y / truth.widths(s)) > 0.2))


def _band(value: float, limits: tuple[float, float], names: tuple[str, str, str]) -> str:
    return names[int(np.searchsorted(limits, value))]


def main() -> None:
    summary, _, details = (__doc__ or "").partition("\n")
    parser = ArgumentParser(description=summary, epilog=details, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=File, required=True, help="folder to write to")
    parser.add_argument("--cases", type=int, default=20)
    parser.add_argument("--first", type=int, default=0)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    for seed in range(options.first, options.first + options.cases):
        write(draw(seed), options.out)


def write(case: Case, folder: File) -> None:
    """The case as NAME.npz, and its answer at 2001 arc lengths as NAME.truth.npz."""
    truth = case.truth
    s = np.linspace(0.0, truth.length, 2001)
    np.savez_compressed(folder / f"{case.name}.npz", points=case.points, click=case.click, kind=case.kind)
    np.savez_compressed(
        folder / f"{case.name}.truth.npz",
        arc_length=s,
        spine=truth.spine(s),
        height=truth.height(s),
        width=truth.width(s),
        half_height_width=truth.half_height_width(s),
        closed=truth.closed,
        ends=np.array(truth.ends),
        visible=np.array(truth.visible),
        version=VERSION,
    )


if __name__ == "__main__":
    main()
