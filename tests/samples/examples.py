"""Size of property tests: equal examples in every run, more of them where the environment asks for a long run."""

import os

from hypothesis import HealthCheck, settings

TIMES = int(os.environ.get("MRWORK_EXAMPLES", "1"))
"""Factor of the number of examples."""


def examples(count: int) -> settings:
    """Settings of a property that is tried `count` times in `make test`."""
    return settings(
        max_examples=count * TIMES, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
    )
