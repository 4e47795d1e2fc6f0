//! Force histories of a batch and their derivatives with respect to columns of `theta`, by dual numbers in lanes.
//!
//! A lane differentiates one candidate with respect to [`TANGENTS`] inputs on which the states depend; more take more
//! lanes. Inputs that enter the force only are shared among these lanes. Where the command is constant the inputs are
//! the parameters, however many coefficients their laws have. A dual number is several vectors, enough to hide each
//! other's latency, so a block has the lanes of one vector. Without inputs on which the states depend they are plain
//! numbers, in packs side by side.

use crate::any_damper::Damper;
use crate::block::{BatchProgress, Block};
use crate::current_law::CurrentLaws;
use crate::damper::DamperSpec;
use crate::dual_block::{LaneRows, LaneSeeds, TANGENTS};
use crate::error::{DynamicsError, Outcome};
use crate::loading::{Command, LoadingHistory};
use crate::schedule::Schedule;
use crate::settings::Settings;
use crate::simulate::{CandidateResult, stopped};
use crate::threads::on_threads;

/// Cost of a step of a lane with derivatives, in steps of a lane of a full block without.
const DUAL_COST: u64 = 6;

/// Force histories [N] of a batch, shape (batch, `n_time`), and their derivatives [N per unit of the column] with respect
/// to `asked` columns of `theta`, shape (batch, `asked.len()`, `n_time`).
///
/// The forces are bit-identical to those of [`crate::simulate::force_histories`]. Force and derivatives of a row that did
/// not finish are infinite; a row with derivatives that are not finite counts as diverged.
///
/// # Errors
/// If shapes do not match, a column does not exist, or the batch was cancelled.
#[allow(clippy::too_many_arguments)] // two outputs of one simulation
pub fn sensitivities(
    damper: &dyn Damper,
    laws: &CurrentLaws,
    theta: &[f64],
    asked: &[usize],
    loading: &LoadingHistory,
    force: &mut [f64],
    jacobian: &mut [f64],
    settings: Settings<'_>,
) -> Result<Vec<CandidateResult>, DynamicsError> {
    let n_columns = laws.n_columns();
    if let Some(&column) = asked.iter().find(|&&column| column >= n_columns) {
        return Err(DynamicsError::NoColumn { model: damper.spec().name, column, n_columns });
    }
    let schedule = Schedule::new(damper, laws, theta, loading, settings)?;
    let n_time = loading.n_time();
    let n_batch = schedule.rows.len();
    check("force", force.len(), n_batch * n_time)?;
    check("jacobian", jacobian.len(), n_batch * asked.len() * n_time)?;
    force.fill(f64::INFINITY);
    jacobian.fill(f64::INFINITY);

    let progress = BatchProgress::at_rest(damper.spec(), n_batch, None);
    let directions = Directions::of(damper.spec(), laws, asked, loading);
    let lanes = lanes(&schedule.order, &directions, asked.len(), force, jacobian, n_time);
    let set = settings.instruction_set;
    let width = if directions.plain_states { set.side_by_side_width() } else { set.vector_width() };
    let work = blocks(lanes, width, |candidate| schedule.rows[candidate].substeps);
    on_threads(
        schedule.threads_at(DUAL_COST * directions.n_lanes() as u64),
        work,
        |mut lanes: LaneList<'_>| {
            let block = Block {
                theta,
                laws,
                candidates: &lanes.candidates,
                loading,
                span: 0..n_time,
                progress: &progress,
                substeps: schedule.rows[lanes.candidates[0]].substeps,
                short: false,
                stop: settings.stop,
            };
            damper.sensitivities(set, &block, &lanes.seeds, &mut lanes.rows, directions.plain_states);
        },
    )?;
    stopped(settings.stop)?;

    let mut rows = schedule.rows.clone();
    for (index, row) in rows.iter_mut().enumerate().filter(|(_, row)| row.outcome == Outcome::Finished) {
        let history = &mut force[index * n_time..][..n_time];
        let derivatives = &mut jacobian[index * asked.len() * n_time..][..asked.len() * n_time];
        directions.chain(laws, &theta[index * n_columns..][..n_columns], asked, derivatives, n_time);
        if history.iter().chain(derivatives.iter()).all(|sample| sample.is_finite()) {
            row.squared_error = 0.0;
            row.steps = n_time as u64 * u64::from(row.substeps);
        } else {
            history.fill(f64::INFINITY);
            derivatives.fill(f64::INFINITY);
            row.outcome = Outcome::Diverged;
        }
    }
    Ok(rows)
}

fn check(name: &'static str, found: usize, expected: usize) -> Result<(), DynamicsError> {
    if found == expected { Ok(()) } else { Err(DynamicsError::LengthMismatch { name, found, expected }) }
}

/// An input of the simulation, see [`crate::dual_block`], and the asked column in whose place its derivatives are written.
#[derive(Clone, Copy)]
struct Direction {
    input: usize,
    place: usize,
}

/// The inputs with respect to which candidates are differentiated.
struct Directions {
    /// Those on which the states depend.
    states: Vec<Direction>,
    /// Those that enter the force only.
    force_only: Vec<Direction>,
    /// For each asked column its direction's place; `None` where the force does not depend on it.
    places: Vec<Option<usize>>,
    /// The command of the whole record, if parameters follow it: the inputs are the parameters at it, and derivatives
    /// with respect to coefficients follow by the chain rule.
    held: Option<f64>,
    /// Whether the states depend on none of the inputs, and parameters are constant in time.
    plain_states: bool,
}

impl Directions {
    fn of(spec: &DamperSpec, laws: &CurrentLaws, asked: &[usize], loading: &LoadingHistory) -> Self {
        let varying = matches!(loading.command(), Command::Varying(_)) && !laws.are_constant();
        let held = match loading.command() {
            Command::Held(command) if !laws.are_constant() => Some(*command),
            _ => None,
        };
        let (states, force_only, places) = (Vec::new(), Vec::new(), Vec::new());
        let mut directions = Self { states, force_only, places, held, plain_states: false };
        let mut place_of: Vec<Option<usize>> = vec![None; spec.parameters.len()];
        for (place, &column) in asked.iter().enumerate() {
            let parameter = laws.parameter_of(column).map(|(parameter, _)| parameter);
            let input = if varying { Some(column) } else { parameter };
            let known = if varying { None } else { parameter.and_then(|parameter| place_of[parameter]) };
            directions.places.push(known.or(input.map(|_| place)));
            if let (Some(input), None) = (input, known) {
                if let Some(parameter) = parameter {
                    place_of[parameter] = Some(place);
                }
                let force_only = parameter.is_some_and(|parameter| spec.parameters[parameter].force_only);
                let group = if force_only { &mut directions.force_only } else { &mut directions.states };
                group.push(Direction { input, place });
            }
        }
        directions.plain_states = directions.states.is_empty() && !varying;
        directions
    }

    /// Lanes of a candidate, at least one.
    fn n_lanes(&self) -> usize {
        self.states.len().div_ceil(TANGENTS).max(1)
    }

    /// Turns derivatives with respect to the directions into those with respect to the asked columns, `derivatives` of
    /// one candidate with that row of `theta`.
    fn chain(
        &self,
        laws: &CurrentLaws,
        theta: &[f64],
        asked: &[usize],
        derivatives: &mut [f64],
        n_time: usize,
    ) {
        // Last to first: the row of a direction stands at the first of its columns, and is scaled after it was copied.
        for (index, (&column, &place)) in asked.iter().zip(&self.places).enumerate().rev() {
            let own = index * n_time..(index + 1) * n_time;
            let Some(place) = place else {
                derivatives[own].fill(0.0);
                continue;
            };
            if place != index {
                derivatives.copy_within(place * n_time..(place + 1) * n_time, own.start);
            }
            let Some(command) = self.held else { continue };
            let slope = laws.slope(theta, column, command);
            for sample in &mut derivatives[own] {
                // A parameter that is limited to its range has derivatives of zero, whatever those of the force.
                *sample = if slope == 0.0 { 0.0 } else { *sample * slope };
            }
        }
    }
}

/// The lanes of a block.
#[derive(Default)]
struct LaneList<'a> {
    candidates: Vec<usize>,
    seeds: Vec<LaneSeeds>,
    rows: Vec<LaneRows<'a>>,
}

impl<'a> LaneList<'a> {
    fn push(&mut self, (candidate, seeds, rows): (usize, LaneSeeds, LaneRows<'a>)) {
        self.candidates.push(candidate);
        self.seeds.push(seeds);
        self.rows.push(rows);
    }
}

/// The lanes of the candidates in `order`.
fn lanes<'a>(
    order: &[usize],
    directions: &Directions,
    n_asked: usize,
    force: &'a mut [f64],
    jacobian: &'a mut [f64],
    n_time: usize,
) -> Vec<(usize, LaneSeeds, LaneRows<'a>)> {
    let mut forces: Vec<Option<&mut [f64]>> = force.chunks_mut(n_time).map(Some).collect();
    let mut derivatives: Vec<Option<&mut [f64]>> = jacobian.chunks_mut(n_time).map(Some).collect();
    let mut lanes = Vec::with_capacity(order.len() * directions.n_lanes());
    for &candidate in order {
        let own = &mut derivatives[candidate * n_asked..][..n_asked];
        let mut states = directions.states.chunks(TANGENTS);
        let mut force_only = directions.force_only.chunks(TANGENTS);
        let parts = directions.force_only.len().div_ceil(TANGENTS).div_ceil(directions.n_lanes());
        for _ in 0..directions.n_lanes() {
            let mut seeds = LaneSeeds::default();
            let mut rows = LaneRows { force: forces[candidate].take(), ..LaneRows::default() };
            let mut seed = |some: Option<&[Direction]>| {
                let mut inputs = [None; TANGENTS];
                let mut places = [const { None }; TANGENTS];
                for (k, direction) in some.into_iter().flatten().enumerate() {
                    inputs[k] = Some(direction.input);
                    places[k] = own[direction.place].take();
                }
                (inputs, places)
            };
            (seeds.states, rows.states) = seed(states.next());
            for part in force_only.by_ref().take(parts) {
                let (inputs, places) = seed(Some(part));
                seeds.force_only.push(inputs);
                rows.force_only.push(places);
            }
            lanes.push((candidate, seeds, rows));
        }
    }
    lanes
}

/// Groups lanes into blocks of at most `width` lanes with the same number of sub-steps.
fn blocks<'a>(
    lanes: Vec<(usize, LaneSeeds, LaneRows<'a>)>,
    width: usize,
    substeps: impl Fn(usize) -> u32,
) -> Vec<LaneList<'a>> {
    let mut blocks: Vec<LaneList<'a>> = Vec::with_capacity(lanes.len().div_ceil(width));
    for lane in lanes {
        match blocks.last_mut() {
            Some(block)
                if block.candidates.len() < width && substeps(block.candidates[0]) == substeps(lane.0) =>
            {
                block.push(lane);
            }
            _ => {
                let mut block = LaneList::default();
                block.push(lane);
                blocks.push(block);
            }
        }
    }
    blocks
}
