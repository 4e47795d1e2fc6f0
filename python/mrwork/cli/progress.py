"""One line of progress on stderr."""

from __future__ import annotations

import sys

from mrwork.identification.identify import Progress

_EVERY = 0.2


class ProgressLine:
    """Rewrites one line on a terminal; elsewhere writes nothing, so that logs stay readable."""

    def __init__(self, *, quiet: bool) -> None:
        self._active = not quiet and sys.stderr.isatty()
        self._last = -_EVERY
        self._stage = ""
        self._began = 0.0
        self._width = 0

    def __call__(self, progress: Progress) -> None:
        """Show where the identification stands."""
        if not self._active:
            return
        if progress.stage != self._stage:
            self._stage, self._began = progress.stage, progress.seconds
        if progress.seconds - self._last < _EVERY:
            return
        self._last = progress.seconds
        running = max(progress.seconds - self._began, 1e-9)
        text = (
            f"{progress.stage}: {progress.count} {progress.unit}, {progress.count / running:,.0f}/s, "
            f"best fit {progress.fit_percent:.2f} %, {progress.seconds:.0f} s"
        )
        if progress.share > 0.0:
            text += f", at most {running * (1.0 / progress.share - 1.0):.0f} s of this stage left"
        self._write(text)

    def close(self) -> None:
        """Clear the line."""
        if self._active:
            self._write("")
            print("\r", end="", file=sys.stderr, flush=True)

    def _write(self, text: str) -> None:
        print("\r" + text.ljust(self._width), end="", file=sys.stderr, flush=True)
        self._width = len(text)
