"""From the settings of a control law to its finished numbers, on the building with its devices."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mrwork.control.fuzzy import fuzzy_table
from mrwork.control.inverse_network import InverseNetwork, train_inverse_network
from mrwork.control.lqr import Regulator, regulator_of_outputs, regulator_of_state
from mrwork.control.lyapunov import lyapunov_function
from mrwork.control.outputs import accelerations, displacements, drifts, stacked, velocities
from mrwork.control.sliding import SlidingGains, SlidingSurface, optimal_surface, sliding_gains
from mrwork.study.design_problem import Subject
from mrwork.study.law_settings import (
    ClippedSettings,
    FrictionSettings,
    FuzzySettings,
    LyapunovSettings,
    NetworkSettings,
    PassiveSettings,
    ProportionalSettings,
    RegulatorSettings,
    SlidingSettings,
    Weights,
)

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """Gains of a law by name: one number for each device, or a row over the state; and arrays that it looks up."""

    gains: Mapping[str, Floats] = field(default_factory=dict)
    tables: Mapping[str, Floats] = field(default_factory=dict)


def designed(law: str, settings: Any, subject: Subject) -> Design:
    """The numbers of a law; `settings` is of its class in `SETTINGS`.

    Raises
    ------
    SettingError
        Where no such law can be made for this building.
    """
    return _DESIGNS[law](settings, subject)


def _nothing(settings: Any, subject: Subject) -> Design:
    return Design()


def _passive(settings: PassiveSettings, subject: Subject) -> Design:
    largest = min(device.largest_command for device in subject.devices)
    if settings.command > largest:
        settings.place.within("command").refuse(
            f"command is {settings.command:g}, and the driver gives {largest:g} at most"
        )
    return Design(gains={"command": subject.each(settings.command)})


def _clipped_optimal(settings: RegulatorSettings, subject: Subject) -> Design:
    return Design(gains={"gain": _regulator(settings, subject).gain})


def _in_proportion(settings: ClippedSettings, subject: Subject) -> Design:
    gain = _regulator(settings, subject).gain
    return Design(gains={"gain": gain, "full_force": subject.each(settings.full_force)})


def _lyapunov(settings: LyapunovSettings, subject: Subject) -> Design:
    return Design(gains={"weight": lyapunov_function(subject.plant, settings.state_weight).vectors})


def _proportional_direct(settings: ProportionalSettings, subject: Subject) -> Design:
    plant = subject.plant
    if settings.control_weight is None:
        weight = lyapunov_function(plant, settings.state_weight).vectors
    else:
        state_weight = plant.energy if settings.state_weight is None else settings.state_weight
        weight = regulator_of_state(plant, state_weight, settings.control_weight).vectors
    return Design(gains={"weight": weight, "slope": subject.each(settings.slope)})


def _friction(settings: FrictionSettings, subject: Subject) -> Design:
    return Design(gains={"slope": subject.each(settings.slope)})


def _sliding_mode(settings: SlidingSettings, subject: Subject) -> Design:
    surface, gains = _sliding(settings, subject)
    return Design(gains={**_pushed_down(surface, gains), "switching": gains.switching})


def _adaptive_sliding_mode(settings: SlidingSettings, subject: Subject) -> Design:
    surface, gains = _sliding(settings, subject)
    adapted = {"adaptation": gains.adaptation, "floor": gains.floor, "ceiling": gains.ceiling}
    return Design(gains={**_pushed_down(surface, gains), **adapted})


def _pushed_down(surface: SlidingSurface, gains: SlidingGains) -> dict[str, Floats]:
    # The loop signs the surface so that the force pushes it down.
    return {"gain": surface.drift, "surface": -surface.S, "boundary": gains.boundary}


def _super_twisting(settings: SlidingSettings, subject: Subject) -> Design:
    surface, gains = _sliding(settings, subject)
    return Design(
        gains={
            "surface": surface.S,
            "drift": surface.drift,
            "push": subject.each(1.0),
            "root_gain": gains.proportional,
            "integral_gain": gains.integral,
        }
    )


def _sliding(settings: SlidingSettings, subject: Subject) -> tuple[SlidingSurface, SlidingGains]:
    surface = optimal_surface(subject.plant)
    gains = sliding_gains(
        surface,
        peak_acceleration=settings.peak_acceleration,
        largest_force=settings.largest_force,
        frequency=settings.frequency,
        margin=settings.margin,
        bandwidth=settings.bandwidth,
    )
    return surface, gains


def _fuzzy(settings: FuzzySettings, subject: Subject) -> Design:
    table = fuzzy_table(deformation_scale=settings.deformation, rate_scale=settings.rate)
    return Design(
        gains={
            "deformation_scale": subject.each(settings.deformation),
            "rate_scale": subject.each(settings.rate),
        },
        tables={"shares": table.share.ravel()},
    )


def _inverse_network(settings: NetworkSettings, subject: Subject) -> Design:
    device = subject.devices[0]
    network = train_inverse_network(
        device.spec,
        device.draws[0],
        largest_command=device.largest_command,
        amplitude=settings.amplitude,
        velocity=settings.velocity,
        sample_time=subject.sample_time,
        n_hidden=settings.hidden,
        rng=settings.seed,
    )
    return Design(gains={"gain": _regulator(settings, subject).gain}, tables=_network_tables(network))


def _network_tables(network: InverseNetwork) -> dict[str, Floats]:
    """The network with its scales folded in, and how far its inputs reach.

    A row for each hidden unit holds its bias, the weights of its inputs and its weight in the output.
    """
    layer = np.column_stack([network.b1, network.W1 / network.input_scale, network.w2 * network.output_scale])
    output = np.array([network.b2 * network.output_scale])
    return {"layer": layer.ravel(), "output": output, "reach": network.input_scale}


def _regulator(settings: RegulatorSettings, subject: Subject) -> Regulator:
    plant = subject.plant
    outputs = (
        ("accelerations", accelerations, settings.accelerations),
        ("drifts", drifts, settings.drifts),
        ("displacements", displacements, settings.displacements),
        ("velocities", velocities, settings.velocities),
    )
    weighed = [(name, make(plant), weights) for name, make, weights in outputs if weights is not None]
    if not weighed:
        return regulator_of_state(plant, (settings.energy or 1.0) * plant.energy, settings.control_weight)
    if settings.energy is not None:
        settings.place.within("energy").refuse(
            f"a regulator weighs the energy or outputs such as {weighed[0][0]}; keep one"
        )
    weights = [_each(settings, name, given, len(made.names)) for name, made, given in weighed]
    return regulator_of_outputs(
        plant, stacked(*(made for _, made, _ in weighed)), np.concatenate(weights), settings.control_weight
    )


def _each(settings: RegulatorSettings, name: str, given: Weights, count: int) -> Floats:
    if isinstance(given, tuple) and len(given) != count:
        settings.place.within(name).refuse(
            f"{name} has {len(given)} weights, and there are {count}; give one for each, or one for all"
        )
    return np.full(count, given) if isinstance(given, float) else np.array(given)


_DESIGNS: dict[str, Callable[[Any, Subject], Design]] = {
    "passive": _passive,
    "clipped_optimal": _clipped_optimal,
    "modified_clipped_optimal": _in_proportion,
    "proportional_clipped_optimal": _in_proportion,
    "lyapunov": _lyapunov,
    "decentralised_bang_bang": _nothing,
    "maximum_energy_dissipation": _nothing,
    "modulated_homogeneous_friction": _friction,
    "sliding_mode": _sliding_mode,
    "adaptive_sliding_mode": _adaptive_sliding_mode,
    "super_twisting": _super_twisting,
    "fuzzy": _fuzzy,
    "lyapunov_direct": _lyapunov,
    "lyapunov_direct_bang_bang": _lyapunov,
    "proportional_direct": _proportional_direct,
    "inverse_direct": _clipped_optimal,
    "inverse_network": _inverse_network,
    "active": _clipped_optimal,
}
