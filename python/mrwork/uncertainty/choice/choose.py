"""Choice of model: every family identified, judged on what its fits have not seen, and ranked."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from mrwork.dampers.parameters import CommandUnit, LawName
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import Interrupted
from mrwork.identification.fit import Fit
from mrwork.identification.identify import identify_with
from mrwork.identification.nuisance import NuisanceName
from mrwork.identification.progress import Progress
from mrwork.identification.settings import FitSettings, Search
from mrwork.records import DamperTest
from mrwork.store import Journal
from mrwork.uncertainty.bands.left_out import Fold, folds_of
from mrwork.uncertainty.choice.comparison import Choice, ChoiceProgress, JournalOf, RunningComparison
from mrwork.uncertainty.choice.families import ALL, Family, command_remark, families
from mrwork.uncertainty.choice.held_out import ONE_TEST
from mrwork.uncertainty.choice.likelihood import Likelihood
from mrwork.uncertainty.noise import noise_model


def choose_model(
    tests: DamperTest | Sequence[DamperTest],
    models: str | Sequence[DamperSpec | str] = ALL,
    *,
    leave_out: Fold = "test",
    laws: Mapping[str, LawName] | None = None,
    unit: CommandUnit = "A",
    search: Search | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    nuisances: Sequence[NuisanceName] = (),
    power: float = 2.0,
    noise: str = "iid",
    sampled: bool = False,
    rng: int = 0,
    threads: int = 0,
    on_progress: Callable[[ChoiceProgress], None] | None = None,
    journal_of: JournalOf | None = None,
) -> Choice:
    """Identify every family of models from the same tests, and rank them by what their fits have not seen.

    Each family is identified from all tests, and again without each test in turn (motion, or command), which is then
    predicted; from one test, on the first half of its cycles. PSIS-LOO over blocks of cycles and BIC stand beside it.
    A family that fails is a row of the ranking.

    Parameters
    ----------
    models
        Names or models, or "all".
    leave_out
        What is left out together: each test, all tests of one motion, all at one command.
    laws, unit
        Laws of the parameters that follow the command, for the families that have such parameters.
    search, bounds, nuisances, power, rng, threads
        As for `identify`; bounds apply to the families that have such parameters.
    noise
        Noise model of the likelihood, one of `mrwork.uncertainty.noise.NOISES`.
    sampled
        Draw from the posterior by its chain, `sample_posterior`, rather than from an ellipsoid about the fit: slower.
    on_progress
        Called as the fits go on.
    journal_of
        Gives the journal of each step of the comparison, by name; see `Journal`.

    Raises
    ------
    SettingError
        Where nothing can be left out, or no family could be judged.
    UnknownNameError
        Where a model is unknown, or a law or bound names what no family has.
    Interrupted
        On Ctrl-C once a family was judged, carrying the `Choice` so far.

    Examples
    --------
    >>> import mrwork as mr
    >>> tests = mr.read_damper_tests(["rig/10mm1Hz0x5A.csv", "rig/5mm3Hz0x5A.csv"])  # doctest: +SKIP
    >>> choice = mr.choose_model(tests, ["dahl", "normalised_bouc_wen"])  # doctest: +SKIP
    >>> print(choice.ranking.sentence)  # doctest: +SKIP
    """
    settings = FitSettings(search=search, nuisances=tuple(nuisances), power=power, rng=rng)
    tests = (tests,) if isinstance(tests, DamperTest) else tuple(tests)
    compared, remarks = families(models, laws=laws or {}, unit=unit, bounds=bounds or {})
    remarks += command_remark(tests, has_laws=bool(laws))
    if len(tests) == 1:
        remarks += (ONE_TEST,)
    n_folds = len(folds_of(tests, leave_out)) if len(tests) > 1 else 1
    comparison = RunningComparison(
        tests=tests,
        compared=compared,
        leave_out=leave_out,
        n_folds=n_folds,
        remarks=remarks,
        journal_of=journal_of,
        on_progress=on_progress,
    )

    def fit_of(
        family: Family,
        these: tuple[DamperTest, ...],
        tell: Callable[[Progress], None],
        journal: Journal | None,
    ) -> Fit:
        own = replace(settings, bounds=family.bounds)
        return identify_with(family.spec, these, own, threads=threads, on_progress=tell, journal=journal)

    likelihood = Likelihood(noise=noise_model(noise), sampled=sampled, rng=rng, threads=threads)
    try:
        for number in range(1, len(compared) + 1):
            comparison.judge(number, fit_of)
        comparison.weigh(likelihood)
    except KeyboardInterrupt as interrupt:
        if not comparison.judged:
            raise KeyboardInterrupt from interrupt
        raise Interrupted(comparison.conclude(), "choice of model") from interrupt
    return comparison.conclude()
