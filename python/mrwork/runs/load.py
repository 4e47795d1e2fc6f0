"""Run folders read back by `mr.load`, of a fit with what later verbs have added; `mr.save` writes a fit into one."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar, overload

from mrwork.base.arguments import checked
from mrwork.base.plotted import Plotted
from mrwork.base.summary import Summarised, Summary
from mrwork.errors import OutputError, RecordError
from mrwork.identification.fit import Fit
from mrwork.identification.fit_file import fit_of, manifest_of, write_run
from mrwork.store.run_folder import (
    DRAWS,
    FIT_RUN,
    PLAN,
    PROFILES,
    RANKING,
    STUDY_RUN,
    RunFolder,
    reading_changed,
)
from mrwork.store.run_writer import RunAtWork, add_to_run, adding
from mrwork.uncertainty.bands.calibration_files import StoredBands, read_bands
from mrwork.uncertainty.bands.conformal import Calibration
from mrwork.uncertainty.bands.held_out import read_held_out
from mrwork.uncertainty.bands.predictions import Predictions
from mrwork.uncertainty.choice.ranking import Ranking
from mrwork.uncertainty.identifiability.profile import Profiles
from mrwork.uncertainty.planning import Plan
from mrwork.uncertainty.posterior.draws import Draws, draws_content, read_draws

if TYPE_CHECKING:
    from mrwork.study.results import StudyResults
    from mrwork.tuning.judging import TunedStudy

RunT = TypeVar("RunT", "StoredRun", "StudyResults", "TunedStudy")


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class StoredRun(Plotted, Summarised):
    """Contents of the run folder at `place`; `None` for what no verb has added.

    The `fit` has the intervals of the draws where they have converged, else of the profiles where they are of every
    free parameter. `draws` and `profiles` are of `mrwork intervals`, `bands` of `mrwork calibrate`,
    `plan` of `mrwork plan`, `ranking` of `mrwork identify` with several models or `--law auto`, and `held_out` the
    tests that `mrwork predict` has predicted and neither the fit nor its calibration has seen.
    """

    _made_by: ClassVar[str] = "mr.load(run)"

    place: Path
    fit: Fit
    draws: Draws | None = None
    profiles: Profiles | None = None
    bands: StoredBands | None = None
    plan: Plan | None = None
    ranking: Ranking | None = None
    held_out: Predictions | None = None

    @property
    def calibration(self) -> Calibration | None:
        """Calibration of the prediction bands; `None` before `mrwork calibrate`."""
        return None if self.bands is None else self.bands.calibration

    def _summary(self) -> Summary:
        present = [entry.name for entry in fields(self) if getattr(self, entry.name) is not None]
        of_fit = self.fit._summary()
        return replace(
            of_fit,
            title=f"Run {self.place.name}: {of_fit.title}",
            facts=(("folder", str(self.place)), ("holds", ", ".join(present[1:])), *of_fit.facts),
        )


@overload
def load(run: str | Path, kind: type[RunT], *, changed: bool = False) -> RunT: ...
@overload
def load(run: str | Path, kind: None = None, *, changed: bool = False) -> StoredRun | StudyResults: ...
@checked
def load(
    run: str | Path, kind: type[Any] | None = None, *, changed: bool = False
) -> StoredRun | StudyResults:
    """Read back the run folder of any verb.

    Parameters
    ----------
    run
        The folder that a verb has written with ``--out``.
    kind
        The type that is expected: a folder of another is refused, and checkers of types know what is returned. By
        default any.
    changed
        Also read files that are not as mrwork has written them, which its manifest tells by their digests.

    Returns
    -------
    StoredRun
        Of `mrwork identify` and `demo`: the fit, and what `profile`, `sample`, `calibrate` and `plan` have added.
    StudyResults
        Of `mrwork respond`: what `run_study` has returned.
    TunedStudy
        Of `mrwork tune`: what `mr.tuning.judge` has returned, which is the results of a study with the tuning.

    Raises
    ------
    RecordError
        Where it is no run folder, or not of this kind, or one of its files was changed; the message names the file.

    Examples
    --------
    >>> import mrwork as mr
    >>> run = mr.load("out/demo", mr.StoredRun)  # doctest: +SKIP
    >>> run.fit.fit_percent, run.draws is None  # doctest: +SKIP
    (99.41, True)
    >>> mr.load("out/study").to_pandas()["peak_drift"]  # doctest: +SKIP
    """
    path = Path(run)
    with reading_changed(changed):
        stored = read_run(path)
        held = with_additions(RunFolder.open(path), stored) if isinstance(stored, Fit) else stored
    if kind is not None and not isinstance(held, kind):
        raise RecordError(
            f"{path} is read back as `{type(held).__name__}`, and `{kind.__name__}` was expected; give the folder of "
            "one, or leave `kind` out"
        )
    return held


@checked
def save(result: Fit | Draws, folder: str | Path) -> Path:
    """Save a fit in a new run folder, or draws in the folder of their fit; return the folder, which has no page.

    `load` and every verb take it, but for those that need tests again which `mrwork identify` has not read from files.

    Raises
    ------
    OutputError
        Where there is a run, or draws, already: nothing is replaced.
    RecordError
        Where draws are of another fit than the folder's.

    Examples
    --------
    >>> import mrwork as mr
    >>> fit = mr.identify("bingham", mr.synthetic_test("spencer1997"))
    >>> mr.load(mr.save(fit, "out/bingham"), mr.StoredRun).fit.model  # doctest: +SKIP
    'bingham'
    """
    path = Path(folder)
    if isinstance(result, Fit):
        work = RunAtWork(path, FIT_RUN)
        if work.run() is not None:
            raise OutputError(f"{path} has a run, which is not replaced; choose another folder")
        with work:
            write_run(work, fit=result, manifest=manifest_of(result, result.status))
        return path
    with adding(path, DRAWS):
        run = RunFolder.open(path, FIT_RUN)
        fit = fit_of(run)
        made_of = result.provenance and result.provenance.inputs
        if (result.model, result.names, made_of) != (fit.model, fit.spec.names, fit.provenance.inputs):
            raise RecordError(f"{path} has another fit than the draws; save their fit in a folder, then them")
        if run.file(DRAWS).exists():
            raise OutputError(f"{path} has draws, which are not replaced; choose another folder")
        add_to_run(path, {DRAWS: draws_content(result)})
    return path


def read_run(place: Path) -> Fit | StudyResults:
    """What the verb has found that wrote the folder at `place`."""
    run = RunFolder.open(place)
    if run.kind is FIT_RUN:
        return fit_of(run)
    # The wing of control, which a fit does not need, takes half as long again to load.
    if run.kind is STUDY_RUN:
        from mrwork.study.study_folder import read_results

        return read_results(place)
    from mrwork.tuning.tuning_folder import read_tuning

    return read_tuning(place)


def with_additions(run: RunFolder, fit: Fit) -> StoredRun:
    """The run of a `fit` that has been read from a folder, with what later verbs have added."""
    draws, profiles = read_draws(run, fit), run.read(Profiles, PROFILES, verb="intervals")
    # Intervals of converged draws, else of finished profiles of every free parameter.
    if draws is not None and draws.status == "converged":
        fit = fit.with_intervals(draws.summaries)
    # Profiles of a model with redundant parameters are in other parameters.
    elif profiles is not None and profiles.model == fit.model and profiles.status == "finished":
        profiled = {profile.name for profile in profiles.profiles}
        if profiled.issuperset(estimate.name for estimate in fit.estimates if estimate.is_free):
            fit = fit.with_intervals(profiles.profiles)
    return StoredRun(
        place=run.path,
        fit=fit,
        draws=draws,
        profiles=profiles,
        bands=read_bands(run),
        plan=run.read(Plan, PLAN, verb="plan"),
        ranking=run.read(Ranking, RANKING),
        held_out=read_held_out(run, fit),
    )
