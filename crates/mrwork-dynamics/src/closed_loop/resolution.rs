//! Integration step of a run: from the natural frequencies of the building, from the slopes of the damper force, and from
//! the relaxation rate of the damper states under the simulated motion.

use super::batch::Batch;
use super::hardware::Hardware;
use crate::building::{Building, Springs};
use crate::coupled::{UNLOADING, added_rates, relaxation_bound};
use crate::damper::fastest_relaxation;
use crate::damper::model::Severity;
use crate::integrate::{MAX_SUBSTEPS, RESOLUTION};

/// Steps per sample for a rate bound [1/s]: the steps of the hardware times a power of two; `None` beyond the largest.
pub(super) fn steps_for(hardware: &Hardware, bound: f64) -> Option<u32> {
    let wanted = hardware.sample_time * bound / RESOLUTION;
    let mut steps = hardware.steps;
    while f64::from(steps) < wanted {
        steps *= 2;
        if steps > MAX_SUBSTEPS * hardware.steps {
            return None;
        }
    }
    wanted.is_finite().then_some(steps)
}

/// What dampers and passive elements add to the largest rate of the building.
pub(super) struct Addition {
    /// Of their stiffness [1/s2].
    stiffening: f64,
    /// Of their damping [1/s].
    decay: f64,
}

impl Addition {
    /// Largest rate [1/s] of the building with the dampers, without the dampers' own states.
    pub(super) fn rate_with(&self, springs: &Springs) -> f64 {
        springs.fastest.hypot(self.stiffening.sqrt()) + self.decay
    }
}

/// What the dampers of a draw and the passive elements add to the rate of the building.
pub(super) fn addition_of(batch: &Batch<'_>, draw: usize) -> Addition {
    let (mut stiffening, decay) = added_rates(batch.dampers, draw, batch.ranges, &batch.building.device_mass);
    for (element, &mass) in batch.building.element_parameters.iter().zip(&batch.building.element_mass) {
        stiffening += element.yield_force * element.slope / mass;
    }
    Addition { stiffening, decay }
}

/// Largest relaxation rate of the damper states [1/s] under the simulated motion; that of dampers that are watched is
/// `fastest` of each device.
pub(super) fn damper_bound(
    batch: &Batch<'_>,
    draw: usize,
    severity: &[[f64; 2]],
    fastest: &[f64],
    step: f64,
) -> f64 {
    let bound = relaxation_bound(batch.dampers, draw, batch.ranges, |device| {
        let [peak_velocity, change] = severity[device];
        Severity { peak_velocity, reversal_acceleration: change / step }
    });
    // A bound that is not a number is kept.
    fastest.iter().fold(bound, |bound, &own| if own > bound { own } else { bound })
}

/// Largest rate of the passive elements [1/s] under the simulated motion: that of a loop, or of a loss of head.
pub(super) fn element_bound(building: &Building, springs: &Springs, severity: &[[f64; 2]], step: f64) -> f64 {
    let mut bound: f64 = 0.0;
    for (index, &[peak_velocity, change]) in severity.iter().enumerate() {
        let element = building.element_parameters[index];
        let severity = Severity { peak_velocity, reversal_acceleration: change / step };
        let yielding = if element.yield_force > 0.0 {
            fastest_relaxation(element.slope, UNLOADING, element.sharpness, severity)
        } else {
            0.0
        };
        let losing = 2.0 * element.head_loss * peak_velocity / building.element_mass[index];
        bound = bound.max(yielding).max(losing + springs.fastest);
    }
    bound
}
