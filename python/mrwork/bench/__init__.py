"""Speed of the compiled kernels and of the searches on them, beside what other libraries make of the same."""

from __future__ import annotations

from mrwork.bench.identify import SearchBenchmark, bench_identify
from mrwork.bench.identify_table import format_identify
from mrwork.bench.kernels import KernelBenchmark, KernelRow, bench_kernels, format_table
from mrwork.bench.loop import LoopBenchmark, LoopRow, bench_loop, format_loop
from mrwork.bench.models import ModelBenchmark, ModelRow, bench_models, format_models
from mrwork.bench.posterior import PosteriorBenchmark, bench_posterior, format_posterior
from mrwork.bench.refine import RefineBenchmark, RefineRow, bench_refine, format_refine
from mrwork.bench.search_rows import SearchRow

__all__ = [
    "KernelBenchmark",
    "KernelRow",
    "LoopBenchmark",
    "LoopRow",
    "ModelBenchmark",
    "ModelRow",
    "PosteriorBenchmark",
    "RefineBenchmark",
    "RefineRow",
    "SearchBenchmark",
    "SearchRow",
    "bench_identify",
    "bench_kernels",
    "bench_loop",
    "bench_models",
    "bench_posterior",
    "bench_refine",
    "format_identify",
    "format_loop",
    "format_models",
    "format_posterior",
    "format_refine",
    "format_table",
]
