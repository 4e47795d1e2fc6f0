"""Designed weights of a regulator: the share of the limits that can be reached, what binds, and the certificate."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from mrwork.base.arguments import checked
from mrwork.base.numbers import format_rounded
from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.base.summary import Summarised, Summary
from mrwork.base.table import Column, Table, as_json
from mrwork.base.values import Floats, array_dataclass
from mrwork.control.linear.lqr import Weights
from mrwork.control.linear.plant import Plant
from mrwork.control.linear.riccati import LyapunovEquations, mean_squares, solve_riccati
from mrwork.control.weights.limits import LimitedOutputs
from mrwork.control.weights.regulator import DualPoint
from mrwork.control.weights.system import DesignSystem
from mrwork.errors import SettingError
from mrwork.motions.spectral_density import CloughPenzien, RoadVelocity, SpectralDensity, mean_square_of


@array_dataclass(repr=False)
class WeightCertificate(Summarised):
    """The ratio that the weights reach, beside a lower bound of every linear law.

    `rms` of each limited output and `forces`, the rms desired force of each device [N], are by a Lyapunov equation
    those under the regulator of the weights, which knows the state of the building and of the soil; `ratio` is the
    largest rms over its limit. `bound` is a lower bound on the ratio of any linear law within the budget, from the
    Riccati equation of the weights (with the c of a semi-active condition as found). `gap` is the larger of
    ratio / bound - 1 and of the excess of a force over its budget. `law_ratio` and `law_force` are the largest rms over
    its limit, and force over its budget, under the one gain of the law on the state of the building; infinite if the
    loop is not stable.
    """

    outputs: LimitedOutputs
    rms: Floats
    forces: Floats
    budgets: Floats
    ratio: float
    bound: float
    gap: float
    law_ratio: float
    law_force: float

    @property
    def law_in_words(self) -> str:
        """Ratio that the gain of the law alone reaches, and its share of the budget."""
        return f"ratio {self.law_ratio:.4g} with {self.law_force:.4g} of the budget, from the building's state only"

    def _summary(self) -> Summary:
        devices = range(1, len(self.forces) + 1)
        names = (*self.outputs.names, *(f"force, device {number}" for number in devices))
        units = (*self.outputs.units, *("N" for _ in devices))
        rms, limits = np.append(self.rms, self.forces), np.append(self.outputs.limits, self.budgets)
        columns = (
            Column("", "output", of=names.__getitem__),
            Column("", "unit", of=units.__getitem__),
            Column("", "rms", of=rms.item, shown=format_rounded),
            Column("", "limit", of=limits.item, shown=format_rounded),
            Column("", "rms / limit", of=(rms / limits).item, shown=format_rounded),
        )
        return Summary(
            title="Certificate of a weight design",
            facts=(
                ("ratio", f"{self.ratio:.6g}"),
                ("bound", f"{self.bound:.6g}, gap {self.gap:.1e}"),
                ("law's gain", self.law_in_words),
            ),
            tables=[Table.of(columns, range(len(names)))],
        )


def certificate_of(
    system: DesignSystem, outputs: LimitedOutputs, budgets: Floats, point: DualPoint, law_gain: Floats
) -> WeightCertificate:
    """Check the regulator of a dual point, and the gain of the law [N per unit of s]."""
    limits = outputs.limits
    rms, forces = rms_under_gain(system, point.regulated.gain)
    law_rms, law_forces = rms_under_gain(system, law_gain @ system.state)
    return WeightCertificate(
        outputs=outputs,
        rms=rms,
        forces=forces,
        budgets=budgets,
        ratio=float(np.max(rms / limits)),
        bound=point.bound,
        gap=point.gap,
        law_ratio=float(np.max(law_rms / limits)),
        law_force=float(np.max(law_forces / budgets)),
    )


def rms_under_gain(system: DesignSystem, gain: Floats) -> tuple[Floats, Floats]:
    """Rms of the outputs and of the desired forces of `u = -gain x`; infinite if the loop is not stable."""
    try:
        X = LyapunovEquations(system.A - system.B @ gain).covariance(system.ground)
    except SettingError:
        return np.full(len(system.C), np.inf), np.full(len(gain), np.inf)
    return np.sqrt(mean_squares(system.C - system.D @ gain, X)), np.sqrt(mean_squares(gain, X))


_UNREACHABLE: Final = RemarkKind(
    "limits_unreachable",
    "the limits cannot be met with this budget{nor}: the least factor by which all are met is {value:.3g}{more}",
    warns=True,
)
_UNDETERMINED: Final = RemarkKind(
    "limits_undetermined",
    "whether all limits can be met with this budget is not determined: the least factor by which they are is between "
    "{bound:.5g} and {value:.5g}",
    warns=True,
)
_NO_FORECAST: Final = RemarkKind(
    "gain_without_soil",
    "the gain of the law reaches {reached}: a law with the least ratio also knows the state of the soil",
)
_SCAN: Final = RemarkKind(
    "control_weight_to_scan",
    "the weights give the shape of the cost, and the size of R is to be scanned in the true loop (from 10 to 1e-4 "
    "times R as designed), because a damper saturates and only resists motion; least-force weights are too timid",
)
_SCAN_BUDGET: Final = RemarkKind(
    "budget_to_scan",
    "with the semi-active condition the budget decides the law, and R hardly matters: scan the budget in the true loop "
    "(budget_scale from 0.1 to 10)",
)

_SETTING = {"rms_drift": "drifts", "rms_acceleration": "accelerations", "rms_displacement": "displacements"}
# Excess of the gain of the law over ratio and budget, as a factor, beyond which it is said in words.
_NEAR = 1.05
# Outputs and sentences on what binds that the summary shows.
_BINDING_SHOWN = 4
# Shares of the multipliers below this one belong to limits that do not bind.
_BINDING = 1e-4


@array_dataclass(repr=False)
class DesignedWeights(Summarised):
    """Weights of a regulator from limits on rms responses and a budget of force.

    The cost is `s'Q s + 2 s'N f + f'R f`, with `Q = C'W C`, `N = C'W D` and `R = control_weight + D'W D` of the limited
    outputs `y = C s + D f`, W the diagonal of `output_weights` (in the inverse squares of the units of the outputs); in
    a design with a semi-active condition, also the terms of `(f - c v)^2 - b^2 f^2`. `control_weight` is the multiplier
    of the budget of each device [1/N^2].

    `gain` is K of the desired force `f_c = -K s` on the state of the building, shape (n_devices, 2n): the Riccati gain
    of Q, N, R. All limits can be met at once up to the factor `reachable_ratio` with the budget; where the `bound` of
    the certificate is above 1 they cannot be reached, and `budget_factor` is the factor on all budgets with which they
    can, infinite if no factor up to 100 suffices, NaN where it is not determined. `binding` says what keeps the ratio
    from being lower, `engine` what solved it, and `origin` sentences on ground and budget, where a study has asked for
    the design.
    """

    plant: Plant
    spectrum: SpectralDensity
    output_weights: Floats
    control_weight: Floats
    Q: Floats
    N: Floats
    R: Floats
    gain: Floats
    reachable_ratio: float
    certificate: WeightCertificate
    binding: tuple[str, ...]
    engine: str
    budget_factor: float | None
    outputs: LimitedOutputs
    system: DesignSystem
    semi_active: bool
    origin: tuple[str, ...] = ()

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """On limits that cannot be met, on the gain of the law, and on the setting to scan in the true loop."""
        return (*self._unmet(), (_SCAN_BUDGET if self.semi_active else _SCAN).remark())

    def _unmet(self) -> Iterator[Remark]:
        ratio, times, check = self.reachable_ratio, self.budget_factor or np.nan, self.certificate
        if ratio > 1.0 >= check.bound:
            yield _UNDETERMINED.remark(measured=Measured(ratio, ""), bound=check.bound)
        elif ratio > 1.0:
            nor = ", nor with 100 times the budget" if np.isinf(times) else ""
            more = f"; with {times:.3g} times the budget they can" if np.isfinite(times) else ""
            yield _UNREACHABLE.remark(measured=Measured(ratio, ""), nor=nor, more=more)
        if not (check.law_ratio <= _NEAR * ratio and check.law_force <= _NEAR):
            yield _NO_FORECAST.remark(reached=check.law_in_words)

    @checked
    def rms_under_ground(self, *, controlled: bool) -> Floats:
        """Rms of each limited output, without control or with ideal forces of the law's gain.

        Infinite if the loop of the gain is not stable.
        """
        if not controlled:
            return self.system.rms_without_control()
        return rms_under_gain(self.system, self.gain @ self.system.state)[0]

    def document(self) -> dict[str, object]:
        """The design as plain values: ground, budget, and each limited output with its rms under the ground."""
        outputs, spectrum = self.outputs, self.spectrum
        columns = (
            Column("name", of=outputs.names.__getitem__),
            Column("unit", of=outputs.units.__getitem__),
            Column("limit", of=outputs.limits.item),
            Column("rms_without_control", of=self.rms_under_ground(controlled=False).item),
            Column("rms", of=self.rms_under_ground(controlled=True).item),
        )
        return {
            "ground": [_ground(spectrum)],
            "budget": self.certificate.budgets.tolist(),
            "least_ratio": self.reachable_ratio,
            "gain": self.gain.tolist(),
            "outputs": [as_json(columns, row) for row in range(len(outputs.names))],
        }

    @checked
    def gain_with(self, control_scale: float) -> Floats:
        """The gain of the law with the control weight times `control_scale`, shape (n_devices, 2n)."""
        if not 0.0 < control_scale < np.inf:
            raise SettingError(f"control_scale is {control_scale}; give a positive number")
        R = self.R + np.diag((control_scale - 1.0) * self.control_weight)
        return solve_riccati(self.plant.A, self.plant.B, self.Q, R, self.N, scaling=self.plant.scaling)[0]

    @checked
    def settings(self, control_scale: float = 1.0) -> dict[str, Weights]:
        """Settings of a regulator with these weights, as `RegulatorSettings(**designed.settings(1e-2))`."""
        if self.semi_active:
            raise SettingError(
                "these weights are more than weights of outputs: the law has their gain, see `gain_with`, or give the "
                "settings of the law the key designed"
            )
        settings: dict[str, Weights] = {}
        building = self.plant.building
        for setting, name in _SETTING.items():
            if setting in self.outputs.settings:
                places = building.storey_names if setting == "rms_drift" else building.floor_names
                settings[name] = tuple(self._of_places(setting, places))
        forces = self._of_places("rms_force", self.plant.device_names)
        settings["control_weight"] = tuple((control_scale * self.control_weight + forces).tolist())
        return settings

    def _of_places(self, setting: str, places: tuple[str, ...]) -> Floats:
        """Weights of all places of a quantity, zero without a limit."""
        weights = np.zeros(len(places))
        for name, key, weight in zip(
            self.outputs.names, self.outputs.settings, self.output_weights, strict=True
        ):
            if key == setting:
                weights[next(k for k, location in enumerate(places) if name.endswith(f" {location}"))] = (
                    weight
                )
        return weights

    @property
    def in_words(self) -> tuple[str, ...]:
        """Sentences on what can be reached, what binds, remarks; where a study asked, on ground and budget first."""
        remarks = (remark.as_sentence for remark in self.remarks)
        return (*self._origin_in_words, *self._reached_in_words, *remarks)

    @property
    def _origin_in_words(self) -> tuple[str, ...]:
        """Ground and budget, and the response under this ground that is worst over its limit without control."""
        if not self.origin:
            return ()
        bare, ruled = (self.rms_under_ground(controlled=flag) for flag in (False, True))
        worst = int(np.argmax(bare / self.outputs.limits))
        unit = self.outputs.units[worst]
        return (
            *self.origin,
            f"Under this ground rms {self.outputs.names[worst]} is {bare[worst]:.4g} {unit} without control and "
            f"{ruled[worst]:.4g} {unit} with ideal forces of the gain as designed (limit "
            f"{self.outputs.limits[worst]:.4g}).",
        )

    @property
    def _reached_in_words(self) -> tuple[str, ...]:
        ratio = self.reachable_ratio
        met = f"All limits can be met, down to {ratio:.3g} of them with the whole budget."
        return (*((met,) if ratio <= 1.0 else ()), *self.binding)

    def _summary(self) -> Summary:
        check = self.certificate
        over = check.rms / self.outputs.limits
        columns = (
            Column("", "output", of=self.outputs.names.__getitem__),
            Column("", "weight", of=self.output_weights.item, shown=format_rounded),
            Column("", "rms / limit", of=over.item, shown=format_rounded),
        )
        weights = ", ".join(format_rounded(weight) for weight in self.control_weight)
        return Summary(
            title=f"Designed weights for {self.plant.building.name}: least ratio {self.reachable_ratio:.4g}",
            facts=(
                ("spectrum", self.spectrum.name),
                ("engine", self.engine),
                ("certificate", f"gap to the bound {check.gap:.1e}"),
                ("law's gain", check.law_in_words),
                ("control weight", f"{weights} 1/N2"),
            ),
            tables=[Table.of(columns, np.argsort(-over, kind="stable")[:_BINDING_SHOWN].tolist())],
            remarks=self.remarks,
            notes=(*self.origin, *self._reached_in_words[: 1 + _BINDING_SHOWN]),
        )


def binding_in_words(
    outputs: LimitedOutputs, multipliers: Floats, ratio: float, budgets: Floats, plant: Plant
) -> tuple[str, ...]:
    """The limits and budgets with a multiplier, the largest first, one sentence each."""
    value = ratio**2
    n_limits = len(outputs.limits)
    q = multipliers[:n_limits]
    sentences = [
        f"Binds: rms {outputs.names[k]}, {outputs.limits[k] * ratio:.4g} {outputs.units[k]} at the least ratio "
        f"(limit {outputs.limits[k]:.4g}), with {100.0 * q[k]:.3g} % of the weight."
        for k in np.argsort(-q)
        if q[k] > _BINDING
    ]
    for name, budget, r in zip(
        plant.device_names, budgets, multipliers[n_limits : n_limits + len(budgets)], strict=True
    ):
        if r > _BINDING * value:
            # d log t / d log budget = -r / t^2.
            sentences.append(
                f"Binds: budget of {name}, {budget:.4g} N rms; 1 % more force lowers the ratio by {r / value:.2g} %."
            )
    return tuple(sentences)


def _ground(spectrum: SpectralDensity) -> dict[str, object]:
    """The numbers of a spectrum, with the mean square of the acceleration, of a road of the velocity."""
    numbers = {"spectrum": spectrum.name, "intensity": spectrum.intensity}
    if isinstance(spectrum, RoadVelocity):
        return {**numbers, "frequency": spectrum.frequency, "mean_square_velocity": spectrum.mean_square}
    soil = spectrum.soil if isinstance(spectrum, CloughPenzien) else spectrum
    damped = {"frequency": soil.frequency, "damping": soil.damping}
    return {**numbers, **damped, "mean_square": mean_square_of(spectrum)}
