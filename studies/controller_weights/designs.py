"""Designs of frames of 3 to 20 storeys and their extensions on five: values, violations, times."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mrwork.buildings import Building, building, shear_building, with_rayleigh_damping
from mrwork.closed_loop import STANDARD_GRAVITY, Device
from mrwork.control import (
    DesignCase,
    DesignedWeights,
    LoopTiming,
    Plant,
    SemiActiveCondition,
    WeightDesigner,
    accelerations,
    design_weights,
    drifts,
    inverse_weights,
    plant_of,
    regulator_of_outputs,
    sine_force,
    stiffness_cases,
)
from mrwork.motions import CloughPenzien, KanaiTajimi
from studies.former.frame import pair

STOREYS = (3, 5, 8, 20)
BUDGET = 0.03
"""Budget of force over the weight of a frame."""
SEED = 5


def frame(n_storeys: int) -> Building:
    """The frame of Dyke et al., the five-storey frame, and taller ones of its storeys with 1 % in modes 1 and 3."""
    if n_storeys in (3, 5):
        return building({3: "dyke1996", 5: "uts"}[n_storeys])
    bare = shear_building(
        name=f"{n_storeys} storeys", masses=[330.0] * n_storeys, stiffnesses=[1.448e6] * n_storeys
    )
    return with_rayleigh_damping(bare, ratios=(0.01, 0.01), modes=(1, 3))


def budget_of(bare: Building) -> float:
    """Rms force of the device [N]."""
    return BUDGET * bare.total_mass * STANDARD_GRAVITY


def limits_of(bare: Building) -> dict[str, float]:
    """The largest rms drift and the largest rms acceleration without control."""
    bound = {"rms_drift": 1.0, "rms_acceleration": 1.0}
    found = design_weights(bare, bare.storeys[:1], limits=bound, budget=1e-3 * budget_of(bare))
    rms = found.system.rms_without_control()
    n = len(bare.drifts)
    return {"rms_drift": float(rms[:n].max()), "rms_acceleration": float(rms[n:].max())}


def seconds_of(call: Callable[[], DesignedWeights]) -> tuple[DesignedWeights, float]:
    """A design and its seconds of processor time, which other work on the machine changes least."""
    began = time.process_time()
    found = call()
    return found, time.process_time() - began


def sizes(*, quick: bool) -> Iterator[tuple[str, dict[str, Any]]]:
    """For each frame the value of the program beside that of the Riccati equations, the violation and the times."""
    for n in STOREYS[:2] if quick else STOREYS:
        bare = frame(n)
        limits, budget = limits_of(bare), budget_of(bare)

        def designer(
            bare: Building = bare, limits: dict[str, float] = limits, modes: int | None = None
        ) -> WeightDesigner:
            return WeightDesigner(
                bare, bare.storeys[:1], limits=limits, budget=budget_of(bare), program_modes=modes
            )

        made = designer()
        found, first = seconds_of(made.design)
        again, repeated = seconds_of(lambda made=made, budget=budget: made.design(budget=1.1 * budget))
        row = _figures(found) | {"first_s": first, "repeated_s": repeated, "budget": budget}
        if found.certificate.program_ratio is None:
            whole, row["whole_program_s"] = seconds_of(designer(modes=n).design)
            row["program_ratio"] = whole.certificate.program_ratio
            row["program_error"] = _program_error(whole)
        yield f"{n} storeys", row | {"repeated_violation": again.certificate.violation}


def _figures(found: DesignedWeights) -> dict[str, Any]:
    check = found.certificate
    return {
        "ratio": found.reachable_ratio,
        "law_ratio": check.law_ratio,
        "law_force": check.law_force,
        "violation": check.violation,
        "gap": check.gap,
        "program_ratio": check.program_ratio,
        "program_error": _program_error(found),
        "engine": found.engine,
        "binding": list(found.binding),
    }


def _program_error(found: DesignedWeights) -> float | None:
    """Least t^2 of the program over that of the Riccati equations, minus 1."""
    check = found.certificate
    return None if check.program_ratio is None else abs(check.program_ratio**2 / check.ratio**2 - 1.0)


def drawn_pair(draws: int) -> Device:
    """Two RD-1005-3 in opposition at the first storey, with draws of 5 % on every parameter."""
    nominal = pair(lagged=False)
    scatter = np.random.default_rng(SEED).standard_normal((draws, np.size(nominal.theta)))
    return replace(nominal, theta=np.array(nominal.theta) * (1.0 + 0.05 * scatter))


def soil_cases(bare: Building, spectra: Sequence[KanaiTajimi]) -> tuple[DesignCase, ...]:
    """The building under each spectrum."""
    return tuple(
        DesignCase(name=f"{spectrum.name} {number + 1}", building=bare, spectrum=spectrum)
        for number, spectrum in enumerate(spectra)
    )


def damper_cases(
    bare: Building, device: Device, *, amplitude: float, frequency: float
) -> tuple[DesignCase, ...]:
    """The building with the dampers at zero command as springs and dashpots, for up to 8 draws of their parameters.

    The force at zero command is replaced by `k x + c v` of the same work and the same force at the largest displacement
    in a sinusoid of this amplitude [m] and frequency [Hz] (equivalent linearisation). Budgets are then of the force
    beyond it.
    """
    n_draws, w = len(device.draws), 2.0 * np.pi * frequency
    cases = []
    for draw in np.unique(np.linspace(0, n_draws - 1, min(8, n_draws)).round().astype(int)):
        force = sine_force(replace(device, theta=device.draws[draw]), amplitude, amplitude * w, 0.0)
        force, phase = force - force.mean(), 2.0 * np.pi * np.arange(force.size) / force.size
        k = max(2.0 * float(np.mean(force * np.sin(phase))) / amplitude, 0.0)
        c = max(2.0 * float(np.mean(force * np.cos(phase))) / (amplitude * w), 0.0)
        across = np.outer(device.row, device.row)
        drawn = replace(bare, stiffness=bare.stiffness + k * across, damping=bare.damping + c * across)
        cases.append(DesignCase(name=f"draw {draw + 1} of the dampers", building=drawn))
    return tuple(cases)


def extensions(*, quick: bool) -> Iterator[tuple[str, dict[str, Any]]]:
    """Each extension on the five storeys, beside the plain design."""
    bare = frame(5)
    soils = [
        KanaiTajimi(),
        KanaiTajimi(frequency=25.0, intensity=0.006),
        KanaiTajimi(frequency=8.0, damping=0.4),
    ]
    asked: dict[str, dict[str, Any]] = {
        "plain": {},
        "stiffness +-25 %": {"cases": stiffness_cases(bare)},
        "three soils": {"cases": soil_cases(bare, soils)},
        "draws of the dampers": {"cases": damper_cases(bare, drawn_pair(5), amplitude=4e-3, frequency=3.0)},
        "Clough-Penzien": {"spectrum": CloughPenzien()},
        "sampled, 1 ms": {"timing": LoopTiming()},
        "driver 190 1/s": {"timing": LoopTiming(driver_rate=190.0)},
        "driver, delay 5 ms": {"timing": LoopTiming(driver_rate=190.0, delay=5e-3)},
        "driver, delay 20 ms, 5 ms": {"timing": LoopTiming(driver_rate=190.0, delay=0.02, sample_time=5e-3)},
        "semi-active, b = 0.2": {"semi_active": SemiActiveCondition(share=0.2)},
        "semi-active, b = 0.1": {"semi_active": SemiActiveCondition(share=0.1)},
    }
    limits, budget = limits_of(bare), budget_of(bare)
    for name, given in asked.items():
        if quick and name not in ("plain", "driver, delay 5 ms"):
            continue
        found, first = seconds_of(
            lambda given=given: design_weights(bare, bare.storeys[:1], limits=limits, budget=budget, **given)
        )
        yield name, _figures(found) | {"first_s": first}


def unreachable() -> dict[str, Any]:
    """Wishes beyond the budget, in the words of the design: one that a larger budget meets, and one that none does."""
    bare = frame(5)
    limits = {name: 0.25 * limit for name, limit in limits_of(bare).items()}
    few = design_weights(bare, bare.storeys[:1], limits=limits, budget=budget_of(bare))
    hopeless = {"rms_acceleration": 0.02 * limits["rms_acceleration"]}
    none = design_weights(bare, bare.storeys[:1], limits=hopeless, budget=budget_of(bare))
    return {
        name: {"ratio": found.reachable_ratio, "words": list(found.in_words)}
        for name, found in (("too small a budget", few), ("no budget suffices", none))
    }


def inverses(*, quick: bool) -> Iterator[tuple[str, dict[str, Any]]]:
    """Distances of gains to the nearest that is optimal for some Q and R without cross term."""
    bare = frame(5)
    plant: Plant = plant_of(bare, bare.storeys[:1])
    dashpot = np.zeros((1, 10))
    dashpot[0, 5] = -1e4
    spring = dashpot.copy()
    spring[0, 0] = -1e5
    gains = {
        "equal drift weights, R = 1e-13": regulator_of_outputs(plant, drifts(plant), 1.0, 1e-13).gain,
        "equal drift weights, R = 1e-10": regulator_of_outputs(plant, drifts(plant), 1.0, 1e-10).gain,
        "designed, R as designed": design_weights(
            bare, bare.storeys[:1], limits=limits_of(bare), budget=budget_of(bare)
        ).gain,
        "equal acceleration weights, R = 1e-5": regulator_of_outputs(
            plant, accelerations(plant), 1.0, 1e-5
        ).gain,
        "dashpot of 10 kN s/m": dashpot,
        "dashpot and spring of 100 kN/m": spring,
    }
    for name, gain in list(gains.items())[: 2 if quick else None]:
        yield name, {"distance": inverse_weights(plant, gain).distance}
