//! One block of lanes that carry derivatives: force histories and their derivatives, by dual numbers.

use core::marker::PhantomData;

use crate::block::{Block, columns, integrate_span, steady};
use crate::damper::model::{DamperModel, State};
use crate::dispatch::{InstructionSet, LaneJob};
use crate::driver::{Either, Following};
use crate::dual::Dual;
use crate::lanes::Lanes;
use crate::loading::Command;
use crate::misfit::ForceSink;
use crate::real::{Bits, Real};

/// Derivatives per lane.
pub const TANGENTS: usize = 4;

/// The columns of `theta` with respect to which a lane differentiates.
pub type Seed = [Option<usize>; TANGENTS];

/// Output of a lane: its force [N] and its derivatives [N per unit of the column].
#[derive(Default)]
pub struct LaneRows<'a> {
    /// The force; `None` if another lane of the same candidate writes it.
    pub force: Option<&'a mut [f64]>,
    /// The derivatives, one row per seed.
    pub tangents: [Option<&'a mut [f64]>; TANGENTS],
}

/// Simulates a block whose lanes differentiate with respect to `seeds`.
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
        integrate_span::<M, _, _>(block, &mut driver, at_rest, &mut RowWriter { rows });
    }
}

/// The columns of `theta` as dual numbers: derivative 1 in the lanes and directions seeded with the column, else 0.
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

/// Writes the force and derivatives of every lane to its rows.
struct RowWriter<'a, 'b> {
    rows: &'a mut [LaneRows<'b>],
}

impl<R: Lanes + Bits> ForceSink<Dual<R, TANGENTS>> for RowWriter<'_, '_> {
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
    fn is_settled(&self) -> bool {
        false
    }
}
