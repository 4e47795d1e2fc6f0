"""Choice of current laws: which parameters follow the command, and by which law, by the fit to tests left out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

from mrwork.arguments import Threads, checked
from mrwork.dampers.parameters import LawName
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import Interrupted
from mrwork.identification.settings import FitSettings
from mrwork.records import DamperTest, observed
from mrwork.records.damper_test import as_tests
from mrwork.uncertainty.bands.prediction import Fold
from mrwork.uncertainty.choice.choose import JournalOf
from mrwork.uncertainty.choice.families import compared_models, refuse_unknown
from mrwork.uncertainty.choice.law_search import prepare_search
from mrwork.uncertainty.choice.running_laws import ComparedModel, LawChoice, LawProgress, RunningLawChoice
from mrwork.units import CommandUnit

T = TypeVar("T")


@checked
def choose_laws(
    model: DamperSpec | str | Sequence[DamperSpec | str],
    tests: DamperTest | Sequence[DamperTest],
    *,
    laws: Mapping[str, LawName] | None = None,
    unit: CommandUnit = "A",
    leave_out: Fold | None = None,
    settings: FitSettings | None = None,
    threads: Threads = 0,
    on_progress: Callable[[LawProgress], None] | None = None,
    journal_of: JournalOf | None = None,
) -> LawChoice:
    """Choose the laws by which parameters of a model follow the command, and the model where several are given.

    The first laws, with every positive parameter quadratic in the command, are identified from all tests by a global
    search. From there one law at a time is lowered by a degree, the one for which the linearised fit loses least; the
    best laws of that path are raised again where that promises a better fit. Laws are given by values at commands, as
    many as a polynomial of the degree has coefficients. All are fitted to all tests and to all but
    those of each fold, and judged by their predictions of the tests left out. Of all laws that are as
    good as the best within one standard error, those with the fewest parameters are chosen and fitted to the whole
    tests. The laws of several models stand in one table and are judged alike; a model that cannot be fitted is named
    there.

    Parameters
    ----------
    model
        A model without current laws, or its name; several of them, or "all".
    laws
        Laws that are given and not to be chosen.
    leave_out
        Tests that are left out together: those of one motion where there are three motions or more, else each test.
    settings
        Settings of the identifications, see `identify`. A parameter with bounds remains constant, unless it has a
        law in `laws`; starts and a power other than 2 are refused. Of several models, each takes the laws and bounds
        of the parameters that it has.
    threads
        Threads of the simulation, 0 for all.
    on_progress
        Called before each fit and during the first identification of a model and the last one.
    journal_of
        Opens the journal of each step of the choice, by name; see `Journal`.

    Raises
    ------
    SettingError
        Where the tests run at fewer commands than a law needs, fewer than two tests or motions are given, the
        settings cannot be used, or none of several models could be fitted.
    UnknownNameError
        Where a model is unknown, or a law or bound names a parameter that no model has.
    Interrupted
        On Ctrl-C, carrying the `LawChoice` so far, `None` before any laws are fitted.

    Examples
    --------
    >>> import mrwork as mr
    >>> tests = mr.read_damper_tests(["rig/10mm1Hz0A.csv", "rig/10mm1Hz1A.csv"])  # doctest: +SKIP
    >>> mr.choose_laws("normalised_bouc_wen", tests).table  # doctest: +SKIP
    """
    settings = settings or FitSettings()
    tests = tuple(observed(test, settings.observe) for test in as_tests(tests))
    specs, remarks = compared_models(model)
    given = dict(laws or {})
    several = len(specs) > 1
    if several:
        known = {name for spec in specs for name in spec.names}
        refuse_unknown("law", given, known)
        refuse_unknown("bound", settings.bounds, known)
    compared = []
    for spec in specs:
        # A single model refuses what is given for parameters that it has not.
        own = replace(settings, bounds=_of_names(settings.bounds, spec)) if several else settings
        own_laws = _of_names(given, spec) if several else given
        search = prepare_search(spec, tests, own_laws, unit, leave_out, own, threads)
        compared.append(ComparedModel(search=search, settings=own))
    running = RunningLawChoice(
        tests=tests,
        compared=tuple(compared),
        given=given,
        remarks=remarks,
        threads=threads,
        journal_of=journal_of,
        on_progress=on_progress,
    )
    try:
        for each in running.compared:
            running.search(each)
    except KeyboardInterrupt as interrupt:
        so_far = running.so_far() if running.found else None
        raise Interrupted(so_far, "choice of laws") from interrupt
    return running.fitted()


def _of_names(values: Mapping[str, T], spec: DamperSpec) -> dict[str, T]:
    """What is given for parameters of a model."""
    return {name: value for name, value in values.items() if name in spec.names}
