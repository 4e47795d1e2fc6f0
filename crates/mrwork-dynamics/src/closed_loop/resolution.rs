//! How fine a step a run needs: from the building, from how steep the force is over the motion, and from how fast the
//! dampers' states relax under the motion that came out.

use super::batch::Batch;
use crate::damper::{Motion, Severity};
use crate::integrate::{MAX_SUBSTEPS, RESOLUTION};

/// Commands between none and the largest that are looked at.
const COMMAND_LEVELS: u32 = 9;
/// Motions at which the slope of the force is looked at, and how far it is moved for that.
const VELOCITIES: [f64; 9] = [0.0, 1e-3, -1e-3, 1e-2, -1e-2, 0.1, -0.1, 0.5, -0.5];
const DISPLACEMENTS: [f64; 5] = [0.0, 1e-4, -1e-4, 1e-2, -1e-2];
const SHIFT: f64 = 1e-7;

/// Steps per sample, a power of two times what the hardware names, that a bound [1/s] asks for; `None` beyond the most.
pub(super) fn steps_for(batch: &Batch<'_>, bound: f64) -> Option<u32> {
    let wanted = batch.hardware.sample_time * bound / RESOLUTION;
    let mut steps = batch.hardware.steps;
    while f64::from(steps) < wanted {
        steps *= 2;
        if steps > MAX_SUBSTEPS * batch.hardware.steps {
            return None;
        }
    }
    wanted.is_finite().then_some(steps)
}

/// Fastest motion [1/s] of the building with the dampers of a draw, as far as their force follows the motion at once.
pub(super) fn building_bound(batch: &Batch<'_>, draw: usize) -> f64 {
    let (mut decay, mut stiffening) = (0.0, 0.0);
    for (device, &mass) in batch.building.device_mass.iter().enumerate() {
        let [over_velocity, over_displacement] = steepest(batch, draw, device);
        let place = batch.places[device];
        let dampers = place.count * if place.differential { 2.0 } else { 1.0 };
        decay += dampers * over_velocity / mass;
        stiffening += dampers * over_displacement / mass;
    }
    batch.building.fastest.hypot(stiffening.sqrt()) + decay
}

/// Largest slopes of the force of a device, over velocity [N s/m] and over displacement [N/m].
fn steepest(batch: &Batch<'_>, draw: usize, device: usize) -> [f64; 2] {
    let mut values = vec![f64::NAN; batch.laws.n_params()];
    let state = vec![0.0; batch.damper.spec().n_states];
    let mut found = [0.0_f64; 2];
    for command in commands(batch, device) {
        batch.laws.evaluate(batch.theta_of(draw, device), command, &mut values);
        for velocity in VELOCITIES {
            for displacement in DISPLACEMENTS {
                let at = |displacement, velocity| {
                    batch.damper.force(&values, &state, Motion { displacement, velocity })
                };
                let here = at(displacement, velocity);
                let slopes =
                    [at(displacement, velocity + SHIFT) - here, at(displacement + SHIFT, velocity) - here];
                for (most, slope) in found.iter_mut().zip(slopes) {
                    *most = most.max((slope / SHIFT).abs());
                }
            }
        }
    }
    found
}

/// How fast the states of the dampers relax [1/s] under the motion that came out.
pub(super) fn damper_bound(batch: &Batch<'_>, draw: usize, severity: &[[f64; 2]], step: f64) -> f64 {
    let mut bound = 0.0;
    for (device, &[peak_velocity, change]) in severity.iter().enumerate() {
        let severity = Severity { peak_velocity, reversal_acceleration: change / step };
        let commands = commands(batch, device);
        let theta = batch.theta_of(draw, device);
        let own = batch.damper.stiffness_bound(theta, batch.laws, &commands, severity);
        // A bound that is not a number stays.
        if own > bound || own.is_nan() {
            bound = own;
        }
    }
    bound
}

fn commands(batch: &Batch<'_>, device: usize) -> Vec<f64> {
    let [smallest, largest] = batch.ranges[device];
    if batch.laws.are_constant() {
        return vec![smallest];
    }
    let spacing = (largest - smallest) / f64::from(COMMAND_LEVELS - 1);
    (0..COMMAND_LEVELS).map(|level| f64::from(level).mul_add(spacing, smallest)).collect()
}
