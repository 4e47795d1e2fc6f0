"""A controller as C: its law printed by the core, in a frame with observer, limits of readings and queue."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from mrwork import _rust
from mrwork.base.numbers import of_unit
from mrwork.base.values import Floats
from mrwork.closed_loop.loop_sample import READINGS
from mrwork.closed_loop.printed_loop import PrintedLoop
from mrwork.control.laws.control_law import ControlLaw
from mrwork.embedded.c_source import CSource, Flavour, Signal, head_of, status_of, table_rows, within_comment

_SAMPLES = 1000
# Readings that a controller may have: unit, size in the check, largest that is believed, and words.
_SIGNALS: dict[str, tuple[str, float, float, str]] = {
    "displacement": ("m", 0.01, 1e3, "of coordinate {0}"),
    "velocity": ("m/s", 0.1, 1e3, "of coordinate {0}"),
    "acceleration": ("m/s^2", 3.0, 1e3, "absolute, of {floor}"),
    "ground_acceleration": ("m/s^2", 3.0, 1e3, "of the ground"),
    "ground_velocity": ("m/s", 0.1, 1e2, "of the ground"),
    "drift": ("m", 0.01, 1e2, "of {storey}"),
    "deformation": ("m", 0.01, 1e2, "of {device}, positive as it lengthens"),
    "force": ("N", 2e3, 1e9, "with which {device} resists"),
}


_OF_STATE = (
    'It reads displacements and velocities of the building, which no sensor gives; with feedback = "observer" of the '
    "hardware it estimates them."
)
_ABSOLUTE = (
    "It was designed for a road: the velocities that it {0} are absolute, those of the floors themselves and not over "
    "the road."
)
_OF_GROUND = "It reads the velocity of the ground, as of a road under a tyre, which no sensor gives."


def controller_source(
    name: str,
    loop: PrintedLoop,
    law: ControlLaw,
    places: dict[str, Sequence[str]],
    flavour: Flavour,
    *,
    unit: str,
    origin: Sequence[str] = (),
    example: bool = False,
) -> CSource:
    """The C of the controller of a loop: NAME.h, NAME.c, NAME_check.c with a test, and NAME_process.c for a loop.

    `places` are the names of floors, measured storeys and devices, `unit` is of the commands, and `origin` are
    sentences on where the gains are from. An `example` is a program around it to copy, with a Makefile.
    """
    text = _rust.law_text(loop, flavour.single)
    given = dict(_rust.law_readings(loop))
    observer = loop.matrices
    used = {signal for signal, _ in text["reads"]}
    if observer is not None:
        used |= {"acceleration", "deformation", "force", "drift"} | (
            {"ground_acceleration"} if np.any(observer.Ed) or np.any(observer.G) else set()
        )
    read = {signal: count for signal, count in given.items() if signal in used}
    inputs = tuple(_inputs(read, places))
    rollout = text["rollout"]
    gains = tuple(_gains(law, without=rollout and rollout["fixed"]))
    n_all, kept = given["force"], text["kept"]
    sample_time = loop.hardware.sample_time
    head = [
        *law.spec.equation.split("\n"),
        "",
        *origin,
        f"Source of the law: {law.spec.source}",
        *law.shaping_notes,
        "A force is that with which a device resists, and is positive while it lengthens. The law was "
        f"designed for samples {of_unit(sample_time, 's')} apart.",
        "No watchdog is here: stop calling, and the last command stays. Send zero where samples do not come.",
    ]
    of_state = {"displacement", "velocity"} & read.keys()
    notes = (
        *([_OF_STATE] if of_state else []),
        *([_ABSOLUTE.format("reads" if of_state else "estimates")] if loop.is_absolute else []),
        *([_OF_GROUND] if "ground_velocity" in read else []),
        *([_decision(rollout["counts"])] if rollout else []),
    )
    head[2:2] = notes
    real = flavour.real
    words = {
        "name": name,
        "macro": name.upper(),
        "title": f"Controller: {law.spec.title}, in SI",
        "unit": unit,
        "head": head_of(name, head),
        "n_devices": loop.n_commanded,
        "n_all": n_all,
        "n_estimated": 1 if observer is None else len(observer.Ad),
        "n_kept": max(len(kept), 1),
        "kept": ", ".join(map(flavour.number, kept or [0.0])),
        "sample_time": flavour.number(sample_time),
        "gains": "\n".join(_fields(gains, real)) or f"    {real} none;",
        "values": ",\n".join(_initial(gains, flavour)) or f"    {flavour.number(0.0)}",
        "readings": "\n".join(_fields(inputs, real)) or f"    {real} none;",
        "limit_fields": "\n".join(f"    {real} {signal};  /* [{_SIGNALS[signal][0]}] */" for signal in read)
        or f"    {real} none;",
        "limits": ", ".join(flavour.number(_SIGNALS[signal][2]) for signal in read) or flavour.number(0.0),
        "believed": "".join(_believed(name, read)),
        "n_ages": max(sum(read.values()), 1),
        "status": status_of(
            name.upper(), [*read], "rate_limited", "state_healed", "sample_missed", "parameters_refused"
        ),
        "bridged": "the observer go on" if rollout else "law and observer go on",
        "bridge": "".join(
            [
                "" if rollout else "    send(m, gains, &m->before);\n",
                "" if observer is None else "    estimate(m, &m->before);\n",
            ]
        ),
        "furthest": flavour.number(text["furthest"]),
        "command": text["command"],
        "tables": "\n".join(
            f"static const {real} table_{number}[{len(table)}] = {{{', '.join(map(flavour.number, table))}}};"
            for number, table in enumerate(text["tables"])
        ),
        **dict.fromkeys(
            ("observer", "estimate", "rollout", "plan", "plan_types", "plan_is_sound", "plan_anew"), ""
        ),
        **flavour.preamble(calls=text["calls"]),
    }
    if observer is not None:
        words["observer"] = _observer(name, loop, n_all, given.get("drift", 0), flavour)
        words["estimate"] = "    estimate(m, &m->before);\n"
    if rollout:
        words |= _rollout(rollout, name, loop, n_all, flavour)
        words["command"] = f"    plan(m, gains, in);\n{text['command']}"
    return CSource(
        name=name,
        kind="controller",
        description=f"{law.spec.title} controller",
        files={
            f"{name}.h": flavour.fill("controller.h", **words),
            f"{name}.c": flavour.fill("controller.c", **words),
            f"{name}_check.c": _check(name, loop, read, given, flavour),
            **_process(name, loop, read, n_all, flavour),
            **(_example(name, read, flavour) if example else {}),
        },
        inputs=inputs,
        outputs=tuple(
            Signal(name=f"command[{device}]", unit=unit, description=f"of {places['device'][device]}")
            for device in range(loop.n_commanded)
        ),
        parameters=gains,
        n_states=0,
        is_lagged=False,
        sample_time=sample_time,
        substeps=1,
        notes=notes,
    )


def _believed(name: str, read: dict[str, int]) -> Iterator[str]:
    first = 0
    for signal, count in read.items():
        bit = f"{name.upper()}_{signal.upper()}_REPLACED"
        arguments = f"{bit}, {first}, input->{signal}, m->before.{signal}, {count}, m->limits.{signal}"
        yield f"    believe(m, {arguments});\n"
        first += count


def _inputs(read: dict[str, int], places: dict[str, Sequence[str]]) -> Iterator[Signal]:
    for signal, count in read.items():
        unit, _, _, words = _SIGNALS[signal]
        for entry in range(count):
            names = {kind: each[entry] for kind, each in places.items() if entry < len(each)}
            yield Signal(name=f"{signal}[{entry}]", unit=unit, description=words.format(entry + 1, **names))


def _gains(law: ControlLaw, *, without: str | None) -> Iterator[Signal]:
    for gain in law.spec.gains:
        if gain.name == without:
            continue
        for entry, value in enumerate(np.ravel(np.asarray(law.gains[gain.name], dtype=np.float64)).tolist()):
            yield Signal(
                name=f"{gain.name}[{entry}]", unit=gain.unit, description=gain.description, value=value
            )


def _groups(signals: Sequence[Signal]) -> dict[str, list[Signal]]:
    """Entries of arrays by the name of the array."""
    groups: dict[str, list[Signal]] = {}
    for signal in signals:
        groups.setdefault(signal.name.partition("[")[0], []).append(signal)
    return groups


def _fields(signals: Sequence[Signal], real: str) -> Iterator[str]:
    for array, entries in _groups(signals).items():
        words = "; ".join(dict.fromkeys(entry.description for entry in entries))
        yield f"    {real} {array}[{len(entries)}];  /* [{entries[0].unit}] {within_comment(words)} */"


def _initial(gains: Sequence[Signal], flavour: Flavour) -> Iterator[str]:
    for array, entries in _groups(gains).items():
        yield f"    {{{', '.join(flavour.number(entry.value or 0.0) for entry in entries)}}}  /* {array} */"


def _matrix(name: str, matrix: Floats, flavour: Flavour) -> str:
    rows = ",\n".join(f"    {{{', '.join(map(flavour.number, row))}}}" for row in matrix.tolist())
    return f"static const {flavour.real} {name}[{len(matrix)}][{len(matrix[0])}] = {{\n{rows},\n}};"


def _observer(name: str, loop: PrintedLoop, n_all: int, n_drifts: int, flavour: Flavour) -> str:
    observer = loop.matrices
    assert observer is not None
    matrices = {
        "transition": observer.Ad,
        "input_of": observer.Bd,
        "gain": observer.gain,
        "output": observer.C,
        "direct": observer.D,
    }
    expects = moves = ""
    if loop.hardware.observes_ground:
        matrices |= {"ground": observer.Ed[:, None], "direct_ground": observer.G[:, None]}
        shaking = "where_finite(in->ground_acceleration[0])"
        fma = "fmaf" if flavour.single else "fma"
        expects = f"        expected = {fma}({shaking}, direct_ground[row][0], expected);\n"
        moves = f"        sum = {fma}({shaking}, ground[row][0], sum);\n"
    n_measured = len(observer.C)
    n_floors = n_measured - n_all - n_drifts
    measured_floors = loop.hardware.measured_floors
    floors = range(n_floors) if measured_floors is None else measured_floors
    measured = [
        *(f"in->acceleration[{floor}]" for floor in floors),
        *(f"in->deformation[{device}]" for device in range(n_all)),
        *(f"in->drift[{place}]" for place in range(n_drifts)),
    ]
    return flavour.fill(
        "observer.c",
        name=name,
        matrices="\n".join(
            _matrix(word, np.atleast_2d(matrix), flavour) for word, matrix in matrices.items()
        ),
        n_measured=n_measured,
        n_states=len(observer.Ad),
        n_all=n_all,
        measured=", ".join(measured),
        expects=expects,
        moves=moves,
    )


def _decision(counts: dict[str, int]) -> str:
    """What a decision of a rollout computes within its sample."""
    every, steps = counts["decision"], counts["n_trials"] * (counts["horizon_steps"] + 1)
    return (
        f"It decides {f'every {every} samples' if every > 1 else 'in every sample'}: its model then takes {steps} "
        "steps before the command is sent. The horizon is fixed, since arrays are as long."
    )


def _rollout(
    rollout: dict[str, Any], name: str, loop: PrintedLoop, n_all: int, flavour: Flavour
) -> dict[str, str]:
    """The plan of a rollout: its types, its place in the memory, and its functions."""
    counts, real = rollout["counts"], flavour.real
    sizes = {f"max_{size}": max(1, counts[key]) for size, key in (("loops", "n_loops"), ("order", "order"))}
    ends = (
        ("drives", f"{name}_memory *m, const {real} *command, const {real} share[3]", ("command", "share")),
        (
            "moves",
            f"const {name}_memory *m, const {name}_moment *x, {name}_moment *next, const {real} *command,\n"
            f"                   const {real} *ground, {real} *found",
            ("m", "command"),
        ),
    )
    functions = {
        kind: "\n".join(
            f"static void {kind[:-1]}_{number}({arguments})\n{{\n"
            f"{''.join(f'    (void){each};{chr(10)}' for each in unused)}{text}}}\n"
            for number, text in enumerate(rollout[kind])
        )
        for kind, arguments, unused in ends
    }
    words = {
        **rollout,
        **functions,
        **counts,
        **sizes,
        **{key: flavour.number(value) for key, value in rollout["numbers"].items()},
        **{
            key: ", ".join(flavour.number(bounds[place]) for bounds in rollout["ranges"])
            for place, key in enumerate(("smallest", "largest"))
        },
        "name": name,
        "n_all": n_all,
        "n_devices": loop.n_commanded,
    }
    return {
        "rollout": flavour.fill("rollout.c", **words),
        "plan_types": flavour.fill("rollout.h", **words),
        "plan": f"    {name}_plan plan;\n",
        # A moment is made of numbers.
        "plan_is_sound": " &&\n        "
        f"are_finite((const {real} *)&m->plan.now, sizeof m->plan.now / sizeof({real}))",
        "plan_anew": "    memset(&m->plan, 0, sizeof m->plan);\n",
    }


def _filled(read: dict[str, int], row: str, flavour: Flavour) -> str:
    """Statements that fill an input from a row, from a column on."""
    statements = "".join(
        f"        for (int entry = 0; entry < {count}; ++entry)\n"
        f"            input.{signal}[entry] = ({flavour.real}){row}[column++];\n"
        for signal, count in read.items()
    )
    return statements or "        memset(&input, 0, sizeof input);\n"


def _process(
    name: str, loop: PrintedLoop, read: dict[str, int], n_all: int, flavour: Flavour
) -> dict[str, str]:
    """A program that a loop can have as a law; none where it is told of fewer devices than the observer counts."""
    if n_all != loop.n_commanded:
        return {}
    sent = {reading: read[reading] for reading in READINGS if reading in read}
    text = flavour.fill(
        "controller_process.c",
        name=name,
        names=", ".join(f'"{reading}"' for reading in sent),
        width=sum(sent.values()),
        n_devices=loop.n_commanded,
        filled=_filled(sent, "in", flavour),
    )
    return {f"{name}_process.c": text}


def _example(name: str, read: dict[str, int], flavour: Flavour) -> dict[str, str]:
    """A program around the controller with a record of its own, its Makefile, and vectors of a Cortex-M for it."""
    # Sensors of 16 bits whose range is four times what a check reads.
    scales = [repr(_SIGNALS[signal][1] / 8000.0) for signal, count in read.items() for _ in range(count)]
    words = {
        "name": name,
        "macro": name.upper(),
        "width": max(len(scales), 1),
        "scales": ", ".join(scales or ["1.0"]),
        "filled": _filled(read, "in", flavour),
    }
    return {
        f"{name}_example.c": flavour.fill("controller_example.c", **words),
        "Makefile": flavour.fill("Makefile", **words),
        "vectors.c": flavour.fill("vectors.c"),
    }


def readings_of_check(given: dict[str, int]) -> Floats:
    """Readings at samples, shape (n_samples, n_readings), of all signals that a controller is given."""
    rng = np.random.default_rng(0)
    columns = []
    for signal, count in given.items():
        time = np.arange(_SAMPLES)[:, None]
        turns = time * rng.uniform(0.002, 0.03, size=(3, 1, count)) + rng.uniform(size=(3, 1, count))
        columns.append(_SIGNALS[signal][1] * np.sin(2.0 * np.pi * turns).mean(axis=0))
    return np.concatenate(columns, axis=1)


def _check(
    name: str, loop: PrintedLoop, read: dict[str, int], given: dict[str, int], flavour: Flavour
) -> str:
    """A program that ends with 0 where the printed controller sends the commands of the core."""
    readings = readings_of_check(given)
    commands = _rust.law_commands(loop, np.ascontiguousarray(readings))[:, : loop.n_commanded]
    places = np.cumsum([0, *given.values()])
    shown = [
        np.arange(first, first + count)
        for (signal, count), first in zip(given.items(), places.tolist(), strict=False)
        if signal in read
    ]
    columns = np.concatenate([readings[:, [place for part in shown for place in part]], commands], axis=1)
    filled = _filled(read, "samples[i]", flavour)
    largest = float(np.abs(commands).max())
    return flavour.fill(
        "controller_check.c",
        name=name,
        n_samples=len(columns),
        width=columns.shape[1],
        n_devices=loop.n_commanded,
        rows=table_rows(columns),
        filled=filled,
        tolerance=repr(flavour.share * largest),
        allowed=commands.size // 100 if flavour.single else 0,
        but=", but for one in a hundred that switches earlier or later" if flavour.single else "",
    )
