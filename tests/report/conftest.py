"""What the tests of pages share."""

from collections.abc import Iterator

import headless_browser
import pytest


@pytest.fixture(scope="module")
def tab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[headless_browser.Browser]:
    """A page in a browser, if this machine has one."""
    program = headless_browser.executable()
    if program is None:
        pytest.skip(f"no browser or font: none of {', '.join(headless_browser.NAMES)} would start")
    with headless_browser.browser(program, tmp_path_factory.mktemp("profile")) as opened:
        yield opened
