"""Weights designed from wishes among the settings of a law, so that a study file can ask for them."""

# `key` is a dataclass field with notes.

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from mrwork.arguments import checked
from mrwork.control.design.limits import LoopTiming, RmsLimits, SemiActiveCondition
from mrwork.control.design_problem import DesignProblem
from mrwork.control.plant import Plant
from mrwork.errors import InvalidSettingError
from mrwork.keys import DeclaredTable, key
from mrwork.motions.spectral_density import CloughPenzien, KanaiTajimi, SpectralDensity

if TYPE_CHECKING:
    from mrwork.control.design.designed import DesignedWeights

_FIRM = KanaiTajimi()
# Designs that are kept: a search tries many sizes of R with one shape.
_KEPT = 32


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class WeightWishes(RmsLimits, metaclass=DeclaredTable):
    """Weights of a law from limits on rms responses and a budget of force, see `design_weights`.

    They are scaled such that control_weight = 1 is R as designed; its size is to be scanned in the true loop.
    """

    budget: float | tuple[float, ...] = key(
        "largest rms wanted force of each device with all its dampers", unit="N", above=0.0
    )
    spectrum: Literal["kanai_tajimi", "clough_penzien"] = key(
        "spectrum of the ground acceleration", default="kanai_tajimi"
    )
    ground_frequency: float = key("frequency of the ground [rad/s]", default=_FIRM.frequency, above=0.0)
    ground_damping: float = key("damping ratio of the ground", default=_FIRM.damping, above=0.0)
    intensity: float = key(
        "two-sided spectral density of the bedrock [m2/s3]; only the budget over its root matters",
        default=_FIRM.intensity,
        above=0.0,
    )
    record: str | None = key(
        "record to which the spectrum is fitted instead, relative to the study file", default=None
    )
    stiffness: tuple[float, ...] = key(
        "factors of the stiffness of the buildings that share the weights, as [0.75, 1, 1.25]",
        default=(),
        above=0.0,
    )
    semi_active: float | None = key(
        "share b of the condition that the wanted force be that of a damper, between 0 and 1",
        default=None,
        above=0.0,
    )

    sampled: bool = key(
        "whether the design is in discrete time, with sample time and delay of the loop and the lag of the driver, if "
        "the damper has one; for laws of a wanted force",
        default=False,
    )

    @checked
    def of_problem(self, problem: DesignProblem) -> DesignedWeights:
        """The weights for a building with its devices, and its loop if the design is sampled."""
        return self.design(problem.plant, problem.timing if self.sampled else None)

    @checked
    def design(self, plant: Plant, timing: LoopTiming | None = None) -> DesignedWeights:
        """The weights for the building and devices of a plant; kept, so that the same design is solved once."""
        token = (self, timing, plant.A.tobytes(), plant.B.tobytes(), plant.device_names)
        if token in _DESIGNS:
            _DESIGNS.move_to_end(token)
            return _DESIGNS[token]
        from mrwork.control.design.cases import stiffness_cases
        from mrwork.control.design.weights import design_weights

        spectrum = self.spectral_density()
        limits = {name: value for name in _LIMITS if (value := getattr(self, name)) is not None}
        found = design_weights(
            plant.building,
            plant.attachment,
            limits=limits,
            budget=self.budget if isinstance(self.budget, float | int) else list(self.budget),
            spectrum=None if self.stiffness else spectrum,
            cases=stiffness_cases(plant.building, self.stiffness, spectrum) if self.stiffness else (),
            timing=timing,
            semi_active=None if self.semi_active is None else SemiActiveCondition(share=self.semi_active),
        )
        _DESIGNS[token] = found
        while len(_DESIGNS) > _KEPT:
            _DESIGNS.popitem(last=False)
        return found

    def spectral_density(self) -> SpectralDensity:
        """The spectrum by its numbers, or fitted to the record."""
        if self.record is not None:
            if (self.ground_frequency, self.ground_damping, self.intensity) != (
                _FIRM.frequency,
                _FIRM.damping,
                _FIRM.intensity,
            ):
                raise InvalidSettingError(
                    "record", "the spectrum is fitted to the record, or given by its numbers; keep one"
                )
            from mrwork.motions.read import read_motion
            from mrwork.motions.spectrum_fit import fitted_spectrum

            return fitted_spectrum(read_motion(self.record), self.spectrum)
        soil = KanaiTajimi(
            frequency=self.ground_frequency, damping=self.ground_damping, intensity=self.intensity
        )
        return soil if self.spectrum == "kanai_tajimi" else CloughPenzien(soil=soil)

    @checked
    def in_words(self, problem: DesignProblem) -> tuple[str, ...]:
        """What the design reaches, what binds, and how the weights are to be used."""
        from mrwork.control.design.designed import SCAN

        return (*self.of_problem(problem).in_words, SCAN)

    @checked
    def relative_control_weight(self, plant: Plant) -> tuple[float, ...]:
        """R of each device as designed, over their mean."""
        found = self.design(plant).control_weight
        return tuple((found / found.mean()).tolist())


_LIMITS = ("rms_drift", "rms_acceleration", "rms_displacement", "rms_force")
_DESIGNS: OrderedDict[tuple[object, ...], DesignedWeights] = OrderedDict()
