"""`mrwork profile`: how well the data settle each parameter of a stored fit."""

from __future__ import annotations

import argparse
import json
import sys
import time
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mrwork.cli.options import add_json
from mrwork.cli.run_page import renew_page
from mrwork.errors import Interrupted, SettingError
from mrwork.identification.fit import Fit, Identifiability
from mrwork.identification.fit_file import reopen
from mrwork.store.codec import json_document
from mrwork.store.run_folder import PROFILES, write_files

if TYPE_CHECKING:
    from mrwork.uncertainty.identifiability.profile import Profiles
    from mrwork.uncertainty.identifiability.profile_likelihood import ProfileProgress

# Seconds until progress is worth a line, and between two.
_PATIENCE, _EVERY = 2.0, 0.2


def add_parser(verbs: Any) -> None:
    """Declare the verb."""
    parser = verbs.add_parser(
        "profile",
        description="Profile the likelihood of a fit in each parameter: intervals that may stay open, verdicts, and "
        "the directions that the data do not see.",
    )
    parser.add_argument("place", type=Path, metavar="RUN", help="run directory of mrwork identify")
    parser.add_argument(
        "--parameter",
        dest="parameters",
        action="append",
        default=[],
        metavar="NAME",
        help="profile this one only; repeat for more",
    )
    parser.add_argument(
        "--level", type=float, default=0.95, metavar="P", help="of the intervals, default 0.95"
    )
    parser.add_argument("--threads", type=int, default=0, metavar="N", help="threads, default all")
    parser.add_argument("--quiet", action="store_true", help="no progress")
    add_json(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Profile, write the document and the figure into the run directory, print the table."""
    if options.threads < 0:
        raise SettingError(f"--threads is {options.threads}; it cannot be negative")
    # SciPy's optimisers are slow to load, and not wanted where help is.
    from mrwork.uncertainty.identifiability.profile_likelihood import profile
    from mrwork.uncertainty.identifiability.verdicts import identifiability_of

    opened = reopen(options.place)
    line = _Line(quiet=options.quiet or options.json)
    status = 0
    try:
        profiles = profile(
            opened.fit,
            opened.tests,
            parameters=options.parameters,
            level=options.level,
            threads=options.threads,
            on_progress=line,
        )
    except Interrupted as interrupt:
        profiles, status = interrupt.result, 130
    finally:
        line.close()
    seen = identifiability_of(opened.fit, opened.tests, threads=options.threads)
    document = asdict(profiles) | {"directions": [asdict(each) for each in seen.directions]}
    figures: dict[str, bytes] = {}
    if status == 0:
        # Matplotlib is slow to load.
        from mrwork.report.fit.profiles import profiles_figure
        from mrwork.report.svg import figure_files

        figures = figure_files({"profiles": profiles_figure(profiles)})
    write_files(opened.place, {PROFILES: json_document(document).encode()} | figures)
    renew_page(opened.place)
    if options.json:
        # One line, and null for what is not finite, as in the file.
        print(json.dumps(json.loads(json_document(document | {"out": str(opened.place / PROFILES)}))))
    else:
        print(_text(opened.fit, profiles, seen, opened.place))
    if status == 130:
        print(f"mrwork: interrupted; what was profiled is in {opened.place / PROFILES}", file=sys.stderr)
    return status


class _Line:
    """One line of progress on a terminal, from two seconds on."""

    def __init__(self, *, quiet: bool) -> None:
        self._active = not quiet and sys.stderr.isatty()
        self._next = time.perf_counter() + _PATIENCE
        self._width = 0

    def __call__(self, progress: ProfileProgress) -> None:
        if not self._active or time.perf_counter() < self._next:
            return
        self._next = time.perf_counter() + _EVERY
        self._write(
            f"{progress.ended} of {progress.sides} sides, {progress.points} points, "
            f"{progress.evaluations / progress.seconds:.0f} evaluations/s, {progress.seconds:.0f} s"
        )

    def close(self) -> None:
        if self._active and self._width:
            self._write("")
            print("\r", end="", file=sys.stderr, flush=True)

    def _write(self, text: str) -> None:
        print("\r" + text.ljust(self._width), end="", file=sys.stderr, flush=True)
        self._width = len(text)


def _text(fit: Fit, profiles: Profiles, seen: Identifiability, place: Path) -> str:
    share = 100.0 * profiles.level
    form = "" if profiles.model == fit.model else f", in the form {profiles.model}"
    lines = [
        f"{share:g} % intervals by profile likelihood{form}; {profiles.n_time} samples with correlated residuals "
        f"count as {profiles.n_effective:.0f}",
        "",
    ]
    width = max(len(each.name) for each in profiles.profiles)
    units = max(len(each.unit) for each in profiles.profiles)
    for each in profiles.profiles:
        ends = [f"{end:.5g}" if end is not None else "open" for end in (each.lower, each.upper)]
        reason = f" ({each.reason})" if each.reason else ""
        lines.append(
            f"  {each.name:<{width}} {each.estimate:>12.6g} {each.unit:<{units}}  {ends[0]:>12} to {ends[1]:<12} "
            f"{_WORDS[each.verdict]}{reason}"
        )
    sentences = [*(each.sentence for each in seen.directions), *filter(None, [profiles.remark])]
    lines += ["", *(f"- {sentence}" for sentence in sentences)]
    lines += [""] if sentences else []
    lines += [f"{profiles.evaluations} simulations, {profiles.seconds:.1f} s. Figure: {place / 'figures'}"]
    return "\n".join(lines)


_WORDS = {"identifiable": "identifiable", "weakly": "weakly identifiable", "not": "not identifiable"}
