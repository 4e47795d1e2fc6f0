"""What it takes to get the same numbers again."""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version

from mrwork import _rust
from mrwork.dampers.spec import DamperSpec
from mrwork.identification.fit import Engine, Provenance
from mrwork.identification.multistart import Multistart
from mrwork.identification.nuisance import NuisanceName
from mrwork.records import DamperTest
from mrwork.search import EfficientGA
from mrwork.store import digest_of

_PACKAGES = ("mrwork", "numpy", "scipy", "jax", "optimistix")


def provenance_of(
    tests: tuple[DamperTest, ...],
    *,
    search: Multistart | EfficientGA,
    bounds: Mapping[str, tuple[float, float]],
    starts: Sequence[Mapping[str, float]],
    power: float,
    engine: Engine,
    rng: int,
) -> Provenance:
    """Versions, inputs by hash, and settings of an identification."""
    return Provenance(
        versions={"python": platform.python_version()} | {name: _version(name) for name in _PACKAGES},
        instruction_set=_rust.instruction_set(),
        inputs={test.path or test.name: test.sha256 for test in tests},
        settings={
            "search": asdict(search),
            "bounds": {name: list(pair) for name, pair in bounds.items()},
            "starts": [dict(start) for start in starts],
            "power": power,
            "engine": engine,
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
        rng=rng,
        created=datetime.now(UTC).isoformat(timespec="seconds"),
    )


def premises_of(
    spec: DamperSpec,
    tests: tuple[DamperTest, ...],
    *,
    search: Multistart | EfficientGA,
    bounds: Mapping[str, tuple[float, float]],
    nuisances: Sequence[NuisanceName],
    starts: Sequence[Mapping[str, float]],
    power: float,
    engine: Engine,
    rng: int,
) -> dict[str, object]:
    """All that the result of an identification follows from, bit for bit: what a journal and who resumes it share."""
    return {
        "model": spec.name,
        "current_laws": None if spec.current is None else asdict(spec.current),
        "seed": rng,
        "bounds": {name: list(bounds[name]) for name in sorted(bounds)},
        "nuisances": list(nuisances),
        "starts": [dict(start) for start in starts],
        "power": power,
        "engine": engine,
        "search": {"kind": type(search).__name__} | asdict(search),
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
            for test in tests
        ],
        "version": {name: _version(name) for name in _PACKAGES},
    }


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "unknown"
