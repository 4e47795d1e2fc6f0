//! What a controller believes of its damper: the force as a function of the command, at the motion of the moment.

use super::Seen;
use crate::current_law::CurrentLaws;
use crate::damper::{DamperModel, Motion, StaticHysteretic};
use crate::elementary::tanh;
use crate::error::DynamicsError;
use crate::parameters::FromSlice;
use crate::real::Real;

/// A static hysteretic model with current laws, which is what a controller can evaluate: it has no hidden state.
#[derive(Clone, Debug)]
pub struct CurveModel<'a> {
    laws: &'a CurrentLaws,
    theta: &'a [f64],
}

type Parameters<R> = <StaticHysteretic as DamperModel>::Parameters<R>;

impl<'a> CurveModel<'a> {
    /// One set of coefficients for all devices.
    ///
    /// # Errors
    /// Where their number differs from what the laws take.
    pub fn new(laws: &'a CurrentLaws, theta: &'a [f64]) -> Result<Self, DynamicsError> {
        let (found, expected) = (theta.len(), laws.n_columns());
        if found != expected {
            let model = StaticHysteretic::SPEC.name;
            return Err(DynamicsError::ParameterCount { model, found, expected });
        }
        Ok(Self { laws, theta })
    }

    /// The curve of one device.
    pub(crate) fn curve<R: Real>(&self, largest: f64, place: Place) -> ForceCurve<R> {
        let at = |command: f64| {
            let mut values = vec![f64::NAN; self.laws.n_params()];
            self.laws.evaluate(self.theta, command, &mut values);
            let values: Vec<R> = values.into_iter().map(R::splat).collect();
            Parameters::from_slice(&values)
        };
        let at = [at(0.0), at(0.5 * largest), at(largest)];
        let one_side = at.iter().all(|p| R::all(p.x_s.equal(at[0].x_s)));
        ForceCurve { at, place, largest, one_side }
    }
}

/// How dampers sit in a place: so many side by side, and as many again the other way round in a differential pair.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// Dampers that are elongated together.
    pub count: f64,
    /// Whether as many others are shortened by the same motion.
    pub differential: bool,
}

/// The force of a device at three commands: none, half, all.
pub(crate) struct ForceCurve<R: Real> {
    at: [Parameters<R>; 3],
    place: Place,
    largest: f64,
    /// Whether `x_s` is the same at all three.
    one_side: bool,
}

impl<R: Real> ForceCurve<R> {
    /// Forces at no command, half of the largest, and the largest.
    #[inline(always)]
    pub(crate) fn points(&self, deformation: R, rate: R) -> [R; 3] {
        let motion = Motion { displacement: deformation, velocity: rate };
        let mut forces = [R::splat(0.0); 3];
        let mut side = tanh(deformation * self.at[0].per_x_s);
        for (force, p) in forces.iter_mut().zip(&self.at) {
            if !self.one_side {
                side = tanh(deformation * p.per_x_s);
            }
            let one = StaticHysteretic::force_on_side(p, side, motion);
            // Two in opposition: the model is odd but for its offset.
            let whole = if self.place.differential { (one - p.f0) * R::splat(2.0) } else { one };
            *force = whole * R::splat(self.place.count);
        }
        forces
    }

    /// F0, G, H of the parabola F0 + G i + H i^2 through these points.
    #[inline(always)]
    pub(crate) fn parabola(&self, deformation: R, rate: R) -> [R; 3] {
        let [none, half, all] = self.points(deformation, rate);
        let bend = (all - half - half + none) * R::splat(2.0 / (self.largest * self.largest));
        let slope = (all - none) * R::splat(1.0 / self.largest) - bend * R::splat(self.largest);
        [none, slope, bend]
    }
}

impl<R: Real> Seen<'_, R> {
    /// F0, G, H of a device now.
    #[inline(always)]
    pub(crate) fn parabola(&self, device: usize) -> [R; 3] {
        self.curves[device].parabola(self.deformation[device], self.rate[device])
    }
}
