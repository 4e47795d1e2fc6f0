//! What is kept of a run: peaks, means of squares, energies. Memory does not grow with the record.

use crate::building::Building;
use crate::lanes::{Apart, Lanes};
use crate::real::Real;

/// Quantities of a run in the order in which they are handed out, with how many numbers each has.
#[must_use]
pub fn layout(building: &Building) -> Vec<(&'static str, usize)> {
    let (floors, storeys, devices) = (building.n_floors(), building.n_storeys(), building.n_devices());
    vec![
        ("peak_displacement", floors),
        ("rms_displacement", floors),
        ("peak_acceleration", floors),
        ("rms_acceleration", floors),
        ("peak_drift", storeys),
        ("rms_drift", storeys),
        ("peak_base_shear", 1),
        ("rms_base_shear", 1),
        ("peak_force", devices),
        ("rms_force", devices),
        ("peak_stroke", devices),
        ("peak_rate", devices),
        ("peak_current", devices),
        ("mean_current", devices),
        ("rms_current", devices),
        ("device_energy", devices),
        ("input_energy", 1),
        ("kinetic_energy", 1),
        ("strain_energy", 1),
        ("damping_energy", 1),
        ("energy_error", 1),
    ]
}

/// A magnitude and its square over time.
struct Extent<R> {
    peak: Vec<R>,
    squares: Vec<R>,
}

impl<R: Real> Extent<R> {
    fn new(count: usize) -> Self {
        Self { peak: vec![R::splat(0.0); count], squares: vec![R::splat(0.0); count] }
    }

    #[inline(always)]
    fn take(&mut self, index: usize, value: R) {
        let peak = self.peak[index];
        self.peak[index] = larger(peak, value.abs());
        self.squares[index] = value.mul_add(value, self.squares[index]);
    }
}

/// The larger of the two; `value` where it is not a number.
#[inline(always)]
fn larger<R: Real>(before: R, value: R) -> R {
    R::select(value.less(before), before, value)
}

/// Running reductions of a block of lanes.
pub(super) struct Reductions<R> {
    displacement: Extent<R>,
    acceleration: Extent<R>,
    drift: Extent<R>,
    base_shear: Extent<R>,
    force: Extent<R>,
    stroke: Vec<R>,
    rate: Vec<R>,
    /// Rate at the step before.
    last_rate: Vec<R>,
    /// Largest change of the rate in a step with which it changed sign.
    reversal: Vec<R>,
    current: Extent<R>,
    current_sum: Vec<R>,
    /// Work of each device [J].
    pub(super) device_work: Vec<R>,
    /// Work of the ground [J].
    pub(super) input: R,
    /// Work of the building's own damping [J].
    pub(super) damping: R,
    kinetic: R,
    strain: R,
    /// Largest imbalance, and largest energy to compare it with [J].
    imbalance: R,
    turnover: R,
    steps: usize,
}

impl<R: Lanes> Reductions<R> {
    pub(super) fn new(building: &Building) -> Self {
        let (floors, storeys, devices) = (building.n_floors(), building.n_storeys(), building.n_devices());
        let zero = R::splat(0.0);
        Self {
            displacement: Extent::new(floors),
            acceleration: Extent::new(floors),
            drift: Extent::new(storeys),
            base_shear: Extent::new(1),
            force: Extent::new(devices),
            stroke: vec![zero; devices],
            rate: vec![zero; devices],
            last_rate: vec![zero; devices],
            reversal: vec![zero; devices],
            current: Extent::new(devices),
            current_sum: vec![zero; devices],
            device_work: vec![zero; devices],
            input: zero,
            damping: zero,
            kinetic: zero,
            strain: zero,
            imbalance: zero,
            turnover: zero,
            steps: 0,
        }
    }

    /// The numbers of a lane, in the order of [`layout`].
    pub(super) fn of_lane(&self, lane: usize, row: &mut Vec<f64>) {
        #[allow(clippy::cast_precision_loss)] // steps are far below 2^53
        let steps = self.steps as f64;
        let mut put = |values: &[R], finish: fn(f64, f64) -> f64| {
            for value in values {
                value.for_each(|index, value| {
                    if index == lane {
                        row.push(finish(value, steps));
                    }
                });
            }
        };
        let plain: fn(f64, f64) -> f64 = |value, _| value;
        let mean: fn(f64, f64) -> f64 = |sum, steps| sum / steps;
        let root_mean: fn(f64, f64) -> f64 = |sum, steps| (sum / steps).sqrt();
        for extent in [&self.displacement, &self.acceleration, &self.drift, &self.base_shear, &self.force] {
            put(&extent.peak, plain);
            put(&extent.squares, root_mean);
        }
        put(&self.stroke, plain);
        put(&self.rate, plain);
        put(&self.current.peak, plain);
        put(&self.current_sum, mean);
        put(&self.current.squares, root_mean);
        put(&self.device_work, plain);
        put(&[self.input, self.kinetic, self.strain, self.damping], plain);
        let at_rest = self.turnover.equal(R::splat(0.0));
        put(&[R::select(at_rest, R::splat(0.0), self.imbalance / self.turnover)], plain);
    }

    /// Largest rate of a device in a lane [m/s], and largest change of it in a step with which it changed sign.
    pub(super) fn severity(&self, device: usize, lane: usize) -> [f64; 2] {
        let mut found = [f64::NAN; 2];
        for (value, values) in found.iter_mut().zip([self.rate[device], self.reversal[device]]) {
            values.for_each(|index, number| {
                if index == lane {
                    *value = number;
                }
            });
        }
        found
    }
}

/// Takes the start of an integration step.
pub(super) struct Take<'a, R> {
    pub(super) building: &'a Building,
    pub(super) displacement: &'a [R],
    pub(super) velocity: &'a [R],
    pub(super) acceleration: &'a [R],
    pub(super) force: &'a [R],
    pub(super) current: &'a [R],
    pub(super) ground_acceleration: R,
    pub(super) into: &'a mut Reductions<R>,
}

impl<R: Lanes> Apart for Take<'_, R> {
    #[inline(always)]
    fn run(self) {
        let Self { building, displacement, velocity, acceleration, force, current, into, .. } = self;
        for floor in 0..building.n_floors() {
            into.displacement.take(floor, building.floors.dot(floor, displacement));
            let absolute = building.floors.add_dot(floor, acceleration, self.ground_acceleration);
            into.acceleration.take(floor, absolute);
        }
        for storey in 0..building.n_storeys() {
            into.drift.take(storey, building.storeys.dot(storey, displacement));
        }
        let mut shear = self.ground_acceleration * R::splat(building.total_mass);
        for (&mass, &acceleration) in building.pushed_mass.iter().zip(acceleration) {
            shear = acceleration.mul_add(R::splat(mass), shear);
        }
        into.base_shear.take(0, shear);
        for device in 0..force.len() {
            into.force.take(device, force[device]);
            into.stroke[device] =
                larger(into.stroke[device], building.devices.dot(device, displacement).abs());
            let rate = building.devices.dot(device, velocity);
            into.rate[device] = larger(into.rate[device], rate.abs());
            let before = into.last_rate[device];
            let turned = (rate * before).less(R::splat(0.0));
            let change = R::select(turned, (rate - before).abs(), R::splat(0.0));
            into.reversal[device] = larger(into.reversal[device], change);
            into.last_rate[device] = rate;
            into.current.take(device, current[device]);
            into.current_sum[device] = into.current_sum[device] + current[device];
        }
        into.steps += 1;
    }
}

/// Draws up the balance of energies now.
pub(super) struct Balance<'a, R> {
    pub(super) building: &'a Building,
    pub(super) displacement: &'a [R],
    pub(super) velocity: &'a [R],
    pub(super) into: &'a mut Reductions<R>,
}

impl<R: Lanes> Apart for Balance<'_, R> {
    #[inline(always)]
    fn run(self) {
        let Self { building, displacement, velocity, into } = self;
        let (mut kinetic, mut strain) = (R::splat(0.0), R::splat(0.0));
        for coordinate in 0..building.n {
            kinetic = building.mass.dot(coordinate, velocity).mul_add(velocity[coordinate], kinetic);
            let force = building.stiffness.dot(coordinate, displacement);
            strain = force.mul_add(displacement[coordinate], strain);
        }
        into.kinetic = kinetic * R::splat(0.5);
        into.strain = strain * R::splat(0.5);
        let held = into.kinetic + into.strain;
        let mut lost = into.damping;
        let mut turned_over = into.damping.abs();
        for &work in &into.device_work {
            lost = lost + work;
            turned_over = turned_over + work.abs();
        }
        let imbalance = (into.input - held - lost).abs();
        into.imbalance = larger(into.imbalance, imbalance);
        into.turnover = larger(into.turnover, larger(into.input.abs(), turned_over + held));
    }
}
