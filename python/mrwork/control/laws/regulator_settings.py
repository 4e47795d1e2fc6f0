"""Settings of the laws that are designed from a linear quadratic regulator; some are functions of measured signals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import ClassVar, Self

import numpy as np

from mrwork.base.arguments import checked
from mrwork.base.keys import key, keys_of, optional, positive
from mrwork.base.values import Floats
from mrwork.control.laws.control_law import control_law
from mrwork.control.laws.design_ground import AskedForce, asked_forces
from mrwork.control.laws.law_problem import Design, DesignProblem, Magnitude, Span
from mrwork.control.laws.weights import CostWeights
from mrwork.control.linear.lqr import (
    MatrixRows,
    Regulator,
    Weighed,
    Weights,
    plain_weight,
    regulators_of_costs,
)
from mrwork.control.linear.margins import LoopMargins, loop_margins
from mrwork.control.linear.riccati import attempt_each, only
from mrwork.errors import InvalidSettingError, SettingError


@checked
class RegulatorSettings(CostWeights):
    """A linear quadratic regulator; without weights of outputs or states it weighs the energy of the building."""

    is_regulator: ClassVar[bool] = True
    weighed_by_default: ClassVar[Mapping[str, float]] = {"drifts": 1.0}
    control_weight: Weights | None = positive(
        "R of the forces, each the force of a device with all its dampers; with designed weights, 1 is R as designed; "
        "required without a gain",
        unit="1/N2",
        matrix=True,
        span=Span(lower=1e-6, upper=10.0, of=(("cost", 1.0), ("force", -2.0))),
    )
    gain: MatrixRows | None = optional(
        "finished gain K of the desired force f_c = -K s instead of any weights: a row for each device, a column for "
        "each displacement [N/m] of the coordinates and then for each velocity [N s/m]; rows of numbers, or the name "
        "of a .csv, .tsv, .txt, .npy or .mat file with them",
        matrix=True,
    )

    def __post_init__(self) -> None:
        CostWeights.__post_init__(self)
        if self.gain is None and self.control_weight is None:
            entry = next(entry for entry in keys_of(type(self)) if entry.name == "control_weight")
            raise SettingError(f"the law has no control_weight; give {entry.in_words}")

    def given_gain(self, problem: DesignProblem) -> Floats:
        """The finished gain, shape (n_devices, 2n)."""
        assert self.gain is not None
        for name in (*sorted(self.weight_names()), "control_weight"):
            if getattr(self, name) is not None:
                raise InvalidSettingError("gain", f"the law has a finished gain, and {name}; keep one")
        m, n = problem.plant.n_devices, problem.plant.n_coordinates
        if {len(row) for row in self.gain} != {2 * n} or len(self.gain) != m:
            columns = " and ".join(map(str, sorted({len(row) for row in self.gain})))
            out = ", ".join(map(str, problem.building.condensed))
            raise InvalidSettingError(
                "gain",
                f"gain is {len(self.gain)} x {columns}, and the law takes {m} x {2 * n}: a row for each device, and "
                f"{n} columns of displacements [N/m], then {n} of velocities [N s/m] of the coordinates"
                + (
                    f", of which {out} are condensed; condense = false in [building] keeps them"
                    if out
                    else ""
                ),
            )
        return np.array(self.gain)

    @classmethod
    def solved(cls, problem: DesignProblem, many: Sequence[Self]) -> list[Floats | SettingError]:
        """The gain of each: as given, or of its regulator."""
        found = attempt_each(
            lambda item: item.weighed(problem) if item.gain is None else item.given_gain(problem), many
        )
        costs = [cost for cost in found if isinstance(cost, tuple)]
        regulators = iter(regulators_of_costs(problem.plant, costs))
        solved = [next(regulators) if isinstance(each, tuple) else each for each in found]
        return [each.gain if isinstance(each, Regulator) else each for each in solved]

    def design_of(self, problem: DesignProblem, solution: Floats) -> Design:
        """The gain of the desired forces."""
        return Design(gains={"gain": solution})

    def regulator(self, problem: DesignProblem) -> Regulator:
        """LQR of the building with the output weights and the control weight of the settings."""
        return only(regulators_of_costs(problem.plant, [self.weighed(problem)]))

    def weighed(self, problem: DesignProblem) -> tuple[Weighed, Weights]:
        """What the output weights add to the cost, and R of the devices.

        One number for R keeps the ratios of designed weights.
        """
        if self.control_weight is None:
            raise InvalidSettingError("gain", "the law has a finished gain, and no weights; ask for its gain")
        cost, designed, R = self.weigh_outputs(problem), self.weights(problem), self.control_weight
        if designed is None or not isinstance(R, float | int):
            return cost, R
        of_design = designed.control_weight
        return cost, tuple((R * of_design / of_design.mean()).tolist())

    def margins(
        self, problem: DesignProblem, design: Design, rates: Sequence[float | None]
    ) -> LoopMargins | None:
        """Stability margins of the gain; `None` for a loop that is too large for them."""
        try:
            return loop_margins(
                problem.plant,
                design.gains["gain"],
                sample_time=problem.sample_time,
                delay=problem.delay,
                driver_rates=rates,
            )
        except SettingError:
            return None

    def notes(self, problem: DesignProblem, design: Design) -> tuple[str, ...]:
        """A sentence on a finished gain, and one on a gain that asks for no force."""
        notes = (
            () if self.gain is None else (f"The gain, {len(self.gain)} x {len(self.gain[0])}, is as given.",)
        )
        (asked,) = asked_forces(problem, [design.gains["gain"]])
        if asked is None or not asked.asks_for_none:
            return notes
        return (*notes, f"Asks for no force: {asked.in_words}; {self._too_small(problem, asked)}.")

    def _too_small(self, problem: DesignProblem, asked: AskedForce) -> str:
        """Say which number of a law that asks for no force is too large or too small, and by which factor."""
        if self.gain is not None:
            return f"the gain is about {_power(1.0 / max(asked.share, 1e-300))} too small"
        designed = self.weights(problem)
        as_designed = isinstance(self.control_weight, float | int) and self.control_weight <= 1.0
        if designed is not None and (designed.semi_active or as_designed):
            return f"the budget is about {_power(1.0 / max(asked.share, 1e-300))} too small"
        return f"R is about {_power(self._excess_of_control_weight(problem))} too large"

    def _excess_of_control_weight(self, problem: DesignProblem) -> float:
        """Factor by which R is to be divided for the law to act, from decade to decade.

        With R going to zero the desired force of some weights stays below the damper force; half of its largest value
        counts then.
        """
        factors = 10.0 ** np.arange(1.0, _DECADES)
        R = np.asarray(self.control_weight, dtype=np.float64)
        designs = type(self).designs(
            problem, [replace(self, control_weight=plain_weight(R / float(factor))) for factor in factors]
        )
        sound = [
            (float(factor), design.gains["gain"])
            for factor, design in zip(factors, designs, strict=True)
            if isinstance(design, Design)
        ]
        asked = asked_forces(problem, [gain for _, gain in sound])
        shares = {
            factor: force.share for (factor, _), force in zip(sound, asked, strict=True) if force is not None
        }
        enough = min(1.0, 0.5 * max(shares.values(), default=1.0))
        return next((factor for factor, share in shares.items() if share >= enough), float(factors[-1]))

    def certificate(self, problem: DesignProblem) -> str:
        """Stability of the linear loop of the regulator, or of a finished gain."""
        if self.gain is not None:
            margins = self.margins(problem, self.design(problem), problem.driver_rates)
            stable = "is stable" if margins is not None and margins.stable else "is not shown to be stable"
            return (
                f"the linear loop of the given gain {stable} with the hardware of the study; the damper, which only "
                "resists motion and saturates, is not covered"
            )
        regulator = self.regulator(problem)
        slowest = float(-regulator.poles.real.max())
        return (
            f"with ideal forces the loop is stable, its slowest pole decays at {slowest:.3g} 1/s, and no other gain "
            f"has a lower cost of these weights (residual of the Riccati equation {regulator.residual:.1e}); the "
            "damper, which only resists motion and saturates, is not covered"
        )


_DECADES = 31


def _power(factor: float) -> str:
    return f"1e{max(1, round(float(np.log10(factor))))}"


@checked
class ClippedSettings(RegulatorSettings):
    """A regulator with a command in proportion to the desired force."""

    full_force: float = key(
        "desired force of a device with all its dampers at which the largest command is sent",
        unit="N",
        above=0.0,
        span=Span(lower=0.03, upper=10.0, start=1.0, of=(("force", 1.0),)),
    )

    def design_of(self, problem: DesignProblem, solution: Floats) -> Design:
        """The gain, and the full force of each device."""
        return Design(gains={"gain": solution, "full_force": problem.each(self.full_force)})


def _about(magnitude: Magnitude) -> Span:
    """Range of a setting that is usually held at a magnitude of the response."""
    return Span(lower=0.3, upper=3.0, start=1.0, of=((magnitude, 1.0),), free=False)


@checked
class NetworkSettings(RegulatorSettings):
    """A regulator with a neural network from the desired force to the command, which is trained elsewhere.

    All devices have the same network, of a device with all its dampers. Its inputs are deformation [m], velocity [m/s]
    and desired force [N], or these followed by their values at the sample before.
    """

    layer: MatrixRows = key(
        "a row for each hidden unit: its bias, the weights of its inputs in SI units, its weight in the output [A or "
        "V]; rows of numbers, or the name of a .csv, .tsv, .txt, .npy or .mat file with them",
        matrix=True,
    )
    output: float = key("bias of the output [A or V]")
    reach: tuple[float, ...] = key(
        "largest magnitude of each input, to which it is clipped: the largest of the training", above=0.0
    )

    def design_of(self, problem: DesignProblem, solution: Floats) -> Design:
        """The gain, and the network as the tables layer, output and reach; sizes that do not fit are refused."""
        n_columns = len(self.reach) + 2
        if len(self.reach) not in (3, 6):
            raise InvalidSettingError(
                "reach", f"reach has {len(self.reach)} numbers; give 3, or 6 with the sample before"
            )
        if not self.layer or {len(row) for row in self.layer} != {n_columns}:
            raise InvalidSettingError(
                "layer",
                f"layer has rows of another length than {n_columns}; give in each a bias, {len(self.reach)} weights "
                "and the weight in the output",
            )
        tables = {
            "layer": np.ravel(self.layer),
            "output": np.array([self.output]),
            "reach": np.array(self.reach),
        }
        return Design(gains={"gain": solution}, tables=tables)


_NEAR_CLIPPED = (
    (-0.66, 0.0, 0.0, 1.0, 1.0, 2.0),
    (-0.66, 0.0, 0.0, -1.0, 1.0, -2.0),
    (-0.66, 0.0, 0.0, 1.0, 0.0, -4.0),
    (0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
)
_NEAR_CLIPPED_BIAS = -4.6
"""A network that is about the clipped-optimal law: (f_c - f) f of the two forces as a sum of even functions."""


@checked
class SignalNetworkSettings(RegulatorSettings):
    """A regulator, and a small network of measured signals whose numbers are learned; all devices have the same.

    The signals of a device are its elongation, its rate, its force and the desired force, each over its scale.
    """

    deformation: float = key("scale of the damper displacement", unit="m", above=0.0, span=_about("stroke"))
    rate: float = key("scale of the damper velocity", unit="m/s", above=0.0, span=_about("rate"))
    force: float = key(
        "scale of the force and of the desired force of a device with all its dampers",
        unit="N",
        above=0.0,
        span=_about("force"),
    )
    network: tuple[float, ...] = key(
        "for each of four hidden units its bias, the weights of displacement, velocity, force and desired force over "
        "their scales, and its weight in the output; last the bias of the output; 25 numbers, which mrwork tune finds",
        span=Span(
            lower=-8.0,
            upper=8.0,
            scale="linear",
            entries=(*(number for unit in _NEAR_CLIPPED for number in unit), _NEAR_CLIPPED_BIAS),
        ),
    )

    def design_of(self, problem: DesignProblem, solution: Floats) -> Design:
        """The gain, and the network for signals in SI units."""
        numbers = next(gain.numbers for gain in control_law("signal_network").gains if gain.name == "network")
        if len(self.network) != numbers:
            raise InvalidSettingError("network", f"network has {len(self.network)} numbers; give {numbers}")
        scales = np.array([self.deformation, self.rate, self.force, self.force])
        network = np.array(self.network)
        network[:-1].reshape(-1, len(scales) + 2)[:, 1:-1] /= scales
        return Design(gains={"gain": solution, "network": np.tile(network, (len(problem.devices), 1))})

    def margins(
        self, problem: DesignProblem, design: Design, rates: Sequence[float | None]
    ) -> LoopMargins | None:
        """None: the law is no linear one, also without saturation."""
        return None

    def certificate(self, problem: DesignProblem) -> str:
        """A sentence: the command stays in its range, and nothing is proved of the response."""
        return (
            "the command is between 0 and the largest one for any numbers of the law and any signals, so the damper "
            "remains the passive device that it is at each command; nothing is proved of the response"
        )
