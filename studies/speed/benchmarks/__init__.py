"""Speed of the compiled kernels and of the searches on them, beside what other libraries make of the same."""

from __future__ import annotations

from benchmarks.identify import SearchBenchmark, bench_identify
from benchmarks.identify_table import format_identify
from benchmarks.kernels import KernelBenchmark, KernelRow, bench_kernels, format_table
from benchmarks.loop import LoopBenchmark, LoopRow, bench_loop, format_loop
from benchmarks.models import ModelBenchmark, ModelRow, bench_models, format_models
from benchmarks.posterior import PosteriorBenchmark, bench_posterior, format_posterior
from benchmarks.refine import RefineBenchmark, RefineRow, bench_refine, format_refine
from benchmarks.regulators import RegulatorBenchmark, bench_regulators, format_regulators
from benchmarks.search_rows import SearchRow

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
    "RegulatorBenchmark",
    "SearchBenchmark",
    "SearchRow",
    "bench_identify",
    "bench_kernels",
    "bench_loop",
    "bench_models",
    "bench_posterior",
    "bench_refine",
    "bench_regulators",
    "format_identify",
    "format_loop",
    "format_models",
    "format_posterior",
    "format_refine",
    "format_regulators",
    "format_table",
]
