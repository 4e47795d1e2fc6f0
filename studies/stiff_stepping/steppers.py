"""One step of the modified Bouc-Wen model by each method, for one candidate.

State y, w; parameters (c0/D, k0/D, k_w/D, rho, 2 sigma - 1, n), D = c0 + c1; motions (x, v, v') at the three times
that the method names in `TIMES`, fractions of the step. With g = v - y' the model is

    y' = (k_w w + c0 v + k0 (x - y))/D,   w' = g S(g, w),   S = rho (1 - |w|^n)                where g w > 0
                                                            S = rho (1 + (2 sigma - 1) |w|^n)  elsewhere

The same source is compiled for the clock and run on counting numbers, so it calls no library and
its choices are between numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

Parameters: TypeAlias = tuple[float, float, float, float, float, float]
Motions: TypeAlias = tuple[float, float, float, float, float, float, float, float, float]
Matrix: TypeAlias = tuple[float, float, float, float]
State: TypeAlias = tuple[float, float]
Step: TypeAlias = Callable[[Parameters, float, float, Motions, float], State]

GAMMA_ROS2 = 1.0 - 0.5**0.5
GAMMA_ROS3 = 0.43586652150845899941601945119356
ENDS = (0.0, 1.0, 1.0)
TIMES = {
    "rk4": (0.0, 0.5, 1.0),
    "ros2": ENDS,
    "ros3": (0.0, GAMMA_ROS3, 1.0),
    "rodas3": ENDS,
    "exponential": ENDS,
    "exact_loop": ENDS,
}


def steppers(
    power: Callable[[Any, Any], Any], exp: Callable[[Any], Any], compiled: Callable[[Any], Any]
) -> dict[str, Step]:
    """Every method by name, over |w|^n and e^x, each function passed through `compiled`."""

    @compiled
    def rate(p: Parameters, y: float, w: float, x: float, v: float) -> State:
        y_rate = p[2] * w + (p[0] * v + p[1] * (x - y))
        g = v - y_rate
        share = 1.0 if (g > 0.0) == (w > 0.0) else -p[4]
        return y_rate, g * (p[3] * (1.0 - share * power(abs(w), p[5])))

    @compiled
    def rk4(p: Parameters, y: float, w: float, m: Motions, h: float) -> State:
        half = 0.5 * h
        y1, w1 = rate(p, y, w, m[0], m[1])
        y2, w2 = rate(p, y + half * y1, w + half * w1, m[3], m[4])
        y3, w3 = rate(p, y + half * y2, w + half * w2, m[3], m[4])
        y4, w4 = rate(p, y + h * y3, w + h * w3, m[6], m[7])
        sixth = h / 6.0
        return y + sixth * (y1 + 2.0 * (y2 + y3) + y4), w + sixth * (w1 + 2.0 * (w2 + w3) + w4)

    @compiled
    def linearised(
        p: Parameters, y: float, w: float, m: Motions
    ) -> tuple[float, float, float, float, float, float]:
        """y', w', their derivatives by time, dw'/dy and dw'/dw; dy'/dy = -k0/D and dy'/dw = k_w/D."""
        y_rate = p[2] * w + (p[0] * m[1] + p[1] * (m[0] - y))
        g = m[1] - y_rate
        share = 1.0 if (g > 0.0) == (w > 0.0) else -p[4]
        reduced = share * power(abs(w), p[5] - 1.0)
        slope = p[3] * (1.0 - reduced * abs(w))
        signed = reduced if w > 0.0 else -reduced
        y_time = p[0] * m[2] + p[1] * m[1]
        w_by_w = -(p[3] * p[5]) * (g * signed) - slope * p[2]
        return y_rate, g * slope, y_time, slope * (m[2] - y_time), slope * p[1], w_by_w

    @compiled
    def inverted(p: Parameters, hg: float, w_by_y: float, w_by_w: float) -> Matrix:
        """(I - hg J)^-1."""
        a, b, c, d = 1.0 + hg * p[1], hg * p[2], hg * w_by_y, 1.0 - hg * w_by_w
        inverse = 1.0 / (a * d - b * c)
        return inverse * d, inverse * b, inverse * c, inverse * a

    @compiled
    def times(m: Matrix, y: float, w: float) -> State:
        return m[0] * y + m[1] * w, m[2] * y + m[3] * w

    @compiled
    def ros2(p: Parameters, y: float, w: float, m: Motions, h: float) -> State:
        """Verwer et al. 1999: second order, two rates."""
        hg = h * GAMMA_ROS2
        fy, fw, ty, tw, w_by_y, w_by_w = linearised(p, y, w, m)
        solve = inverted(p, hg, w_by_y, w_by_w)
        y1, w1 = times(solve, h * (fy + hg * ty), h * (fw + hg * tw))
        fy, fw = rate(p, y + y1, w + w1, m[3], m[4])
        y2, w2 = times(solve, h * (fy - hg * ty) - 2.0 * y1, h * (fw - hg * tw) - 2.0 * w1)
        return y + (1.5 * y1 + 0.5 * y2), w + (1.5 * w1 + 0.5 * w2)

    @compiled
    def ros3(p: Parameters, y: float, w: float, m: Motions, h: float) -> State:
        """ROS3 of Sandu et al. 1997: third order, two rates."""
        hg = h * GAMMA_ROS3
        fy, fw, ty, tw, w_by_y, w_by_w = linearised(p, y, w, m)
        solve = inverted(p, hg, w_by_y, w_by_w)
        y1, w1 = times(solve, hg * (fy + hg * ty), hg * (fw + hg * tw))
        fy, fw = rate(p, y + y1, w + w1, m[3], m[4])
        c1 = GAMMA_ROS3 * -1.0156171083877702091975600115545
        ht = h * 0.24291996454816804366592249683314
        y2, w2 = times(solve, hg * (fy + ht * ty) + c1 * y1, hg * (fw + ht * tw) + c1 * w1)
        c1 = GAMMA_ROS3 * 4.0759956452537699824805835358067
        c2 = GAMMA_ROS3 * 9.2076794298330791242156818474003
        ht = h * 2.1851380027664058511513169485832
        right_y = hg * (fy + ht * ty) + (c1 * y1 + c2 * y2)
        y3, w3 = times(solve, right_y, hg * (fw + ht * tw) + (c1 * w1 + c2 * w2))
        m2, m3 = 6.1697947043828245592553615689730, -0.4277225654321857332623837380651
        return y + (y1 + m2 * y2 + m3 * y3), w + (w1 + m2 * w2 + m3 * w3)

    @compiled
    def rodas3(p: Parameters, y: float, w: float, m: Motions, h: float) -> State:
        """RODAS3 of Sandu et al. 1997: third order, stiffly accurate, three rates."""
        hg = h * 0.5
        fy, fw, ty, tw, w_by_y, w_by_w = linearised(p, y, w, m)
        solve = inverted(p, hg, w_by_y, w_by_w)
        y1, w1 = times(solve, hg * (fy + hg * ty), hg * (fw + hg * tw))
        ht = h * 1.5
        y2, w2 = times(solve, hg * (fy + ht * ty) + 2.0 * y1, hg * (fw + ht * tw) + 2.0 * w1)
        y, w = y + 2.0 * y1, w + 2.0 * w1
        past_y, past_w = 0.5 * (y1 - y2), 0.5 * (w1 - w2)
        fy, fw = rate(p, y, w, m[3], m[4])
        y3, w3 = times(solve, hg * fy + past_y, hg * fw + past_w)
        y, w = y + y3, w + w3
        fy, fw = rate(p, y, w, m[3], m[4])
        last = 4.0 / 3.0
        y4, w4 = times(solve, hg * fy + (past_y - last * y3), hg * fw + (past_w - last * w3))
        return y + y4, w + w4

    @compiled
    def exponential(p: Parameters, y: float, w: float, m: Motions, h: float) -> State:
        """Exponential Rosenbrock-Euler in w, Heun's step in y: second order, one rate."""
        fy, fw, _, tw, w_by_y, w_by_w = linearised(p, y, w, m)
        z = h * w_by_w
        # (e^z - 1)/z and (e^z - 1 - z)/z^2 cancel near z = 0, where their series serve.
        small = abs(z) < 1e-2
        away = 1.0 if small else z
        inverse = 1.0 / away
        tail = 1.0 / 6.0 + z * (1.0 / 24.0)
        first = 1.0 + z * (0.5 + z * tail) if small else (exp(away) - 1.0) * inverse
        second = 0.5 + z * tail if small else (first - 1.0) * inverse
        w_end = w + h * (first * fw + h * second * (tw + w_by_y * fy))
        y_rate = p[2] * w_end + (p[0] * m[4] + p[1] * (m[3] - (y + h * fy)))
        return y + 0.5 * h * (fy + y_rate), w_end

    @compiled
    def travelled(p: Parameters, w: float, travel: float) -> float:
        """W after x - y has moved by `travel` without turning, for n = 2 and sigma = 1/2: exact.

        Unloading is a straight line down to w = 0, loading a tanh from there.
        """
        q = w if travel > 0.0 else -w
        t = p[3] * abs(travel)
        line = -q if q < 0.0 else 0.0
        line = line if line < t else t
        q = q + line
        e = exp(-2.0 * (t - line))
        rise = (1.0 - e) / (1.0 + e)
        q = (q + rise) / (1.0 + q * rise)
        return q if travel > 0.0 else -q

    @compiled
    def exact_loop(p: Parameters, y: float, w: float, m: Motions, h: float) -> State:
        """Heun's step in y over the exact loop, its travel split where g, taken as linear, turns."""
        y_start = p[2] * w + (p[0] * m[1] + p[1] * (m[0] - y))
        g_start = m[1] - y_start
        w_end = travelled(p, w, (m[3] - m[0]) - h * y_start)
        y_end = p[2] * w_end + (p[0] * m[4] + p[1] * (m[3] - (y + h * y_start)))
        g_end = m[4] - y_end
        change = 0.5 * h * (y_start + y_end)
        travel = (m[3] - m[0]) - change
        turns = (g_start > 0.0) != (g_end > 0.0)
        fall = g_start - g_end if turns else 1.0
        forth = 0.5 * h * (g_start * g_start) / fall if turns else travel
        w = travelled(p, w, forth)
        return y + change, travelled(p, w, travel - forth)

    return {
        "rk4": rk4,
        "ros2": ros2,
        "ros3": ros3,
        "rodas3": rodas3,
        "exponential": exponential,
        "exact_loop": exact_loop,
    }
