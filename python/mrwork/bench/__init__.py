"""Speed of the compiled kernels against the best that jax and numba make of the same arithmetic."""

from __future__ import annotations

from mrwork.bench.kernels import KernelBenchmark, KernelRow, bench_kernels, format_table
from mrwork.bench.models import ModelBenchmark, ModelRow, bench_models, format_models

__all__ = [
    "KernelBenchmark",
    "KernelRow",
    "ModelBenchmark",
    "ModelRow",
    "bench_kernels",
    "bench_models",
    "format_models",
    "format_table",
]
