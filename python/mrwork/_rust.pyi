from collections.abc import Callable, Sequence
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from mrwork.buildings import PassiveElement
from mrwork.closed_loop import Hardware

__all__ = [
    "Building",
    "Controller",
    "Dampers",
    "ForceCurve",
    "LawTape",
    "LoadingHistory",
    "LoopModel",
    "Observer",
    "__version__",
    "control_laws",
    "current_laws",
    "damper_specs",
    "damper_text",
    "elementary_functions",
    "flops_per_step",
    "fma_peak",
    "force",
    "force_histories",
    "history_signals",
    "instruction_set",
    "instruction_sets",
    "law_commands",
    "law_readings",
    "law_text",
    "misfits",
    "rate",
    "register_damper",
    "respond",
    "riccati_equations",
    "run_quantities",
    "sensitivities",
    "stiffness_shares",
    "straight_forces",
    "tape_operations",
    "xla_handler",
]

_Floats = NDArray[np.float64]

__version__: str

@final
class Building:
    def __new__(
        cls,
        mass: _Floats,
        damping: _Floats,
        stiffness: _Floats,
        influence: _Floats,
        floors: _Floats,
        storeys: _Floats,
        unit_drifts: _Floats,
        heights: _Floats,
        storey_springs: _Floats,
        devices: _Floats,
        sprung: _Floats,
        elements: Sequence[PassiveElement],
        varied: Sequence[tuple[_Floats, _Floats]] = ...,
    ) -> Building: ...
    @property
    def summary_layout(self) -> list[tuple[str, int]]: ...
    @property
    def history_layout(self) -> list[tuple[str, int]]: ...

@final
class LoadingHistory:
    def __new__(
        cls, dt: float, displacement: _Floats, velocity: _Floats | None = None, command: _Floats | None = None
    ) -> LoadingHistory: ...
    def __getnewargs__(self) -> tuple[float, _Floats, _Floats | None, _Floats | None]: ...
    @property
    def dt(self) -> float: ...
    @property
    def n_time(self) -> int: ...
    @property
    def peak_velocity(self) -> float: ...
    @property
    def reversal_acceleration(self) -> float: ...
    @property
    def command(self) -> _Floats | None: ...
    @property
    def parts(self) -> tuple[_Floats, _Floats]: ...
    def stages(self, substeps: int) -> _Floats: ...

def current_laws() -> list[tuple[str, int, int | None]]: ...
def damper_specs() -> list[dict[str, Any]]: ...
def misfits(
    model: str,
    theta: _Floats,
    loading: LoadingHistory,
    force: _Floats,
    first: int = 0,
    laws: list[str] | None = None,
    rates: int = 0,
    substep_factor: int = 1,
    threads: int = 0,
    limits: _Floats | None = None,
) -> tuple[_Floats, NDArray[np.uint8], NDArray[np.uint32], NDArray[np.uint64]]: ...
def stiffness_shares(
    model: str, theta: _Floats, loading: LoadingHistory, laws: list[str] | None = None, rates: int = 0
) -> _Floats: ...
def force_histories(
    model: str,
    theta: _Floats,
    loading: LoadingHistory,
    laws: list[str] | None = None,
    rates: int = 0,
    substep_factor: int = 1,
    threads: int = 0,
) -> tuple[_Floats, NDArray[np.uint8], NDArray[np.uint32]]: ...
def damper_text(
    model: str,
    coefficients: list[str],
    steps: list[float],
    laws: list[str] | None = None,
    rates: int = 0,
    single: bool = False,
) -> dict[str, Any]: ...
def elementary_functions() -> str: ...
def straight_forces(
    model: str,
    theta: _Floats,
    displacement: _Floats,
    velocity: _Floats,
    command: _Floats,
    dt: float,
    substeps: int,
    laws: list[str] | None = None,
    rates: int = 0,
    speeds: list[float] = ...,
    fading: float = 0.0,
) -> _Floats | None: ...
def tape_operations() -> list[tuple[str, int]]: ...
def register_damper(
    name: str, parameters: list[Any], n_states: int, force: Any, rate: Any, relaxation: Any
) -> None: ...
def law_text(looped: Any, single: bool = False) -> dict[str, Any]: ...
def law_readings(looped: Any) -> list[tuple[str, int]]: ...
def law_commands(looped: Any, readings: _Floats) -> _Floats: ...
def sensitivities(
    model: str,
    theta: _Floats,
    loading: LoadingHistory,
    columns: list[int] | None = None,
    laws: list[str] | None = None,
    rates: int = 0,
    substep_factor: int = 1,
    threads: int = 0,
) -> tuple[_Floats, _Floats, NDArray[np.uint8], NDArray[np.uint32]]: ...
def rate(model: str, theta: _Floats, state: _Floats, displacement: float, velocity: float) -> _Floats: ...
def force(model: str, theta: _Floats, state: _Floats, displacement: float, velocity: float) -> float: ...
def xla_handler() -> tuple[int, list[int]]: ...
def instruction_set() -> str: ...
def instruction_sets() -> tuple[list[str], list[str]]: ...
def fma_peak(threads: int, seconds: float) -> float: ...
def flops_per_step(model: str, theta: _Floats) -> int: ...
def riccati_equations(
    time: str,
    state: _Floats,
    control: _Floats,
    state_weight: _Floats,
    control_weight: _Floats,
    cross_weight: _Floats | None = None,
    scaling: _Floats | None = None,
    threads: int = 0,
) -> tuple[_Floats, _Floats, _Floats, NDArray[np.uint8]]: ...
def control_laws() -> list[dict[str, Any]]: ...
def run_quantities() -> list[tuple[str, str, str, str]]: ...
def history_signals() -> list[tuple[str, str, str, str]]: ...

@final
class Dampers:
    def __new__(
        cls,
        model: str,
        theta: _Floats,
        counts: Sequence[float],
        differential: Sequence[bool],
        ranges: Sequence[tuple[float, float]],
        laws: Sequence[str] | None = None,
        rates: int = 0,
    ) -> Dampers: ...

@final
class ForceCurve:
    def __new__(cls, laws: Sequence[str], theta: _Floats, rates: int = 0) -> ForceCurve: ...

@final
class LoopModel:
    def __new__(cls, building: Building, dampers: Sequence[Dampers]) -> LoopModel: ...

@final
class Controller:
    def __new__(
        cls,
        law: str,
        gains: _Floats,
        tables: Sequence[_Floats] = ...,
        curve: ForceCurve | None = None,
        shaping: _Floats | None = None,
        model: LoopModel | None = None,
    ) -> Controller: ...

@final
class LawTape:
    def __new__(
        cls,
        tape: object,
        inputs: Sequence[tuple[str, int, bool]],
        start: Sequence[float],
        names: Sequence[str],
        settings: _Floats,
    ) -> LawTape: ...

@final
class Observer:
    def __new__(
        cls,
        accelerations: Sequence[int],
        deformations: Sequence[int],
        transition: _Floats,
        input: _Floats,
        gain: _Floats,
        output: _Floats,
        direct: _Floats,
        ground: _Floats | None = None,
        direct_ground: _Floats | None = None,
        is_absolute: bool = False,
    ) -> Observer: ...

def respond(
    building: Building,
    dampers: Sequence[Dampers],
    controller: Controller,
    hardware: Hardware,
    motions: Sequence[tuple[float, _Floats, _Floats, bool]],
    runs: NDArray[np.uint32],
    streams: NDArray[np.uint64],
    observer: Observer | None = None,
    histories: bool = False,
    step_factor: int = 1,
    threads: int = 0,
    outside: Callable[..., _Floats] | None = None,
    changes: _Floats | None = None,
    n_commanded: int | None = None,
    own: LawTape | None = None,
) -> tuple[_Floats, NDArray[np.uint8], NDArray[np.uint32], list[_Floats] | None, _Floats | None]: ...
