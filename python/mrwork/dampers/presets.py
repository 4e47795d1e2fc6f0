"""Published parameter sets, with the numbers of their papers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from mrwork.summary import Summarised


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class PublishedSet(Summarised):
    """A published set: for each parameter its value, or the coefficients of a polynomial in the command.

    `status` is "verified" if an independent simulation reproduced the results of the paper, "published" if the numbers
    are only quoted. The command is between 0 and `largest_command` in `unit`; `eta` [1/s] is the rate of the lag of the
    driver. A set without a command holds for the command in its `note`.
    """

    name: str
    model: str
    values: Mapping[str, float | tuple[float, ...]]
    source: str
    status: Literal["verified", "published"]
    unit: Literal["A", "V"] | None = None
    largest_command: float | None = None
    eta: float | None = None
    note: str = ""


_SPENCER = "Spencer, Dyke, Sain, Carlson, J. Eng. Mech. 123(3), 1997, 230-238"

PUBLISHED_SETS = (
    PublishedSet(
        name="spencer1997",
        model="bingham",
        values={"f_c": 670.0, "v_s": 1e-3, "c0": 5000.0, "f0": -95.0},
        source=_SPENCER,
        status="published",
        note="at 1.5 V; v_s is ours, the paper has sgn(v)",
    ),
    PublishedSet(
        name="spencer1997",
        model="bouc_wen",
        values={
            "c0": 5000.0,
            "k0": 2500.0,
            "x0": 0.038,
            "alpha": 88e3,
            "gamma": 1e6,
            "beta": 1e6,
            "A": 120.0,
            "n": 2.0,
        },
        source=_SPENCER,
        status="published",
        note="at 1.5 V",
    ),
    PublishedSet(
        name="jansen2000",
        model="bouc_wen",
        values={
            "c0": (0.64, 0.52),
            "k0": 0.0,
            "x0": 0.0,
            "alpha": (866.0, 886.0),
            "gamma": 3e6,
            "beta": 3e6,
            "A": 120.0,
            "n": 2.0,
        },
        source="Jansen, Dyke, J. Eng. Mech. 126(8), 2000, 795-803",
        status="verified",
        unit="V",
        largest_command=5.0,
        eta=190.0,
    ),
    PublishedSet(
        name="yoshida2004",
        model="bouc_wen",
        values={
            "c0": (440.0, 4400.0),
            "k0": 0.0,
            "x0": 0.0,
            "alpha": (1.0872e7, 4.9616e7),
            "gamma": 300.0,
            "beta": 300.0,
            "A": 1.2,
            "n": 1.0,
        },
        source="Yoshida, Dyke, J. Eng. Mech. 130(4), 2004",
        status="published",
        unit="V",
        largest_command=10.0,
        eta=50.0,
        note="a damper of 1000 kN",
    ),
    PublishedSet(
        name="dyke1996",
        model="modified_bouc_wen",
        values={
            "c0": (2100.0, 350.0),
            "k0": 4690.0,
            "c1": (28300.0, 295.0),
            "k1": 500.0,
            "x0": 0.143,
            "alpha": (14000.0, 69500.0),
            "gamma": 3.63e6,
            "beta": 3.63e6,
            "A": 301.0,
            "n": 2.0,
        },
        source="Dyke, Spencer, Sain, Carlson, Smart Mater. Struct. 5, 1996, 565-575",
        status="verified",
        unit="V",
        largest_command=2.25,
        eta=190.0,
        note="the prototype; in a building drop the constant force k1 x0. Stiff: the loop yields within 0.02 mm",
    ),
    PublishedSet(
        name="leva2002",
        model="modified_bouc_wen",
        values={
            "c0": (2020.0, 268.0),
            "k0": 1500.0,
            "c1": (35000.0, 7070.0),
            "k1": 537.0,
            "x0": 0.0,
            "alpha": (4490.0, 63800.0),
            "gamma": 3.93e5,
            "beta": 3.93e5,
            "A": 47.2,
            "n": 2.0,
        },
        source="Leva, Piroddi, Smart Mater. Struct. 11, 2002, 79",
        status="published",
        unit="V",
        largest_command=2.25,
        eta=251.0,
        note="the largest command is that of the same prototype in Dyke et al. 1996",
    ),
    PublishedSet(
        name="kwok2006",
        model="static_hysteretic",
        values={
            "c": (1232.0, 1929.0),
            "k": (5100.0, -1700.0),
            "alpha": (32.0, 918.0, -244.0),
            "beta": 100.0,
            "delta": (0.58, 0.30),
            "x_s": 1e-4,
            "f0": (57.0, -18.0),
        },
        source="Kwok, Ha, Nguyen, Li, Samali, Sens. Actuators A 132, 2006, 441-451",
        status="published",
        unit="A",
        largest_command=1.88,
        note="RD-1005-3; beyond 1.88 A alpha would fall again. x_s is ours, the paper has sgn(x)",
    ),
)
