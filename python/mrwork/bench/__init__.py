"""Speed of the compiled kernels against the best that jax and numba make of the same arithmetic."""

from __future__ import annotations

from mrwork.bench.kernels import KernelBenchmark, KernelRow, bench_kernels, format_table

__all__ = ["KernelBenchmark", "KernelRow", "bench_kernels", "format_table"]
