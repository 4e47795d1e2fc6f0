"""`mrwork respond`: response of a building with MR dampers to ground motions, as defined in a study file."""

from __future__ import annotations

import argparse
from dataclasses import asdict, replace
from functools import partial
from typing import TYPE_CHECKING, Any

from mrwork.cli.command_parser import CommandParser, examples
from mrwork.cli.derived import add_option_of
from mrwork.cli.number_texts import named_path
from mrwork.cli.options import add_seed, add_threads, end_parser
from mrwork.cli.terminal import note
from mrwork.errors import Interrupted, SettingError
from mrwork.store.run_folder import STUDY_RUN
from mrwork.study.run_options import CheckStep

if TYPE_CHECKING:
    from mrwork.base.progress import Progress, ProgressLine
    from mrwork.cli.study_text import StudyVerb
    from mrwork.store.journal import Journal
    from mrwork.store.run_writer import RunAtWork
    from mrwork.study.results import Ensemble, StudyResults
    from mrwork.study.study import Study


def add_options(parser: CommandParser) -> None:
    """Declare the study, and what of it is simulated."""
    parser.describe("Building, dampers, control laws and motions are described in a study file.")
    parser.epilog = examples(
        "mrwork respond study.toml",
        "mrwork respond car/car.toml",
        "mrwork respond study.toml --motions all --check-step --out out/checked",
    )
    parser.add_argument("study", type=named_path, metavar="STUDY.toml", help="study file")
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
    from mrwork.cli.study_text import run_on_study

    return run_on_study(
        options,
        STUDY_RUN,
        options.study.stem,
        "what was simulated",
        partial(_verb, options),
        use=options.motions,
    )


def _verb(options: argparse.Namespace, study: Study, work: RunAtWork) -> StudyVerb[StudyResults]:
    from mrwork.cli.study_text import StudyVerb, design_lines
    from mrwork.study.ensemble import dampers_apart
    from mrwork.study.histories import Histories
    from mrwork.study.study_folder import design_document, study_document, study_files

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
        from mrwork.study.running import run_study

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
    from mrwork.runs.read_study import read_study
    from mrwork.study.ensemble import ensemble_of
    from mrwork.study.running import run_study

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
