//! A damper whose motion is known at samples only, as on a rig: straight lines lie between them.

use crate::current_law::CurrentLaws;
use crate::damper::model::{DamperModel, Motion, State};
use crate::damper::{ModelVisitor, visit};
use crate::driver::{Driver, Following};

/// Motion and command at each sample.
#[derive(Clone, Copy)]
pub struct Samples<'a> {
    /// Displacement [m].
    pub displacement: &'a [f64],
    /// Velocity [m/s].
    pub velocity: &'a [f64],
    /// Command, held until the next sample.
    pub command: &'a [f64],
}

impl Samples<'_> {
    fn motion(&self, sample: usize) -> Motion<f64> {
        Motion { displacement: self.displacement[sample], velocity: self.velocity[sample] }
    }
}

struct Straight<'a> {
    theta: &'a [f64],
    laws: &'a CurrentLaws,
    samples: Samples<'a>,
    dt: f64,
    substeps: u32,
}

/// The motion at a share of the way between two.
fn between(from: Motion<f64>, to: Motion<f64>, share: f64) -> Motion<f64> {
    let on_line = |from: f64, to: f64| share.mul_add(to - from, from);
    Motion {
        displacement: on_line(from.displacement, to.displacement),
        velocity: on_line(from.velocity, to.velocity),
    }
}

impl ModelVisitor<Vec<f64>> for Straight<'_> {
    fn visit<M: DamperModel + 'static>(self, model: M) -> Vec<f64> {
        let Self { theta, laws, samples, dt, substeps } = self;
        let step = dt / f64::from(substeps);
        let mut driver = Following::<M, f64>::new(model, laws, theta.to_vec(), samples.command, step);
        let mut state = M::State::<f64>::splat(0.0);
        let mut force = Vec::with_capacity(samples.command.len());
        for sample in 0..samples.command.len() {
            let now = samples.motion(sample);
            driver.begin(sample);
            force.push(M::force(driver.parameters(), state, now));
            if sample + 1 == samples.command.len() {
                break;
            }
            let next = samples.motion(sample + 1);
            let per = 1.0 / f64::from(substeps);
            for substep in 0..substeps {
                let first = f64::from(substep) * per;
                let motions = [first, first + 0.5 * per, first + per].map(|share| between(now, next, share));
                state = M::step::<f64, f64, false>(driver.step(), state, motions, step);
            }
        }
        force
    }
}

/// Forces [N] at samples `dt` [s] apart, with straight lines between the motions at them; `theta` has a value for each column of
/// the laws. `None` where no damper has that name.
#[must_use]
pub fn straight_forces(
    name: &str,
    theta: &[f64],
    laws: &CurrentLaws,
    samples: Samples<'_>,
    dt: f64,
    substeps: u32,
) -> Option<Vec<f64>> {
    visit(name, Straight { theta, laws, samples, dt, substeps })
}
