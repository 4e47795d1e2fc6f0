"""`mrwork respond`: response of a building with MR dampers to ground motions, as defined in a study file."""

from __future__ import annotations

import argparse
from dataclasses import asdict, replace
from functools import partial
from typing import TYPE_CHECKING, Any

from mrwork.cli.command_parser import CommandParser, examples
from mrwork.cli.derived import add_option_of
from mrwork.cli.numbers import named_path
from mrwork.cli.options import add_seed, add_threads, end_parser
from mrwork.cli.output import check_figure, print_result, progress_line, show_results, write_figure
from mrwork.cli.terminal import note, show
from mrwork.errors import Interrupted, SettingError
from mrwork.store.run_folder import STUDY_RUN
from mrwork.study.options import CheckStep

if TYPE_CHECKING:
    from mrwork.base.progress import Progress, ProgressLine
    from mrwork.cli.study_text import StudyVerb
    from mrwork.store.journal import Journal
    from mrwork.store.run_writer import RunAtWork
    from mrwork.study.results import Ensemble, StudyResults
    from mrwork.study.study import Study


def add_options(parser: CommandParser) -> None:
    """Declare the study, the listings that replace its simulation, and what is simulated."""
    parser.description = (
        "Simulate a building with dampers and control laws under ground motions, as described in a study "
        "file."
    )
    parser.epilog = examples(
        "mrwork respond study.toml", "mrwork respond study.toml --motions all --check-step --out out/checked"
    )
    parser.add_argument("study", nargs="?", type=named_path, metavar="STUDY.toml", help="study file")
    listings = {
        "--schema": "print the keys of a study file and exit",
        "--laws": "print the control laws with their settings and exit",
        "--building": "print masses, stiffnesses, periods, participation and effective modal masses of the building "
        "and exit",
        "--pushover": "push the building sideways in its first mode, print base shear and drifts over the displacement "
        "of the roof and exit",
    }
    for option, says in listings.items():
        parser.option("listings", option, says, bool)
    parser.option(
        "listings",
        "--size",
        "find the least dampers that keep the limit of the study, report.limit or drift_limit of its building: with "
        "count as many in each [[damper]], or of the viscous or tuned_mass of a [[baseline]], with storey a count of "
        "each; print them and exit",
        choices=("count", "storey"),
    )
    says = "with --size, draw the criterion over the number of dampers, as an .svg or a .png file"
    parser.option("listings", "--figure", says, named_path, metavar="FILE")
    parser.option(
        "simulation",
        "--motions",
        "use of the motions that are simulated, default test; with all, scores stand on the test motions",
        choices=("test", "training", "all"),
        default="test",
    )
    add_option_of(parser, CheckStep, "simulation", "check_step")
    parser.option(
        "simulation",
        "--ensemble",
        "run the study once more for each other set of laws that predicts nearly as well, within 1 point, of a damper "
        "from a run of identify --law auto, with its control laws designed anew; say which verdict changes",
        bool,
    )
    add_seed(parser)
    add_threads(parser, "the runs without histories")
    end_parser(
        parser,
        run,
        out="folder of the results, default out/STUDY",
        resume="resume a study that was killed or interrupted; all other options but --threads, --workers, "
        "--check-step and --ensemble as in that study",
    )


def run(options: argparse.Namespace) -> int:
    """Simulate, write the folder, print the result."""
    if options.schema or options.laws:
        if options.json:
            raise SettingError("--schema and --laws print text; leave --json out")
        from mrwork.study.schema import laws_text, schema_text

        show(schema_text() if options.schema else laws_text())
        return 0
    if options.study is None:
        raise SettingError("no study is given; give a STUDY.toml, or --schema to print its keys")
    if options.building or options.pushover:
        from mrwork.buildings.yielding import pushover
        from mrwork.study.reading import read_bare_building
        from mrwork.study.results import BuildingFacts

        building = read_bare_building(options.study)
        if options.pushover:
            pushed = pushover(building)
            print_result(options, pushed.document(), repr(pushed))
            return 0
        modal = {name: getattr(building, name).tolist() for name in ("effective_masses", "participation")}
        facts = {**asdict(BuildingFacts.of(building)), **modal, "remarks": building.remarks}
        print_result(options, facts, repr(building))
        return 0
    if options.size is not None:
        return _find_counts(options)
    if options.figure is not None:
        raise SettingError(
            "--figure draws what --size finds; leave it out, the page has the figures of a study"
        )
    from mrwork.cli.study_text import run_on_study

    return run_on_study(
        options,
        STUDY_RUN,
        options.study.stem,
        "what was simulated",
        partial(_verb, options),
        use=options.motions,
    )


def _find_counts(options: argparse.Namespace) -> int:
    if options.figure is not None:
        check_figure(options.figure)
    from mrwork.runs.study import read_study
    from mrwork.study.least_counts import damper_counts

    study = read_study(options.study, seed=options.seed, on_python=note)
    study = study if options.motions == "all" else study.of_use(options.motions)
    with progress_line(options) as line:
        counts = damper_counts(
            study,
            by="uniform" if options.size == "count" else "storey",
            on_progress=line,
            threads=options.threads,
        )
    drawn: dict[str, str] = {}
    if options.figure is not None:
        drawn = {"figure": str(options.figure)}
        from mrwork.plots import style
        from mrwork.plots.canvas import column_axes
        from mrwork.plots.of_studies import damper_counts as figure_of

        with style.drawn_in_style():
            figure, axes = column_axes()
            figure_of(counts, axes)
        write_figure(options.figure, figure)
    below = [f"Figure: {path}" for path in drawn.values()]
    show_results(options, counts, document=counts.document() | drawn, below=below)
    return 0


def _verb(options: argparse.Namespace, study: Study, work: RunAtWork) -> StudyVerb[StudyResults]:
    from mrwork.cli.study_text import StudyVerb, design_lines
    from mrwork.study.ensemble import dampers_apart
    from mrwork.study.folder import design_document, study_document, study_files
    from mrwork.study.histories import Histories

    if options.ensemble and not study.other_sets:
        raise SettingError(
            "--ensemble runs the study for each set of laws that predicts nearly as well, and no run folder of "
            "its dampers has others than the chosen one; leave it out, or identify the damper with mrwork identify "
            "--law auto"
        )
    histories = Histories(work, study)
    further: dict[str, Any] = {}
    lines: list[str] = []

    def compute(journal: Journal, line: ProgressLine) -> StudyResults:
        from mrwork.control.laws.control_law import ControlLaw
        from mrwork.study.run import run_study

        if options.workers or options.cluster:
            if len(study.histories) == len(study.motions):
                note("every history is stored, and this process simulates the runs with histories")
            if labels := [
                arrangement.row.label
                for arrangement in study.arrangements
                if not (arrangement.law is None or isinstance(arrangement.law, ControlLaw))
            ]:
                note(f"laws of the user run in this process: {', '.join(labels)}")
        results = run_study(
            study,
            journal=journal,
            kept=histories.is_stored,
            keep=histories.keep,
            on_progress=line,
            check_step=options.check_step,
            threads=options.threads,
        )
        try:
            if words := dampers_apart(study, results, threads=options.threads):
                further["sets_apart"] = words
                lines.extend([f"{words}.", ""])
            if options.ensemble:
                ensemble = _run_ensemble(options, study, results, journal, line)
                results, further["ensemble"] = replace(results, ensemble=ensemble), asdict(ensemble)
                lines.append(f"The study with {len(ensemble.sets)} sets of laws that predict nearly as well:")
                lines.extend([*(f"  {sentence}" for sentence in ensemble.in_words), ""])
        except KeyboardInterrupt as interrupt:
            raise Interrupted(results, "study with other sets of laws") from interrupt
        return results

    return StudyVerb(
        compute=compute,
        files=study_files,
        document=lambda results: study_document(results) | design_document(study) | further,
        text=lambda results, simulated: "\n".join([*design_lines(study), *lines, simulated]),
    )


def _run_ensemble(
    options: argparse.Namespace, study: Study, results: StudyResults, journal: Journal, line: ProgressLine
) -> Ensemble:
    """The study with each other set of laws, read anew with its dampers, in the journal after the study itself."""
    from mrwork.runs.study import read_study
    from mrwork.study.ensemble import ensemble_of
    from mrwork.study.run import run_study

    every = [results]
    for number, other in enumerate(study.other_sets, start=2):
        name = f"set {number} of {1 + len(study.other_sets)} of the laws"

        def report(progress: Progress, name: str = name) -> None:
            line(replace(progress, said=(name, *progress.said)))

        read = read_study(options.study, other.fitted.__getitem__, seed=options.seed)
        alone = read if options.motions == "all" else read.of_use(options.motions)
        # No verdict is from histories or realisations.
        alone = replace(alone, histories=(), realisations=None)
        every.append(run_study(alone, journal=journal, on_progress=report, threads=options.threads))
    return ensemble_of(every)
