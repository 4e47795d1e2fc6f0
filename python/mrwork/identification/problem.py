"""What is identified: a model with its settings, as the objective that a search and a descent make small."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SettingError
from mrwork.identification.equivalent import Form, identifiable_form
from mrwork.identification.fit import Fit
from mrwork.identification.multistart import Multistart
from mrwork.identification.nuisance import offsets_left_to
from mrwork.identification.objective import ROOT_MEAN_SQUARE, Objective
from mrwork.identification.settings import FitSettings, Search
from mrwork.identification.warm_start import check_starts
from mrwork.records import DamperTest
from mrwork.search import EfficientGA
from mrwork.store import Journal


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """A model `spec` with the settings of its identification, and the objective on the tests.

    `form` is the equivalent of the model that is searched, see `identifiable_form`; the `objective` is of that form.
    The settings are complete: they say the search, and hold what nuisance parameters leave no room for.
    """

    spec: DamperSpec
    settings: FitSettings
    form: Form
    objective: Objective

    @classmethod
    def of(
        cls,
        spec: DamperSpec,
        tests: tuple[DamperTest, ...],
        settings: FitSettings,
        *,
        threads: int = 0,
        journal: Journal | None = None,
    ) -> Problem:
        """Complete the settings, check them against the model and the tests, and prepare the simulation.

        Raises
        ------
        SettingError
            Where a bound is impossible, nothing is free, a start cannot be used, `Multistart` is to search current
            laws, or the twin is asked to follow an observation model.
        UnknownNameError
            Where a start or a bound names what the model does not have.
        RecordError
            Where there is no test.
        """
        settings = _completed(settings, spec)
        if spec.current is not None and isinstance(settings.search, Multistart):
            raise SettingError(
                f"`search` is Multistart, this {spec.name} has current laws; "
                "give an optimiser such as EfficientGA, or leave it out"
            )
        check_starts(spec, identifiable_form(spec, settings.bounds), settings.starts)
        problem = cls._prepared(spec, tests, settings, threads=threads, journal=journal)
        if not problem.form.box.free:
            raise SettingError(f"every parameter of {spec.name} is fixed; leave at least one free")
        if settings.engine == "twin":
            problem.objective.refuse_observation()
        return problem

    @classmethod
    def of_fit(cls, fit: Fit, tests: tuple[DamperTest, ...], *, threads: int = 0) -> Problem:
        """The problem that a fit solved, on its own tests or others of the same damper.

        The objective is that of least squares, whatever the power of the fit: likelihoods are of least squares.
        """
        settings = replace(_completed(fit.settings, fit.spec), power=ROOT_MEAN_SQUARE)
        return cls._prepared(fit.spec, tests, settings, threads=threads)

    @classmethod
    def _prepared(
        cls,
        spec: DamperSpec,
        tests: tuple[DamperTest, ...],
        settings: FitSettings,
        *,
        threads: int,
        journal: Journal | None = None,
    ) -> Problem:
        form = identifiable_form(spec, settings.bounds)
        objective = Objective.of(
            form.spec,
            tests,
            nuisances=settings.nuisances,
            power=settings.power,
            threads=threads,
            journal=journal,
        )
        return cls(spec=spec, settings=settings, form=form, objective=objective)

    @property
    def search(self) -> Search:
        """The search, which the settings say once they are complete."""
        assert self.settings.search is not None
        return self.settings.search

    def inside(self, theta: ArrayLike) -> NDArray[np.float64]:
        """Parameters of the model asked for, (n_params,), in the form that is searched, off the faces of its box."""
        box = self.form.box
        there = np.asarray(self.form.forth(np.asarray(theta, dtype=np.float64)))
        return np.asarray(box.inside(np.clip(there, box.lower, box.upper)))


def _completed(settings: FitSettings, spec: DamperSpec) -> FitSettings:
    """Settings with the search that suits the model, where none is given, and the bounds that nuisances ask for."""
    return replace(
        settings,
        search=settings.search or (Multistart() if spec.current is None else EfficientGA()),
        bounds=offsets_left_to(settings.nuisances, spec) | dict(settings.bounds),
    )
