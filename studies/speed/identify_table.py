"""The benchmark of searches as aligned text."""

from __future__ import annotations

from collections.abc import Iterator

from studies.speed.identify import SearchBenchmark
from studies.speed.search_rows import SearchRow


def format_identify(benchmark: SearchBenchmark) -> str:
    """Return the benchmark as aligned text: medians over the attempts that came near, their share, the aims."""
    return "\n".join(_lines(benchmark))


def _lines(benchmark: SearchBenchmark) -> Iterator[str]:
    if not benchmark.setups:
        yield "interrupted before anything was measured"
        return
    setup = benchmark.setups[0]
    kind = "SYNTHETIC, the measured record is not here" if setup.synthetic else "measured"
    yield (
        f"searches of non_symmetric_bouc_wen on {setup.test} ({kind}), {setup.n_time} samples, {len(setup.free)} free "
        "parameters:"
    )
    yield f"simulations and seconds to within 0.2 points of the best known fit, {setup.best_known_percent:.2f} %"
    yield f"(multistart of least squares, {setup.known_simulations} simulations, in the same box)"
    yield ""
    yield (
        f"{'method':<29} {'objective':<19} {'threads':>7} {'simulations':>11} {'seconds':>9} {'success':>8} "
        f"{'seeds':>6} {'s/success':>9} {'gap, points':>11}"
    )
    for row in benchmark.rows:
        yield _line(row)
    yield ""
    yield "Medians over the attempts that came near; s/success counts what failures spent. Compiling and loading are"
    yield "not counted; of seeds run at once each has its share. ~ extrapolated. identify is its whole run, and may"
    yield "leave the box: its gap can be negative. A simulation with its derivatives counts as one, as in the local"
    yield "minimisations of identify and multistart; for the difference quotients of SciPy each column counts."
    yield ""
    for abort in benchmark.early_abort:
        same = "the same to the last bit" if abort.identical else "NOT THE SAME RESULT"
        yield (
            f"early abort, {abort.method}, {abort.threads} thread(s), {abort.generations} generations: "
            f"{abort.steps_share_done:.0%} of the steps, {abort.seconds_ratio:.0%} of the time, {same}"
        )
    for test in benchmark.tests:
        yield (
            f"identify on {test.test}: {test.success:.0%} of {test.n_seeds} seeds near "
            f"{test.best_known_percent:.2f} %, {test.evaluations:.0f} simulations, {test.seconds:.2f} s"
        )
    yield ""
    for bar in benchmark.bars:
        measured = "never near" if bar.measured is None else f"{bar.measured:.3g}"
        met = "met" if bar.met else "NOT MET"
        yield f"{met:<8} {bar.claim}, {bar.threads} thread(s): {measured}, aim {bar.aim:g}"
    yield ""
    for each in dict.fromkeys((row.method, row.settings) for row in benchmark.rows):
        yield f"{each[0]}: {each[1]}"
    for setup in benchmark.setups:
        if setup.numba_variant:
            yield f"fastest numba, {setup.threads} thread(s): {setup.numba_variant}"
    first = ", ".join(f"{name} {seconds:.1f}" for name, seconds in setup.first_call_seconds.items())
    yield f"first calls, with loading and compiling [s]: {first}"
    if setup.missing:
        yield f"not installed: {', '.join(setup.missing)}; to compare, run: pip install 'mrwork[bench]'"
    if benchmark.interrupted:
        yield "interrupted: the rows hold the attempts made until then"


def _line(row: SearchRow) -> str:
    mark = "~" if row.extrapolated else ""
    evaluations = "-" if row.evaluations is None else f"{row.evaluations:.0f}"
    seconds = "-" if row.seconds is None else f"{mark}{row.seconds:.3g}"
    expected = "-" if row.expected_seconds is None else f"{row.expected_seconds:.3g}"
    return (
        f"{row.method:<29} {row.objective:<19} {row.threads:>7} {evaluations:>11} {seconds:>9} {row.success:>8.0%} "
        f"{row.n_seeds:>6} {expected:>9} {row.gap_points:>11.2f}"
    )
