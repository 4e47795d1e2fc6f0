"""A leaderboard of identifications, control laws and the Bouc-Wen benchmark; an entry is one small file, see README.md.

python studies/leaderboard/study.py [--only NAME ...] [--quick] [--json] [--out DIRECTORY] [--threads N]
                                    [--workers N | --cluster ADDRESS]
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import json
from argparse import Namespace
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import mrwork as mr
from mrwork.report import Table, write_study_page
from studies.former.command import Command, Findings, Say
from studies.former.processor import processor
from studies.leaderboard.damper_scores import DamperScore, damper_rows
from studies.leaderboard.entries import DAMPERS, LAWS, Kind, Row, attempt, chosen, files_of, row_of
from studies.leaderboard.law_scores import Bench, bench, measured_motions, score_law, synthetic_motions
from studies.leaderboard.measured import BENCHMARK, MOTIONS, UTFSM, absent_sentence, measured_files
from studies.leaderboard.rigs import synthetic_rig, utfsm_rig
from studies.leaderboard.tables import (
    LawScore,
    benchmark_table,
    damper_table,
    law_table,
    mean_score,
    method_table,
)

if TYPE_CHECKING:
    from studies.leaderboard.benchmark_score import BenchmarkScore

HERE = Path(__file__).parent
BENCHMARK_ROW = "boucwen_benchmark"
# Of the quick form: tests of two motions, and motions of three strata.
_QUICK_TESTS, _QUICK_MOTIONS = 8, 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Board:
    """Rows by the name of their data; `absent` says of data why they have no rows."""

    processor: str
    dampers: Mapping[str, Sequence[Row[DamperScore]]]
    laws: Mapping[str, Sequence[Row[LawScore]]]
    benchmark: Sequence[Row[BenchmarkScore]]
    absent: Mapping[str, str]

    @property
    def tables(self) -> list[Table]:
        """The tables of the page and of the README."""
        entered: list[Row[Any]] = [row for rows in self.dampers.values() for row in rows]
        entered += [row for rows in self.laws.values() for row in rows]
        return [
            *(
                damper_table(f"Dampers: {data}", rows, absent=self.absent.get(data, ""))
                for data, rows in self.dampers.items()
            ),
            *(
                law_table(f"Laws: {data}", rows, absent=self.absent.get(data, ""))
                for data, rows in self.laws.items()
            ),
            *([benchmark_table("Bouc-Wen benchmark", self.benchmark)] if self.benchmark else []),
            method_table(entered),
        ]

    @property
    def judged(self) -> dict[str, Any]:
        """The figures that expected.toml may have limits of."""
        return {
            **{
                data: {
                    row.name: {"median": row.score.median, "worst": row.score.worst}
                    for row in rows
                    if row.score is not None
                }
                for data, rows in self.dampers.items()
            },
            **{
                data: {row.name: mean_score(row.score) for row in rows if row.score is not None}
                for data, rows in self.laws.items()
            },
        }


def find(options: Namespace, say: Say) -> Findings | int:
    try:
        for folder in (UTFSM, MOTIONS, BENCHMARK):
            measured_files(folder)
    except mr.errors.RecordError as error:
        say(str(error))
        return 2
    only = options.only or []
    with mr.on_workers(options):
        rows_of_dampers, without_tests = _damper_rows(only, options, say)
        law_rows, without_motions = _law_rows(only, options, say)
    benchmark: list[Row[BenchmarkScore]] = []
    if not only or BENCHMARK_ROW in only:
        # JAX takes seconds to load.
        from studies.leaderboard.benchmark_score import score_benchmark

        say("Bouc-Wen benchmark")
        benchmark = [attempt(BENCHMARK_ROW, lambda: score_benchmark(quick=options.quick))]
    board = Board(
        processor=processor(),
        dampers=rows_of_dampers,
        laws=law_rows,
        benchmark=benchmark,
        absent={**without_tests, **without_motions},
    )
    # A run of some rows leaves the tables of all rows as they are.
    out = options.out / "partial" if only or options.quick else options.out
    numbers = asdict(board)
    write_study_page(
        HERE / "page.html.j2", out / "report.html", tables=board.tables, processor=board.processor
    )
    (out / "leaderboard.json").write_text(json.dumps(numbers, indent=1), encoding="utf-8")
    return Findings(
        numbers=numbers,
        text=[*board.tables, f"Processor: {board.processor}", f"Report: {out / 'report.html'}"],
        judged={} if options.quick else board.judged,
        agreement="" if options.quick else "Every figure agrees with expected.toml.",
    )


def _damper_rows(
    only: Sequence[str], options: Namespace, say: Say
) -> tuple[dict[str, list[Row[DamperScore]]], dict[str, str]]:
    """Rows on each rig, and the sentences on rigs that are absent."""
    if not (files := chosen(DAMPERS, only)):
        return {}, {}
    synthetic = synthetic_rig()
    rigs = {"synthetic rig": synthetic[:_QUICK_TESTS] if options.quick else synthetic}
    if not options.quick:
        rigs["UTFSM sinusoids"] = utfsm_rig()
    rows = {
        rig: [*damper_rows(files if tests else (), tests, lambda name, rig=rig: say(f"{rig}: {name}"))]
        for rig, tests in rigs.items()
    }
    return rows, {rig: absent_sentence(UTFSM) for rig, tests in rigs.items() if not tests}


def _law_rows(
    only: Sequence[str], options: Namespace, say: Say
) -> tuple[dict[str, list[Row[LawScore]]], dict[str, str]]:
    """Rows under each set of motions, of a law that is designed once, and the sentences on sets that are absent."""
    if not (files := chosen(LAWS, only)):
        return {}, {}
    synthetic = synthetic_motions()
    sets = {
        "synthetic motions": synthetic[:: len(synthetic) // _QUICK_MOTIONS] if options.quick else synthetic
    }
    if not options.quick:
        sets["records of the benchmarks"] = measured_motions()
    present = [name for name, motions in sets.items() if motions]
    benches: list[Bench] = [bench(sets[name], threads=options.threads) for name in present]
    rows: dict[str, list[Row[LawScore]]] = {name: [] for name in sets}
    for file in files:
        say(f"laws: {file.stem}")
        row = row_of(file, LAWS, lambda entry: score_law(entry, benches))
        for place, name in enumerate(present):
            score = None if row.score is None else row.score[place]
            rows[name].append(replace(row, score=score))  # type: ignore[arg-type] # a row of one set
    return rows, {name: absent_sentence(MOTIONS) for name in sets if name not in present}


def names_of(*kinds: Kind) -> list[str]:
    """Every name that `--only` takes."""
    return [*(name for kind in kinds for name in files_of(kind)), BENCHMARK_ROW]


if __name__ == "__main__":
    command = Command(
        __file__,
        __doc__,
        quick="two motions of the synthetic rig, three motions of the laws, a short benchmark, no measured data",
        threads=True,
        workers=True,
        out=True,
    )
    command.parser.add_argument(
        "--only",
        action="append",
        choices=names_of(DAMPERS, LAWS),
        metavar="NAME",
        help="one entry, by the name of its file; repeat for more",
    )
    sys.exit(command.run(find))
