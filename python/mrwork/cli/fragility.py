"""`mrwork fragility`: the intensity at which the arrangements of a study reach a limit."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from mrwork.base.table import csv_text
from mrwork.cli.command_parser import OUTPUT, CommandParser, examples
from mrwork.cli.numbers import DISPERSION, LEVEL, add_number, named_path
from mrwork.cli.options import end_parser
from mrwork.cli.output import print_result, undrawn_warned
from mrwork.errors import SettingError
from mrwork.store.output_file import write_file
from mrwork.store.run_folder import check_output

if TYPE_CHECKING:
    from mrwork.study.fragilities import Fragilities


def add_options(parser: CommandParser) -> None:
    """Declare the options."""
    parser.description = (
        "Find the intensity at which each arrangement of a study reaches a limit, lognormal over its records: median "
        "with its band, dispersion, and what each law changes. The study has records at several levels, as pga or sa = "
        '["0.1 g", "0.2 g"] of its [[motion]] tables, and best a design_level.'
    )
    parser.epilog = examples(
        "mrwork fragility out/ida --limit peak_drift_ratio=1%",
        "mrwork fragility out/ida --limit peak_acceleration=3m/s2 --against uncontrolled --output limit.csv",
    )
    parser.add_argument("study_run", type=named_path, metavar="RUN", help="folder of mrwork respond")
    group = parser.group("fragility")
    group.add_argument(
        "--limit",
        metavar="CRITERION=LIMIT",
        help="criterion and its limit, a number in SI or with a unit, as in peak_drift_ratio=1%%; default: limit of "
        "[report] or drift_limit of [building] of the study, else collapse, peak_drift_ratio=10%%",
    )
    add_number(group, "--level", LEVEL, "level of the bands, default 0.9", default=0.9, metavar="P")
    add_number(
        group,
        "--modelling-dispersion",
        DISPERSION,
        "standard deviation of the logarithm that models add, default 0",
        default=0.0,
        metavar="BETA",
    )
    group.add_argument(
        "--against",
        metavar="LABEL",
        help="arrangement that the others are compared with; default: the best constant command, else uncontrolled",
    )
    output = parser.group(OUTPUT)
    output.add_argument(
        "--output",
        type=named_path,
        metavar="FILE",
        help="file of the shares and probabilities at each level, as CSV; beside it FILE-ida.svg and "
        "FILE-fragility.svg",
    )
    output.add_argument("--replace", action="store_true", help="replace files that are there")
    end_parser(parser, run, quiet="")


def run(options: argparse.Namespace) -> int:
    """Find, write the files, print the table."""
    limit = None if options.limit is None else _limit(options.limit)
    table: Path | None = options.output
    figures = ("ida", "fragility") if table is not None else ()
    files = (
        [] if table is None else [table, *(table.parent / f"{table.stem}-{figure}.svg" for figure in figures)]
    )
    for path in files:
        check_output(path, replace=options.replace, otherwise="give --replace")
    # SciPy and the readers of runs are slow to load.
    from mrwork.runs.load import load
    from mrwork.study.fragilities import fragility
    from mrwork.study.results import StudyResults

    result = fragility(
        load(options.study_run, StudyResults),
        limit,
        level=options.level,
        modelling_dispersion=options.modelling_dispersion,
    )
    contents = [_table(result)] if files else []
    with undrawn_warned("a figure", "the table stands without it"):
        contents += _figures(result) if files else []
    written = files[: len(contents)]
    for path, content in zip(written, contents, strict=True):
        write_file(path, content)
    document = result.document(options.against) | {"files": list(map(str, written))}
    text = result._summary(options.against).text(whole=True)
    print_result(options, document, "\n".join([text, *(f"Written: {path}" for path in written)]))
    return 0


def _limit(text: str) -> dict[str, float | str]:
    name, _, limit = (part.strip() for part in text.partition("="))
    if not name or not limit:
        raise SettingError(f"--limit is {text!r}; give a criterion and its limit, as peak_drift_ratio=1%")
    try:
        return {name: float(limit)}
    except ValueError:
        return {name: limit}


def _figures(result: Fragilities) -> tuple[bytes, ...]:
    # Matplotlib is slow to load.
    from mrwork.plots.canvas import svg_bytes
    from mrwork.report.study.fragility_section import fragility_figure, ida_figure

    return svg_bytes(ida_figure(result)), svg_bytes(fragility_figure(result))


def _table(result: Fragilities) -> bytes:
    first = next(iter(result.rows.values()))
    head = ("arrangement", f"{first.measure} [m/s2]", "probability", "reached", "beyond tests")
    lines = [
        (label, *(f"{cell:.6g}" for cell in (level, row.probability(level), *shares)))
        for label, row in result.rows.items()
        for level, *shares in zip(row.levels.tolist(), row.crossed, row.outside, strict=True)
    ]
    return csv_text([head, *lines]).encode()
