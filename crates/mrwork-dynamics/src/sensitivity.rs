//! Force histories of a batch and their derivatives with respect to columns of `theta`, by dual numbers in lanes.
//!
//! A lane differentiates one candidate with respect to [`TANGENTS`] columns; more columns take more lanes. A dual number
//! is several vectors, enough to hide each other's latency, so a block has the lanes of one vector.

use crate::any_damper::Damper;
use crate::block::{BatchProgress, Block};
use crate::current_law::CurrentLaws;
use crate::dual_block::{LaneRows, Seed, TANGENTS};
use crate::error::{DynamicsError, Outcome};
use crate::loading::LoadingHistory;
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
    let lanes = lanes(&schedule.order, asked, force, jacobian, n_time);
    let set = settings.instruction_set.or_plain();
    let work = blocks(lanes, set.vector_width(), |candidate| schedule.rows[candidate].substeps);
    let lanes_per_candidate = asked.len().div_ceil(TANGENTS).max(1) as u64;
    on_threads(schedule.threads_at(DUAL_COST * lanes_per_candidate), work, |mut lanes: LaneList<'_>| {
        let block = Block {
            theta,
            laws,
            candidates: &lanes.candidates,
            loading,
            span: 0..n_time,
            progress: &progress,
            substeps: schedule.rows[lanes.candidates[0]].substeps,
            stop: settings.stop,
        };
        damper.sensitivities(set, &block, &lanes.seeds, &mut lanes.rows);
    })?;
    stopped(settings.stop)?;

    let mut rows = schedule.rows.clone();
    for (index, row) in rows.iter_mut().enumerate().filter(|(_, row)| row.outcome == Outcome::Finished) {
        let history = &mut force[index * n_time..][..n_time];
        let derivatives = &mut jacobian[index * asked.len() * n_time..][..asked.len() * n_time];
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

/// The lanes of a block.
#[derive(Default)]
struct LaneList<'a> {
    candidates: Vec<usize>,
    seeds: Vec<Seed>,
    rows: Vec<LaneRows<'a>>,
}

impl<'a> LaneList<'a> {
    fn push(&mut self, (candidate, seed, rows): (usize, Seed, LaneRows<'a>)) {
        self.candidates.push(candidate);
        self.seeds.push(seed);
        self.rows.push(rows);
    }
}

/// The lanes of the candidates in `order`: one for every [`TANGENTS`] columns, at least one.
fn lanes<'a>(
    order: &[usize],
    asked: &[usize],
    force: &'a mut [f64],
    jacobian: &'a mut [f64],
    n_time: usize,
) -> Vec<(usize, Seed, LaneRows<'a>)> {
    let mut forces: Vec<Option<&mut [f64]>> = force.chunks_mut(n_time).map(Some).collect();
    let mut derivatives: Vec<Option<&mut [f64]>> = jacobian.chunks_mut(n_time).map(Some).collect();
    let mut lanes = Vec::with_capacity(order.len() * asked.len().div_ceil(TANGENTS).max(1));
    for &candidate in order {
        for first in (0..asked.len().max(1)).step_by(TANGENTS) {
            let mut seed = [None; TANGENTS];
            let mut rows = LaneRows { force: forces[candidate].take(), ..LaneRows::default() };
            for (k, &column) in asked.iter().skip(first).take(TANGENTS).enumerate() {
                seed[k] = Some(column);
                rows.tangents[k] = derivatives[candidate * asked.len() + first + k].take();
            }
            lanes.push((candidate, seed, rows));
        }
    }
    lanes
}

/// Groups lanes into blocks of at most `width` lanes with the same number of sub-steps.
fn blocks<'a>(
    lanes: Vec<(usize, Seed, LaneRows<'a>)>,
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
