"""The examples in docstrings of public names do what they say."""

import doctest
from pathlib import Path

import matplotlib.pyplot as plt
import pytest
from test_wrong_arguments import NAMESPACES, methods, named

from mrwork.base.summary import Summarised

FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


@pytest.mark.long
def test_examples_give_what_they_show(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    finder, runner, told = doctest.DocTestFinder(recurse=False), doctest.DocTestRunner(optionflags=FLAGS), []
    for name, found in named((*NAMESPACES, "mrwork.plots", "mrwork.jax")):
        within = methods(found) if isinstance(found, type) else ()
        for own, target in ((name, found), *((f"{name}.{own}", method) for own, method in within)):
            for examples in finder.find(target, own):
                runner.run(examples, out=told.append, clear_globs=False)
                results = [each for each in examples.globs.values() if isinstance(each, Summarised)]
                # What a result says of itself, in a terminal and in a notebook.
                assert all(repr(each) and each._repr_html_().startswith("<div") for each in results)
    plt.close("all")
    assert runner.summarize(verbose=False).failed == 0, "".join(told)
    assert runner.tries > 100
