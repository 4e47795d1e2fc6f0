//! A rollout in C: what has no loops is recorded, for a frame that loops over samples, steps and trials.

use super::{ACCELERATION_WEIGHT, Costs, HORIZON, Moment, Planner, TAILS, TRIALS, numbers, squares_of};
use crate::control::measurement::Measurement;
use crate::control::rollout::copy::{Stretch, force_that_counts};
use crate::control::spec::Gains;
use crate::coupled::DeviceState;
use crate::real::Real;
use crate::record::{Formula, Term};

type T = Term<false>;

/// Functions of a rollout whose memory is `m`, with its plan in `m->plan`.
pub struct RolloutText {
    /// Takes the readings `in` into the plan.
    pub read: String,
    /// Puts the coils to `command[]`.
    pub settle: String,
    /// Follow the dampers along a step under `command[]`, with `share[3]` of the way at its start, middle and end.
    pub drives: Vec<String>,
    /// Follows the loops of storeys that yield.
    pub follow: String,
    /// Compares the readings with the model.
    pub compare: String,
    /// Move the model from `x` to `next` by a step under `command[]` and `ground[3]`; `found[4]` are sums and largest squares
    /// of drifts and accelerations at its start.
    pub moves: Vec<String>,
    /// Returns the cost of `found[4]` at the horizon `x`.
    pub price: String,
    /// The gain that cannot be another than that with which it was planned.
    pub fixed: &'static str,
    /// Smallest and largest command of each device.
    pub ranges: Vec<[f64; 2]>,
    /// Sizes, and which of the steps is which.
    pub counts: Vec<(&'static str, usize)>,
    /// Times and settings.
    pub numbers: Vec<(&'static str, f64)>,
    pub(crate) ends: Vec<T>,
}

/// Functions under record; what they assign.
struct Writer<'a> {
    formula: &'a mut Formula,
    ends: Vec<T>,
}

/// Places of an array, with what they are assigned.
fn array(name: &str, terms: &[T]) -> Vec<(String, T)> {
    terms.iter().enumerate().map(|(entry, &term)| (format!("{name}[{entry}]"), term)).collect()
}

impl Writer<'_> {
    fn moment(&mut self, name: &str, like: &Moment<T>) -> Moment<T> {
        Moment {
            displacement: self.formula.inputs(&format!("{name}displacement"), like.displacement.len()),
            velocity: self.formula.inputs(&format!("{name}velocity"), like.velocity.len()),
            devices: self.devices(name, &like.devices),
            loops: self.formula.inputs(&format!("{name}loops"), like.loops.len()),
        }
    }

    fn devices(&mut self, name: &str, like: &DeviceState<T>) -> DeviceState<T> {
        let (mut own, mut entry) = (like.clone(), 0);
        own.each(&mut |term| {
            *term = self.formula.input(format!("{name}devices[{entry}]"));
            entry += 1;
        });
        own
    }

    fn function(&mut self, assigned: &[Vec<(String, T)>]) -> String {
        let (places, ends): (Vec<String>, Vec<T>) = assigned.iter().flatten().cloned().unzip();
        self.ends.extend(&ends);
        self.formula.assigned_at_once(&places, &ends)
    }
}

fn terms_of(devices: &DeviceState<T>) -> Vec<T> {
    let mut terms = Vec::new();
    devices.clone().each(&mut |term| terms.push(*term));
    terms
}

/// The stretches with other steps than those before them, and for each which it is.
fn distinct(stretches: &[Stretch]) -> (Vec<f64>, Vec<usize>) {
    let mut steps: Vec<f64> = Vec::new();
    let mut of = |step: f64| {
        steps.iter().position(|known| known.to_bits() == step.to_bits()).unwrap_or_else(|| {
            steps.push(step);
            steps.len() - 1
        })
    };
    let which = stretches.iter().map(|stretch| of(stretch.step())).collect();
    (steps, which)
}

impl Planner<'_, T> {
    /// The functions of the rollout, from the gains and readings under record. The horizon is that of the gains with which it
    /// was planned.
    pub(crate) fn recorded(
        &mut self,
        formula: &mut Formula,
        gains: &Gains<'_, T>,
        measured: &Measurement<'_, T>,
        ranges: &[[f64; 2]],
    ) -> RolloutText {
        let n_devices = self.held.len();
        self.copy.save(&mut self.start.devices);
        let mut writer = Writer { formula, ends: Vec::new() };
        let read = self.recorded_reading(&mut writer, measured);
        let now = writer.moment("m->plan.now.", &self.start);
        let command = writer.formula.inputs("command", n_devices);
        self.copy.devices.restore(&now.devices);
        self.copy.devices.receive(&command, true);
        let settle = self.saved(&mut writer);
        let (after, sample) = (self.copy.after, self.sample);
        let (before, on_way) = (self.copy.before.unwrap_or(after), self.on_way.unwrap_or(sample));
        let trial = Stretch::new(self.timing.hold, self.timing.step());
        let (drives, which_drive) = distinct(&[before, after]);
        let drives = drives
            .into_iter()
            .map(|step| {
                self.copy.devices.restore(&now.devices);
                self.copy.devices.set_step(step);
                self.copy.devices.receive(&command, false);
                let shares = [0, 1, 2].map(|place| writer.formula.input(format!("share[{place}]")));
                self.copy.step(step, shares);
                self.saved(&mut writer)
            })
            .collect();
        self.place_strengths(&mut writer);
        let doubt = writer.formula.input("m->plan.doubt");
        let known = doubt.equal(doubt);
        self.storeys.loops.clone_from(&now.loops);
        self.storeys.displacement = writer.formula.inputs("m->plan.followed", now.displacement.len());
        self.storeys.follow(&mut self.prediction, measured.displacement, known, false);
        let follow = writer.function(&[
            array("m->plan.now.loops", &self.storeys.loops),
            array("m->plan.followed", &self.storeys.displacement),
        ]);
        self.storeys.loops.clone_from(&now.loops);
        self.copy.devices.restore(&now.devices);
        let compare = self.recorded_comparison(&mut writer, gains, measured, known);
        let (moves, which_move) = distinct(&[on_way, sample, trial]);
        let moves = moves.into_iter().map(|step| self.recorded_move(&mut writer, &command, step)).collect();
        let price = self.recorded_price(&mut writer, gains);
        let Writer { ends, .. } = writer;
        let (n, n_states) = (now.displacement.len(), terms_of(&now.devices).len());
        let timing = self.timing;
        RolloutText {
            fixed: gains.spec.gains[HORIZON].name,
            ranges: ranges.to_vec(),
            counts: vec![
                ("n_coordinates", n),
                ("n_states", n_states),
                ("n_loops", now.loops.len()),
                ("n_trials", TRIALS),
                ("n_tails", TAILS),
                ("n_nodes", self.forecast.nodes.len()),
                ("order", self.forecast.order),
                ("decision", timing.samples),
                ("hold_steps", timing.steps as usize),
                ("horizon_steps", self.n_steps),
                ("delay", timing.delay_samples),
                ("late", usize::from(self.on_way.is_some())),
                ("before_steps", before.steps as usize),
                ("after_steps", after.steps as usize),
                ("on_way_steps", on_way.steps as usize),
                ("sample_steps", sample.steps as usize),
                ("drive_before", which_drive[0]),
                ("drive_after", which_drive[1]),
                ("move_on_way", which_move[0]),
                ("move_sample", which_move[1]),
                ("move_trial", which_move[2]),
            ],
            numbers: vec![
                ("hold", timing.hold),
                ("model_step", timing.step()),
                ("delay_time", self.delay),
                ("before_length", self.copy.before.map_or(0.0, |before| before.length)),
                ("after_length", after.length),
                ("before_step", before.step()),
                ("after_step", after.step()),
                ("on_way_step", on_way.step()),
                ("sample_step", sample.step()),
                ("forgetting", self.forecast.forgetting),
                ("growth", 1.0 / self.forecast.forgetting),
                ("covariance", numbers::<3>(&gains.tables[1])[2]),
                ("largest_trace", self.forecast.largest_trace),
            ],
            read,
            settle,
            drives,
            follow,
            compare,
            moves,
            price,
            ends,
        }
    }

    fn recorded_reading(&mut self, writer: &mut Writer<'_>, measured: &Measurement<'_, T>) -> String {
        let n_devices = self.held.len();
        let copy = &mut self.copy;
        copy.deformation = writer.formula.inputs("m->plan.deformation", n_devices);
        copy.rate = writer.formula.inputs("m->plan.rate", n_devices);
        self.strongest = writer.formula.input("m->plan.strongest");
        let doubt = self.read(measured);
        let copy = &self.copy;
        let function = writer.function(&[
            array("m->plan.now.displacement", measured.displacement),
            array("m->plan.now.velocity", measured.velocity),
            array("m->plan.deformation", &copy.deformation),
            array("m->plan.rate", &copy.rate),
            array("m->plan.deformation_before", &copy.deformation_before),
            array("m->plan.rate_before", &copy.rate_before),
            vec![
                ("m->plan.doubt".to_owned(), doubt),
                ("m->plan.ground".to_owned(), self.shaking(measured)),
                ("m->plan.strongest".to_owned(), self.strongest),
            ],
        ]);
        let copy = &mut self.copy;
        copy.deformation = writer.formula.inputs("m->plan.deformation", n_devices);
        copy.rate = writer.formula.inputs("m->plan.rate", n_devices);
        copy.deformation_before = writer.formula.inputs("m->plan.deformation_before", n_devices);
        copy.rate_before = writer.formula.inputs("m->plan.rate_before", n_devices);
        function
    }

    /// The states of the copy of the dampers, assigned.
    fn saved(&self, writer: &mut Writer<'_>) -> String {
        let mut own = DeviceState::default();
        self.copy.save(&mut own);
        writer.function(&[array("m->plan.now.devices", &terms_of(&own))])
    }

    /// Puts the strengths of the loops of storeys that are adapted to those in the memory.
    fn place_strengths(&mut self, writer: &mut Writer<'_>) {
        let mut entry = 0;
        if self.storeys.adaptation > 0.0 {
            self.prediction.each_strength(&mut |term| {
                *term = writer.formula.input(format!("m->plan.strengths[{entry}]"));
                entry += 1;
            });
        }
    }

    fn recorded_comparison(
        &mut self,
        writer: &mut Writer<'_>,
        gains: &Gains<'_, T>,
        measured: &Measurement<'_, T>,
        known: <T as Real>::Mask,
    ) -> String {
        let n_devices = self.held.len();
        self.copy.counted =
            force_that_counts(numbers::<2>(&gains.tables[2])[1], gains.of_loop(ACCELERATION_WEIGHT));
        self.copy.measured = writer.formula.inputs("m->plan.measured", n_devices);
        self.copy.expected = writer.formula.inputs("m->plan.expected", n_devices);
        self.peaks = [0, 1].map(|kind| writer.formula.input(format!("m->plan.peaks[{kind}]")));
        self.compare(gains, measured, known, true);
        let mut adapted = Vec::new();
        if self.storeys.adaptation > 0.0 {
            self.prediction.each_strength(&mut |term| adapted.push(*term));
        }
        let missed = if self.storeys.offsets { self.storeys.missed.len() } else { 0 };
        let function = writer.function(&[
            array("m->plan.measured", &self.copy.measured),
            array("m->plan.expected", &self.copy.expected),
            array("m->plan.scale", self.prediction.scale()),
            array("m->plan.peaks", &self.peaks),
            array("m->plan.strengths", &adapted),
            array("m->plan.offset", &self.storeys.missed[..missed]),
        ]);
        // The trials go on from what was compared.
        let scale = writer.formula.inputs("m->plan.scale", n_devices);
        self.prediction.scale().copy_from_slice(&scale);
        self.place_strengths(writer);
        self.prediction.offset(&writer.formula.inputs("m->plan.offset", missed));
        function
    }

    fn recorded_move(&mut self, writer: &mut Writer<'_>, command: &[T], step: f64) -> String {
        let from = writer.moment("x->", &self.start);
        let ground = [0, 1, 2].map(|place| writer.formula.input(format!("ground[{place}]")));
        self.prediction.begin(&from, step);
        self.prediction.evaluate(command, &ground[0]);
        let now = squares_of(&self.prediction, ground[0]);
        self.prediction.advance(&ground[1], &ground[2]);
        let mut next = from;
        self.prediction.save(&mut next);
        writer.function(&[
            array("found", &[now.sums, now.largest].concat()),
            array("next->displacement", &next.displacement),
            array("next->velocity", &next.velocity),
            array("next->devices", &terms_of(&next.devices)),
            array("next->loops", &next.loops),
        ])
    }

    fn recorded_price(&mut self, writer: &mut Writer<'_>, gains: &Gains<'_, T>) -> String {
        let end = writer.moment("x->", &self.start);
        let found = writer.formula.inputs("found", 4);
        self.prediction.begin(&end, self.timing.step());
        let (energy, left) = (self.prediction.twice_energy(), self.prediction.left_squared());
        let costs = Costs { sums: [found[0], found[1]], peaks: [found[2], found[3]], energy, left };
        let cost = self.sum(gains, costs);
        writer.ends.push(cost);
        writer.formula.statements([("return".to_owned(), cost)])
    }
}
