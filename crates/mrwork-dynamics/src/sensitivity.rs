//! Force histories of a batch with their derivatives with respect to columns of `theta`, by dual numbers in lanes.
//!
//! A lane holds a candidate and [`TANGENTS`] of its columns; a candidate with more of them takes several lanes. A dual
//! number is several vectors, enough to hide each other's latency, so a block is as many lanes as one vector has.

use core::marker::PhantomData;

use crate::any_damper::Damper;
use crate::block::{Block, Standings, columns, march, steady};
use crate::current_law::CurrentLaws;
use crate::damper::{DamperModel, State};
use crate::dispatch::{InstructionSet, LaneJob};
use crate::driver::{Either, Following};
use crate::dual::Dual;
use crate::error::{DynamicsError, Outcome};
use crate::lanes::Lanes;
use crate::loading::{Command, LoadingHistory};
use crate::misfit::Keeper;
use crate::plan::Plan;
use crate::real::{Bits, Real};
use crate::simulate::{Row, Settings, stopped};
use crate::threads::on_threads;

/// Derivatives that a lane carries.
pub const TANGENTS: usize = 4;

/// The columns of `theta` along which a lane differentiates.
pub type Seed = [Option<usize>; TANGENTS];

/// Where a lane writes: its force [N], and its derivatives [N per unit of the column].
#[derive(Default)]
pub struct LaneRows<'a> {
    /// The force; `None` where another lane of the candidate writes it.
    pub force: Option<&'a mut [f64]>,
    /// The derivatives, seed by seed.
    pub tangents: [Option<&'a mut [f64]>; TANGENTS],
}

/// Force histories [N] of a batch, shape (batch, `n_time`), and their derivatives [N per unit of the column] with respect
/// to `asked` columns of `theta`, shape (batch, `asked.len()`, `n_time`).
///
/// The forces have the bits of [`crate::simulate::force_histories`]. A row that did not finish is filled with infinity,
/// force and derivatives; one whose derivatives left the finite numbers counts as diverged.
///
/// # Errors
/// Where shapes do not fit, a column does not exist, or the batch was stopped from outside.
#[allow(clippy::too_many_arguments)] // two arrays are filled in one run
pub fn sensitivities(
    damper: &dyn Damper,
    laws: &CurrentLaws,
    theta: &[f64],
    asked: &[usize],
    loading: &LoadingHistory,
    force: &mut [f64],
    jacobian: &mut [f64],
    settings: Settings<'_>,
) -> Result<Vec<Row>, DynamicsError> {
    let n_columns = laws.n_columns();
    if let Some(&column) = asked.iter().find(|&&column| column >= n_columns) {
        return Err(DynamicsError::NoColumn { model: damper.spec().name, column, n_columns });
    }
    let plan = Plan::new(damper, laws, theta, loading, settings)?;
    let n_time = loading.n_time();
    let n_batch = plan.rows.len();
    check("force", force.len(), n_batch * n_time)?;
    check("jacobian", jacobian.len(), n_batch * asked.len() * n_time)?;
    force.fill(f64::INFINITY);
    jacobian.fill(f64::INFINITY);

    let standings = Standings::at_rest(damper.spec(), n_batch, None);
    let lanes = lanes(&plan.order, asked, force, jacobian, n_time);
    let set = settings.instruction_set.or_plain();
    let work = blocks(lanes, set.vector_width(), |candidate| plan.rows[candidate].substeps);
    on_threads(plan.threads, work, |mut lanes: LaneList<'_>| {
        let block = Block {
            theta,
            laws,
            candidates: &lanes.candidates,
            loading,
            span: 0..n_time,
            standings: &standings,
            substeps: plan.rows[lanes.candidates[0]].substeps,
            stop: settings.stop,
        };
        damper.sensitivities(set, &block, &lanes.seeds, &mut lanes.rows);
    })?;
    stopped(settings.stop)?;

    let mut rows = plan.rows.clone();
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

/// Lanes that run together.
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

/// The lanes of all candidates in `order`: one for each [`TANGENTS`] columns, at least one.
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

/// The same in blocks of at most `width` lanes, in which all take as many sub-steps.
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

/// Runs a block whose lanes differentiate along `seeds`.
pub(crate) fn run<M: DamperModel>(
    set: InstructionSet,
    block: &Block<'_>,
    seeds: &[Seed],
    rows: &mut [LaneRows<'_>],
) {
    set.run_vector(SensitivityJob::<M> { block, seeds, rows, model: PhantomData });
}

struct SensitivityJob<'a, 'b, M> {
    block: &'a Block<'a>,
    seeds: &'a [Seed],
    rows: &'a mut [LaneRows<'b>],
    model: PhantomData<M>,
}

impl<M: DamperModel> LaneJob for SensitivityJob<'_, '_, M> {
    type Output = ();
    #[inline(always)]
    fn run<R: Lanes>(self) {
        let Self { block, seeds, rows, .. } = self;
        let columns = seeded(columns::<R>(block), seeds);
        let mut driver: Either<'_, M, Dual<R, TANGENTS>> = match block.loading.command() {
            Command::Varying(command) if !block.laws.are_constant() => {
                let step = block.loading.dt() / f64::from(block.substeps);
                Either::Following(Following::new(block.laws, columns, command, step))
            }
            _ => Either::Steady(steady::<M, _>(block, columns)),
        };
        let at_rest = M::State::from_fn(|_| Dual::splat(0.0));
        march::<M, _, _>(block, &mut driver, at_rest, &mut Record { rows });
    }
}

/// The columns of `theta`, each with derivative 1 in the lanes and directions that were asked of it.
#[inline(always)]
fn seeded<R: Lanes>(columns: Vec<R>, seeds: &[Seed]) -> Vec<Dual<R, TANGENTS>> {
    let mut duals = Vec::with_capacity(columns.len());
    for (column, value) in columns.into_iter().enumerate() {
        let mut dual = Dual::constant(value);
        for (k, tangent) in dual.tangents.iter_mut().enumerate() {
            *tangent = R::from_fn(|lane| match seeds.get(lane) {
                Some(seed) if seed[k] == Some(column) => 1.0,
                _ => 0.0,
            });
        }
        duals.push(dual);
    }
    duals
}

/// Writes every lane to its rows.
struct Record<'a, 'b> {
    rows: &'a mut [LaneRows<'b>],
}

impl<R: Lanes + Bits> Keeper<Dual<R, TANGENTS>> for Record<'_, '_> {
    #[inline(always)]
    fn take(&mut self, sample: usize, force: Dual<R, TANGENTS>) {
        let rows = &mut *self.rows;
        force.value.for_each(|lane, value| {
            if let Some(LaneRows { force: Some(row), .. }) = rows.get_mut(lane) {
                row[sample] = value;
            }
        });
        for (k, tangent) in force.tangents.into_iter().enumerate() {
            tangent.for_each(|lane, value| {
                if let Some(row) = rows.get_mut(lane).and_then(|rows| rows.tangents[k].as_deref_mut()) {
                    row[sample] = value;
                }
            });
        }
    }

    #[inline(always)]
    fn is_lost(&self) -> bool {
        false
    }
}
