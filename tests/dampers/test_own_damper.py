"""`own_damper`: what it refuses, and the value that it makes."""

import math
import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import own_dampers
import pytest
from refusals import refusal

import mrwork as mr
from mrwork.store.user_python import run_text
from test_imports import in_fresh_process

C = {"c": ("N s/m", 1, 100.0, 1000)}
GAIN = 2.0
TABLE = np.array([1.0, 2.0])


def force(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    return p.c * velocity


def leans(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    return GAIN * p.c * velocity * TABLE[1]


def second(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    return p.c * velocity + state[1]


def fades(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    return np.stack([velocity - p.c * state[0]])


def strays(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    return velocity - p.c * state[0]


def sinks(p: Any, displacement: Any, velocity: Any) -> Any:
    return p.c - 1e9 * velocity


LOOP: dict[str, Any] = {"rate": fades, "states": 1}
EQUATION = """
import jax, jax.numpy as jnp, math, numpy as np
class Helper: gain = 2.0
HELPER = Helper()
SEEN = []
def force(p, state, {arguments}):
    {lines}
"""


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (
            "return p.c * velocity if velocity > 0.0 else 0.0",
            r"mine.py, line \d+: `if`, .* np.where\(condition",
        ),
        ("return p.c * math.tanh(velocity)", "line 7: float.., a function of math"),
        ("return p.c * np.sinh(velocity)", "np.sinh is none of the operations of the core"),
        ("return p.c * jax.nn.relu(velocity)", "cannot be recorded at .*mine.py, line 7"),
        ("return p.k * velocity", "p has no k; it has c"),
        ("return p['c'] * velocity", r"p\.NAME, not p\["),
        ("return jnp.stack([p.c * velocity, p.c])", r"shape \(2,\)"),
        ("p.c * velocity", "returns a NoneType"),
        ("return p.c * velocity > 0.0", "returns a condition"),
        ("return p.c * velocity / jnp.abs(velocity)", "not a finite number at rest"),
        ("return jnp.sqrt(p.c * jnp.abs(velocity))", "derivative by c"),
        ("return p.c * velocity * np.random.default_rng().uniform(1.0, 2.0)", "another one each time"),
        ("return -p.c * velocity", "turn its sign"),
        ("SEEN.append(velocity); return p.c * velocity", "line 7: it calls SEEN.append .* would happen once"),
        ("return sum(p.c * velocity * k for k in range(30_000))", "operations, of which"),
    ],
)
def test_a_mistake_in_an_equation_is_told(lines: str, words: str, tmp_path: Path) -> None:
    wrong = written(tmp_path / "mine.py", lines)
    refusal(mr.own_damper, "mine", parameters=C, force=wrong, match=words)


def written(place: Path, lines: str, arguments: str = "displacement, velocity") -> Callable[..., Any]:
    """A force in a file."""
    text = EQUATION.replace("{arguments}", arguments).replace("{lines}", lines)
    place.write_text(text)
    made: Callable[..., Any] = run_text(text, str(place)).force
    return made


def test_exchanged_arguments_are_told(tmp_path: Path) -> None:
    exchanged = written(tmp_path / "mine.py", "return p.c * velocity", "velocity, displacement")
    refusal(mr.own_damper, "mine", parameters=C, force=exchanged, match="exchange them")


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"force": second, **LOOP}, "index 1 is out of bounds"),
        ({**LOOP, "relaxation": sinks}, "relaxation of mine .* is negative"),
        ({"rate": strays, "states": 1}, r"return shape \(1,\)"),
        ({"rate": fades}, "`states` of mine is 0"),
        ({"relaxation": fades}, "no states, and a relaxation"),
        ({"spring": ("k", "x0")}, "no parameter 'k'"),
        ({"rate": force, "states": 9}, "at most 8"),
        ({"name": "bouc_wen"}, "a model of the package"),
        ({"name": "my damper"}, "letters, digits"),
        ({"parameters": {}}, "no parameters"),
        ({"parameters": {**C, "k": ("N/m", 1.0, 100.0, 1000.0)}}, "nothing in mine uses k"),
        ({"parameters": {"eta": C["c"]}}, "none of eta"),
        ({"parameters": {"c": ("N s/m", 1000.0, 100.0, 1.0)}}, "in this order"),
        ({"parameters": {"c": ("N s/m", 100.0, 100.0, 100.0)}}, "equal bounds"),
        ({"parameters": {"c": ("kN s/m", 1, 100, 1000)}}, "numbers are in SI"),
    ],
)
def test_a_wrong_declaration_is_told(given: dict[str, Any], words: str) -> None:
    refusal(mr.own_damper, **{"name": "mine", "parameters": C, "force": force, **given}, match=words)


def test_units_of_products_are_taken() -> None:
    for unit in ("N (s/m)^0.3", "m^-n", ""):
        assert mr.own_damper("mine", parameters={"c": (unit, 1, 100, 1000)}, force=force).parameters[0].unit


def test_it_is_a_value() -> None:
    first, again = (mr.own_damper("mine", parameters=C, force=leans) for _ in range(2))
    assert first == again
    assert hash(first) == hash(again)
    assert pickle.loads(pickle.dumps(first)) == first
    # What it uses is carried along.
    for line in ("GAIN = 2.0", "TABLE = numpy.array([1.0, 2.0]"):
        assert line in first.own.source
    assert first != mr.own_damper("mine", parameters=C, force=force)
    assert [each.scale for each in own_dampers.guo.parameters if each.name == "f0"] == ["offset"]
    laws = own_dampers.loop.with_current_laws({"k_w": "quadratic"}, lag="one_rate")
    assert laws.without_laws == own_dampers.loop


def test_what_is_no_text_for_readers_is_recorded_all_the_same(tmp_path: Path) -> None:
    """A lambda, what an object holds, and a file that was edited after its import."""
    typed = eval("lambda p, state, displacement, velocity: p.c * velocity")
    assert mr.own_damper("mine", parameters=C, force=typed).own.source == ""
    held = written(tmp_path / "held.py", "return HELPER.gain * p.c * velocity")
    assert mr.own_damper("mine", parameters=C, force=held).own.source == ""
    place = tmp_path / "mine.py"
    made = written(place, "return p.c * velocity")
    place.write_text(place.read_text().replace("p.c", "7.0 * p.c"))
    mine = mr.own_damper("mine", parameters=C, force=made)
    assert mine.own.source == ""
    assert mr.simulate_force(mine, [100.0], LOADING)[0] == pytest.approx(
        100.0 * LOADING.history().parts[0][0, 4]
    )


LOADING = mr.Loading(dt=0.001, displacement=np.sin(np.arange(5.0)))


def test_text_of_jax_is_recorded_with_numpy(tmp_path: Path) -> None:
    made = written(tmp_path / "mine.py", "return p.c * jnp.tanh(velocity)")
    assert (
        mr.own_damper("mine", parameters=C, force=made).own
        == mr.own_damper(
            "mine", parameters=C, force=lambda p, state, displacement, velocity: p.c * np.tanh(velocity)
        ).own
    )


def test_another_process_needs_neither_its_file_nor_jax(tmp_path: Path) -> None:
    spec = mr.own_damper("mine", parameters=C, force=leans)
    place = tmp_path / "spec"
    place.write_bytes(pickle.dumps(spec))
    code = (
        "import pickle, sys; from pathlib import Path; import mrwork as mr; import numpy as np\n"
        "sys.modules['jax'] = None\n"
        "spec = pickle.loads(Path(sys.argv[1]).read_bytes())\n"
        "force = mr.simulate_force(spec, [100.0], mr.Loading(dt=0.001, displacement=np.sin(np.arange(5.0))))\n"
        "print(float(np.abs(force).max()) > 0.0)"
    )
    assert in_fresh_process(code, place).strip() == "True"


def test_a_damaged_tape_is_refused() -> None:
    spec = mr.own_damper("mine", parameters=C, force=force)
    tape = spec.own.force
    newer = replace(tape, entries=(("sine", 5, (0,)), *tape.entries))
    beyond = replace(tape, entries=(("add", 9, (0, 1)), *tape.entries))
    for damaged, words in ((newer, "a newer version may have it"), (beyond, "is damaged|are damaged")):
        wrong = replace(spec, own=replace(spec.own, force=damaged))
        refusal(mr.simulate_force, wrong, [100.0], LOADING, match=words)


def test_parameters_are_declared_by_four_values_that_are_finite() -> None:
    for given in (("N s/m", 1.0, 100.0, math.inf), ("N s/m", 1.0, 100.0)):
        error = refusal(mr.own_damper, "mine", parameters={"c": given}, force=force, match=r"'c'\]")
        assert error.key == "parameters"
