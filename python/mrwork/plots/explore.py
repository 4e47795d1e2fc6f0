"""Sliders over the parameters of a model with its loops, for notebooks; ipywidgets is imported here only."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any, ClassVar

import numpy as np
from matplotlib.figure import Figure

from mrwork.base.arguments import AnyArrayLike, NotNegative, checked
from mrwork.base.numbers import format_fixed
from mrwork.base.values import Floats
from mrwork.dampers.spec import DamperSpec, damper
from mrwork.errors import LibraryError, MrworkError, SettingError, SimulationError
from mrwork.identification.candidates import objective, simulate
from mrwork.identification.fit import Fit, SearchTrace
from mrwork.identification.identify import identify_with
from mrwork.identification.settings import FitSettings
from mrwork.plots import style
from mrwork.plots.canvas import png_bytes
from mrwork.plots.of_tests import loops, nominal_test
from mrwork.plots.style import with_unit
from mrwork.records.damper_test import DamperTest
from mrwork.uncertainty.bands.prediction import Prediction

# The motion without a test, as in Spencer et al. 1997.
_AMPLITUDE, _FREQUENCY, _PER_CYCLE = 0.015, 2.5, 400
_STEPS, _SIZE = 400, (8.0, 3.4)
_WIDTH, _PICTURE_WIDTH = "420px", "720px"


class Explorer:
    """Sliders, loops and a button of `mr.explore`; a notebook shows it.

    `sliders` are by parameter, `theta` are the parameters that they make, `lines` draw the model over displacement
    and velocity, and `fit` the last fit from these values, `None` before the first.
    """

    _made_by: ClassVar[str] = "mr.explore(model, test)"

    def __init__(self, spec: DamperSpec, test: DamperTest, theta: Floats | None, *, measured: bool) -> None:
        import ipywidgets

        self.spec, self.test = spec, test
        self.fit: Fit | None = None
        # While several sliders are set, nothing is drawn.
        self._is_setting = False
        self._objective = objective(spec, test)
        start = self._objective.theta(self._objective.start) if theta is None else theta
        self.sliders = {
            name: _slider(spec, name, float(start[spec.names.index(name)]), ends)
            for name, ends in zip(self._objective.names, self._objective.bounds, strict=True)
        }
        with style.drawn_in_style():
            self.figure = Figure(figsize=_SIZE, layout="constrained")
            left, right = self.figure.subplots(1, 2, sharey=True)
            drawn = Prediction(test=test, model_force=test.force)
            loops(drawn, left, legend=False)
            loops(drawn, right, over="velocity").set_ylabel("")
        self._unit = style.force_unit(float(np.abs(test.force).max()))
        self.lines = tuple(axes.get_lines()[-1] for axes in self.figure.axes)
        self._picture = ipywidgets.Image(format="png", layout=ipywidgets.Layout(width=_PICTURE_WIDTH))
        self._status = ipywidgets.Label()
        self.button = ipywidgets.Button(description="Fit from these values", disabled=not measured)
        self.button.on_click(self._fit)
        for slider in self.sliders.values():
            slider.observe(self._draw, names="value")
        controls = ipywidgets.VBox([*self.sliders.values(), self.button, self._status])
        self.widget = ipywidgets.HBox([controls, self._picture])
        self._draw()

    @property
    def theta(self) -> Floats:
        """The parameters of the sliders, with those that are held, shape (n_params,)."""
        return self._objective.theta([slider.value for slider in self.sliders.values()])

    @property
    def status(self) -> str:
        """The line below the button: how well the model agrees, or why there is no force."""
        return str(self._status.value)

    def _repr_mimebundle_(self, **options: Any) -> Any:
        return self.widget._repr_mimebundle_(**options)

    def _draw(self, _: object = None) -> None:
        if self._is_setting:
            return
        try:
            force = simulate(self.spec, self.theta, self.test)
            misfit = float(self._objective([slider.value for slider in self.sliders.values()]))
            self._status.value = f"fit {format_fixed(100.0 * (1.0 - misfit), 2)} %"
        except SimulationError as reason:
            force = np.full(self.test.n_time, np.nan)
            self._status.value = str(reason)
        for axes, line in zip(self.figure.axes, self.lines, strict=True):
            line.set_ydata(force * self._unit.factor)
            axes.relim()
            axes.autoscale_view()
        self._picture.value = png_bytes(self.figure)

    def _fit(self, _: object = None) -> None:
        start = dict(zip(self.spec.names, self.theta.tolist(), strict=True))
        self._status.value = "fitting ..."
        try:
            self.fit = identify_with(
                self.spec,
                self.test,
                FitSettings(starts=(start,)),
                warns=False,
                searched=(
                    self._objective.box,
                    SearchTrace(evaluations=(), best=(), median=(), stop_reason="given"),
                ),
            )
        except MrworkError as reason:
            self._status.value = str(reason)
            return
        self._is_setting = True
        # Without a driver's lag that the test does not show.
        for estimate in self.fit.estimates:
            if estimate.name in self.sliders:
                self.sliders[estimate.name].value = estimate.value
        self._is_setting = False
        self._draw()


@checked
def explore(
    model: DamperSpec | str,
    test: DamperTest | None = None,
    *,
    theta: AnyArrayLike | None = None,
    command: NotNegative | None = None,
) -> Explorer:
    """Sliders over the parameters of a model beside its loops on a test, and a button for a fit from their values.

    The sliders span the ranges in which an identification searches first. The fit is local; `mr.identify` also searches
    for other minima. It needs ipywidgets, of the extra `notebook`.

    Parameters
    ----------
    model
        A model or its name.
    test
        A test; by default the nominal force under 15 mm at 2.5 Hz, which nothing is fitted to.
    theta
        First values, in spec order, shape (n_params,); by default the nominal ones, with a test moved into the ranges.
    command
        Constant command of a model with current laws where there is no test, in its unit; zero by default.

    Returns
    -------
    Explorer
        What a notebook shows; `fit` is the last fit.

    Raises
    ------
    LibraryError
        If ipywidgets is not installed.
    SettingError
        If `theta` does not fit the model, or a command is given together with a test or to a model without laws.

    Examples
    --------
    >>> import mrwork as mr
    >>> explorer = mr.explore("bingham", mr.synthetic_test("spencer1997"))  # doctest: +SKIP
    >>> explorer.sliders["c0"].value = 2000.0  # doctest: +SKIP
    """
    if find_spec("ipywidgets") is None:
        raise LibraryError("exploring needs ipywidgets; run: pip install 'mrwork[notebook]'")
    spec = damper(model) if isinstance(model, str) else model
    if command is not None and (test is not None or spec.command_unit is None):
        raise SettingError(
            "`command` is for a model with current laws where there is no test; leave it out, or leave out `test`"
        )
    values = None if theta is None else np.asarray(theta, dtype=np.float64)
    if values is not None and values.shape != (len(spec.names),):
        raise SettingError(f"`theta` has shape {values.shape}, {spec.name} takes ({len(spec.names)},)")
    if test is not None:
        return Explorer(spec, test, values, measured=True)
    first = np.array(spec.nominal) if values is None else values
    nominal = nominal_test(
        spec, amplitude=_AMPLITUDE, frequency=_FREQUENCY, per_cycle=_PER_CYCLE, command=command or 0.0
    )
    return Explorer(spec, nominal, first, measured=False)


def _slider(spec: DamperSpec, name: str, value: float, ends: tuple[float, float]) -> Any:
    """A slider from bound to bound, or further where its first value lies outside; of powers on a logarithmic scale."""
    import ipywidgets

    parameter = spec.parameters[spec.names.index(name)]
    low, high, kind = min(ends[0], value), max(ends[1], value), ipywidgets.FloatSlider
    if parameter.scale == "log" and low > 0.0:
        # Rounded powers of ten must not shut out the bounds themselves.
        low, high, kind = np.log10(low) - 1e-9, np.log10(high) + 1e-9, ipywidgets.FloatLogSlider
    return kind(
        value=value,
        min=low,
        max=high,
        step=(high - low) / _STEPS,
        description=with_unit(name, parameter.unit),
        tooltip=parameter.description,
        readout_format=".4g",
        style={"description_width": "38%"},
        layout=ipywidgets.Layout(width=_WIDTH),
    )
