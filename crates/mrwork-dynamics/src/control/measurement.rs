//! What a control law is given at a sample.

use super::force_curve::ForceCurve;
use crate::building::SparseRows;
use crate::ground_motion::GroundMotion;
use crate::lanes::Lanes;
use crate::real::Real;

/// Input of a control law at a sample.
pub(crate) struct Measurement<'a, R: Real> {
    /// Displacements of the coordinates, true or estimated.
    pub(crate) displacement: &'a [R],
    /// Their velocities.
    pub(crate) velocity: &'a [R],
    /// Elongation of each device [m].
    pub(crate) deformation: &'a [R],
    /// Its rate [m/s].
    pub(crate) rate: &'a [R],
    /// Force with which each device resists [N].
    pub(crate) force: &'a [R],
    /// Absolute acceleration of each floor [m/s^2]; zero where the law does not read them.
    pub(crate) acceleration: &'a [R],
    /// Drift of each measured storey [m].
    pub(crate) drift: &'a [R],
    /// Rows x of the absolute motion that laws read for each device: of its sprung mass, else its elongation.
    pub(crate) absolute: &'a SparseRows,
    /// Whether each device has a sprung mass.
    pub(crate) has_sprung: &'a [bool],
    /// Weights of the floors' accelerations that add up to `x (q'' + r a_g)` of each device.
    pub(crate) device_floors: Option<&'a SparseRows>,
    /// Acceleration of the ground [m/s^2].
    pub(crate) ground_acceleration: R,
    /// Velocity of the ground [m/s].
    pub(crate) ground_velocity: R,
    /// Displacement of the coordinates per displacement of the ground: r.
    pub(crate) influence: &'a [f64],
    /// Velocity of the ground that the state of gains has in it [m/s], zero in lanes where that is relative; none if all are.
    pub(crate) state_ground: Option<R>,
    /// What is known of the ground ahead.
    pub(crate) preview: Preview<'a>,
    /// Displacement of these rows per displacement of the ground: x r.
    pub(crate) ground_reach: &'a [f64],
    /// Largest command of each device.
    pub(crate) largest: &'a [f64],
    /// Damper force as a function of the command, one per device, if the law needs it.
    pub(crate) curves: &'a [ForceCurve<R>],
    /// Sampling interval [s].
    pub(crate) sample_time: f64,
    /// Commands that were sent at the sample before, after limits and faults.
    pub(crate) sent: &'a [R],
}

/// Ground accelerations that a law is told before they come.
#[derive(Clone, Copy)]
pub(crate) struct Preview<'a> {
    /// Ground motion of each lane; lanes beyond have the last.
    pub(crate) motions: &'a [&'a GroundMotion],
    /// Present time [s].
    pub(crate) now: f64,
    /// Time that is known ahead, zero for none [s].
    pub(crate) reach: f64,
    /// Integration step of the hardware [s].
    pub(crate) step: f64,
}

impl Preview<'_> {
    /// Whether the acceleration at a time ahead is known [s].
    #[inline(always)]
    pub(crate) fn reaches(&self, ahead: f64) -> bool {
        self.reach > 0.0 && ahead <= self.reach * (1.0 + 1e-9)
    }

    /// Acceleration at a time ahead [m/s^2].
    #[inline(always)]
    pub(crate) fn acceleration<R: Lanes>(&self, ahead: f64) -> R {
        let last = self.motions.len() - 1;
        R::from_fn(|lane| self.motions[lane.min(last)].reading(self.now + ahead, self.step))
    }
}

impl<R: Real> Measurement<'_, R> {
    /// Absolute velocity `x (q' + r v_g)`: of the sprung mass, else of the upper end of a device less that of its lower.
    #[inline(always)]
    pub(crate) fn absolute_rate(&self, device: usize) -> R {
        let relative = if self.has_sprung[device] {
            self.absolute.dot(device, self.velocity)
        } else {
            self.rate[device]
        };
        R::splat(self.ground_reach[device]).mul_add(self.ground_velocity, relative)
    }

    /// Absolute acceleration `x (q'' + r a_g)` of the same.
    #[inline(always)]
    pub(crate) fn absolute_acceleration(&self, device: usize) -> R {
        match self.device_floors {
            Some(floors) => floors.dot(device, self.acceleration),
            None => R::splat(f64::NAN),
        }
    }
}

/// Displacement of the rows of each device per displacement of the ground: x r.
pub(crate) fn ground_reach(absolute: &SparseRows, influence: &[f64]) -> Vec<f64> {
    (0..absolute.len()).map(|device| absolute.dot(device, influence)).collect()
}

impl<R: Real> Measurement<'_, R> {
    /// F0, G, H of a device at the measured motion.
    #[inline(always)]
    pub(crate) fn parabola(&self, device: usize) -> [R; 3] {
        self.curves[device].parabola(self.deformation[device], self.rate[device])
    }

    /// The least command with which a device exerts this force at the measured motion, as nearly as it can.
    #[inline(always)]
    pub(crate) fn inverse(&self, device: usize, desired: R) -> R {
        self.curves[device].inverse(self.deformation[device], self.rate[device], desired)
    }

    /// The command that minimises `sigma` times the force of a device at the measured motion.
    #[inline(always)]
    pub(crate) fn minimiser(&self, device: usize, sigma: R) -> R {
        self.curves[device].minimiser(self.deformation[device], self.rate[device], sigma)
    }
}
