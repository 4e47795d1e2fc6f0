"""Asks the built pages what a user would type, and wants the page that answers it as the first hit.

The search runs in Chromium, from files, as for a reader without a network; where there is none, nothing is tried.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path
from urllib.parse import quote

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "samples"))
import headless_browser

# The pages that answer a question, any of which may come first.
ANSWERS = {
    "own damper": ("guides/own_damper", "tutorials/damper_of_your_own"),
    "cluster": ("guides/beyond_one_machine",),
    "JAX gradient": ("guides/gradients_and_jax", "tutorials/gradients_in_jax"),
    "gradient of the misfit in JAX": ("guides/gradients_and_jax",),
    "numpyro": ("guides/gradients_and_jax", "tutorials/gradients_in_jax"),
    "optax": ("guides/gradients_and_jax",),
    "jax.jit": ("guides/gradients_and_jax",),
    "drift ratio": ("guides/frame_that_yields", "guides/write_a_study"),
    "own axes": ("gallery",),
    "units of a column": ("reference/_generated/formats", "guides/record_formats"),
    "confidence interval": ("guides/parameters_and_next_test",),
    "OpenSees": ("guides/coming_from_opensees",),
    "Optuna": ("tutorials/many_candidates",),
    "choose a model": ("guides/choose_model_and_laws",),
    "number of dampers": ("guides/write_a_study",),
    "fragility of few records": ("guides/fragility",),
    "lag of the load cell": ("guides/steer_an_identification",),
    "two damper types": ("guides/write_a_study",),
}
_FIRST = "(e => e ? e.getAttribute('href') : '')(document.querySelector('ul.search li a'))"
_SUMMARY = "(document.querySelector('.search-summary') || {textContent: ''}).textContent"
_PATIENCE, _PAUSE = 20.0, 0.1


def first_hit(tab: headless_browser.Browser, page: Path, question: str) -> str:
    """Address of the first page that the search finds; empty where it finds none."""
    tab.open(page, width=1300)
    tab.call("Page.navigate", url=f"{page.as_uri()}?q={quote(question)}")
    end = time.monotonic() + _PATIENCE
    while time.monotonic() < end:
        time.sleep(_PAUSE)
        if "found" in tab.ask(_SUMMARY) and (hit := tab.ask(_FIRST)):
            return str(hit)
    return ""


def main() -> int:
    """Print the questions whose answer does not come first; the exit status is 1 where there are some."""
    root = Path(sys.argv[1]).resolve()
    chromium = headless_browser.executable()
    if chromium is None:
        print("no Chromium: the search of the pages was not tried")
        return 0
    with tempfile.TemporaryDirectory() as profile, headless_browser.browser(chromium, Path(profile)) as tab:
        hits = {question: first_hit(tab, root / "search.html", question) for question in ANSWERS}
    missed = [
        f"{question!r} finds {hits[question] or 'nothing'} first; the answer is in {' or '.join(pages)}"
        for question, pages in ANSWERS.items()
        if not hits[question].startswith(tuple(f"{page}.html" for page in pages))
    ]
    print("\n".join(missed) if missed else f"{len(ANSWERS)} questions: each finds its page first")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
