"""Campaigns on the reference ridges: what was asked beside what was measured, and what fails by kind of case.

    python benchmarks/reference/run.py [--quick] [--jobs 2] [--cases 500] [--first 0] [--only KIND]
                                       [--table F.csv] [--failures DIR]

KIND is one of the parts campaign, flat, clicks, rings; or holds kinds of case in the campaign alone, such as
path=ring or host=sphere,section=steep. Deterministic. --failures writes a picture of every case that fails.
"""

from __future__ import annotations

import csv
import os
import sys
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import fields
from functools import partial
from multiprocessing import get_context
from pathlib import Path as File
from typing import Any

sys.path.insert(0, str(File(__file__).resolve().parents[1]))

import numpy as np
from report import Report, at_least, at_most, between

from reference.flat import SURFACES
from reference.make import VERSION, kinds_of
from reference.measure import Row, one_case, one_flat, one_of_clicks, warm_up
from reference.score import Score

PARTS = ("campaign", "flat", "clicks", "rings")
KINDS = ("path", "host", "section", "sampling", "start", "end", "gap", "outliers", "banding", "kind", "noise")


def each(jobs: int, work: Callable[[Any], Any], tasks: Iterable[Any]) -> Iterator[Any]:
    """Results in the order of the tasks, from so many processes."""
    if jobs == 1:
        warm_up()
        yield from map(work, tasks)
        return
    os.environ["OPENBLAS_NUM_THREADS"] = os.environ["OMP_NUM_THREADS"] = "1"
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn"), initializer=warm_up) as pool:
        for n, result in enumerate(pool.map(work, tasks, chunksize=2), 1):
            if n % 50 == 0:
                print(f"{n} done", file=sys.stderr, flush=True)
            yield result


def campaign(report: Report, rows: list[Row]) -> None:
    """The figures of the campaign's rows."""
    scores: list[Score] = [row["score"] for row in rows]
    n = len(rows)
    passed = sum(not row["failed"] for row in rows)
    report.add(f"{n} random ridges: found whole, right and no more [%]", at_least(99), 100 * passed / n)
    for name, count in Counter(why for row in rows for why in row["failed"]).most_common():
        report.tell(f"  of these fail by {name}", f"{count} ({100 * count / n:.1f} %)")
    _ends(report, rows)
    for which, name in enumerate(("height", "width between the feet", "half-height width", "spine")):
        for words, asked, good in (
            ("no outliers", between(93, 97), lambda r: r["outliers"] == "none" and r["banding"] == "none"),
            ("outliers", between(93, 97), lambda r: r["outliers"] != "none" and r["banding"] == "none"),
            ("banding", at_least(90), lambda r: r["banding"] != "none"),
        ):
            pairs = [row["score"].bands[which] for row in rows if good(row)]
            total = sum(a for a, _ in pairs)
            if total:
                inside = 100 * sum(b for _, b in pairs) / total
                report.add(f"95 % band of {name}, {words}: holds the truth [%]", asked, inside, f"of {total}")
    seconds = [s.seconds for s in scores if np.isfinite(s.seconds)]
    if seconds:
        report.tell("seconds a scan: median, longest", f"{np.median(seconds):.2g}, {max(seconds):.2g}")


def _ends(report: Report, rows: list[Row]) -> None:
    errors: dict[str, list[float]] = {}
    holds: list[bool] = []
    exact: list[bool] = []
    for row in rows:
        for kind, error, held, at in zip(
            (row["start"], row["end"]),
            row["score"].ends,
            row["score"].end_holds,
            row["score"].end_exact,
            strict=True,
        ):
            if np.isfinite(error):
                errors.setdefault(kind, []).append(error)
            if kind == "fading" and held is not None:
                holds.append(held)
                exact.append(bool(at))
    for kind in ("abrupt", "border"):
        found = np.array(errors.get(kind, ()))
        if len(found):
            name = f"{kind} ends, {len(found)}: distance to the true end [local w]"
            rms = float(np.sqrt(np.mean(found**2)))
            if kind == "abrupt":
                report.add(f"{name}, rms", at_most(0.5), rms)
            else:
                report.tell(f"{name}, rms", f"{rms:.3g}")
            within = 100 * np.mean(np.abs(found) <= 0.5)
            report.tell(f"{name}, median; within 0.5 [%]", f"{np.median(np.abs(found)):.3g}; {within:.0f}")
    fading = len(errors.get("fading", ()))
    if holds:
        share = 100 * float(np.mean(holds))
        report.add(
            f"fading ends, {len(holds)}: 95 % interval reaches where it fades [%]", at_least(90), share
        )
        report.tell("  and holds where the height is 0 [%]", f"{100 * np.mean(exact):.0f}")
    elif fading:
        report.add(
            f"fading ends, {fading}: in the stated 95 % interval [%]", at_least(90), 0.0, "(none stated)"
        )


def by_kind(rows: list[Row]) -> str:
    """A Markdown table: of each kind of case, how many pass, and by what the others fail; weakest first."""
    lines = ["| kind | cases | pass [%] | fail by |", "|---|---|---|---|"]
    groups = []
    for key in KINDS:
        for value in sorted({str(row[key]) for row in rows}):
            group = [row for row in rows if str(row[key]) == value]
            why = Counter(w for row in group for w in row["failed"]).most_common(4)
            share = 100 * sum(not row["failed"] for row in group) / len(group)
            groups.append((share, f"{key} = {value}", len(group), ", ".join(f"{w} {c}" for w, c in why)))
    lines += [f"| {name} | {n} | {share:.0f} | {why} |" for share, name, n, why in sorted(groups)]
    return "\n".join(lines)


def flat(report: Report, found: list[tuple[str, int, str]]) -> None:
    wrong = [row for row in found if row[2]]
    share = 100 * len(wrong) / len(found)
    report.add(f"{len(found)} clicks where there is no ridge: false ridges [%]", at_most(1), share)
    for name in SURFACES:
        rows = [row for row in wrong if row[0] == name]
        examples = "; ".join(f"seed {seed}: {what}" for _, seed, what in rows[:2])
        report.tell(f"  {name}", f"{len(rows)} of {sum(row[0] == name for row in found)}. {examples}")


def same_ridge(report: Report, rows: list[Row]) -> None:
    total, found = sum(row["clicks"] for row in rows), sum(row["found"] for row in rows)
    report.tell(
        f"{len(rows)} ridges clicked {rows[0]['clicks']} times each: found [%]", f"{100 * found / total:.1f}"
    )
    for which, name in enumerate(("h(s)", "w(s)")):
        spreads = np.array([row["spread"][which] for row in rows])
        known = spreads[np.isfinite(spreads)]
        middle = float(np.median(known)) if len(known) else float("nan")
        note = f"(median; most {known.max():.3g})" if len(known) else ""
        report.add(f"  spread of {name} between clicks / its std", at_most(0.5), middle, note)


def rings(report: Report, rows: list[Row]) -> None:
    closed = [row for row in rows if row["score"].found and row["score"].closed]
    whole = sum(not row["failed"] for row in rows)
    report.add(f"{len(rows)} noisy rings: recognised as closed", at_least(len(rows)), len(closed))
    report.tell("  found whole and right too", str(whole))
    worst = max((row["seam"] for row in closed), default=float("nan"))
    report.add("  jump at the seam, up to the second derivative [w]", at_most(1e-9), worst)


def write_table(rows: list[Row], file: File) -> None:
    """One row a case: its kinds, what failed, all of its score."""
    flat_rows = []
    for row in rows:
        values = {key: row[key] for key in ("seed", *KINDS, "points", "seconds", "error")}
        values["failed"] = "; ".join(row["failed"])
        values |= dict(zip(("stop_start", "stop_end"), row["stop"], strict=True))
        scored = {f.name: getattr(row["score"], f.name) for f in fields(Score)}
        del scored["failed"], scored["seconds"]
        flat_rows.append(values | scored)
    with file.open("w", newline="") as stream:
        writer = csv.DictWriter(stream, list(flat_rows[0]))
        writer.writeheader()
        writer.writerows(flat_rows)


def main() -> None:
    options = _options()
    report = Report()
    part, fixed = _only(options.only)
    quick, jobs, first = options.quick, options.jobs, options.first
    rows: list[Row] = []
    if part in (None, "campaign"):
        if options.failures is not None:
            options.failures.mkdir(parents=True, exist_ok=True)
        work = partial(one_case, failures=options.failures, fixed=fixed)
        rows = list(each(jobs, work, range(first, first + options.cases)))
        if options.table is not None:
            write_table(rows, options.table)
        campaign(report, rows)
        print(by_kind(rows), file=sys.stderr, flush=True)
    if part in (None, "flat"):
        tasks = [(name, seed) for seed in range(3 if quick else 50) for name in SURFACES]
        flat(report, list(each(jobs, one_flat, tasks)))
    if part in (None, "clicks"):
        clicked = [(10_000 + seed, 6 if quick else 20) for seed in range(2 if quick else 12)]
        same_ridge(report, list(each(jobs, one_of_clicks, clicked)))
    if part in (None, "rings"):
        work = partial(one_case, fixed={"path": "ring"})
        rings(report, list(each(jobs, work, range(20_000, 20_000 + (4 if quick else 100)))))
    print(f"Reference ridges, version {VERSION}\n")
    report.show()
    if rows:
        print("\n" + by_kind(rows))


def _options() -> Namespace:
    summary, _, details = (__doc__ or "").partition("\n")
    parser = ArgumentParser(description=summary, epilog=details, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="about a minute")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--cases", type=int)
    parser.add_argument("--first", type=int, default=0, help="seed of the first case")
    parser.add_argument("--only", help=f"one of {', '.join(PARTS)}, or KIND=VALUE,...")
    parser.add_argument("--table", type=File)
    parser.add_argument("--failures", type=File)
    options = parser.parse_args()
    if options.cases is None:
        options.cases = 20 if options.quick else 500
    if options.jobs < 1 or options.cases < 1:
        parser.error("--jobs and --cases: expected 1 or more")
    try:
        _only(options.only)
    except ValueError as error:
        parser.error(str(error))
    return options


def _only(text: str | None) -> tuple[str | None, dict[str, str]]:
    """The part to run, None for all, and the kinds to hold."""
    if text is None or text in PARTS:
        return text, {}
    pairs = [pair.partition("=") for pair in text.split(",")]
    if not all(equals and key in KINDS[:-1] for key, equals, _ in pairs):
        known = ", ".join(KINDS[:-1])
        raise ValueError(f"--only: expected {', '.join(PARTS)} or KIND=VALUE,... with KIND one of {known}")
    fixed = {key: value for key, _, value in pairs}
    kinds_of(0, **fixed)
    return "campaign", fixed


if __name__ == "__main__":
    main()
