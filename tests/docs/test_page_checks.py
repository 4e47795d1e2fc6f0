"""Blocks of pages are found and run as the guide says, and built pages are looked through."""

import re
import shlex
import sys

import pytest
from command_line import ran

import run_blocks
from check import findings
from mrwork.cli.door import parser, verbs
from run_blocks import pages


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("```python\nx = 1\n```\n\ntext\n\n```python\nassert x == 1\nassert x == 2\n```\n", '", line 9'),
        ("<!-- run -->\n```console\n$ exit 3\n```\n", "exit status 3 of: exit 3"),
    ],
)
def test_blocks_share_variables_and_an_error_names_its_line_or_command(tmp_path, text, said):
    page = tmp_path / "page.md"
    page.write_text(text)
    done = ran(sys.executable, run_blocks.__file__, "--page", page, cwd=tmp_path)
    assert done.returncode == 1
    assert said in done.stderr


@pytest.mark.parametrize(
    ("body", "finding"),
    [
        ('<a href="other.html#no">x</a>', "other.html#no leads nowhere"),
        ('<a href="none.html">x</a>', "none.html leads nowhere"),
        ('<img src="other.html" alt=" ">', "has no words"),
        ('<script src="https://example.org/x.js"></script>', "is fetched from elsewhere"),
        ('<a href="https://example.org/none">x</a> <a href="other.html#here">y</a>', ""),
    ],
)
def test_built_pages_are_looked_through(tmp_path, body, finding):
    (tmp_path / "index.html").write_text(f"<html><body>{body}</body></html>")
    (tmp_path / "other.html").write_text('<html><body><p id="here"></p></body></html>')
    found = findings(tmp_path)
    assert [each for each in found if finding and finding in each] == found
    assert bool(found) == bool(finding)


@pytest.mark.contract
def test_every_command_of_readme_and_pages_is_one_that_the_command_line_takes() -> None:
    lines = [
        match[1]
        for path in pages()
        for match in re.finditer(
            r"^(?:\$ |!)(?:\.venv/bin/)?mrwork ([^\n|>]*?)(?: 2>.*)?$",
            path.read_text(encoding="utf-8"),
            flags=re.MULTILINE,
        )
    ]
    assert len(lines) > 40
    whole = parser(verbs())
    for line in lines:
        whole.parse_args(shlex.split(line, comments=True))
