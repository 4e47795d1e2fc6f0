"""What it takes to get the same numbers again."""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version

from mrwork import _rust
from mrwork.identification.fit import Provenance
from mrwork.identification.multistart import Multistart
from mrwork.records import DamperTest
from mrwork.search import EfficientGA

_PACKAGES = ("mrwork", "numpy", "scipy", "jax", "optimistix")


def provenance_of(
    tests: tuple[DamperTest, ...],
    *,
    search: Multistart | EfficientGA,
    bounds: Mapping[str, tuple[float, float]],
    starts: Sequence[Mapping[str, float]],
    power: float,
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


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "unknown"
