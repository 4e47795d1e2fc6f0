"""The tables of a study and their keys: the one place where they are declared.

All is in SI units. A number that has a unit may also come as a text with another one, as "1 ms" or "0.1 g".
"""

# `key` is a dataclass field with notes.
# ruff: noqa: RUF009

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from mrwork.dampers.parameters import CommandUnit, LawName
from mrwork.keys import Place, key

Synthetic = Literal["kanai_tajimi", "clough_penzien"]
Signal = Literal["acceleration", "deformation", "force", "command"]


@dataclass(frozen=True, slots=True, kw_only=True)
class BraceTable:
    """What a damper is in series with."""

    stiffness: float = key("stiffness of the brace", unit="N/m", above=0.0)
    damping: float = key("its damping", unit="N s/m", default=0.0, least=0.0)
    mass: float | None = key(
        "mass of the joint between brace and damper; small, for none cannot be simulated",
        unit="kg",
        default=None,
        above=0.0,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class DamperTable:
    """A damper across a storey: a published set, a run of `mrwork identify`, or parameters written here."""

    storey: int | str = key("storey it stands in: its number from 1, or its name")
    preset: str | None = key("a published set, as kwok2006; see mrwork models NAME", default=None)
    run: str | None = key("folder of an identified run, from the study's folder", default=None)
    model: str | None = key(
        "model of the parameters, or of the preset where two share its name", default=None
    )
    parameters: Mapping[str, float | tuple[float, ...]] | None = key(
        "parameters, or those to change of a preset or run: a number, or the coefficients of its law",
        default=None,
    )
    laws: Mapping[str, LawName] | None = key(
        "laws of parameters in the command; several coefficients are a polynomial where none is named",
        default=None,
    )
    unit: CommandUnit = key("what the command is measured in, for parameters written here", default="A")
    lag: float | None = key(
        "rate of the driver's lag, in place of the preset's", unit="1/s", default=None, above=0.0
    )
    largest_command: float | None = key(
        "the most the driver gives, in place of the preset's", unit="A or V", default=None, above=0.0
    )
    count: int = key("equal dampers beside each other", default=1, least=1)
    differential: bool = key("an equal one in opposition, with the same command", default=False)
    brace: BraceTable | None = key("brace in series", default=None)
    amplitude: tuple[float, ...] | None = key(
        "least and largest elongation expected, for laws that want a static model of another damper",
        unit="m",
        default=None,
        above=0.0,
    )
    velocity: tuple[float, ...] | None = key(
        "least and largest velocity expected, for the same", unit="m/s", default=None, above=0.0
    )
    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerTable:
    """A control law; `mrwork respond --laws` lists them with their settings.

    The building without dampers and i = 0 are simulated in any case. Besides the laws there are `passive_off`,
    `passive_on`, and `best_passive`, the constant command of the least score.
    """

    law: str = key("name of the law")
    label: str = key("what tables call it; the law's title if empty", default="")
    settings: Mapping[str, Any] | None = key("settings of the law", default=None)
    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class BaselineTable:
    """The building with other devices, to stand beside the control laws: a viscous damper, a tuned mass, isolation."""

    label: str = key("what tables call it")
    building: Mapping[str, Any] = key("keys of [building] that are put in place of its own or added")
    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class SoilTable:
    """Filters of a synthetic motion; what is not said is that of firm soil."""

    frequency: float | None = key("of the ground [rad/s]", default=None, above=0.0)
    damping: float | None = key("damping ratio of the ground", default=None, above=0.0)
    intensity: float | None = key("two-sided density of the bedrock [m2/s3]", default=None, above=0.0)
    high_pass_frequency: float | None = key(
        "of the second filter of clough_penzien [rad/s]", default=None, above=0.0
    )
    high_pass_damping: float | None = key("its damping ratio", default=None, above=0.0)
    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionTable:
    """A ground motion, from a file or made; each factor and each peak gives one of its own."""

    file: str | None = key("record: .AT2, .csv, .mat and others, from the study's folder", default=None)
    synthetic: Synthetic | None = key("filtered noise instead of a file", default=None)
    name: str = key("what tables call it", default="")
    unit: str | None = key("unit of the file's acceleration where it does not say, as g", default=None)
    column: str | None = key("column or variable of the acceleration, where several may be it", default=None)
    channel: int | None = key("channel of a file that holds several, from 1", default=None, least=1)
    dt: float | None = key(
        "step of a synthetic motion, 0.01 s if not given, or of a table without times",
        unit="s",
        default=None,
        above=0.0,
    )
    duration: float = key("length of a synthetic motion", unit="s", default=30.0, above=0.0)
    seed: int = key("seed of a synthetic motion, added to that of the command line", default=0, least=0)
    soil: SoilTable | None = key("soil of a synthetic motion", default=None)
    factor: float | tuple[float, ...] | None = key("amplitudes are multiplied by it", default=None)
    pga: float | tuple[float, ...] | None = key(
        "amplitudes are scaled to this peak", unit="m/s2", default=None
    )
    time_scale: float = key("the time axis is multiplied by it", default=1.0, above=0.0)
    start: float = key("cut before, in the file's time", unit="s", default=0.0, least=0.0)
    end: float | None = key("cut after, in the file's time", unit="s", default=None, above=0.0)
    baseline: int | None = key("order of the polynomial taken off as baseline", default=None, least=0)
    resample: float | None = key("step that it is brought to", unit="s", default=None, above=0.0)
    rest: float = key("seconds without motion that follow", unit="s", default=0.0, least=0.0)
    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultTable:
    """A signal that breaks for a while: a sensor of a floor or damper, or the command of a damper that is stuck."""

    signal: Signal = key("what breaks")
    number: int = key("of which floor or damper, from 1, lowest first", default=1, least=1)
    start: float = key("from", unit="s", default=0.0, least=0.0)
    end: float = key("until", unit="s", default=math.inf, least=0.0)
    value: float | None = key("what it says meanwhile, nan too; the last before, if not given", default=None)
    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class HardwareTable:
    """What lies between the building and the law: sampling, delay, noise, observer, driver, faults."""

    sample_time: float = key("time between two commands", unit="s", default=1e-3, above=0.0)
    step: float = key("longest integration step; a sample has whole ones", unit="s", default=5e-4, above=0.0)
    delay: float = key("from the measurement to its command", unit="s", default=0.0, least=0.0)
    feedback: Literal["state", "observer"] = key(
        "what a law sees: the true state, or that of an observer of measurements", default="state"
    )
    measured_floors: tuple[int, ...] | None = key(
        "floors with an accelerometer for the observer, from 1; all if not given", default=None, least=1
    )
    noise_ratio: float = key("ground over sensor noise in the observer's design", default=50.0, above=0.0)
    acceleration_noise: float = key("standard deviation", unit="m/s2", default=0.0, least=0.0)
    deformation_noise: float = key("standard deviation", unit="m", default=0.0, least=0.0)
    force_noise: float = key("standard deviation", unit="N", default=0.0, least=0.0)
    acceleration_resolution: float = key("quantisation", unit="m/s2", default=0.0, least=0.0)
    deformation_resolution: float = key("quantisation", unit="m", default=0.0, least=0.0)
    force_resolution: float = key("quantisation", unit="N", default=0.0, least=0.0)
    command_rate: float = key(
        "the fastest the command may change", unit="A/s or V/s", default=math.inf, above=0.0
    )
    fault: tuple[FaultTable, ...] = key("faults", default=())


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportTable:
    """What the page draws in detail."""

    motion: str | None = key(
        "motion of the histories and loops; default: that of the largest peak", default=None
    )
    controllers: tuple[str, ...] = key("labels of those drawn there; default: all", default=())
    histories: Literal["detailed", "all", "none"] = key(
        "which histories are kept: those of the motion drawn in detail, or of all", default="detailed"
    )
    place: Place | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyTable:
    """A building, its dampers, control laws and ground motions."""

    title: str = key("heading of the page", default="")
    building: Mapping[str, Any] = key("the building")
    damper: tuple[DamperTable, ...] = key("dampers, all of one model", default=())
    controller: tuple[ControllerTable, ...] = key("control laws", default=())
    baseline: tuple[BaselineTable, ...] = key("other devices, to compare with", default=())
    motion: tuple[MotionTable, ...] = key("ground motions")
    hardware: HardwareTable = key("the loop around the law", default=HardwareTable())
    report: ReportTable = key("what the page draws", default=ReportTable())
