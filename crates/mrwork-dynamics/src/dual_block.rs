//! One block of lanes that carry derivatives: force histories and their derivatives, by dual numbers.
//!
//! What a lane differentiates with respect to are the inputs of its simulation: the parameters, or, where they follow a
//! varying command, the columns of `theta`. States are integrated with their derivatives; inputs that enter the force
//! only leave the states alone, so their derivatives are those of the force at the sample; where there are no others,
//! states are plain numbers in packs side by side.

use core::marker::PhantomData;

use crate::block::{Block, Integrated, WithState, columns, integrate_span, steady_values};
use crate::current_law::Prepare;
use crate::damper::model::{DamperModel, Motion, State};
use crate::dispatch::{InstructionSet, LaneJob};
use crate::driver::{Driver, Either, Following, Steady};
use crate::dual::Dual;
use crate::lanes::Lanes;
use crate::loading::Command;
use crate::misfit::ForceSink;
use crate::real::{Bits, Real};

/// Derivatives of a dual number.
pub const TANGENTS: usize = 4;

/// The inputs along whose directions a dual number has derivatives.
pub type Seed = [Option<usize>; TANGENTS];

/// The inputs with respect to which a lane differentiates.
#[derive(Default)]
pub struct LaneSeeds {
    /// Those on which the states depend.
    pub states: Seed,
    /// Those that enter the force only, as many as there are; every [`TANGENTS`] of them cost an evaluation of the force.
    pub force_only: Vec<Seed>,
}

/// Output of a lane: its force [N] and its derivatives [N per unit of the input].
#[derive(Default)]
pub struct LaneRows<'a> {
    /// The force; `None` if another lane of the same candidate writes it.
    pub force: Option<&'a mut [f64]>,
    /// The derivatives with respect to inputs on which the states depend.
    pub states: [Option<&'a mut [f64]>; TANGENTS],
    /// The derivatives with respect to inputs that enter the force only.
    pub force_only: Vec<[Option<&'a mut [f64]>; TANGENTS]>,
}

/// Simulates a block whose lanes differentiate with respect to `seeds`; those of a block with `plain_states` enter the
/// force only, and its parameters are constant in time.
pub(crate) fn run<M: DamperModel>(
    model: M,
    set: InstructionSet,
    block: &Block<'_>,
    seeds: &[LaneSeeds],
    rows: &mut [LaneRows<'_>],
    plain_states: bool,
) {
    if plain_states {
        set.run_narrow(ForceSlopesJob { block, seeds, rows, model });
    } else {
        set.run_vector(SensitivityJob { block, seeds, rows, model });
    }
}

struct ForceSlopesJob<'a, 'b, M> {
    block: &'a Block<'a>,
    seeds: &'a [LaneSeeds],
    rows: &'a mut [LaneRows<'b>],
    model: M,
}

impl<M: DamperModel> LaneJob for ForceSlopesJob<'_, '_, M> {
    type Output = ();
    type Home = M;
    #[inline(always)]
    fn run<R: Lanes + Bits>(self) {
        let Self { block, seeds, rows, model } = self;
        let mut packs = Vec::with_capacity(seeds.len().div_ceil(R::WIDTH));
        let lanes = seeds.chunks(R::WIDTH).zip(rows.chunks_mut(R::WIDTH));
        for (candidates, (seeds, rows)) in block.candidates.chunks(R::WIDTH).zip(lanes) {
            let values = steady_values(block, columns::<R>(block, candidates));
            let mut parts = Vec::new();
            for part in 0..seeds.iter().map(|seeds| seeds.force_only.len()).max().unwrap_or(0) {
                let inputs = seeded(&values, |lane| seeds.get(lane)?.force_only.get(part).copied());
                parts.push(model.parameters(&inputs));
            }
            let driver = Steady::<_, false> { parameters: model.parameters(&values) };
            let sink = SlopeWriter::<M, R> { rows, parts };
            let pack = Integrated::<M, R, _, _> { driver, sink, kind: PhantomData };
            packs.push(WithState { pack, state: M::State::splat(R::splat(0.0)) });
        }
        integrate_span(block, &mut packs, ());
    }
}

/// Writes the force and its derivatives with respect to inputs that the states do not depend on.
struct SlopeWriter<'a, 'b, M: DamperModel, R: Lanes + Bits> {
    rows: &'a mut [LaneRows<'b>],
    parts: Vec<M::Parameters<Numbers<R>>>,
}

impl<M: DamperModel, R: Lanes + Bits> ForceSink<M, R, Steady<M::Parameters<R>>>
    for SlopeWriter<'_, '_, M, R>
{
    #[inline(always)]
    fn take(
        &mut self,
        sample: usize,
        driver: &Steady<M::Parameters<R>>,
        state: M::State<R>,
        motion: Motion<R>,
    ) {
        write_force(self.rows, sample, M::force(&driver.parameters, state, motion));
        let state = M::State::<Numbers<R>>::from_fn(|place| {
            let mut entry = Dual::splat(0.0);
            state.for_each(|index, value| {
                if index == place {
                    entry = Dual::constant(value);
                }
            });
            entry
        });
        let motion = Motion {
            displacement: Dual::constant(motion.displacement),
            velocity: Dual::constant(motion.velocity),
        };
        for (part, parameters) in self.parts.iter().enumerate() {
            write_force_only(self.rows, part, sample, M::force(parameters, state, motion).tangents);
        }
    }

    #[inline(always)]
    fn is_settled(&self) -> bool {
        false
    }
}

/// Writes the force of the lanes that have a row for it.
#[inline(always)]
fn write_force<R: Lanes>(rows: &mut [LaneRows<'_>], sample: usize, force: R) {
    force.for_each(|lane, value| {
        if let Some(LaneRows { force: Some(row), .. }) = rows.get_mut(lane) {
            row[sample] = value;
        }
    });
}

/// Writes the derivatives of a part of the inputs that enter the force only.
#[inline(always)]
fn write_force_only<R: Lanes>(
    rows: &mut [LaneRows<'_>],
    part: usize,
    sample: usize,
    tangents: [R; TANGENTS],
) {
    for (k, tangent) in tangents.into_iter().enumerate() {
        tangent.for_each(|lane, value| {
            let rows = rows.get_mut(lane).and_then(|rows| rows.force_only.get_mut(part));
            if let Some(row) = rows.and_then(|rows| rows[k].as_deref_mut()) {
                row[sample] = value;
            }
        });
    }
}

struct SensitivityJob<'a, 'b, M> {
    block: &'a Block<'a>,
    seeds: &'a [LaneSeeds],
    rows: &'a mut [LaneRows<'b>],
    model: M,
}

type Numbers<R> = Dual<R, TANGENTS>;

impl<M: DamperModel> LaneJob for SensitivityJob<'_, '_, M> {
    type Output = ();
    type Home = M;
    #[inline(always)]
    fn run<R: Lanes + Bits>(self) {
        let Self { block, seeds, rows, model } = self;
        let Block { laws, loading, substeps, .. } = *block;
        let columns = columns::<R>(block, block.candidates);
        let varying = match loading.command() {
            Command::Varying(command) if !laws.are_constant() => Some(command),
            _ => None,
        };
        let inputs = if varying.is_some() { columns } else { steady_values(block, columns) };
        let of_states = seeded(&inputs, |lane| seeds.get(lane).map(|seeds| seeds.states));
        let n_force_only = seeds.iter().map(|seeds| seeds.force_only.len()).max().unwrap_or(0);
        let mut force_only = Vec::with_capacity(n_force_only);
        for part in 0..n_force_only {
            let mut columns = seeded(&inputs, |lane| seeds.get(lane)?.force_only.get(part).copied());
            let parameters = model.parameters(&columns);
            if varying.is_some() {
                Numbers::<R>::out_of_line(Prepare { laws, columns: &mut columns });
            }
            let values = vec![Dual::splat(f64::NAN); laws.n_params()];
            force_only.push(ForceOnly { parameters, columns, values });
        }
        let driver = if let Some(command) = varying {
            let step = loading.dt() / f64::from(substeps);
            Either::Following(Following::new(model, laws, of_states, command, step))
        } else {
            Either::Steady(Steady { parameters: model.parameters(&of_states) })
        };
        let sink = RowWriter { rows, force_only };
        let mut pack = Integrated::<M, Numbers<R>, _, _> { driver, sink, kind: PhantomData };
        integrate_span(block, &mut pack, M::State::splat(Dual::splat(0.0)));
    }
}

/// Inputs as dual numbers: derivative 1 in the lanes and directions seeded with the input, else 0.
#[inline(always)]
fn seeded<R: Lanes + Bits>(inputs: &[R], seed: impl Fn(usize) -> Option<Seed>) -> Vec<Numbers<R>> {
    let mut duals = Vec::with_capacity(inputs.len());
    for (input, &value) in inputs.iter().enumerate() {
        let mut dual = Dual::constant(value);
        for (k, tangent) in dual.tangents.iter_mut().enumerate() {
            *tangent = R::from_fn(|lane| match seed(lane) {
                Some(seed) if seed[k] == Some(input) => 1.0,
                _ => 0.0,
            });
        }
        duals.push(dual);
    }
    duals
}

/// Parameters with derivatives with respect to inputs that enter the force only.
struct ForceOnly<M: DamperModel, R: Lanes + Bits> {
    parameters: M::Parameters<Numbers<R>>,
    /// From which the parameters are evaluated at every sample of a varying command, prepared.
    columns: Vec<Numbers<R>>,
    values: Vec<Numbers<R>>,
}

/// Writes the force and derivatives of every lane to its rows.
struct RowWriter<'a, 'b, M: DamperModel, R: Lanes + Bits> {
    rows: &'a mut [LaneRows<'b>],
    force_only: Vec<ForceOnly<M, R>>,
}

impl<M: DamperModel, R: Lanes + Bits> ForceSink<M, Numbers<R>, Either<'_, M, Numbers<R>>>
    for RowWriter<'_, '_, M, R>
{
    #[inline(always)]
    fn take(
        &mut self,
        sample: usize,
        driver: &Either<'_, M, Numbers<R>>,
        state: M::State<Numbers<R>>,
        motion: Motion<Numbers<R>>,
    ) {
        let rows = &mut *self.rows;
        let force = M::force(driver.parameters(), state, motion);
        write_force(rows, sample, force.value);
        for (k, tangent) in force.tangents.into_iter().enumerate() {
            tangent.for_each(|lane, value| {
                if let Some(row) = rows.get_mut(lane).and_then(|rows| rows.states[k].as_deref_mut()) {
                    row[sample] = value;
                }
            });
        }
        for (part, ForceOnly { parameters, columns, values }) in self.force_only.iter_mut().enumerate() {
            if let Either::Following(following) = driver {
                *parameters = following.parameters_of(columns, values);
            }
            let force = M::force(parameters, state.without_derivatives(), motion);
            write_force_only(rows, part, sample, force.tangents);
        }
    }

    #[inline(always)]
    fn is_settled(&self) -> bool {
        false
    }
}
