//! A control sample with its readings given: recorded as statements of C, and computed.

use super::batch::Batch;
use super::sample::{Controller, Sample, known_state};
use crate::control::{Gains, Measurement, Memory, Preview, Rollout, RolloutText};
use crate::coupled::PlantMotion;
use crate::lanes::Lanes;
use crate::real::Real;
use crate::record::{Formula, Precision, Term};

/// A signal that a controller reads, with the number of its entries.
type Signal = (&'static str, usize);

/// The commands of a controller as statements, whose memory is `m`, whose gains are `gains->NAME[]` and whose readings are `in`.
///
/// `m->sent` are the commands of the sample before, `m->law` is what the law keeps, `m->state` the estimate of an observer and
/// `m->furthest` the largest change of a command from the sample before.
pub struct LawText {
    /// The statements.
    pub command: String,
    /// What the law reads.
    pub reads: Vec<Signal>,
    /// What it keeps, at the start.
    pub kept: Vec<f64>,
    /// Largest change of a command from sample to sample.
    pub furthest: f64,
    /// Whether the statements call elementary functions.
    pub calls: bool,
    /// Its tables, `table_0`, `table_1`, ...
    pub tables: Vec<Vec<f64>>,
    /// The functions of a rollout, which plan what the law keeps.
    pub rollout: Option<RolloutText>,
}

/// What can be read: the state where no observer estimates it, then what sensors measure.
fn signals(batch: &Batch<'_>) -> Vec<Signal> {
    let n_state = if batch.observer.is_some() { 0 } else { batch.building.n_coordinates() };
    let signals = [
        ("displacement", n_state),
        ("velocity", n_state),
        ("acceleration", batch.building.n_floors()),
        ("ground_acceleration", 1),
        // An estimate of absolute velocities has it in them.
        ("ground_velocity", usize::from(!batch.observer.is_some_and(|observer| observer.is_absolute))),
        ("drift", batch.hardware.measured_storeys.len()),
        ("deformation", batch.n_devices()),
        ("force", batch.n_devices()),
    ];
    signals.into_iter().filter(|signal| signal.1 > 0).collect()
}

/// Commands of a sample and the estimate for the next one, from readings in the order of `signals`.
fn sampled<'b, R: Lanes>(
    batch: &Batch<'b>,
    controller: &mut Controller<'b, R>,
    number: usize,
    readings: &[R],
    estimates: bool,
) {
    let zero = R::splat(0.0);
    let n = batch.building.n_coordinates();
    let (mut displacement, mut velocity, mut ground_velocity) = (vec![zero; n], vec![zero; n], zero);
    let mut rest = readings;
    for (name, count) in signals(batch) {
        let (own, others) = rest.split_at(count);
        rest = others;
        match name {
            "displacement" => displacement = own.to_vec(),
            "velocity" => velocity = own.to_vec(),
            "acceleration" => controller.acceleration = own.to_vec(),
            "ground_acceleration" => controller.ground_acceleration = own[0],
            "ground_velocity" => ground_velocity = own[0],
            "drift" => controller.drift = own.to_vec(),
            "deformation" => controller.deformation = own.to_vec(),
            _ => controller.force = own.to_vec(),
        }
    }
    controller.relate(batch.observer, &batch.building.influence, zero);
    let estimate = [&*controller.state, &*controller.relative];
    let (_, known) = known_state(batch.observer, estimate, &displacement, &velocity);
    controller.rate =
        (0..batch.n_devices()).map(|device| batch.building.devices.dot(device, known)).collect();
    let force = controller.force.clone();
    let mut sample = Sample {
        batch,
        runs: &[0],
        streams: &[0],
        number,
        motion: PlantMotion {
            displacement: &displacement,
            velocity: &velocity,
            acceleration: &[],
            element_force: &[],
        },
        force: &force,
        ground_acceleration: &zero,
        ground_reading: &zero,
        ground_velocity: &ground_velocity,
        state_ground: None,
        preview: Preview { motions: &[], now: 0.0, reach: 0.0, step: 0.0 },
        controller,
    };
    sample.command();
    if let (true, Some(observer)) = (estimates, batch.observer) {
        sample.estimate(observer);
    }
}

/// The controller of the first run of a batch, in C.
#[must_use]
pub fn law_text(batch: &Batch<'_>, precision: Precision) -> LawText {
    let mut formula = Formula::new(precision);
    let mut controller = Controller::<Term<false>>::new(batch, &[0], None);
    let furthest = controller.furthest.value().unwrap_or(f64::INFINITY);
    let planner = match &mut controller.memory {
        Memory::PredictiveRollout(rollout @ Rollout::Planned(_)) => {
            let given = Rollout::Given(vec![Term::splat(f64::NAN); batch.n_commanded]);
            Some(core::mem::replace(rollout, given))
        }
        _ => None,
    };
    let mut kept = Vec::new();
    let mut keep = |term: &mut Term<false>| kept.push(term.value().unwrap_or(f64::NAN));
    controller.memory.each(&mut keep);
    if let Some(own) = &mut controller.own {
        own.each(&mut keep);
        own.set(|name| formula.input(format!("gains->{name}")));
    }
    controller.columns = (batch.law.spec().gains.iter())
        .flat_map(|gain| formula.inputs(&format!("gains->{}", gain.name), gain.shape.size(batch.sizes())))
        .collect();
    controller.furthest = formula.input("m->furthest");
    if batch.observer.is_some() {
        controller.state = formula.inputs("m->state", controller.state.len());
    }
    let n_devices = batch.n_devices();
    for (device, term) in formula.inputs("m->sent", n_devices).into_iter().enumerate() {
        controller.sent[device] = term;
    }
    let mut memory = formula.inputs("m->law", kept.len()).into_iter();
    let mut recall = |term: &mut Term<false>| *term = memory.next().unwrap_or(*term);
    controller.memory.each(&mut recall);
    if let Some(own) = &mut controller.own {
        own.each(&mut recall);
    }
    let signals = signals(batch);
    let groups: Vec<Vec<Term<false>>> =
        signals.iter().map(|&(name, count)| formula.inputs(&format!("in->{name}"), count)).collect();
    sampled(batch, &mut controller, 1, &groups.concat(), false);
    let rollout = if let Some(Rollout::Planned(mut planner)) = planner {
        let (displacement, velocity) = match batch.observer {
            Some(_) => controller.state.split_at(batch.building.n_coordinates()),
            None => (&groups[0][..], &groups[1][..]),
        };
        let gains = Gains {
            spec: batch.law.spec(),
            columns: &controller.columns,
            tables: batch.tables,
            sizes: batch.sizes(),
        };
        let measured = Measurement {
            displacement,
            velocity,
            deformation: &controller.deformation,
            rate: &controller.rate,
            force: &controller.force,
            acceleration: &controller.acceleration,
            drift: &controller.drift,
            absolute: &batch.building.absolute,
            has_sprung: &[],
            device_floors: None,
            ground_acceleration: controller.ground_acceleration,
            ground_velocity: Term::splat(0.0),
            influence: &[],
            state_ground: None,
            preview: Preview { motions: &[], now: 0.0, reach: 0.0, step: 0.0 },
            ground_reach: &[],
            largest: &[],
            curves: &[],
            sample_time: batch.hardware.sample_time,
            sent: &[],
        };
        Some(planner.recorded(&mut formula, &gains, &measured, batch.ranges))
    } else {
        None
    };
    // The commands of the sample before stand in the first row.
    let place = (1 % controller.depth) * n_devices;
    let mut ends = controller.sent[place..place + n_devices].to_vec();
    let mut end = |term: &mut Term<false>| ends.push(*term);
    controller.memory.each(&mut end);
    if let Some(own) = &mut controller.own {
        own.each(&mut end);
    }
    let mut used = ends.clone();
    used.extend(rollout.iter().flat_map(|rollout| &rollout.ends));
    let lefts: Vec<String> = (0..n_devices)
        .map(|device| format!("m->sent[{device}]"))
        .chain((0..kept.len()).map(|place| format!("m->law[{place}]")))
        .collect();
    let reads = signals
        .into_iter()
        .zip(&groups)
        .filter(|(_, terms)| terms.iter().any(|&term| Formula::uses(term, &used)))
        .map(|(signal, _)| signal)
        .collect();
    let (calls, tables) = (Formula::calls(), Formula::tables());
    let command = formula.assigned_at_once(&lefts, &ends);
    LawText { command, reads, kept, furthest, calls, tables, rollout }
}

/// Names and numbers of entries of what [`commands_of`] is given, in order.
#[must_use]
pub fn readings_of(batch: &Batch<'_>) -> Vec<Signal> {
    signals(batch)
}

/// Commands of the controller of the first run, shape (samples, devices), for readings, shape (samples, readings).
#[must_use]
pub fn commands_of(batch: &Batch<'_>, readings: &[f64]) -> Vec<f64> {
    let mut controller = Controller::<f64>::new(batch, &[0], None);
    let n_devices = batch.n_devices();
    let width: usize = signals(batch).iter().map(|signal| signal.1).sum();
    let mut commands = Vec::with_capacity(readings.len() / width * n_devices);
    for (number, row) in readings.chunks_exact(width).enumerate() {
        sampled(batch, &mut controller, number, row, true);
        commands.extend_from_slice(controller.sent_at(number));
    }
    commands
}
