//! Reductions of a run: peaks, mean squares, energies. Memory does not grow with the length of the motion.

use super::quantity::{Axis, Quantity};
use crate::building::{Building, Shears};
use crate::coupled::{Energies, Plant, PlantMotion};
use crate::lanes::Lanes;
use crate::real::{OutOfLine, Real};

/// Declares the quantities of a run, each with its value over the reductions of a block: the table
/// [`RUN_QUANTITIES`], and `Reductions::quantities`, which has them in that order.
macro_rules! run_quantities {
    ($of:ident; $($name:ident: $axis:ident, $unit:literal, $description:literal, $finish:ident($values:expr);)+) => {
        /// Quantities of a run, in the order of its summary; accelerations are absolute.
        pub const RUN_QUANTITIES: &[Quantity] =
            &[$(Quantity::new(stringify!($name), Axis::$axis, $unit, $description),)+];

        impl<R: Lanes> Reductions<R> {
            /// The quantities in lanes, in that order.
            pub(super) fn quantities(&self) -> Vec<R> {
                let $of = self;
                #[allow(clippy::cast_precision_loss)] // steps are far below 2^53
                let steps = R::splat(self.steps as f64);
                let mut quantities = Vec::new();
                $(quantities.extend($values.iter().map(|&value| $finish(value, steps)));)+
                quantities
            }
        }
    };
}

run_quantities! {
    r;
    peak_displacement: Floor, "m", "peak displacement relative to the ground", last(r.displacement.peak);
    rms_displacement: Floor, "m", "root mean square displacement", root_mean(r.displacement.squares);
    peak_acceleration: Floor, "m/s^2", "peak absolute acceleration", last(r.acceleration.peak);
    rms_acceleration: Floor, "m/s^2", "root mean square absolute acceleration", root_mean(r.acceleration.squares);
    peak_drift: Storey, "m", "peak drift", last(r.drift.peak);
    rms_drift: Storey, "m", "root mean square drift", root_mean(r.drift.squares);
    peak_base_shear: Run, "N", "peak base shear, r'M(q'' + r a_g) less the forces on floors", last(r.base_shear.peak);
    rms_base_shear: Run, "N", "root mean square base shear", root_mean(r.base_shear.squares);
    peak_storey_shear: Storey, "N", "peak of the inertia of all above it less the forces there: shear of frame, dampers and damping", last(r.storey_shear);
    peak_frame_shear: Storey, "N", "peak shear of springs and elements alone, on which yield stands", last(r.frame_shear);
    peak_overturning: Storey, "N m", "peak overturning moment at its foot, from the shears above", last(r.overturning);
    residual_drift: Storey, "m", "drift at the end", last(r.residual_drift);
    storey_energy: Storey, "J", "energy dissipated by what of the frame yields, without what it holds at the end", last(r.storey_energy);
    peak_force: Device, "N", "peak force", last(r.force.peak);
    rms_force: Device, "N", "root mean square force", root_mean(r.force.squares);
    peak_stroke: Device, "m", "peak damper displacement", last(r.stroke);
    peak_rate: Device, "m/s", "peak damper velocity", last(r.rate.peak);
    peak_current: Device, "A or V", "peak current", last(r.current.peak);
    mean_current: Device, "A or V", "mean current", mean(r.current_sum);
    rms_current: Device, "A or V", "root mean square current", root_mean(r.current.squares);
    command_travel: Device, "A/s or V/s", "total variation of the command per second", last(r.per_second(&r.command.distance));
    switching_rate: Device, "1/s", "changes of the command by more than 10 % of the largest per second; a change ends where \
        the command turns back by as much", last(r.per_second(&r.command.changes));
    device_energy: Device, "J", "energy dissipated by the device", last(r.energies.devices);
    peak_element_force: Element, "N", "peak force of the passive element with its spring and dashpot", last(r.element_force);
    peak_element_stroke: Element, "m", "its peak displacement", last(r.element_stroke);
    element_energy: Element, "J", "work of the motion on it, but for its spring", last(r.energies.with_dashpots);
    input_energy: Run, "J", "work of the ground and of forces on floors", last([r.energies.input]);
    kinetic_energy: Run, "J", "kinetic energy at the end", last([r.kinetic]);
    strain_energy: Run, "J", "strain energy at the end", last([r.strain]);
    damping_energy: Run, "J", "energy dissipated by the damping of the building beside its elements", last([r.energies.damping_alone()]);
    energy_error: Run, "1", "largest imbalance of the energies over the largest energy", last([r.energy_error()]);
}

/// Columns of a summary.
pub(super) fn width(building: &Building) -> usize {
    super::quantity::width(RUN_QUANTITIES, building)
}

/// A value that needs no division by the number of steps.
fn last<R>(value: R, _: R) -> R {
    value
}

/// The mean over the steps.
fn mean<R: Real>(sum: R, steps: R) -> R {
    sum / steps
}

/// The root mean square over the steps.
fn root_mean<R: Real>(sum: R, steps: R) -> R {
    (sum / steps).sqrt()
}

/// Peak magnitude and sum of squares of a signal.
#[derive(Clone)]
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
        self.peak[index] = peak.max(value.abs());
        self.squares[index] = value.mul_add(value, self.squares[index]);
    }
}

impl<R: Real> Extent<R> {
    /// Takes the values of all.
    #[inline(always)]
    fn take_all(&mut self, values: &[R]) {
        let (peak, squares) = (&mut self.peak[..values.len()], &mut self.squares[..values.len()]);
        for i in 0..values.len() {
            peak[i] = peak[i].max(values[i].abs());
            squares[i] = values[i].mul_add(values[i], squares[i]);
        }
    }

    /// Takes all values, to each of which the same is added.
    #[inline(always)]
    fn take_sums(&mut self, values: &[R], added: R) {
        let (peak, squares) = (&mut self.peak[..values.len()], &mut self.squares[..values.len()]);
        for i in 0..values.len() {
            let value = values[i] + added;
            peak[i] = peak[i].max(value.abs());
            squares[i] = value.mul_add(value, squares[i]);
        }
    }
}

/// Peak of a rate, and its largest change in a step in which it changed sign.
#[derive(Clone)]
struct Reversal<R> {
    peak: Vec<R>,
    /// Rate at the preceding step.
    last: Vec<R>,
    change: Vec<R>,
}

impl<R: Lanes> Reversal<R> {
    fn new(count: usize) -> Self {
        let zero = || vec![R::splat(0.0); count];
        Self { peak: zero(), last: zero(), change: zero() }
    }

    #[inline(always)]
    fn take(&mut self, index: usize, rate: R) {
        self.peak[index] = self.peak[index].max(rate.abs());
        let before = self.last[index];
        let turned = (rate * before).less(R::splat(0.0));
        let change = R::select(turned, (rate - before).abs(), R::splat(0.0));
        self.change[index] = self.change[index].max(change);
        self.last[index] = rate;
    }

    /// Peak and change of each rate in a lane.
    fn of_lane(&self, lane: usize) -> Vec<[f64; 2]> {
        let mut found = vec![[f64::NAN; 2]; self.peak.len()];
        for (values, [peak, change]) in self.peak.iter().zip(&self.change).zip(&mut found) {
            for (values, value) in [(values.0, peak), (values.1, change)] {
                values.for_each(|index, number| {
                    if index == lane {
                        *value = number;
                    }
                });
            }
        }
        found
    }
}

/// Share of the largest command that a change exceeds to be counted.
const CHANGE: f64 = 0.1;

/// Travel of commands from sample to sample, and the number of their changes of more than `CHANGE`.
#[derive(Clone)]
struct Travel<R> {
    distance: Vec<R>,
    changes: Vec<R>,
    /// Command at the preceding sample.
    last: Vec<R>,
    /// Smallest and largest command since the last change.
    low: Vec<R>,
    high: Vec<R>,
    /// 1 after a rise, -1 after a fall, 0 before the first change.
    direction: Vec<R>,
}

impl<R: Real> Travel<R> {
    fn new(count: usize) -> Self {
        let zero = || vec![R::splat(0.0); count];
        Self { distance: zero(), changes: zero(), last: zero(), low: zero(), high: zero(), direction: zero() }
    }

    /// Takes the first command of a device.
    #[inline(always)]
    fn begin(&mut self, index: usize, command: R) {
        (self.last[index], self.low[index], self.high[index]) = (command, command, command);
    }

    /// Takes a further command; `least` is the change that is not counted yet.
    #[inline(always)]
    fn take(&mut self, index: usize, command: R, least: R) {
        let (zero, one) = (R::splat(0.0), R::splat(1.0));
        self.distance[index] = self.distance[index] + (command - self.last[index]).abs();
        self.last[index] = command;
        let low = self.low[index].min(command);
        let high = self.high[index].max(command);
        let direction = self.direction[index];
        let may_rise = R::select(direction.less(R::splat(0.5)), one, zero);
        let may_fall = R::select(R::splat(-0.5).less(direction), one, zero);
        let rise = R::select(least.less(command - low), may_rise, zero);
        let fall = R::select(least.less(high - command), may_fall, zero);
        self.changes[index] = self.changes[index] + (rise + fall);
        // A change begins the search for the next one, in the other direction.
        let (rose, fell) = (zero.less(rise), zero.less(fall));
        self.direction[index] = R::select(rose, one, R::select(fell, -one, direction));
        self.low[index] = R::select(fell, command, low);
        self.high[index] = R::select(rose, command, high);
    }
}

/// Running reductions of a block of lanes.
#[derive(Clone)]
pub(super) struct Reductions<R> {
    displacement: Extent<R>,
    acceleration: Extent<R>,
    drift: Extent<R>,
    base_shear: Extent<R>,
    storey_shear: Vec<R>,
    frame_shear: Vec<R>,
    overturning: Vec<R>,
    residual_drift: Vec<R>,
    storey_energy: Vec<R>,
    force: Extent<R>,
    stroke: Vec<R>,
    rate: Reversal<R>,
    current: Extent<R>,
    current_sum: Vec<R>,
    command: Travel<R>,
    element_force: Vec<R>,
    element_stroke: Vec<R>,
    element_reversal: Reversal<R>,
    pub(super) energies: Energies<R>,
    kinetic: R,
    strain: R,
    /// Largest imbalance of the energies, and largest energy that it is compared with [J].
    imbalance: R,
    turnover: R,
    steps: usize,
    /// Duration of a step [s].
    step: f64,
}

impl<R: Lanes> Reductions<R> {
    pub(super) fn new(building: &Building, step: f64) -> Self {
        let (floors, storeys) = (building.n_floors(), building.n_storeys());
        let (devices, elements) = (building.n_devices(), building.n_elements());
        let zero = R::splat(0.0);
        Self {
            displacement: Extent::new(floors),
            acceleration: Extent::new(floors),
            drift: Extent::new(storeys),
            base_shear: Extent::new(1),
            storey_shear: vec![zero; storeys],
            frame_shear: vec![zero; storeys],
            overturning: vec![zero; storeys],
            residual_drift: vec![zero; storeys],
            storey_energy: vec![zero; storeys],
            force: Extent::new(devices),
            stroke: vec![zero; devices],
            rate: Reversal::new(devices),
            current: Extent::new(devices),
            current_sum: vec![zero; devices],
            command: Travel::new(devices),
            element_force: vec![zero; elements],
            element_stroke: vec![zero; elements],
            element_reversal: Reversal::new(elements),
            energies: Energies::zero(building),
            kinetic: zero,
            strain: zero,
            imbalance: zero,
            turnover: zero,
            steps: 0,
            step,
        }
    }

    /// Largest imbalance of the energies over the largest energy; zero at rest.
    fn energy_error(&self) -> R {
        let at_rest = self.turnover.equal(R::splat(0.0));
        R::select(at_rest, R::splat(0.0), self.imbalance / self.turnover)
    }

    /// Adds the commands of a control sample; `ranges` are the smallest and largest command of each device.
    #[inline(always)]
    pub(super) fn take_commands(&mut self, sample: usize, command: &[R], ranges: &[[f64; 2]]) {
        R::out_of_line(ReduceCommand { sample, command, ranges, into: &mut self.command });
    }

    /// Sums over the run, per second of it.
    fn per_second(&self, sums: &[R]) -> Vec<R> {
        #[allow(clippy::cast_precision_loss)] // steps are far below 2^53
        let seconds = self.steps as f64 * self.step;
        sums.iter().map(|&sum| sum / R::splat(seconds)).collect()
    }

    /// Keeps the sums over the steps from before the end of the run was added, which begins no step.
    pub(super) fn keep_sums(&mut self, before: Self) {
        self.displacement.squares = before.displacement.squares;
        self.acceleration.squares = before.acceleration.squares;
        self.drift.squares = before.drift.squares;
        self.base_shear.squares = before.base_shear.squares;
        self.force.squares = before.force.squares;
        self.current.squares = before.current.squares;
        self.current_sum = before.current_sum;
        self.steps = before.steps;
    }

    /// Of each device in a lane: largest rate, and largest change of it in a step in which it changed sign [m/s].
    pub(super) fn severity(&self, lane: usize) -> Vec<[f64; 2]> {
        self.rate.of_lane(lane)
    }

    /// The same of each element.
    pub(super) fn element_severity(&self, lane: usize) -> Vec<[f64; 2]> {
        self.element_reversal.of_lane(lane)
    }
}

/// Adds the start of an integration step, or the end of a run, to the reductions.
pub(super) struct ReduceStep<'a, R> {
    pub(super) building: &'a Building,
    pub(super) motion: PlantMotion<'a, R>,
    pub(super) force: &'a [R],
    pub(super) current: &'a [R],
    pub(super) ground_acceleration: &'a R,
    /// Minus the forces on the floors [N]; empty for none.
    pub(super) on_floors: &'a [R],
    pub(super) into: &'a mut Reductions<R>,
}

impl<R: Lanes> OutOfLine for ReduceStep<'_, R> {
    type Home = Self;
    #[inline(always)]
    fn run(self) {
        let Self { building, ref motion, force, current, on_floors, into, .. } = self;
        let PlantMotion { displacement, velocity, acceleration, .. } = *motion;
        if building.floors_are_coordinates {
            into.displacement.take_all(&displacement[..building.n_floors()]);
            into.acceleration.take_sums(&acceleration[..building.n_floors()], *self.ground_acceleration);
        } else {
            for floor in 0..building.n_floors() {
                into.displacement.take(floor, building.floors.dot(floor, displacement));
                let absolute = building.floors.add_dot(floor, acceleration, *self.ground_acceleration);
                into.acceleration.take(floor, absolute);
            }
        }
        let mut shear = *self.ground_acceleration * R::splat(building.total_mass);
        for (coordinate, &mass) in building.pushed_mass.iter().enumerate() {
            shear = acceleration[coordinate].weighted(R::splat(mass), shear);
        }
        for &minus in on_floors {
            shear = shear + minus;
        }
        into.base_shear.take(0, shear);
        let Shears { mass, pushed, floors, elements, springs, heights, .. } = &building.shears;
        let (mut shear, mut moment) = (R::splat(0.0), R::splat(0.0));
        for storey in (0..building.n_storeys()).rev() {
            let drift = building.storeys.dot(storey, displacement);
            into.drift.take(storey, drift);
            let inertia = self.ground_acceleration.weighted(R::splat(pushed[storey]), shear);
            shear = mass.add_dot(storey, acceleration, inertia);
            if !on_floors.is_empty() {
                shear = floors.add_dot(storey, on_floors, shear);
            }
            into.storey_shear[storey] = into.storey_shear[storey].max(shear.abs());
            if building.shears.has_heights {
                moment = shear.weighted(R::splat(heights[storey]), moment);
                into.overturning[storey] = into.overturning[storey].max(moment.abs());
            }
            // Without elements it is in proportion to the drift, and left out here.
            if !motion.element_force.is_empty() {
                let carried =
                    elements.add_dot(storey, motion.element_force, drift * R::splat(springs[storey]));
                into.frame_shear[storey] = into.frame_shear[storey].max(carried.abs());
            }
        }
        for device in 0..force.len() {
            into.force.take(device, force[device]);
            into.stroke[device] = into.stroke[device].max(building.devices.dot(device, displacement).abs());
            into.rate.take(device, building.devices.dot(device, velocity));
            into.current.take(device, current[device]);
            into.current_sum[device] = into.current_sum[device] + current[device];
        }
        for element in 0..motion.element_force.len() {
            let [x, v, force] = motion.of_element(building, element);
            into.element_force[element] = into.element_force[element].max(force.abs());
            into.element_stroke[element] = into.element_stroke[element].max(x.abs());
            into.element_reversal.take(element, v);
        }
        into.steps += 1;
    }
}

/// Adds the commands of a control sample to their travel.
struct ReduceCommand<'a, R> {
    sample: usize,
    command: &'a [R],
    ranges: &'a [[f64; 2]],
    into: &'a mut Travel<R>,
}

impl<R: Lanes> OutOfLine for ReduceCommand<'_, R> {
    type Home = Self;
    #[inline(always)]
    fn run(self) {
        for (device, &[smallest, largest]) in self.ranges.iter().enumerate() {
            let command = self.command[device];
            if self.sample == 0 {
                self.into.begin(device, command);
            } else {
                let least = CHANGE * largest.abs().max(smallest.abs());
                self.into.take(device, command, R::splat(least));
            }
        }
    }
}

/// Updates kinetic and strain energy and the energy balance.
pub(super) struct BalanceEnergies<'a, 'b, R: Lanes> {
    pub(super) plant: &'a Plant<'b, R>,
    pub(super) into: &'a mut Reductions<R>,
}

impl<R: Lanes> OutOfLine for BalanceEnergies<'_, '_, R> {
    type Home = Self;
    #[inline(always)]
    fn run(self) {
        let Self { plant: Plant { springs, displacement, velocity, .. }, into } = self;
        let building = self.plant.building();
        let (mut kinetic, mut strain) = (R::splat(0.0), R::splat(0.0));
        for coordinate in 0..building.n {
            kinetic = building.mass.dot(coordinate, velocity).mul_add(velocity[coordinate], kinetic);
            let force = springs.sprung(coordinate, displacement);
            strain = force.mul_add(displacement[coordinate], strain);
        }
        for storey in 0..building.n_storeys() {
            into.residual_drift[storey] = building.storeys.dot(storey, displacement);
            let mut dissipated = R::splat(0.0);
            for &(element, share) in building.shears.yielding.row(storey) {
                let lost = into.energies.elements[element] - self.plant.held_by(element);
                dissipated = lost.weighted(R::splat(share), dissipated);
            }
            into.storey_energy[storey] = dissipated;
        }
        into.kinetic = kinetic * R::splat(0.5);
        into.strain = strain * R::splat(0.5);
        let stored = into.kinetic + into.strain;
        let mut dissipated = into.energies.damping;
        let mut turned_over = into.energies.damping.abs();
        for &work in into.energies.devices.iter().chain(&into.energies.elements) {
            dissipated = dissipated + work;
            turned_over = turned_over + work.abs();
        }
        let imbalance = (into.energies.input - stored - dissipated).abs();
        into.imbalance = into.imbalance.max(imbalance);
        into.turnover = into.turnover.max(into.energies.input.abs().max(turned_over + stored));
    }
}
