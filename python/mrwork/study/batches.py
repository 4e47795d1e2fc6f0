"""Criteria of many candidates of a law under motions and realisations, simulated in batches; bands over realisations.

Realisations that share building, delay and noise are one batch, with a row of damper parameters for each.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mrwork.buildings import Building
from mrwork.buildings.matrices import Device
from mrwork.closed_loop.evaluation import SCORE, criteria, ratio, values
from mrwork.closed_loop.hardware import Hardware
from mrwork.closed_loop.responses import Responses, run_quantities
from mrwork.closed_loop.simulate import simulate_loop
from mrwork.control.laws import ControlLaw
from mrwork.dampers.spec import damper
from mrwork.errors import SettingError
from mrwork.motions import GroundMotion
from mrwork.store import Journal
from mrwork.store.codec import OrInfinite, OrNan
from mrwork.study.run_result import own_columns
from mrwork.study.study import Arrangement, Realisations, Study, StudyLaw, digest_of_run
from mrwork.summary import Summarised
from mrwork.units import STANDARD_GRAVITY
from mrwork.values import Floats, holds_arrays


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class RunCriteria(Summarised):
    """Criteria of candidates under motions and realisations.

    `numbers` has the shape (n_criteria, n_candidates, n_motions, n_realisations), criteria in the order of
    `closed_loop.criteria`; infinite where a run did not finish. `energy_error` (n_candidates, n_motions,
    n_realisations) is that of each run. `seconds` is the time inside the simulation.
    """

    numbers: Floats
    energy_error: Floats
    seconds: float

    def __post_init__(self) -> None:
        if self.numbers.shape != (len(criteria()), *self.energy_error.shape) or self.numbers.ndim != 4:
            raise ValueError(
                f"criteria of the shape {self.numbers.shape} with errors of the shape {self.energy_error.shape}"
            )

    @property
    def shape(self) -> tuple[int, ...]:
        """(n_candidates, n_motions, n_realisations)."""
        return self.energy_error.shape

    def of(self, name: str) -> Floats:
        """A criterion by its name, shape (n_candidates, n_motions, n_realisations)."""
        names = [entry.name for entry in criteria()]
        return np.asarray(self.numbers[names.index(name)])


BAND = 0.9
"""Share of the realisations within a band."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RealisationBand:
    """A number over realisations: median, and the ends between which 90 % of them lie; infinite where a run failed."""

    lower: OrNan
    median: OrNan
    upper: OrInfinite

    @staticmethod
    def of(values: Floats) -> RealisationBand:
        """The band of one value for each realisation, shape (n,)."""
        if not np.isfinite(values).all():
            return RealisationBand(lower=math.nan, median=math.nan, upper=math.inf)
        lower, median, upper = np.quantile(values, (0.5 * (1.0 - BAND), 0.5, 0.5 * (1.0 + BAND))).tolist()
        return RealisationBand(lower=lower, median=median, upper=upper)


def simulate_criteria(
    arrangement: Arrangement,
    law: StudyLaw,
    motions: Sequence[GroundMotion],
    hardware: Hardware,
    realisations: Realisations,
    *,
    bare: Building,
    largest_commands: Floats | None = None,
    threads: int = 0,
) -> RunCriteria:
    """Simulate candidates of a law under motions, with realisations, in as few calls of the core as possible.

    The arrangement has building and devices; the law may have one or many candidates. The observer, if there is one,
    is that of the nominal building. `largest_commands` are those of the candidates, see `simulate_loop`.
    """
    weight = bare.total_mass * STANDARD_GRAVITY
    noisy = any(noise for noise, _ in hardware.sensors)
    keys = [
        (
            float(realisations.stiffness[n]),
            float(realisations.damping[n]),
            float(realisations.delay[n]),
            int(realisations.seed[n]) if noisy else 0,
        )
        for n in range(len(realisations))
    ]
    found: dict[int, tuple[Floats, Floats]] = {}
    seconds = 0.0
    fitted, law = with_devices(arrangement, law)
    # Without dampers of its own an arrangement has a device without parameters to vary.
    theta = realisations.theta if arrangement.devices else tuple(device.draws for device in fitted)
    for key in dict.fromkeys(keys):
        members = [n for n, each in enumerate(keys) if each == key]
        stiffness, damping, delay, seed = key
        devices = tuple(
            replace(device, theta=rows[members] if len(rows) > 1 else rows)
            for device, rows in zip(fitted, theta, strict=True)
        )
        began = time.perf_counter()
        responses = simulate_loop(
            vary_building(arrangement, bare, stiffness=stiffness, damping=damping),
            devices,
            law,
            motions,
            _vary_hardware(hardware, delay, seed),
            nominal=arrangement.building if hardware.feedback == "observer" else None,
            largest_commands=largest_commands,
            threads=threads,
        )
        seconds += time.perf_counter() - began
        own = values(_own(responses, arrangement, law), weight=weight)
        numbers = np.stack([own[entry.name] for entry in criteria()]).reshape(-1, *responses.shape)
        numbers = np.where(np.isfinite(numbers), numbers, np.inf)
        error = responses.energy_error.reshape(responses.shape)
        for place, member in enumerate(members):
            draw = place if responses.shape[2] > 1 else 0
            found[member] = (numbers[..., draw], error[..., draw])
    order = range(len(realisations))
    return RunCriteria(
        numbers=np.stack([found[n][0] for n in order], axis=-1),
        energy_error=np.stack([found[n][1] for n in order], axis=-1),
        seconds=seconds,
    )


def with_devices(arrangement: Arrangement, law: StudyLaw) -> tuple[tuple[Device, ...], StudyLaw]:
    """Devices and law of an arrangement; without devices it gets an actuator of zero force."""
    if arrangement.devices:
        return arrangement.devices, law
    building, spec = arrangement.building, damper("dahl")
    device = Device(name="none", spec=spec, theta=spec.nominal, row=building.storeys[0], largest_command=1.0)
    still = ControlLaw(name="active", gains={"gain": np.zeros((1, 2 * building.n_coordinates))})
    return (device,), still


def vary_building(arrangement: Arrangement, bare: Building, *, stiffness: float, damping: float) -> Building:
    """The building of an arrangement with factors of stiffness and damping of the bare building.

    What is built into it stays, such as the spring of a tuned mass, so that it is no longer tuned.
    """
    if stiffness == 1.0 and damping == 1.0:
        return arrangement.building
    building = arrangement.building
    drifts = bare.drifts
    if building.n_coordinates == bare.n_coordinates:
        back: Floats = np.eye(bare.n_coordinates)
    elif drifts.shape[0] == bare.n_coordinates and np.linalg.matrix_rank(drifts) == bare.n_coordinates:
        # Displacements of the bare building relative to its base, from its drifts within the arrangement.
        back = np.asarray(np.linalg.solve(drifts, building.storeys[list(arrangement.storeys)]))
    else:
        raise SettingError(
            f"{building.name}: stiffness and damping of the building cannot be told from those of what was added to "
            "it, because its storeys do not determine its coordinates; leave stiffness and damping out of [uncertainty]"
        )
    return replace(
        building,
        stiffness=building.stiffness + (stiffness - 1.0) * back.T @ bare.stiffness @ back,
        damping=building.damping + (damping - 1.0) * back.T @ bare.damping @ back,
    )


def _vary_hardware(hardware: Hardware, delay: float, seed: int) -> Hardware:
    step = hardware.sample_time / hardware.steps
    total = (hardware.delay_steps + round(delay / step)) * step
    return replace(hardware, delay=total, seed=hardware.seed + seed)


def _own(responses: Responses, arrangement: Arrangement, law: StudyLaw) -> Responses:
    """Responses with the floors and storeys of the bare building alone."""
    kept: dict[str, Any] = {
        quantity.name: own_columns(responses, quantity, arrangement) for quantity in run_quantities()
    }
    if isinstance(law, ControlLaw) and law.spec.commands_force:
        # The command of an ideal actuator is a force, not a current.
        kept |= {name: kept[name][:, :0] for name in ("mean_current", "rms_current")}
    return replace(responses, **kept)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class VariedResults(Summarised):
    """Criteria over `count` realisations, by row of a study, for the rows that are done."""

    count: int
    rows: Mapping[int, RunCriteria]

    def bands(self, row: int, motion: int) -> dict[str, RealisationBand]:
        """Bands of every criterion of a row under a motion; none for a row that is not done."""
        found = self.rows.get(row)
        if found is None:
            return {}
        return {entry.name: RealisationBand.of(found.of(entry.name)[0, motion]) for entry in criteria()}

    def ratio_band(
        self, row: int, reference: int | None, motions: Sequence[int], name: str
    ) -> RealisationBand | None:
        """Band of the mean over motions of a criterion over that of a reference row in the same realisation."""
        ratios = self._ratios(row, reference, motions, name)
        return None if ratios is None else RealisationBand.of(ratios)

    def score_band(self, row: int, reference: int | None, motions: Sequence[int]) -> RealisationBand | None:
        """Band of the score over some motions, against a reference row in the same realisation."""
        parts = [self._ratios(row, reference, motions, name) for name in SCORE]
        known = [each for each in parts if each is not None]
        return RealisationBand.of(np.mean(known, axis=0)) if len(known) == len(SCORE) else None

    def scores(
        self, labels: Sequence[str], reference: int | None, motions: Sequence[int]
    ) -> dict[str, RealisationBand]:
        """Bands of the scores of all rows by their labels."""
        found = {label: self.score_band(row, reference, motions) for row, label in enumerate(labels)}
        return {label: band for label, band in found.items() if band is not None}

    def _ratios(self, row: int, reference: int | None, motions: Sequence[int], name: str) -> Floats | None:
        above, below = self.rows.get(row), None if reference is None else self.rows.get(reference)
        if above is None or below is None:
            return None
        chosen = list(motions)
        return np.asarray(ratio(above.of(name)[0, chosen], below.of(name)[0, chosen]).mean(axis=0))


def simulate_varied(
    study: Study,
    arrangement: Arrangement,
    realisations: Realisations,
    journal: Journal | None,
    *,
    threads: int,
) -> RunCriteria:
    """Criteria of an arrangement under all motions of a study with realisations, from the journal if it has them."""
    law = arrangement.law
    assert law is not None

    def simulated() -> RunCriteria:
        return simulate_criteria(
            arrangement,
            law,
            study.grounds,
            study.hardware,
            realisations,
            bare=study.building,
            threads=threads,
        )

    if journal is None:
        return simulated()
    return journal.once("realisations", digest_of_run(arrangement, *study.grounds), RunCriteria, simulated)
