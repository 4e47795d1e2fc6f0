//! The controller's model of its damper: force as a function of the command at the measured motion.

use super::Measurement;
use crate::current_law::CurrentLaws;
use crate::damper::model::{DamperModel, Motion};
use crate::damper::static_hysteretic::StaticHysteretic;
use crate::elementary::tanh;
use crate::error::DynamicsError;
use crate::parameters::FromSlice;
use crate::real::Real;

/// A static hysteretic model with current laws. It has no internal state, so a controller can evaluate it.
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
    /// If their number differs from that of the laws.
    pub fn new(laws: &'a CurrentLaws, theta: &'a [f64]) -> Result<Self, DynamicsError> {
        let (found, expected) = (theta.len(), laws.n_columns());
        if found != expected {
            let model = StaticHysteretic::SPEC.name;
            return Err(DynamicsError::ParameterCount { model, found, expected });
        }
        Ok(Self { laws, theta })
    }

    /// The curve of one device.
    pub(crate) fn curve<R: Real>(&self, largest: f64, mounting: Mounting) -> ForceCurve<R> {
        let at = |command: f64| {
            let mut values = vec![f64::NAN; self.laws.n_params()];
            self.laws.evaluate(self.theta, command, &mut values);
            let values: Vec<R> = values.into_iter().map(R::splat).collect();
            Parameters::from_slice(&values)
        };
        let at = [at(0.0), at(0.5 * largest), at(largest)];
        let one_side = at.iter().all(|p| R::all(p.x_s.equal(at[0].x_s)));
        ForceCurve { at, mounting, largest, one_side }
    }
}

/// Number and arrangement of the dampers of a device.
#[derive(Clone, Copy, Debug)]
pub struct Mounting {
    /// Dampers in parallel.
    pub count: f64,
    /// Whether the same number acts in opposition (a differential pair).
    pub differential: bool,
}

/// Force of a device at three commands: zero, half of the largest, the largest.
pub(crate) struct ForceCurve<R: Real> {
    at: [Parameters<R>; 3],
    mounting: Mounting,
    largest: f64,
    /// Whether `x_s` is the same at all three commands.
    one_side: bool,
}

impl<R: Real> ForceCurve<R> {
    /// Forces at zero, half of the largest, and the largest command.
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
            // Two in opposition: the model is odd except for its offset.
            let whole = if self.mounting.differential { (one - p.f0) * R::splat(2.0) } else { one };
            *force = whole * R::splat(self.mounting.count);
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

impl<R: Real> Measurement<'_, R> {
    /// F0, G, H of a device at the measured motion.
    #[inline(always)]
    pub(crate) fn parabola(&self, device: usize) -> [R; 3] {
        self.curves[device].parabola(self.deformation[device], self.rate[device])
    }
}
