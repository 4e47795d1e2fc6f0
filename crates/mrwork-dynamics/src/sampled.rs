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

/// How a sub-step is divided by the speed of its motion, with the change of its velocity in a sample.
#[derive(Clone, Copy)]
pub struct Division<'a> {
    /// Largest speed [m/s] of an undivided sub-step, of one in halves, quarters and so on; empty where none is divided.
    pub speeds: &'a [f64],
    /// Share of a speed that counts in the next sub-step: what follows a fast motion is as fast.
    pub fading: f64,
}

impl Division<'_> {
    /// How often a sub-step is halved.
    fn halvings(&self, fastest: f64) -> usize {
        let finer = self.speeds.iter().take_while(|&&speed| fastest > speed).count();
        finer.min(self.speeds.len().saturating_sub(1))
    }
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
    division: Division<'a>,
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
        let Self { theta, laws, samples, dt, substeps, division } = self;
        let step = dt / f64::from(substeps);
        let mut driver = Following::<M, f64>::new(model, laws, theta.to_vec(), samples.command, step);
        let mut state = M::State::<f64>::splat(0.0);
        let mut force = Vec::with_capacity(samples.command.len());
        let (mut fastest, mut halved) = (0.0_f64, 0);
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
                let speed = motions.iter().fold(0.0_f64, |most, motion| most.max(motion.velocity.abs()));
                // A motion that turns within a sample is as fast as it would be before the next.
                let turn = f64::from(substeps) * (motions[2].velocity - motions[0].velocity).abs();
                fastest = (speed + turn).max(division.fading * fastest);
                let halvings = division.halvings(fastest);
                let count = 1_u32 << halvings;
                if halvings != halved {
                    halved = halvings;
                    driver.set_step(step / f64::from(count));
                }
                if count == 1 {
                    state = M::step::<f64, f64, false>(driver.step(), state, motions, step);
                    continue;
                }
                let (half, piece) = (count / 2, step / f64::from(count));
                for number in 0..count {
                    let place = usize::from(number >= half);
                    let first = f64::from(number % half) / f64::from(half);
                    let per = 1.0 / f64::from(half);
                    let motions = [first, first + 0.5 * per, first + per]
                        .map(|share| between(motions[place], motions[place + 1], share));
                    state = M::step::<f64, f64, false>(driver.step(), state, motions, piece);
                }
            }
        }
        force
    }
}

/// Forces [N] at samples `dt` [s] apart, with straight lines between the motions at them, and sub-steps divided by its speed; `theta` has a value for each column of
/// the laws. `None` where no damper has that name.
#[must_use]
pub fn straight_forces(
    name: &str,
    theta: &[f64],
    laws: &CurrentLaws,
    samples: Samples<'_>,
    dt: f64,
    substeps: u32,
    division: Division<'_>,
) -> Option<Vec<f64>> {
    visit(name, Straight { theta, laws, samples, dt, substeps, division })
}
