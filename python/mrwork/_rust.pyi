from collections.abc import Callable
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Building",
    "LoadingHistory",
    "__version__",
    "control_laws",
    "current_laws",
    "damper_specs",
    "flops_per_step",
    "fma_peak",
    "force",
    "force_histories",
    "history_signals",
    "instruction_set",
    "misfits",
    "rate",
    "respond",
    "riccati_equations",
    "run_quantities",
    "sensitivities",
    "stiffness_shares",
]

__version__: str

@final
class Building:
    def __new__(
        cls,
        mass: NDArray[np.float64],
        damping: NDArray[np.float64],
        stiffness: NDArray[np.float64],
        influence: NDArray[np.float64],
        floors: NDArray[np.float64],
        storeys: NDArray[np.float64],
        devices: NDArray[np.float64],
        elements: NDArray[np.float64],
        element_parameters: NDArray[np.float64],
    ) -> Building: ...
    @property
    def summary_layout(self) -> list[tuple[str, int]]: ...
    @property
    def history_layout(self) -> list[tuple[str, int]]: ...

@final
class LoadingHistory:
    def __new__(
        cls,
        dt: float,
        displacement: NDArray[np.float64],
        velocity: NDArray[np.float64] | None = None,
        command: NDArray[np.float64] | None = None,
    ) -> LoadingHistory: ...
    def __getnewargs__(
        self,
    ) -> tuple[float, NDArray[np.float64], NDArray[np.float64] | None, NDArray[np.float64] | None]: ...
    @property
    def dt(self) -> float: ...
    @property
    def n_time(self) -> int: ...
    @property
    def peak_velocity(self) -> float: ...
    @property
    def reversal_acceleration(self) -> float: ...
    @property
    def command(self) -> NDArray[np.float64] | None: ...
    def stages(self, substeps: int) -> NDArray[np.float64]: ...

def current_laws() -> list[tuple[str, int, int | None]]: ...
def damper_specs() -> list[dict[str, Any]]: ...
def misfits(
    model: str,
    theta: NDArray[np.float64],
    loading: LoadingHistory,
    force: NDArray[np.float64],
    first: int = 0,
    laws: list[str] | None = None,
    lagged: bool = False,
    substep_factor: int = 1,
    threads: int = 0,
    limits: NDArray[np.float64] | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.uint8], NDArray[np.uint32], NDArray[np.uint64]]: ...
def stiffness_shares(
    model: str,
    theta: NDArray[np.float64],
    loading: LoadingHistory,
    laws: list[str] | None = None,
    lagged: bool = False,
) -> NDArray[np.float64]: ...
def force_histories(
    model: str,
    theta: NDArray[np.float64],
    loading: LoadingHistory,
    laws: list[str] | None = None,
    lagged: bool = False,
    substep_factor: int = 1,
    threads: int = 0,
) -> tuple[NDArray[np.float64], NDArray[np.uint8], NDArray[np.uint32]]: ...
def sensitivities(
    model: str,
    theta: NDArray[np.float64],
    loading: LoadingHistory,
    columns: list[int] | None = None,
    laws: list[str] | None = None,
    lagged: bool = False,
    substep_factor: int = 1,
    threads: int = 0,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.uint8], NDArray[np.uint32]]: ...
def rate(
    model: str,
    theta: NDArray[np.float64],
    state: NDArray[np.float64],
    displacement: float,
    velocity: float,
) -> NDArray[np.float64]: ...
def force(
    model: str,
    theta: NDArray[np.float64],
    state: NDArray[np.float64],
    displacement: float,
    velocity: float,
) -> float: ...
def instruction_set() -> str: ...
def fma_peak(threads: int, seconds: float) -> float: ...
def flops_per_step(model: str, theta: NDArray[np.float64]) -> int: ...
def riccati_equations(
    time: str,
    state: NDArray[np.float64],
    control: NDArray[np.float64],
    state_weight: NDArray[np.float64],
    control_weight: NDArray[np.float64],
    cross_weight: NDArray[np.float64] | None = None,
    scaling: NDArray[np.float64] | None = None,
    threads: int = 0,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.uint8]]: ...
def control_laws() -> list[dict[str, Any]]: ...
def run_quantities() -> list[tuple[str, str, str, str]]: ...
def history_signals() -> list[tuple[str, str, str, str]]: ...
def respond(
    building: Building,
    model: str,
    laws: tuple[list[str] | None, bool],
    theta: NDArray[np.float64],
    places: list[tuple[float, bool]],
    ranges: list[list[float]],
    law: str,
    gains: NDArray[np.float64],
    tables: list[NDArray[np.float64]],
    curve: tuple[tuple[list[str] | None, bool], NDArray[np.float64]] | None,
    motions: list[tuple[float, NDArray[np.float64]]],
    runs: NDArray[np.uint32],
    streams: NDArray[np.uint64],
    sample_time: float,
    steps: int,
    delay_steps: int,
    command_rate: float,
    sensors: list[list[float]],
    faults: list[tuple[str, int, int, int, float | None]],
    observer: tuple[list[int], list[int], *tuple[NDArray[np.float64], ...]] | None,
    histories: bool = False,
    step_factor: int = 1,
    threads: int = 0,
    outside: Callable[..., NDArray[np.float64]] | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.uint8], NDArray[np.uint32], list[NDArray[np.float64]] | None]: ...
