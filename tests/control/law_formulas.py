"""The control laws again, in NumPy, from their papers: commands over time from what a recorded run did."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

import mrwork as mr
from tests.control.rollout_formula import RolloutInNumPy

Floats = np.ndarray[tuple[int, ...], np.dtype[np.float64]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorded:
    """Inputs of the law at its samples, arrays of shape (n_time, ...), and the numbers of the law."""

    law: mr.ControlLaw
    devices: Sequence[mr.Device]
    state: Floats
    deformation: Floats
    rate: Floats
    force: Floats
    absolute_rate: Floats
    absolute_acceleration: Floats
    ground_acceleration: Floats
    sample_time: float

    @classmethod
    def of(
        cls,
        law: mr.ControlLaw,
        building: mr.Building,
        devices: Sequence[mr.Device],
        motion: mr.GroundMotion,
        run: mr.closed_loop.History,
        sample_time: float,
    ) -> Self:
        # The velocity of straight pieces is exact at their joints only: samples that fall between take the parabola.
        fine = np.arange(len(run.time)) * sample_time
        index = np.minimum((fine / motion.dt + 1e-9).astype(int), motion.n_time - 2)
        start, end = motion.acceleration[index], motion.acceleration[index + 1]
        since = fine - index * motion.dt
        ground = motion.velocity[index] + start * since + 0.5 * (end - start) / motion.dt * since**2
        rows = np.array([device.row if device.sprung is None else device.sprung for device in devices])
        carried = rows @ building.influence
        return cls(
            law=law,
            devices=devices,
            state=run.state,
            deformation=run.deformation,
            rate=run.rate,
            force=run.force,
            absolute_acceleration=run.acceleration @ np.linalg.pinv(building.floors).T @ rows.T,
            ground_acceleration=start + (end - start) * since / motion.dt,
            absolute_rate=run.state[:, rows.shape[1] :] @ rows.T + np.outer(ground, carried),
            sample_time=sample_time,
        )

    def gain(self, name: str) -> Floats:
        return np.asarray(self.law.gains[name], dtype=np.float64)

    @property
    def largest(self) -> Floats:
        return np.array([device.largest_command for device in self.devices])

    @property
    def wanted(self) -> Floats:
        return -self.state @ self.gain("gain").T

    @property
    def sigma(self) -> Floats:
        return self.state @ self.gain("weight").T

    def believed(self, command: Floats) -> Floats:
        """Force of the law's static model at these commands, one for each device."""
        spec, theta = self.law.curve
        columns = dict(zip(spec.names, np.asarray(theta), strict=True))
        p = {
            name: sum(columns.get(f"{name}.{power}", 0.0) * command**power for power in range(3))
            + columns.get(name, 0.0)
            for name in ("c", "k", "alpha", "beta", "delta", "x_s", "f0")
        }

        def one(x: Floats, v: Floats) -> Floats:
            loop = np.tanh(p["beta"] * v + p["delta"] * np.tanh(x / p["x_s"]))
            return np.asarray(p["c"] * v + p["k"] * x + p["alpha"] * loop + p["f0"])

        x, v = self.deformation, self.rate
        pair = np.array([device.differential for device in self.devices])
        count = np.array([device.count for device in self.devices])
        return count * np.where(pair, one(x, v) - one(-x, -v), one(x, v))

    @property
    def parabola(self) -> tuple[Floats, Floats, Floats]:
        """F0, G, H through the forces at no, half and all of the command."""
        i = self.largest
        none, half, all_of_it = self.believed(0.0 * i), self.believed(0.5 * i), self.believed(i)
        H = 2.0 * (all_of_it - 2.0 * half + none) / i**2
        return none, (all_of_it - none) / i - H * i, H


def _on(where: Floats, command: Floats) -> Floats:
    return np.where(where > 0.0, command, 0.0)


def _clipped(run: Recorded, wanted: Floats, share: Floats | float = 1.0) -> Floats:
    return _on((wanted - run.force) * run.force, share * run.largest)


def _passive(run: Recorded) -> Floats:
    return np.broadcast_to(run.gain("command"), run.force.shape)


def _clipped_optimal(run: Recorded) -> Floats:
    return _clipped(run, run.wanted)


def _modified(run: Recorded) -> Floats:
    return _clipped(run, run.wanted, np.minimum(np.abs(run.wanted) / run.gain("full_force"), 1.0))


def _proportional(run: Recorded) -> Floats:
    missing = np.abs(run.wanted - run.force) / (0.1 * run.gain("full_force"))
    return _clipped(run, run.wanted, np.minimum(missing, 1.0))


def _lyapunov(run: Recorded) -> Floats:
    return _on(-run.sigma * run.force, run.largest)


def _decentralised(run: Recorded) -> Floats:
    return _on(run.absolute_rate * run.force, run.largest)


def _energy(run: Recorded) -> Floats:
    return _on(run.rate * run.force, run.largest)


def _friction(run: Recorded) -> Floats:
    peak = np.zeros_like(run.rate)
    for k in range(1, len(peak)):
        turned = run.rate[k - 1] * run.rate[k] < 0.0
        peak[k] = np.where(turned, np.abs(run.deformation[k - 1]), peak[k - 1])
    return _on(run.gain("slope") * peak - np.abs(run.force), run.largest)


def _layer(run: Recorded) -> tuple[Floats, Floats]:
    distance = run.state @ run.gain("surface").T
    return distance, np.clip(distance / run.gain("boundary"), -1.0, 1.0)


def _sliding(run: Recorded) -> Floats:
    return _clipped(run, run.wanted + run.gain("switching") * _layer(run)[1])


def _adaptive(run: Recorded) -> Floats:
    distance, layer = _layer(run)
    rho, switching = np.zeros(len(run.devices)), []
    for s in distance:
        grows = np.where(np.abs(s) > run.gain("boundary"), 1.0, -1.0)
        rho = rho + run.gain("adaptation") * run.sample_time * np.abs(s) * grows
        rho = np.clip(rho, run.gain("floor"), run.gain("ceiling"))
        switching.append(rho)
    return _clipped(run, run.wanted + np.array(switching) * layer)


def _super_twisting(run: Recorded) -> Floats:
    s = run.state @ run.gain("surface").T
    integral = -run.gain("integral_gain") * run.sample_time * np.cumsum(np.sign(s), axis=0)
    wanted = integral - run.gain("root_gain") * np.sqrt(np.abs(s)) * np.sign(s)
    push, i = run.gain("push"), run.largest
    free = run.state @ run.gain("drift").T + push * run.believed(0.0 * i)
    slope = push * (run.believed(i) - run.believed(0.0 * i)) / i
    return np.divide(wanted - free, slope, out=np.zeros_like(s), where=slope != 0.0)


def _fuzzy(run: Recorded) -> Floats:
    from scipy.interpolate import RegularGridInterpolator

    table = np.asarray(run.law.tables["shares"])
    side = round(np.sqrt(table.size))
    points = np.linspace(-1.0, 1.0, side)
    x = np.clip(run.deformation / run.gain("deformation_scale"), -1.0, 1.0)
    y = np.clip(run.rate / run.gain("rate_scale"), -1.0, 1.0)
    shares = RegularGridInterpolator((points, points), table.reshape(side, side))
    return np.asarray(shares(np.stack([x, y], axis=-1)) * run.largest)


# Commands among which the current is searched: many, so that every crossing of a force is seen.
_MANY = 1921


def _direct(run: Recorded) -> Floats:
    """The least of sigma f among many commands."""
    share = np.linspace(0.0, 1.0, _MANY)
    cost = np.stack([run.sigma * run.believed(each * run.largest) for each in share])
    return share[np.argmin(cost, axis=0)] * run.largest


def _direct_parabola(run: Recorded) -> Floats:
    F0, G, H = run.parabola
    with np.errstate(divide="ignore", invalid="ignore"):
        vertex = np.clip(np.nan_to_num(-G / (2.0 * H)), 0.0, run.largest)
    tried = np.stack([np.zeros_like(vertex), np.broadcast_to(run.largest, vertex.shape), vertex])
    best = np.argmin(run.sigma * (F0 + G * tried + H * tried**2), axis=0)
    return np.take_along_axis(tried, best[None], axis=0)[0]


def _direct_on_off(run: Recorded) -> Floats:
    return _on(-run.sigma * run.parabola[1], run.largest)


def _direct_proportional(run: Recorded) -> Floats:
    return -run.gain("slope") * run.sigma * run.parabola[1]


def _inverse(run: Recorded) -> Floats:
    """The least of many commands at which the force passes through the wanted one, or else the nearest in force."""
    share = np.linspace(0.0, 1.0, _MANY)
    error = np.stack([run.believed(each * run.largest) for each in share]) - run.wanted
    passes = error[:-1] * error[1:] <= 0.0
    first = np.argmax(passes, axis=0)
    before = np.take_along_axis(error, first[None], axis=0)[0]
    after = np.take_along_axis(error, first[None] + 1, axis=0)[0]
    between = np.divide(before, before - after, out=np.zeros_like(before), where=before != after)
    nearest = np.argmin(np.abs(error), axis=0) / (_MANY - 1)
    return np.where(passes.any(axis=0), (first + between) / (_MANY - 1), nearest) * run.largest


def _inverse_parabola(run: Recorded) -> Floats:
    """The least root within the range, or else the end that is nearest in force."""
    found = np.empty_like(run.force)
    F0, G, H = run.parabola
    for index in np.ndindex(found.shape):
        i = run.largest[index[1]]
        f = [F0[index] - run.wanted[index], G[index], H[index]]
        roots = np.roots(f[::-1])
        inside = [root.real for root in roots if root.imag == 0.0 and 0.0 <= root.real <= i]
        at_end = f[0] + i * (f[1] + i * f[2])
        found[index] = min(inside) if inside else i * (abs(at_end) < abs(f[0]))
    return found


def _network(run: Recorded) -> Floats:
    reach = np.asarray(run.law.tables["reach"])
    layer = np.reshape(run.law.tables["layer"], (-1, reach.size + 2))
    commands = []
    for d in range(len(run.devices)):
        now = np.column_stack([run.deformation[:, d], run.rate[:, d], run.wanted[:, d]])
        before = np.vstack([np.zeros(3), now[:-1]])
        inputs = np.clip(np.hstack([now, before])[:, : reach.size], -reach, reach)
        hidden = np.tanh(inputs @ layer[:, 1:-1].T + layer[:, 0])
        commands.append(hidden @ layer[:, -1] + np.sum(run.law.tables["output"]))
    return np.column_stack(commands)


def _signals(run: Recorded) -> Floats:
    """Shape (4, n_time, n_devices)."""
    return np.stack([run.deformation, run.rate, run.force, run.wanted])


def _signal_network(run: Recorded) -> Floats:
    shares = []
    for device, network in enumerate(run.gain("network")):
        total = network[-1]
        for bias, *weights, output in network[:-1].reshape(4, 6):
            inner = np.tensordot(weights, _signals(run)[..., device], 1)
            total = total + output * (np.tanh(bias + inner) + np.tanh(bias - inner))
        shares.append(0.5 * (1.0 + np.tanh(total)))
    return np.column_stack(shares) * run.largest


def _acceleration_driven(run: Recorded) -> Floats:
    return _on(run.absolute_acceleration * run.rate, run.largest)


def _mixed_skyhook(run: Recorded) -> Floats:
    a, v = run.absolute_acceleration, run.absolute_rate
    slow = a**2 - (run.gain("crossover") * v) ** 2 <= 0.0
    return np.where(slow, _on(v * run.rate, run.largest), _on(a * run.rate, run.largest))


def _skyhook_groundhook(run: Recorded) -> Floats:
    unsprung, share = run.absolute_rate - run.rate, run.gain("share")
    skyhook = _on(run.absolute_rate * run.rate, run.largest)
    return share * skyhook + (1.0 - share) * _on(-unsprung * run.rate, run.largest)


def _active(run: Recorded) -> Floats:
    return run.wanted


def _rollout(run: Recorded) -> Floats:
    """Sample after sample, with the steps of the model that the law takes for these dampers."""
    again = RolloutInNumPy(run.law, run.sample_time, steps=8)
    n = run.state.shape[1] // 2
    return np.array(
        [
            again.command(state[:n], state[n:], *readings)
            for state, *readings in zip(
                run.state, run.deformation, run.rate, run.force, run.ground_acceleration, strict=True
            )
        ]
    )


FORMULAS: dict[str, Callable[[Recorded], Floats]] = {
    "passive": _passive,
    "clipped_optimal": _clipped_optimal,
    "modified_clipped_optimal": _modified,
    "proportional_clipped_optimal": _proportional,
    "lyapunov": _lyapunov,
    "decentralised_bang_bang": _decentralised,
    "maximum_energy_dissipation": _energy,
    "modulated_homogeneous_friction": _friction,
    "sliding_mode": _sliding,
    "adaptive_sliding_mode": _adaptive,
    "super_twisting": _super_twisting,
    "fuzzy": _fuzzy,
    "lyapunov_direct": _direct,
    "lyapunov_parabola": _direct_parabola,
    "lyapunov_direct_bang_bang": _direct_on_off,
    "proportional_direct": _direct_proportional,
    "inverse_direct": _inverse,
    "inverse_parabola": _inverse_parabola,
    "inverse_network": _network,
    "signal_network": _signal_network,
    "active": _active,
    "acceleration_driven": _acceleration_driven,
    "mixed_skyhook": _mixed_skyhook,
    "skyhook_groundhook": _skyhook_groundhook,
    "predictive_rollout": _rollout,
}


SEARCHED = ("lyapunov_direct", "inverse_direct")
"""Laws whose formula here is a search among many commands: exact in the force, not in the command."""


def commands(run: Recorded) -> Floats:
    """Commands of the law, cut off at the ends of the range, shape (n_time, n_devices)."""
    plain = FORMULAS[run.law.name](run)
    return plain if run.law.name == "active" else np.clip(plain, 0.0, run.largest)
