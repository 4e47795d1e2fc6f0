"""The function `mr.simulate`, under whose name the module `mrwork.simulation` was imported before.

The import system would put this module in the place of the function, so the function takes the module's place, and has
the names that the module had.
"""

from __future__ import annotations

import sys

from mrwork.identification.candidates import simulate as simulate
from mrwork.simulation import ForceHistories as ForceHistories
from mrwork.simulation import Loading as Loading
from mrwork.simulation import Misfits as Misfits
from mrwork.simulation import Outcome as Outcome
from mrwork.simulation import Sensitivities as Sensitivities
from mrwork.simulation import core_refusals as core_refusals
from mrwork.simulation import simulate_force as simulate_force
from mrwork.simulation import simulate_forces as simulate_forces
from mrwork.simulation import simulate_misfits as simulate_misfits
from mrwork.simulation import simulate_sensitivities as simulate_sensitivities
from mrwork.simulation import stiffness_shares as stiffness_shares

vars(simulate).update({name: each for name, each in globals().items() if callable(each)})
sys.modules[__name__] = simulate  # type: ignore[assignment] # a function in the place of a module
