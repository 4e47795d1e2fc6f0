"""`own_damper`: what it refuses, and the value that it makes."""

from __future__ import annotations

import math
import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import own_dampers
import pytest
from sentences import Refused

import mrwork as mr
from mrwork.base.values import Floats
from mrwork.errors import SettingError
from mrwork.store.user_python import run_text
from test_imports import in_fresh_process

C = {"c": ("N s/m", 1, 100.0, 1000)}
GAIN = 2.0
SHORT = np.float32(0.1)
TABLE = np.array([1.0, 2.0])


class Helper:
    """No text states an instance."""

    gain = 2.0


HELPER = Helper()


def force(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    return p.c * velocity


def leans(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    return GAIN * p.c * velocity * TABLE[1]


def branches(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    if velocity > 0.0:
        return p.c * velocity
    return 0.5 * p.c * velocity


def mathematics(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    return p.c * math.tanh(velocity)


def numpys(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    return p.c * np.tanh(np.asarray(velocity))


def misnamed(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    return p.k * velocity


def listed(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    return [p.c * velocity]


def shaped(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    return jnp.stack([p.c * velocity, p.c])


def short(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    return p.c * velocity.astype(jnp.float32)


def rooted(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    return p.c * velocity / jnp.abs(velocity)


def powered(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    return jnp.sqrt(p.c * jnp.abs(velocity))


def helped(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    return HELPER.gain * p.c * velocity


def fades(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    return jnp.stack([velocity - p.c * state[0]])


def strays(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    return velocity - p.c * state[0]


def test_mistakes_are_refused_with_their_line(refused: Refused) -> None:
    for wrong in (
        branches, mathematics, numpys, misnamed, listed, shaped, short, rooted, powered, helped,
        lambda p, state, displacement, velocity: p.c * velocity,
    ):  # fmt: skip
        refused(mr.own_damper, "mine", parameters=C, force=wrong)
    two = {**C, "k": ("N/m", 1.0, 100.0, 1000.0)}
    refused(mr.own_damper, "mine", parameters=two, force=force)
    refused(mr.own_damper, "mine", parameters=C, force=force, rate=strays, states=1)
    for stated in ({"rate": fades}, {"states": 1}, {"relaxation": fades}):
        refused(mr.own_damper, "mine", parameters=C, force=force, **stated)
    refused(mr.own_damper, "mine", parameters=C, force=force, spring=("k", "x0"))
    refused(mr.own_damper, "mine", parameters=C, force=force, rate=force, states=1)


def test_names_and_ranges_are_refused(refused: Refused) -> None:
    for name in ("bouc_wen", "my damper", "for", ""):
        refused(mr.own_damper, name, parameters=C, force=force)
    for given in (
        {},
        {"eta": C["c"]},
        {"c.0": C["c"]},
        {"c": ("N s/m", 1000.0, 100.0, 1.0)},
        {"c": ("N s/m", 1.0, 100.0, math.inf)},
        {"c": ("N s/m", 100.0, 100.0, 100.0)},
        {"c": ("N s/m", 1.0, 100.0)},
    ):
        refused(mr.own_damper, "mine", parameters=given, force=force)


def test_it_is_a_value() -> None:
    first, again = (mr.own_damper("mine", parameters=C, force=leans) for _ in range(2))
    assert first == again
    assert hash(first) == hash(again)
    assert pickle.loads(pickle.dumps(first)) == first
    assert first.own is not None
    # What it uses is carried along.
    for line in ("import jax.numpy", "GAIN = 2.0", "TABLE = numpy.array([1.0, 2.0]"):
        assert line in first.own.source or line.startswith("import")
    assert first != mr.own_damper("mine", parameters=C, force=force)
    assert first.odd
    assert not own_dampers.guo.odd
    assert [each.scale for each in own_dampers.guo.parameters if each.name == "f0"] == ["offset"]
    laws = own_dampers.loop.with_current_laws({"k_w": "quadratic"}, lagged=True)
    assert laws.without_laws == own_dampers.loop


def test_a_text_that_is_not_trusted_does_not_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refused: Refused
) -> None:
    monkeypatch.chdir(tmp_path)
    spec = mr.own_damper("mine", parameters=C, force=force)
    assert spec.own is not None
    forged = replace(spec.own, source=f"import os\nos.mkdir('harm')\n{spec.own.source}")
    stranger = replace(spec, own=forged)
    refused(mr.simulate_force, stranger, [100.0], mr.Loading(dt=0.001, displacement=np.sin(np.arange(5.0))))
    assert not list(tmp_path.iterdir())
    # Nor where a pickle of it has come from a process that does not trust it.
    assert pickle.loads(pickle.dumps(forged)).is_trusted is False
    with pytest.raises(SettingError):
        pickle.loads(pickle.dumps(forged)).functions()


def test_trust_travels_with_a_pickle(tmp_path: Path) -> None:
    spec = mr.own_damper("mine", parameters=C, force=leans)
    place = tmp_path / "spec"
    place.write_bytes(pickle.dumps(spec))
    code = (
        "import pickle, sys; from pathlib import Path; import mrwork as mr; import numpy as np\n"
        "spec = pickle.loads(Path(sys.argv[1]).read_bytes())\n"
        "force = mr.simulate_force(spec, [100.0], mr.Loading(dt=0.001, displacement=np.sin(np.arange(5.0))))\n"
        "print(float(np.abs(force).max()) > 0.0)"
    )
    assert in_fresh_process(code, place).strip() == "True"


def test_a_prompt_has_no_text(refused: Refused) -> None:
    names: dict[str, Any] = {}
    exec("def typed(p, state, displacement, velocity):\n    return p.c * velocity", names)
    refused(mr.own_damper, "mine", parameters=C, force=names["typed"])


def test_numbers_of_less_precision_are_refused_where_they_enter(refused: Refused) -> None:
    def scaled(p: Any, state: Any, displacement: Any, velocity: Any) -> Floats:
        return p.c * velocity * SHORT

    refused(mr.own_damper, "mine", parameters=C, force=scaled)


CALLS = [0.0]


def counts(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    CALLS[0] += 1.0
    return p.c * velocity * CALLS[0]


def tells(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    jax.debug.print("{}", velocity)
    return p.c * velocity


def test_equations_change_and_print_nothing(refused: Refused) -> None:
    for wrong in (counts, tells):
        refused(mr.own_damper, "mine", parameters=C, force=wrong)


def second(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    return p.c * velocity + state[1]


def exchanged(p: Any, state: Any, velocity: Any, displacement: Any) -> Any:
    return p.c * velocity


def short_of_arguments(p: Any, velocity: Any) -> Any:
    return p.c * velocity


def pushes(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    return -p.c * velocity


def judges(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    return p.c * velocity > 0.0


def keyed(p: Any, state: Any, displacement: Any, velocity: Any) -> Any:
    return p["c"] * velocity


def sinks(p: Any, displacement: Any, velocity: Any) -> Any:
    return p.c - 1e9 * velocity


def test_what_would_be_silently_wrong_is_refused(refused: Refused) -> None:
    loop: dict[str, Any] = {"rate": fades, "states": 1}
    refused(mr.own_damper, "mine", parameters=C, force=second, **loop)
    refused(mr.own_damper, "mine", parameters=C, force=force, **loop, relaxation=sinks)
    for wrong in (exchanged, short_of_arguments, pushes, judges, keyed):
        refused(mr.own_damper, "mine", parameters=C, force=wrong)
    for unit in ("kN s/m", "mm", "lbf"):
        refused(mr.own_damper, "mine", parameters={"c": (unit, 1, 100, 1000)}, force=force)
    refused(mr.own_damper, "mine", parameters={"_c": C["c"]}, force=force)
    for unit in ("N s2/m2", "N (s/m)^0.3", "m^-n", "1/s", "", "-"):
        assert mr.own_damper("mine", parameters={"c": (unit, 1, 100, 1000)}, force=force).parameters[0].unit


def test_a_file_that_was_changed_after_it_was_run_is_refused(tmp_path: Path, refused: Refused) -> None:
    place = tmp_path / "mine.py"
    text = "def force(p, state, displacement, velocity):\n    return p.c * velocity\n"
    place.write_text(text)
    module = run_text(text, str(place))
    place.write_text(text.replace("p.c", "7.0 * p.c"))
    refused(mr.own_damper, "mine", parameters=C, force=module.force)
