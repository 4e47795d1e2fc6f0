"""C as printed: of a damper with a state and a lagged driver, of one with neither, and of a controller."""

import numpy as np

from mrwork.embedded.c_source import CSource, Signal

SAMPLE_TIME, SUBSTEPS = 1e-3, 4
SUBSTEP = SAMPLE_TIME / SUBSTEPS

_HEADER = """#ifndef NAME_H
#define NAME_H
typedef struct {{ double {names}; }} NAME_parameters;
typedef struct {{ double displacement, velocity, command; }} NAME_input;
typedef struct {{
    double state[1];
    double current;
    NAME_parameters given;
    double damping, yield_force; /* at the current */
    unsigned status;
}} NAME_memory;
typedef struct {{ double displacement, velocity, lowest_command, highest_command; }} NAME_limits;
extern const NAME_parameters NAME_fitted;
extern const NAME_limits NAME_believed, NAME_tested;
void NAME_start(NAME_memory *m, const NAME_parameters *parameters, double command);
void NAME_carry(NAME_memory *m, double current);
double NAME_force(const NAME_memory *m, double x, double v);
void NAME_rate(const NAME_memory *m, double command, double x, double v, double *rate);
void NAME_substep(NAME_memory *m, double command, const double motion[6]);
int NAME_retune(NAME_memory *m, const NAME_parameters *parameters);
void NAME_heal(NAME_memory *m, double command);
#endif
"""
_START = """#include "NAME.h"
#include <math.h>
const NAME_parameters NAME_fitted = {VALUES};
const NAME_limits NAME_believed = {0.2, 3.0, -20.0, 20.0}, NAME_tested = {0.02, 0.3, 0.0, 2.0};
int NAME_retune(NAME_memory *m, const NAME_parameters *parameters)
{
    m->given = *parameters;
    NAME_carry(m, m->current);
    return 0;
}
void NAME_heal(NAME_memory *m, double command)
{
    if (isfinite(m->state[0]) && isfinite(m->current)) return;
    m->state[0] = 0.0;
    NAME_carry(m, command);
    m->status |= 8;
}
void NAME_start(NAME_memory *m, const NAME_parameters *parameters, double command)
{
    m->state[0] = 0.0;
    m->given = *parameters;
    NAME_carry(m, command);
}
"""
_HYSTERETIC = """
void NAME_carry(NAME_memory *m, double current)
{
    m->current = current;
    m->damping = m->given.c_0 + m->given.c_1 * current;
    m->yield_force = m->given.f_0 + m->given.f_1 * current;
}
double NAME_force(const NAME_memory *m, double x, double v)
{
    return m->damping * v + m->given.k * x + m->yield_force * m->state[0];
}
void NAME_rate(const NAME_memory *m, double command, double x, double v, double *rate)
{
    const double z = m->state[0], sigma = m->given.sigma;
    rate[0] = m->given.rho * (1.0 + 10.0 * x) * (v - sigma * fabs(v) * fabs(z) * z + (sigma - 1.0) * v * z * z);
    rate[1] = m->given.eta * (command - m->current);
}
void NAME_substep(NAME_memory *m, double command, const double motion[6])
{
    static const double share[4] = {0.0, 0.5, 0.5, 1.0};
    static const int place[4] = {0, 2, 2, 4};
    double rate[4][2];
    NAME_memory at = *m;
    for (int stage = 0; stage < 4; ++stage) {
        if (stage > 0) {
            at.state[0] = m->state[0] + share[stage] * STEP * rate[stage - 1][0];
            at.current = m->current + share[stage] * STEP * rate[stage - 1][1];
        }
        NAME_rate(&at, command, motion[place[stage]], motion[place[stage] + 1], rate[stage]);
    }
    m->state[0] += STEP / 6.0 * (rate[0][0] + 2.0 * rate[1][0] + 2.0 * rate[2][0] + rate[3][0]);
    NAME_carry(m, m->current + STEP / 6.0 * (rate[0][1] + 2.0 * rate[1][1] + 2.0 * rate[2][1] + rate[3][1]));
}
"""
_STATELESS = """
void NAME_carry(NAME_memory *m, double current)
{
    m->current = current;
    m->yield_force = m->given.f_1 * current;
}
double NAME_force(const NAME_memory *m, double x, double v)
{
    (void)x;
    return m->yield_force * tanh(m->given.a * v);
}
void NAME_substep(NAME_memory *m, double command, const double motion[6])
{
    (void)m;
    (void)command;
    (void)motion;
}
"""
_CONTROLLER_HEADER = """#ifndef NAME_H
#define NAME_H
typedef struct { double gain[2]; double command[1]; } NAME_parameters;
typedef struct { double acceleration[2]; double force[1]; } NAME_input;
typedef struct { double good[2]; double sum; unsigned long replaced; unsigned status; } NAME_memory;
void NAME_start(NAME_memory *memory);
void NAME_step(NAME_memory *memory, const NAME_parameters *p, const NAME_input *input, double command[2]);
#endif
"""
_CONTROLLER = """#include "NAME.h"
#include <math.h>
void NAME_start(NAME_memory *memory)
{
    const NAME_memory empty = {{0.0, 0.0}, 0.25, 0, 0};
    *memory = empty;
}
void NAME_step(NAME_memory *memory, const NAME_parameters *p, const NAME_input *input, double command[2])
{
    for (int i = 0; i < 2; ++i) {
        if (isfinite(input->acceleration[i])) {
            memory->good[i] = input->acceleration[i];
        } else {
            memory->replaced += 1;
        }
        memory->sum = 0.5 * memory->sum + p->gain[i] * memory->good[i];
        command[i] = fmin(p->command[0], fmax(0.0, memory->sum - 0.001 * input->force[0]));
    }
}
"""
_MOTION = (
    Signal(name="displacement", unit="m", description="Displacement across the damper"),
    Signal(name="velocity", unit="m/s", description="Velocity across the damper"),
    Signal(name="command", unit="A", description="Command of the driver"),
)
_FORCE = (Signal(name="force", unit="N", description="Force of the damper"),)


def hysteretic() -> CSource:
    """A Bouc-Wen damper whose damping and yield force follow a lagged current, and its stiffness the displacement."""
    values = {
        "c_0": (600.0, "N s/m"), "c_1": (400.0, "N s/(m A)"), "k": (900.0, "N/m"), "f_0": (150.0, "N"),
        "f_1": (900.0, "N/A"), "rho": (2000.0, "1/m"), "sigma": (0.9, "1"), "eta": (190.0, "1/s"),
    }  # fmt: skip
    return _damper("rig_damper", _HYSTERETIC, values, n_states=1, is_lagged=True)


def stateless() -> CSource:
    """Smoothed friction that follows its command at once; its second parameter has a unit without powers."""
    values = {"f_1": (700.0, "N/V"), "a": (50.0, "m^-n")}
    return _damper("friction", _STATELESS, values, n_states=0, is_lagged=False)


def _damper(
    name: str, text: str, values: dict[str, tuple[float, str]], *, n_states: int, is_lagged: bool
) -> CSource:
    header = _HEADER.format(names=", ".join(values))
    code = (_START + text).replace("VALUES", ", ".join(repr(value) for value, _ in values.values()))
    code = code.replace("STEP", repr(SUBSTEP))
    return CSource(
        name=name,
        kind="damper",
        description='Damper of a test, with <marks> & "quotes"',
        files={
            f"{name}.h": header.replace("NAME", name),
            f"{name}.c": code.replace("NAME", name),
            f"{name}_check.c": "int main(void) { return 0; }\n",
        },
        inputs=_MOTION,
        outputs=_FORCE,
        parameters=tuple(
            Signal(name=key, unit=unit, description=f"Parameter {key}", value=value)
            for key, (value, unit) in values.items()
        ),
        n_states=n_states,
        is_lagged=is_lagged,
        sample_time=SAMPLE_TIME,
        substeps=SUBSTEPS,
    )


def controller() -> CSource:
    """Commands of two dampers; a gain has the name of one, and a reading that is not finite is replaced."""
    name = "frame_controller"
    readings = [*((f"acceleration[{n}]", "m/s2") for n in range(2)), ("force[0]", "N")]
    gains = {"gain[0]": 0.3, "gain[1]": -0.2, "command[0]": 2.0}
    return CSource(
        name=name,
        kind="controller",
        description="Controller of a test",
        files={
            f"{name}.h": _CONTROLLER_HEADER.replace("NAME", name),
            f"{name}.c": _CONTROLLER.replace("NAME", name),
        },
        inputs=tuple(Signal(name=key, unit=unit, description="Reading") for key, unit in readings),
        outputs=tuple(Signal(name=f"command[{n}]", unit="A", description="Command") for n in range(2)),
        parameters=tuple(
            Signal(name=key, unit="", description="Gain", value=value) for key, value in gains.items()
        ),
        n_states=0,
        is_lagged=False,
        sample_time=5e-3,
        substeps=1,
    )


def commands_of(readings: np.ndarray) -> np.ndarray:
    """Commands (n_time, 2) [A] of the controller from readings (n_time, 3), written again in Python."""
    gain, most = (0.3, -0.2), 2.0
    good, total, commands = [0.0, 0.0], 0.25, []
    for *acceleration, force in readings.tolist():
        row = []
        for i in range(2):
            good[i] = acceleration[i] if np.isfinite(acceleration[i]) else good[i]
            total = 0.5 * total + gain[i] * good[i]
            row.append(min(most, max(0.0, total - 0.001 * force)))
        commands.append(row)
    return np.array(commands)
