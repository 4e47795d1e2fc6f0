"""The attribute `plot` of results as editors and checkers of types see it; `accessor.py` does the work."""

from typing import Generic, TypeVar

from . import of_buildings, of_fits, of_studies, of_tests

ResultT_co = TypeVar("ResultT_co", covariant=True)

class Plots(Generic[ResultT_co]):
    """Figures of a result: the functions of `mr.plots` that take it, by their names."""

    def __init__(self, result: ResultT_co) -> None: ...
    def _repr_html_(self) -> str | None: ...

    bands = of_fits.bands
    laws = of_fits.laws
    posterior = of_fits.posterior
    profiles = of_fits.profiles
    building = of_buildings.building
    damper_counts = of_studies.damper_counts
    energies = of_studies.energies
    fragility = of_studies.fragility
    fronts = of_studies.fronts
    ida = of_studies.ida
    pushover = of_buildings.pushover
    spectra = of_buildings.spectra
    storey_profiles = of_studies.storey_profiles
    suite_spectra = of_buildings.suite_spectra
    commands = of_tests.commands
    histories = of_tests.histories
    loops = of_tests.loops
    residuals = of_tests.residuals
