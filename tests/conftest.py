"""What all tests share: the memory of a module's compiled functions and figures is given back when it ends."""

from __future__ import annotations

import sys
from collections.abc import Iterator

import pytest


@pytest.fixture(scope="module", autouse=True)
def _memory_is_given_back() -> Iterator[None]:
    yield
    if (jax := sys.modules.get("jax")) is not None:
        jax.clear_caches()
