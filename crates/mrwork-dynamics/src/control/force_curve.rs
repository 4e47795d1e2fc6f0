//! The controller's model of its damper: force as a function of the command at the measured motion.

use crate::coupled::Mounting;
use crate::current_law::CurrentLaws;
use crate::damper::model::{DamperModel, Motion};
use crate::damper::static_hysteretic::StaticHysteretic;
use crate::elementary::tanh;
use crate::error::DynamicsError;
use crate::parameters::FromSlice;
use crate::real::{Real, if_known, within};

/// Number of commands at which the force is tabulated, evenly spaced from zero to the largest; odd, for the middle one.
const NODES: usize = 17;
/// Steps of the root finder in the piece between two of them.
const STEPS: usize = 5;
const PARAMETERS: usize = StaticHysteretic::SPEC.parameters.len();

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
    #[allow(clippy::cast_precision_loss)] // few nodes
    pub(crate) fn curve<R: Real>(&self, largest: f64, mounting: Mounting) -> ForceCurve<R> {
        let mut columns: Vec<R> = self.theta.iter().map(|&value| R::splat(value)).collect();
        self.laws.prepare(&mut columns);
        let nodes: Vec<Node<R>> = (0..NODES)
            .map(|node| {
                let command = R::splat(largest * node as f64 / (NODES - 1) as f64);
                Node { command, at: parameters_at(self.laws, &columns, command) }
            })
            .collect();
        let one_side = nodes.iter().all(|node| R::all(node.at.x_s.equal(nodes[0].at.x_s)));
        ForceCurve { laws: self.laws.clone(), columns, nodes, mounting, largest, one_side }
    }
}

/// Parameters of the model at a command.
#[inline(always)]
fn parameters_at<R: Real>(laws: &CurrentLaws, columns: &[R], command: R) -> Parameters<R> {
    let mut values = [R::splat(f64::NAN); PARAMETERS];
    laws.evaluate(columns, command, &mut values);
    Parameters::from_slice(&values)
}

/// Parameters of the model at one of the tabulated commands.
struct Node<R: Real> {
    command: R,
    at: Parameters<R>,
}

/// Force of a device as a function of the command.
pub(crate) struct ForceCurve<R: Real> {
    laws: CurrentLaws,
    /// Prepared.
    columns: Vec<R>,
    nodes: Vec<Node<R>>,
    mounting: Mounting,
    largest: f64,
    /// Whether `x_s` is the same at all commands.
    one_side: bool,
}

impl<R: Real> ForceCurve<R> {
    /// Forces at the tabulated commands.
    #[inline(always)]
    fn table(&self, deformation: R, rate: R) -> [R; NODES] {
        let motion = Motion { displacement: deformation, velocity: rate };
        let mut forces = [R::splat(0.0); NODES];
        let mut side = tanh(deformation * self.nodes[0].at.per_x_s);
        for (force, node) in forces.iter_mut().zip(&self.nodes) {
            if !self.one_side {
                side = tanh(deformation * node.at.per_x_s);
            }
            *force = self.whole(&node.at, side, motion);
        }
        forces
    }

    /// Force of all dampers of the device.
    #[inline(always)]
    fn whole(&self, p: &Parameters<R>, side: R, motion: Motion<R>) -> R {
        let one = StaticHysteretic::force_on_side(p, side, motion);
        // Two in opposition: the model is odd except for its offset.
        let whole = if self.mounting.differential { (one - p.f0) * R::splat(2.0) } else { one };
        whole * R::splat(self.mounting.count)
    }

    /// Forces at zero, half of the largest, and the largest command.
    #[inline(always)]
    pub(crate) fn points(&self, deformation: R, rate: R) -> [R; 3] {
        let motion = Motion { displacement: deformation, velocity: rate };
        let mut forces = [R::splat(0.0); 3];
        let mut side = tanh(deformation * self.nodes[0].at.per_x_s);
        for (point, force) in forces.iter_mut().enumerate() {
            let p = &self.nodes[point * (NODES - 1) / 2].at;
            if !self.one_side {
                side = tanh(deformation * p.per_x_s);
            }
            *force = self.whole(p, side, motion);
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

    /// The least command with this force; if there is none, the command whose force is nearest to it.
    ///
    /// The first piece between two tabulated commands over which the force passes through `desired` holds the root, which
    /// the Illinois method finds with the model itself (Dowell, Jarratt, BIT 11, 1971, 168-174).
    #[inline(always)]
    pub(crate) fn inverse(&self, deformation: R, rate: R, desired: R) -> R {
        let zero = R::splat(0.0);
        let forces = self.table(deformation, rate);
        let mut bracketed = zero;
        let (mut from, mut to) = (zero, zero);
        let (mut error_from, mut error_to) = (forces[0] - desired, forces[0] - desired);
        for (pair, force) in self.nodes.windows(2).zip(forces.windows(2)) {
            let (before, after) = (force[0] - desired, force[1] - desired);
            let crosses = R::select(zero.less(before * after), zero, R::splat(1.0));
            let first = R::select(zero.less(bracketed), zero, crosses);
            let taken = zero.less(first);
            from = R::select(taken, pair[0].command, from);
            to = R::select(taken, pair[1].command, to);
            error_from = R::select(taken, before, error_from);
            error_to = R::select(taken, after, error_to);
            bracketed = bracketed + first;
        }
        let motion = Motion { displacement: deformation, velocity: rate };
        for _ in 0..STEPS {
            let command = secant(from, to, error_from, error_to);
            let p = parameters_at(&self.laws, &self.columns, command);
            let error = self.whole(&p, tanh(deformation * p.per_x_s), motion) - desired;
            let crossed = (error * error_to).less(zero);
            // The end that stays counts half the next time, so that both ends approach the root.
            error_from = R::select(crossed, error_to, error_from * R::splat(0.5));
            from = R::select(crossed, to, from);
            to = command;
            error_to = error;
        }
        let root = secant(from, to, error_from, error_to);
        let mut distance = [zero; NODES];
        for (distance, force) in distance.iter_mut().zip(forces) {
            *distance = (force - desired).abs();
        }
        let nearest = self.least(&distance);
        if_known(forces[0] + desired, R::select(zero.less(bracketed), root, nearest))
    }

    /// The command that minimises `sigma` times the force.
    #[inline(always)]
    pub(crate) fn minimiser(&self, deformation: R, rate: R, sigma: R) -> R {
        let forces = self.table(deformation, rate);
        let mut values = forces;
        for value in &mut values {
            *value = sigma * *value;
        }
        if_known(values[0], self.least(&values))
    }

    /// The command of the least of the tabulated values, between commands by the parabola through three of them.
    #[inline(always)]
    #[allow(clippy::cast_precision_loss)] // few nodes
    fn least(&self, values: &[R; NODES]) -> R {
        let last = NODES - 1;
        let step = R::splat(self.largest / last as f64);
        let (mut least, mut command) = (values[0], R::splat(0.0));
        for (node, &value) in values.iter().enumerate() {
            // Its vertex counts only within half a step of the least value.
            let centre = node.clamp(1, last - 1);
            let (before, middle, after) = (values[centre - 1], values[centre], values[centre + 1]);
            let bend = before - middle - middle + after;
            let vertex = R::splat(centre as f64) + (before - after) / (bend + bend);
            let lower = R::splat((node as f64 - 0.5).max(0.0));
            let upper = R::splat((node as f64 + 0.5).min(last as f64));
            let here =
                R::select(R::splat(0.0).less(bend), within(vertex, lower, upper), R::splat(node as f64));
            let better = if node == 0 { least.equal(value) } else { value.less(least) };
            command = R::select(better, here * step, command);
            least = R::select(better, value, least);
        }
        command
    }
}

/// Where the chord between two commands of opposite errors is zero; the first command where both have the same error.
#[inline(always)]
fn secant<R: Real>(from: R, to: R, error_from: R, error_to: R) -> R {
    let fall = error_from - error_to;
    let crossing = (error_to / fall).mul_add(to - from, to);
    R::select(fall.equal(R::splat(0.0)), from, crossing)
}
