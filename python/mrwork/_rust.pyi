from typing import Any, final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "LoadingHistory",
    "__version__",
    "current_laws",
    "damper_specs",
    "flops_per_step",
    "fma_peak",
    "force",
    "force_histories",
    "instruction_set",
    "misfits",
    "rate",
    "sensitivities",
]

__version__: str

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

def current_laws() -> list[tuple[str, int]]: ...
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
