"""What it takes to get the same numbers again: the provenance of a fit, and the fingerprint of its inputs."""

from __future__ import annotations

import platform
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version

from mrwork import _rust
from mrwork.identification.fit import Provenance
from mrwork.identification.problem import Problem
from mrwork.store import digest_of

_PACKAGES = ("mrwork", "numpy", "scipy", "jax", "optimistix")
# Settings that a fit has as fields of their own.
_APART = ("nuisances", "rng")


def provenance_of(problem: Problem) -> Provenance:
    """Versions, inputs by hash, and settings of an identification."""
    tests = problem.objective.tests
    record = problem.settings.as_record()
    return Provenance(
        versions={"python": platform.python_version()} | {name: _version(name) for name in _PACKAGES},
        instruction_set=_rust.instruction_set(),
        inputs={test.path or test.name: test.sha256 for test in tests},
        settings={name: value for name, value in record.items() if name not in _APART}
        | {
            "windows": {
                test.path or test.name: {
                    "start": test.start_time,
                    "dt": test.dt,
                    "n_time": test.n_time,
                    "n_settle": test.n_settle,
                }
                for test in tests
            },
        },
        rng=problem.settings.rng,
        created=datetime.now(UTC).isoformat(timespec="seconds"),
    )


def fingerprint_of(problem: Problem) -> dict[str, object]:
    """All that the result follows from, bit for bit: a journal has it, and a run that resumes must have the same."""
    settings = problem.settings.as_record()
    return {
        "model": problem.spec.name,
        "current_laws": None if problem.spec.current is None else asdict(problem.spec.current),
        "seed": settings.pop("rng"),
        # The order in which bounds are given decides nothing.
        "bounds": dict(sorted(settings.pop("bounds").items())),
        **settings,
        "test": [
            {
                "name": test.name,
                "sha256": test.sha256,
                "samples": test.n_time,
                "settle_samples": test.n_settle,
                "current": test.current,
                "voltage": test.voltage,
                "observation": test.observation.in_words,
                # Windows, repairs and units of columns all show here.
                "signals": digest_of(test.dt, test.displacement, test.velocity, test.force, test.observation),
            }
            for test in problem.objective.tests
        ],
        "version": {name: _version(name) for name in _PACKAGES},
    }


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "unknown"
