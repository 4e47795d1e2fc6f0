"""Compiled kernels for studies of speed and stepping; other users call `mr.simulate`."""

from mrwork._rust import (
    LoadingHistory,
    flops_per_step,
    fma_peak,
    force_histories,
    instruction_set,
    misfits,
    sensitivities,
)

__all__ = [
    "LoadingHistory",
    "flops_per_step",
    "fma_peak",
    "force_histories",
    "instruction_set",
    "misfits",
    "sensitivities",
]
