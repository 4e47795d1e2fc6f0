"""What the control laws of a study may be told, declared as the other tables are.

A law is designed on the building with its devices: a regulator by weights, a Lyapunov function, a sliding surface.
"""

# `key` is a dataclass field with notes.
# ruff: noqa: RUF009

from __future__ import annotations

from dataclasses import dataclass

from mrwork.study.declared import Place, key

Weights = float | tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class NoSettings:
    """Nothing to be told."""

    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class PassiveSettings:
    """A command that is held."""

    command: float = key("the command that is held, up to the largest", unit="A or V", least=0.0)
    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class RegulatorSettings:
    """A linear quadratic regulator: one weight for all floors or storeys, or one for each; by default the energy."""

    control_weight: float = key("R of the force [1/N2]", above=0.0)
    accelerations: Weights | None = key(
        "weights of absolute floor accelerations [(s2/m)2]", default=None, least=0.0
    )
    drifts: Weights | None = key("weights of drifts [1/m2]", default=None, least=0.0)
    displacements: Weights | None = key("weights of floor displacements [1/m2]", default=None, least=0.0)
    velocities: Weights | None = key("weights of floor velocities [(s/m)2]", default=None, least=0.0)
    energy: float | None = key("weight of twice the energy of the building [1/J]", default=None, above=0.0)
    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class ClippedSettings(RegulatorSettings):
    """A regulator whose wanted force is clipped in proportion."""

    full_force: float = key("wanted force at which the largest command is sent", unit="N", above=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkSettings(RegulatorSettings):
    """A regulator whose wanted force a trained network turns into a command."""

    amplitude: float = key("elongation that is to be expected", unit="m", above=0.0)
    velocity: float = key("its rate", unit="m/s", above=0.0)
    hidden: int = key("units of the hidden layer", default=12, least=1)
    seed: int = key("seed of its training", default=0, least=0)


@dataclass(frozen=True, slots=True, kw_only=True)
class LyapunovSettings:
    """A Lyapunov function, whose weight is the energy of the building if not given."""

    state_weight: tuple[float, ...] | None = key(
        "diagonal of Q_P over displacements, then velocities of the coordinates", default=None, least=0.0
    )
    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class ProportionalSettings(LyapunovSettings):
    """The smooth law: kappa times sigma G; with a control weight sigma is that of a regulator of the energy."""

    slope: float = key("kappa [A or V, per unit of sigma G]", above=0.0)
    control_weight: float | None = key("R of that regulator [1/N2]", default=None, above=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class FrictionSettings:
    """Friction in proportion to the last peak of the elongation."""

    slope: float = key("wanted friction per elongation", unit="N/m", above=0.0)
    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class SlidingSettings:
    """A sliding surface on which the energy of the building is least, held against motions of a stated size."""

    peak_acceleration: float = key("of the ground motions to be held", unit="m/s2", above=0.0)
    largest_force: float = key("of each damper", unit="N", above=0.0)
    frequency: float = key(
        "the highest at which the ground still has its peak", unit="Hz", default=5.0, above=0.0
    )
    margin: float = key("of the switching force over what it holds", default=1.2, above=1.0)
    bandwidth: float = key(
        "inside the boundary layer; below the driver's", unit="1/s", default=100.0, above=0.0
    )
    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class FuzzySettings:
    """What counts as large for the fuzzy controller."""

    deformation: float = key("elongation", unit="m", above=0.0)
    rate: float = key("its rate", unit="m/s", above=0.0)
    place: Place


SETTINGS: dict[str, type] = {
    "passive": PassiveSettings,
    "clipped_optimal": RegulatorSettings,
    "modified_clipped_optimal": ClippedSettings,
    "proportional_clipped_optimal": ClippedSettings,
    "lyapunov": LyapunovSettings,
    "decentralised_bang_bang": NoSettings,
    "maximum_energy_dissipation": NoSettings,
    "modulated_homogeneous_friction": FrictionSettings,
    "sliding_mode": SlidingSettings,
    "adaptive_sliding_mode": SlidingSettings,
    "super_twisting": SlidingSettings,
    "fuzzy": FuzzySettings,
    "lyapunov_direct": LyapunovSettings,
    "lyapunov_direct_bang_bang": LyapunovSettings,
    "proportional_direct": ProportionalSettings,
    "inverse_direct": RegulatorSettings,
    "inverse_network": NetworkSettings,
    "active": RegulatorSettings,
}
"""By name of the law."""
