"""`mrwork fragility`: the intensity at which the arrangements of a study reach a limit."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from mrwork.base.table import csv_text
from mrwork.cli.command_parser import OUTPUT, CommandParser, examples
from mrwork.cli.derived import add_option_of
from mrwork.cli.number_texts import named_path
from mrwork.cli.options import end_parser
from mrwork.cli.output import show_results, undrawn_warned
from mrwork.store.output_file import write_file
from mrwork.store.run_folder import check_output
from mrwork.study.run_options import BandLevel, FragilityLimit, ModellingDispersion

if TYPE_CHECKING:
    from mrwork.study.fragilities import Fragilities


def add_options(parser: CommandParser) -> None:
    """Declare the run of a study, the limit with its level and dispersion, the rows, and the files."""
    parser.describe(
        "Intensities are lognormal over the records of the study: median with its band, dispersion, and what each "
        'law changes. The study has records at several levels, as pga or sa = ["0.1 g", "0.2 g"] of its '
        "[[motion]] tables, and best a design_level."
    )
    parser.epilog = examples(
        "mrwork fragility out/ida --limit peak_drift_ratio=1%",
        "mrwork fragility out/ida --limit peak_acceleration=3m/s2 --against uncontrolled --output limit.csv",
    )
    parser.add_argument("study_run", type=named_path, metavar="RUN", help="folder of mrwork respond")
    add = partial(add_option_of, parser)
    add(FragilityLimit, "fragility", "limit", reads=_limit, metavar="CRITERION=LIMIT")
    add(BandLevel, "fragility", "level", default=0.9, metavar="P")
    add(ModellingDispersion, "fragility", "modelling_dispersion", default=0.0, metavar="BETA")
    parser.option(
        "fragility",
        "--against",
        "arrangement that the others are compared with; default: the best constant command, else uncontrolled",
        metavar="LABEL",
    )
    file = "file of the shares and probabilities at each level, as CSV; beside it FILE-ida.svg and FILE-fragility.svg"
    parser.option(OUTPUT, "--output", file, named_path, metavar="FILE")
    parser.option(OUTPUT, "--replace", "replace files that are there", bool)
    end_parser(parser, run, quiet="")


def run(options: argparse.Namespace) -> int:
    """Find, write the files, print the table."""
    table: Path | None = options.output
    names = ("ida", "fragility")
    files = [] if table is None else [table, *(table.parent / f"{table.stem}-{name}.svg" for name in names)]
    for path in files:
        check_output(path, replace=options.replace, otherwise="give --replace")
    from mrwork.runs.load import load
    from mrwork.study.fragilities import fragility
    from mrwork.study.results import StudyResults

    result = fragility(
        load(options.study_run, StudyResults),
        limit=options.limit,
        level=options.level,
        modelling_dispersion=options.modelling_dispersion,
    )
    contents = [_table(result)] if files else []
    if files:
        with undrawn_warned("a figure", "the table stands without it"):
            from mrwork.plots import style
            from mrwork.plots.canvas import svg_bytes
            from mrwork.report.study.figures import fragility_figures

            with style.drawn_in_style():
                contents += map(svg_bytes, fragility_figures(result).values())
    written = files[: len(contents)]
    for path, content in zip(written, contents, strict=True):
        write_file(path, content)
    document = result.document(options.against) | {"files": list(map(str, written))}
    below = [f"Written: {path}" for path in written]
    show_results(options, result._summary(options.against), document=document, below=below)
    return 0


def _limit(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def _table(result: Fragilities) -> bytes:
    first = next(iter(result.rows.values()))
    head = ("arrangement", f"{first.measure} [m/s2]", "probability", "reached", "beyond tests")
    lines = [
        (label, *(f"{number:.6g}" for number in (level, row.probability(level), *shares)))
        for label, row in result.rows.items()
        for level, *shares in zip(row.levels.tolist(), row.crossed, row.outside, strict=True)
    ]
    return csv_text([head, *lines]).encode()
