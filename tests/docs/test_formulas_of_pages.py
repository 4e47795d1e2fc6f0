"""Laws and dampers of a user that stand in guides and tutorials: recorded, they have the numbers of their Python."""

import ast
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from loop_samples import devices, five_storeys, rd1005, sweep

import mrwork as mr
from mrwork import _rust

DOCS = Path(__file__).parents[2] / "docs"
BLOCK = re.compile(r"^```(?:python|\{code-cell\} python)\n(?P<text>.*?)^```$", flags=re.MULTILINE | re.DOTALL)
OPTIONS = re.compile(r"\A(?:---\n.*?^---\n|(?::.*\n)+)", flags=re.MULTILINE | re.DOTALL)  # of a cell
MAKERS = {"own_law", "own_damper", "UserLaw"}


def statements_of(path: Path) -> list[ast.stmt]:
    """What the blocks of a page do at the top, at the lines of the page."""
    page, found = path.read_text(encoding="utf-8"), []
    for match in BLOCK.finditer(page):
        text = OPTIONS.sub(lambda options: "\n" * options[0].count("\n"), match["text"])
        text = re.sub(r"^[!%]", "# ", text, flags=re.MULTILINE)  # commands of a notebook
        found += ast.parse("\n" * page.count("\n", 0, match.start("text")) + text).body
    return found


def makes(statement: ast.stmt) -> bool:
    calls = (each.func for each in ast.walk(statement) if isinstance(each, ast.Call))
    return any(isinstance(each, ast.Attribute) and each.attr in MAKERS for each in calls)


def bound(statement: ast.stmt) -> set[str]:
    """Names that a statement gives a value, or a part of one."""
    if isinstance(statement, ast.FunctionDef):
        return {statement.name}
    targets = statement.targets if isinstance(statement, ast.Assign) else []
    return {each.id for target in targets for each in ast.walk(target) if isinstance(each, ast.Name)}


def needed(statements: list[ast.stmt]) -> list[ast.stmt]:
    """Those that make a law or a damper, with those before them whose names they use."""
    kept, names = [], set[str]()
    for statement in reversed(statements):
        taken = isinstance(statement, ast.Assign) and makes(statement)
        if taken or isinstance(statement, ast.Import) or bound(statement) & names:
            kept.append(statement)
            names |= {each.id for each in ast.walk(statement) if isinstance(each, ast.Name)}
    return kept[::-1]


FILES = sorted([*DOCS.glob("*.md"), *DOCS.glob("guides/*.md"), *DOCS.glob("tutorials/*.md")])
PAGES = {path.stem: kept for path in FILES if (kept := needed(statements_of(path))) and any(map(makes, kept))}


def made_by(page: str, monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, tuple[Any, ...], dict[str, Any]]]:
    """Calls that make a law or a damper, with their arguments."""
    calls: list[tuple[str, tuple[Any, ...], dict[str, Any]]] = []

    def noted(maker: str, function: Callable[..., Any]) -> Callable[..., Any]:
        return lambda *args, **named: calls.append((maker, args, named)) or function(*args, **named)

    for place, maker in ((mr, "own_law"), (mr, "own_damper"), (mr.closed_loop, "UserLaw")):
        monkeypatch.setattr(place, maker, noted(maker, getattr(place, maker)))
    exec(compile(ast.Module(PAGES[page], []), page, "exec"), {"__name__": page})
    monkeypatch.undo()
    return calls


def assert_a_law_is_its_python(law: Callable[..., Any]) -> None:
    loop, motion = devices(rd1005())[:1], [sweep(0.4, peak=4.0)]
    found, python = (
        mr.simulate_loop(
            five_storeys(), loop, law(record=record), motion, mr.Hardware(), histories=True
        ).histories[0]
        for record in (True, False)
    )
    assert np.ptp(python.command) > 0.0
    for signal in ("command", "force", "drift"):
        mine, its = getattr(found, signal), getattr(python, signal)
        np.testing.assert_allclose(mine, its, rtol=0.0, atol=1e-12 * np.abs(its).max())


def assert_a_damper_is_its_python(spec: mr.DamperSpec, given: dict[str, Any]) -> None:
    rng = np.random.default_rng(6)
    theta = np.array(spec.nominal)
    p = SimpleNamespace(**dict(zip(spec.names, theta, strict=True)))
    for x, v, *state in rng.uniform(-1.0, 1.0, (50, 2 + spec.n_states)) * np.array(
        [0.02, 0.3] + [0.9] * spec.n_states
    ):
        at = np.array(state)
        mine = _rust.force(spec.core_name, theta, at, x, v)
        np.testing.assert_allclose(mine, given["force"](p, at, x, v), rtol=1e-12)
        if spec.n_states:
            rate = _rust.rate(spec.core_name, theta, at, x, v)
            np.testing.assert_allclose(rate, given["rate"](p, at, x, v), rtol=1e-12)


@pytest.mark.parametrize("page", PAGES)
def test_a_formula_of_a_page_has_the_numbers_of_its_python(
    page: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for maker, args, named in made_by(page, monkeypatch):
        if maker == "own_damper":
            assert_a_damper_is_its_python(mr.own_damper(*args, **named), named)
        else:
            function = getattr(mr, maker, None) or getattr(mr.closed_loop, maker)
            assert_a_law_is_its_python(partial(function, *args, **named))


def test_the_pages_on_formulas_are_among_them() -> None:
    assert {"own_law", "own_damper", "damper_of_your_own", "gradients_and_jax"} <= PAGES.keys()
