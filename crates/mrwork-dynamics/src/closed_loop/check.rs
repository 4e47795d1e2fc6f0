//! Checks of a batch before it is simulated: sizes and indices.

use super::batch::{Batch, Run};
use super::hardware::{Channel, Observer};
use super::own_law::{OwnLaw, Source};
use crate::building::Building;
use crate::control::{LoopModel, Timing};
use crate::error::DynamicsError;

/// Most integration steps per control sample that the hardware may ask for; finer runs multiply them.
const MOST_STEPS: u32 = 10_000;
/// Longest delay, in control samples.
const LONGEST_DELAY: usize = 1_000_000;

impl Batch<'_> {
    /// Refuses arguments that do not match.
    ///
    /// # Errors
    /// If a size or an index does not match the building, the law or the hardware.
    pub fn check(&self) -> Result<(), DynamicsError> {
        let n_devices = self.n_devices();
        let spec = self.law.spec();
        let n_gains = spec.n_gains(self.sizes());
        let sizes = [
            ("devices", self.building.n_devices(), n_devices),
            ("ranges", self.ranges.len(), n_devices),
            ("commanded devices", self.n_commanded.min(n_devices), self.n_commanded),
            ("tables", self.tables.len(), spec.tables.len()),
        ];
        for (name, found, expected) in sizes {
            if found != expected {
                return Err(DynamicsError::MatrixSize { name, found, expected });
            }
        }
        for group in self.dampers {
            if group.n_draws() != Some(self.n_draws()) {
                let expected = self.n_draws() * group.mountings.len() * group.laws.n_columns();
                return Err(DynamicsError::MatrixSize { name: "theta", found: group.theta.len(), expected });
            }
        }
        if n_gains > 0 && !self.gains.len().is_multiple_of(n_gains) {
            return Err(DynamicsError::MatrixSize {
                name: "gains",
                found: self.gains.len(),
                expected: n_gains,
            });
        }
        for motion in self.motions.iter().filter(|motion| motion.n_forced() > 0) {
            let (found, expected) = (motion.n_forced(), self.building.n_floors());
            if found != expected {
                return Err(DynamicsError::MatrixSize { name: "forces", found, expected });
            }
        }
        self.law.check_tables(self.tables)?;
        if spec.reads_acceleration && self.building.device_floors.is_none() {
            return Err(DynamicsError::NoAcceleration(spec.name));
        }
        if spec.needs_curve && self.curve.is_none() {
            return Err(DynamicsError::NoCurve(spec.name));
        }
        if let Some(candidate) = self
            .shaping
            .iter()
            .position(|each| !(each.dead_zone >= 0.0 && each.dead_zone.is_finite() && each.slope > 0.0))
        {
            return Err(DynamicsError::Shaping(candidate));
        }
        if let Some(device) =
            self.ranges.iter().position(|&[from, to]| !(from <= to && (to - from).is_finite()))
        {
            return Err(DynamicsError::CommandRange(device));
        }
        if !(self.hardware.sample_time.is_finite() && self.hardware.sample_time > 0.0)
            || self.hardware.steps == 0
        {
            return Err(DynamicsError::Step(self.hardware.sample_time));
        }
        let preview = self.hardware.ground_preview;
        if !(preview >= 0.0 && preview.is_finite()) {
            return Err(DynamicsError::Preview(preview));
        }
        self.timing()?;
        if let Some(own) = self.own {
            own.check(self)?;
        }
        let limits = [
            ("steps", self.hardware.steps as usize, MOST_STEPS as usize),
            ("delay_steps", self.longest_delay(), LONGEST_DELAY * self.hardware.steps as usize),
        ];
        for (name, found, most) in limits {
            if found > most {
                return Err(DynamicsError::TooLarge { name, found, most });
            }
        }
        if let Some(other) = self.springs.iter().find(|each| each.n_coordinates() != self.building.n) {
            let (found, expected) = (other.n_coordinates(), self.building.n);
            return Err(DynamicsError::MatrixSize { name: "stiffness", found, expected });
        }
        let n_candidates = self.gains.len().checked_div(n_gains).unwrap_or(usize::MAX);
        let n_draws = self.n_draws();
        let n_shaped = if self.shaping.is_empty() { usize::MAX } else { self.shaping.len() };
        for (run, &Run { candidate, motion, draw, springs, .. }) in self.runs.iter().enumerate() {
            let asked = [
                ("candidate", candidate as usize, n_candidates),
                ("motion", motion as usize, self.motions.len()),
                ("draw", draw as usize, n_draws),
                ("the stiffness", springs as usize, self.springs.len().max(1)),
                ("the dead zone of candidate", candidate as usize, n_shaped),
            ];
            for (what, index, count) in asked {
                if index >= count {
                    return Err(DynamicsError::NoSuchEntry { run, what, index, count });
                }
            }
        }
        self.check_sensors()?;
        let n_drifts = self.hardware.measured_storeys.len();
        self.observer.map_or(Ok(()), |observer| observer.check(self.building, n_devices, n_drifts))
    }

    /// Refuses sensors and faults of what is not there.
    fn check_sensors(&self) -> Result<(), DynamicsError> {
        let n_devices = self.n_devices();
        for fault in &self.hardware.faults {
            let (index, count) = match fault.channel {
                Channel::Acceleration(floor) => (floor, self.building.n_floors()),
                Channel::Deformation(device) | Channel::Force(device) | Channel::Command(device) => {
                    (device, n_devices)
                }
                Channel::GroundAcceleration => (0, 1),
                Channel::Drift(storey) => (storey, self.building.n_storeys()),
            };
            if index >= count {
                return Err(DynamicsError::NoSuchEntry { run: 0, what: "the faulty channel", index, count });
            }
        }
        let (storeys, count) = (&self.hardware.measured_storeys, self.building.n_storeys());
        if let Some(&index) = storeys.iter().find(|&&storey| storey >= count) {
            return Err(DynamicsError::NoSuchEntry { run: 0, what: "storey", index, count });
        }
        Ok(())
    }
}

impl Batch<'_> {
    /// The longest delay of a run, in integration steps of the hardware.
    fn longest_delay(&self) -> usize {
        let later = self.runs.iter().map(|run| run.delay_steps as usize).max().unwrap_or(0);
        self.hardware.delay_steps.saturating_add(later)
    }
}

impl<'a> Batch<'a> {
    /// The controller's model of the loop with its instants, of a law that predicts the motion.
    pub(super) fn timing(&self) -> Result<Option<(LoopModel<'a>, Timing)>, DynamicsError> {
        let spec = self.law.spec();
        if !spec.needs_model {
            return Ok(None);
        }
        let model = self.model.clone().ok_or(DynamicsError::NoModel(spec.name))?;
        model.check(self.building, self.n_devices())?;
        if let Some([offsets, rate, ..]) = self.tables.last().map(Vec::as_slice) {
            if (*offsets > 0.0 || *rate > 0.0) && !model.building.floors_are_coordinates {
                return Err(DynamicsError::NoShears(spec.name));
            }
            if *rate > 0.0 && model.building.shears.yielding.is_blank() {
                return Err(DynamicsError::NothingYields(spec.name));
            }
        }
        // The tables of the law were checked: the first are its instants.
        let mut numbers = [f64::NAN; 5];
        for (number, &entry) in numbers.iter_mut().zip(self.tables.iter().flatten()) {
            *number = entry;
        }
        let timing = Timing::of(spec.name, numbers, &model, self.ranges, self.hardware.sample_time)?;
        Ok(Some((model, timing)))
    }
}

impl OwnLaw {
    /// Refuses a tape that is not sound, inputs that are not there and missing settings.
    fn check(&self, batch: &Batch<'_>) -> Result<(), DynamicsError> {
        let Self { tape, inputs, start, names, settings } = self;
        if !tape.is_sound() {
            return Err(DynamicsError::UnsoundTape);
        }
        let kept = inputs.iter().take_while(|input| input.source == Source::Memory).count();
        let n_candidates = batch.runs.iter().map(|run| run.candidate as usize + 1).max().unwrap_or(0);
        let sizes = [
            ("inputs of the law", inputs.len(), tape.n_inputs),
            ("memory of the law", kept, start.len()),
            ("results of the law", tape.ends.len(), start.len() + batch.n_commanded),
            ("settings of the law", settings.len().max(n_candidates * names.len()), settings.len()),
        ];
        for (name, found, expected) in sizes {
            if found != expected {
                return Err(DynamicsError::MatrixSize { name, found, expected });
            }
        }
        for (place, input) in inputs.iter().enumerate().skip(kept) {
            let (what, index, count) = match input.source {
                // What it keeps stands before all else.
                Source::Memory => ("memory", place, kept),
                Source::Setting(index) => ("setting", index, names.len()),
                Source::Displacement(index) | Source::Velocity(index) => {
                    ("coordinate", index, batch.building.n_coordinates())
                }
                Source::Deformation(index) | Source::Rate(index) | Source::Force(index) => {
                    ("commanded device", index, batch.n_commanded)
                }
                Source::Acceleration(index) => ("floor", index, batch.building.n_floors()),
                Source::Drift(index) => ("measured storey", index, batch.hardware.measured_storeys.len()),
                Source::GroundAcceleration | Source::GroundVelocity | Source::Time => continue,
            };
            if index >= count {
                return Err(DynamicsError::NoSuchEntry { run: 0, what, index, count });
            }
        }
        Ok(())
    }
}

impl Observer {
    fn check(&self, building: &Building, n_devices: usize, n_drifts: usize) -> Result<(), DynamicsError> {
        let n_states = 2 * building.n;
        let n_measured = self.accelerations.len() + self.deformations.len() + n_drifts;
        let sizes = [
            ("transition", self.transition.len(), n_states * n_states),
            ("input", self.input.len(), n_states * n_devices),
            ("gain", self.gain.len(), n_states * n_measured),
            ("output", self.output.len(), n_measured * n_states),
            ("direct", self.direct.len(), n_measured * n_devices),
            ("ground", self.ground.len(), if self.ground.is_empty() { 0 } else { n_states }),
            ("direct_ground", self.direct_ground.len(), if self.ground.is_empty() { 0 } else { n_measured }),
        ];
        for (name, found, expected) in sizes {
            if found != expected {
                return Err(DynamicsError::MatrixSize { name, found, expected });
            }
        }
        let measured = self.accelerations.iter().map(|&floor| ("floor", floor, building.n_floors()));
        let measured = measured.chain(self.deformations.iter().map(|&device| ("device", device, n_devices)));
        for (what, index, count) in measured {
            if index >= count {
                return Err(DynamicsError::NoSuchEntry { run: 0, what, index, count });
            }
        }
        Ok(())
    }
}
