"""The predictive rollout again, in NumPy: one run, all candidates side by side as rows."""

from collections.abc import Callable, Sequence

import numpy as np

from mrwork import Device
from mrwork.buildings import PassiveElement
from mrwork.control import ControlLaw

Floats = np.ndarray[tuple[int, ...], np.dtype[np.float64]]


def _static(p: dict[str, Floats], z: Floats, x: Floats, v: Floats) -> tuple[Floats, Floats]:
    loop = np.tanh(p["beta"] * v + p["delta"] * np.tanh(x / p["x_s"]))
    return p["c"] * v + p["k"] * x + p["alpha"] * loop + p["f0"], 0.0 * z


def _bouc_wen(p: dict[str, Floats], z: Floats, x: Floats, v: Floats) -> tuple[Floats, Floats]:
    power = np.abs(z) ** p["n"]
    rate = -p["gamma"] * np.abs(v) * np.sign(z) * power - p["beta"] * v * power + p["A"] * v
    return p["c0"] * v + p["k0"] * (x - p["x0"]) + p["alpha"] * z, rate


MODELS: dict[str, Callable[[dict[str, Floats], Floats, Floats, Floats], tuple[Floats, Floats]]] = {
    "static_hysteretic": _static,
    "bouc_wen": _bouc_wen,
}


class Dampers:
    """The dampers of a loop side by side: arrays of shape (..., n_devices, n_sides). A side that is not there counts 0.

    A parameter is `name` alone or a polynomial of the current, `name.0`, `name.1`, ...; it is evaluated once a step.
    """

    def __init__(self, devices: Sequence[Device]) -> None:
        spec = devices[0].spec
        self.model = MODELS[spec.name]
        columns = [dict(zip(spec.names, device.draws[0], strict=True)) for device in devices]
        plain = [parameter.name for parameter in spec.plain]
        self.constants = {
            name: np.array([[of[name]] for of in columns]) for name in plain if name in spec.names
        }
        self.varying = [name for name in plain if name not in spec.names]
        self.powers = np.array(
            [
                [[[of.get(f"{name}.{power}", 0.0)] for of in columns] for name in self.varying]
                for power in range(4)
            ]
        ).reshape(4, len(self.varying), len(devices), 1)
        self.sign = np.array([1.0, -1.0])
        self.count = np.array([[device.count, device.count * device.differential] for device in devices])

    def parameters(self, current: Floats) -> Floats:
        """Those that vary, shape (..., n_varying, n_devices, 1), at currents of shape (..., n_devices)."""
        i = current[..., None, :, None]
        a, b, c, d = self.powers
        return a + i * (b + i * (c + i * d))

    def forces(self, varying: Floats, z: Floats, x: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Force of each device without its factor, shape (..., n_devices), and the rates of the states of its sides."""
        p = self.constants | {name: varying[..., k, :, :] for k, name in enumerate(self.varying)}
        own, rates = self.model(p, z, x[..., None] * self.sign, v[..., None] * self.sign)
        return np.sum(own * (self.count * self.sign), axis=-1), rates


class Loops:
    """Passive elements `d |v| v + f_y w` side by side, whose states have shape (..., n_elements)."""

    def __init__(self, elements: Sequence[PassiveElement]) -> None:
        numbers = np.array([each.numbers[:6] for each in elements]).reshape(-1, 6)
        _, _, self.head_loss, self.forces_at_yield, self.slope, self.sharpness = numbers.T
        self.rows = np.array([each.row for each in elements])
        self.strength = np.ones(len(elements))

    def forces(self, w: Floats, v: Floats) -> Floats | float:
        """What they resist at the coordinates."""
        if not len(self.rows):
            return 0.0
        speed = v @ self.rows.T
        own = self.head_loss * np.abs(speed) * speed + self.strength * self.forces_at_yield * w
        return own @ self.rows

    def rates(self, w: Floats, v: Floats) -> Floats:
        """w' of each."""
        if not len(self.rows):
            return 0.0 * w
        speed, size = v @ self.rows.T / self.strength, np.abs(w) ** self.sharpness
        return self.slope * (speed - 0.5 * np.abs(speed) * np.sign(w) * size - 0.5 * speed * size)

    def turned(self, w: Floats, change: Floats) -> Floats:
        """The states after a change of the coordinates, by one Runge-Kutta step."""
        rates: list[Floats] = []
        for reach in (0.0, 0.5, 0.5, 1.0):
            staged = np.clip(w + reach * rates[-1], -1.0, 1.0) if rates else w
            rates.append(self.rates(staged, change))
        a, b, c, d = rates
        return np.clip(w + (a + 2.0 * b + 2.0 * c + d) / 6.0, -1.0, 1.0)

    def twice_held(self, w: Floats) -> Floats:
        """Twice the energy that they give back [J]."""
        return np.sum(self.forces_at_yield * (self.strength * w) ** 2 / self.slope, axis=-1)

    def left_squared(self, q: Floats, w: Floats) -> Floats | float:
        """Square of the largest elongation that they keep when they unload [m^2]."""
        if not len(self.rows):
            return 0.0
        return np.max((q @ self.rows.T - self.strength * w / self.slope) ** 2, axis=-1)


class RolloutInNumPy:
    """The law with its memory; call `command` at the samples of a run, one after the other."""

    def __init__(
        self,
        law: ControlLaw,
        sample_time: float,
        *,
        steps: int,
        preview: float = 0.0,
        shaking: Callable[[float], float] | None = None,
    ) -> None:
        """`steps` of the model in a decision; for `preview` seconds `shaking`, the ground acceleration, is known."""
        self.preview, self.shaking = preview, shaking
        building, devices = law.model.building, law.model.devices
        self.mass, self.damping, self.stiffness = building.mass, building.damping, building.site_stiffness
        self.inverse_mass = np.linalg.inv(self.mass)
        self.influence, self.floors, self.drifts = building.influence, building.floors, building.drifts
        self.rows = np.array([np.asarray(device.row) for device in devices])
        self.dampers = Dampers(devices)
        self.lagged = devices[0].spec.n_rates
        self.lag = np.array([device.draws[0][-1] if self.lagged else np.inf for device in devices])
        self.largest = np.array([device.largest_command for device in devices])
        g = {name: np.asarray(gain, dtype=np.float64) for name, gain in law.gains.items()}
        self.weights = np.array([g["drift_weight"][0], g["acceleration_weight"][0]])
        self.peak_weight, self.energy_weight = g["peak_weight"][0], g["energy_weight"][0]
        self.correction, self.residual_weight = g["force_correction"][0], g["residual_weight"][0]
        self.hold, _, self.delay, _, _ = law.tables["timing"]
        order, self.forgetting, covariance = law.tables["forecast"]
        self.order = int(order)
        self.time, mass = law.tables["correction"]
        self.counted = mass / np.sqrt(g["acceleration_weight"][0])
        self.loops = Loops(building.elements)
        self.offsets, self.adaptation, *self.limits = law.tables["shears"]
        self.is_measured = bool(building.elements) or self.offsets > 0.0 or self.adaptation > 0.0
        self.unit_drifts = building.unit_drifts
        self.Ts, self.step, self.hold_steps = sample_time, self.hold / steps, steps
        self.n_steps = round(min(max(g["horizon"][0], self.hold), 1.0) / self.step)
        tails = np.vstack([g["base"], g["tails"].T])
        pairs = [(level, tail) for level in g["levels"].T for tail in tails]
        self.trials = np.clip([g["base"], *(level for level, _ in pairs)], 0.0, self.largest)
        self.tails = np.clip([g["base"], *(tail for _, tail in pairs)], 0.0, self.largest)
        self.samples = round(self.hold / sample_time)
        self.late = int(np.floor(self.delay / sample_time * (1.0 + 1e-9)))
        rest = self.delay - self.late * sample_time
        self.rest = rest if rest > 1e-9 * sample_time else 0.0
        n_devices = len(devices)
        # Memory.
        self.number = 0
        self.sent: list[Floats] = []
        self.current = self.trials[0].copy()
        self.z = np.zeros((n_devices, 2))
        self.x, self.v = np.zeros(n_devices), np.zeros(n_devices)
        self.measured, self.expected, self.strongest = np.zeros(n_devices), np.zeros(n_devices), 0.0
        self.scale = np.ones(n_devices)
        self.peaks = np.zeros(2)
        self.held = self.trials[0].copy()
        self.w, self.readings = np.zeros(self.order), np.zeros(self.order)
        self.P = covariance * np.eye(self.order)
        self.first_trace = covariance * self.order
        self.states, self.before = np.zeros(len(building.elements)), np.zeros(len(self.mass))
        self.missed = np.zeros(len(self.mass))
        self.costs: Floats = np.zeros(len(self.trials))

    # The dampers.

    def lagging(self, current: Floats, command: Floats, time: float) -> Floats:
        """Currents after a time with a command."""
        if not self.lagged:
            return command + 0.0 * current
        return command + (current - command) * np.exp(-self.lag * time)

    def arrived(self, sample: int) -> Floats:
        """The command of a sample; the first for those before."""
        return self.sent[max(sample, 0)]

    def follow(self, x: Floats, v: Floats) -> None:
        """The copy of the dampers from the sample before to the present one."""
        last = self.number - 1
        pieces = [(self.Ts - self.rest, self.rest, self.arrived(last - self.late))]
        if self.rest:
            pieces.insert(0, (self.rest, 0.0, self.arrived(last - self.late - 1)))
        for length, offset, command in pieces:
            count = max(1, int(np.ceil(length / self.step * (1.0 - 1e-9))))
            h = length / count
            for number in range(count):
                if not self.lagged:
                    self.current = command.copy()
                currents = [self.lagging(self.current, command, share * h) for share in (0.0, 0.5, 1.0)]
                parameters = [self.dampers.parameters(each) for each in currents]
                rates: list[Floats] = []
                for place, reach in ((0, 0.0), (1, 0.5), (1, 0.5), (2, 1.0)):
                    share = (offset + h * (number + place / 2)) / self.Ts
                    at_x, at_v = self.x + share * (x - self.x), self.v + share * (v - self.v)
                    staged = self.z + reach * h * rates[-1] if rates else self.z
                    rates.append(self.dampers.forces(parameters[place], staged, at_x, at_v)[1])
                a, b, c, d = rates
                self.z = self.z + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
                self.current = currents[2]

    # The forecast.

    def learn(self, reading: float) -> None:
        """Recursive least squares with forgetting."""
        if not self.order:
            return
        spread = self.P @ self.readings
        gain = spread / (self.forgetting + self.readings @ spread)
        grows = np.trace(self.P) < 1e6 * self.first_trace
        self.w = self.w + gain * (reading - self.w @ self.readings)
        self.P = (self.P - np.outer(gain, spread)) / (self.forgetting if grows else 1.0)
        self.P = np.triu(self.P) + np.triu(self.P, 1).T
        self.readings = np.concatenate([[reading], self.readings[:-1]])

    def nodes(self, count: int) -> Floats:
        """The present acceleration and those that follow, a decision apart."""
        if not self.order:
            return np.zeros(count)
        window, found = self.readings.copy(), [self.readings[0]]
        for number in range(1, count):
            ahead = number * self.hold
            following = float(np.clip(self.w @ window, -self.strongest, self.strongest))
            if self.shaking is not None and ahead <= self.preview * (1.0 + 1e-9):
                following = self.shaking(self.number * self.Ts + ahead)
            window = np.concatenate([[following], window[:-1]])
            found.append(following)
        return np.array(found)

    # The model.

    def accelerations(self, q: Floats, v: Floats, force: Floats, w: Floats, ground: float) -> Floats:
        resisting = q @ self.stiffness.T + v @ self.damping.T + force @ self.rows + self.loops.forces(w, v)
        return -resisting @ self.inverse_mass.T - self.influence * ground

    def evaluate(
        self, q: Floats, v: Floats, parameters: Floats, z: Floats, w: Floats, ground: float
    ) -> tuple[Floats, Floats]:
        """Accelerations of all rows, and the rates of the damper states."""
        force, rates = self.dampers.forces(parameters, z, q @ self.rows.T, v @ self.rows.T)
        return self.accelerations(q, v, force * self.scale, w, ground) + self.missed, rates

    def advance(
        self, motion: tuple[Floats, ...], command: Floats, h: float, ground: Sequence[float]
    ) -> tuple[Floats, ...]:
        """A Runge-Kutta step of all rows; loops are held to their ends."""
        q, v, current, z, w = motion
        if not self.lagged:
            current = command
        currents = np.stack([self.lagging(current, command, share * h) for share in (0.0, 0.5, 1.0)])
        parameters = self.dampers.parameters(currents)
        speeds, pulls, drifts, turns = [], [], [], []
        at_q, at_v, at_z, at_w = q, v, z, w
        for place, reach in ((0, 0.5), (1, 0.5), (1, 1.0), (2, 0.0)):
            pull, rates = self.evaluate(at_q, at_v, parameters[place], at_z, at_w, ground[place])
            turns.append(self.loops.rates(at_w, at_v))
            speeds.append(at_v)
            pulls.append(pull)
            drifts.append(rates)
            at_q, at_v, at_z = q + reach * h * at_v, v + reach * h * pull, z + reach * h * rates
            at_w = np.clip(w + reach * h * turns[-1], -1.0, 1.0)

        def mean(four: Sequence[Floats]) -> Floats:
            return (four[0] + 2.0 * four[1] + 2.0 * four[2] + four[3]) / 6.0

        turned = np.clip(w + h * mean(turns), -1.0, 1.0)
        return q + h * mean(speeds), v + h * mean(pulls), currents[2], z + h * mean(drifts), turned

    def squares(self, q: Floats, acceleration: Floats, ground: float) -> tuple[Floats, Floats]:
        """Sums and largest of the squares of drifts and absolute accelerations, shape (2, rows)."""
        both = [
            np.atleast_2d(q @ self.drifts.T) ** 2,
            np.atleast_2d(acceleration @ self.floors.T + ground) ** 2,
        ]
        return np.array([each.sum(axis=1) for each in both]), np.array([each.max(axis=1) for each in both])

    # A sample.

    def command(
        self,
        q: Floats,
        v: Floats,
        x: Floats,
        rate: Floats,
        force: Floats,
        ground: float,
        measured: Floats | None = None,
    ) -> Floats:
        """The command of each device at the next sample; `measured` are absolute accelerations of the floors."""
        if not self.order:
            ground = 0.0
        if self.number == 1:
            self.current = self.sent[0].copy()
        if self.number:
            self.follow(x, rate)
        self.x, self.v = x, rate
        decides = self.number % self.samples == 0
        weight = min(1.0, self.Ts / self.time)
        own, _ = self.dampers.forces(self.dampers.parameters(self.current), self.z, x, rate)
        self.measured = self.measured + weight * (force**2 - self.measured)
        self.expected = self.expected + weight * (own**2 - self.expected)
        self.strongest = max(self.strongest, abs(ground))
        if decides:
            ratio = np.sqrt((self.measured + self.counted**2) / (self.expected + self.counted**2))
            self.scale = np.clip(1.0 + self.correction * (ratio - 1.0), 0.7, 1.3)
        if self.number:
            for _ in range(2):
                self.states = self.loops.turned(self.states, 0.5 * (q - self.before))
        self.before = q
        acceleration = self.accelerations(q[None], v[None], force[None], self.states[None], ground)[0]
        if self.is_measured:
            # The floors are the coordinates.
            missed = measured - self.influence * ground - acceleration
            acceleration = measured - ground
            self.adapt(missed)
            self.missed = missed if self.offsets else self.missed
        self.peaks = np.maximum(self.peaks, self.squares_now(q, acceleration, ground))
        if decides:
            self.learn(ground)
            self.decide(q, v)
        self.number += 1
        self.sent.append(self.held)
        return self.held

    def adapt(self, missed: Floats) -> None:
        """Yield drifts follow the shears that the model misses, where it yields."""
        shears = -self.unit_drifts @ self.mass @ missed
        for place, row in enumerate(self.loops.rows):
            (storey,) = np.flatnonzero((self.drifts == row).all(axis=1))
            w, share = self.states[place], self.adaptation * self.Ts / self.loops.forces_at_yield[place]
            changed = self.loops.strength[place] + share * np.abs(w) * w * shears[storey]
            self.loops.strength[place] = np.clip(changed, *self.limits)

    def squares_now(self, q: Floats, acceleration: Floats, ground: float) -> Floats:
        return self.squares(q, acceleration, ground)[1][:, 0]

    def decide(self, q: Floats, v: Floats) -> None:
        """Costs of all commands, and the best of them."""
        count = int(np.ceil((self.delay + self.n_steps * self.step) / self.hold)) + 2
        nodes = self.nodes(count)

        def forecast(time: float) -> float:
            return float(np.interp(time / self.hold, np.arange(count), nodes))

        motion = (q[None], v[None], self.current[None], self.z[None], self.states[None])
        time = 0.0
        if self.number:
            pieces = [(self.Ts, self.arrived(self.number - self.late + piece)) for piece in range(self.late)]
            if self.rest:
                pieces.insert(0, (self.rest, self.arrived(self.number - self.late - 1)))
            for length, command in pieces:
                steps = max(1, int(np.ceil(length / self.step * (1.0 - 1e-9))))
                h = length / steps
                for _ in range(steps):
                    ground = [forecast(time + share * h) for share in (0.0, 0.5, 1.0)]
                    motion = self.advance(motion, command[None], h, ground)
                    time += h
        rows = len(self.trials)
        motion = tuple(np.repeat(each, rows, axis=0) for each in motion)
        sums, peaks = np.zeros((2, rows)), np.repeat(self.peaks[:, None], rows, axis=1)
        for step in range(self.n_steps):
            command = self.trials if step < self.hold_steps else self.tails
            start = self.delay + step * self.step
            ground = [forecast(start + share * self.step) for share in (0.0, 0.5, 1.0)]
            motion = self.advance(motion, command, self.step, ground)
            q, v, current, z, w = motion
            following = self.trials if step + 1 < self.hold_steps else self.tails
            parameters = self.dampers.parameters(current if self.lagged else following)
            acceleration = self.evaluate(q, v, parameters, z, w, ground[2])[0]
            total, largest = self.squares(q, acceleration, ground[2])
            sums += total
            peaks = np.maximum(peaks, largest)
        twice = np.sum((q @ self.stiffness) * q + (v @ self.mass) * v, axis=1) + self.loops.twice_held(w)
        mean = self.weights @ sums / self.n_steps
        self.costs = mean + self.peak_weight * (self.weights @ peaks) + self.energy_weight * twice
        self.costs = self.costs + self.residual_weight * self.loops.left_squared(q, w)
        self.held = self.trials[int(np.argmin(self.costs))]
