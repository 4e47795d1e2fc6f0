//! How fast the states of a block of candidates relax along a motion: sub-steps of models that have no bound before it.

use crate::block::{AfterCommand, Block, Constant, Integrated, OverTime, integrate_span};
use crate::damper::model::{DamperModel, Motion, State};
use crate::dispatch::{InstructionSet, LaneJob};
use crate::driver::Driver;
use crate::lanes::Lanes;
use crate::loading::Command;
use crate::misfit::ForceSink;
use crate::real::{Bits, finite_or_infinite};

/// Fastest relaxation of each candidate over the record [1/s]; infinite where it is not a number.
///
/// Where the motion alone decides, the states stay at rest.
pub(crate) fn run<M: DamperModel>(model: M, set: InstructionSet, block: &Block<'_>) -> Vec<f64> {
    match block.loading.command() {
        Command::Varying(command) if !block.laws.are_constant() => {
            set.run_narrow(WatchJob { block, command: AfterCommand { laws: block.laws, command }, model })
        }
        _ => set.run(block.candidates.len(), WatchJob { block, command: Constant::<false>, model }),
    }
}

struct WatchJob<'a, M, C> {
    block: &'a Block<'a>,
    command: C,
    model: M,
}

impl<M: DamperModel, C: OverTime<M>> LaneJob for WatchJob<'_, M, C> {
    type Output = Vec<f64>;
    type Home = M;
    #[inline(always)]
    fn run<R: Lanes + Bits>(self) -> Vec<f64> {
        let Self { block, command, model } = self;
        let mut found = Vec::with_capacity(block.candidates.len() + R::WIDTH);
        for candidates in block.candidates.chunks(R::WIDTH) {
            let driver = command.driver::<R>(model, block, candidates);
            let rest = M::State::<R>::splat(R::splat(0.0));
            let mut pack = Integrated::<M, R, _, _> {
                driver,
                sink: Fastest(R::splat(0.0)),
                kind: core::marker::PhantomData,
            };
            if model.relaxes_by_motion() {
                for (sample, interval) in block.loading.intervals_from(0).enumerate() {
                    pack.driver.begin(sample);
                    pack.sink.take(sample, &pack.driver, rest, interval.motion(0.0).splat());
                    pack.sink.take(sample, &pack.driver, rest, interval.motion(0.5).splat());
                    pack.driver.step();
                }
                let last = block.loading.last().splat();
                pack.sink.take(block.loading.n_time() - 1, &pack.driver, rest, last);
            } else {
                integrate_span(block, &mut pack, rest);
            }
            pack.sink.0.for_each(|_, value| found.push(value));
        }
        found
    }
}

/// The fastest relaxation so far.
struct Fastest<R>(R);

impl<M: DamperModel, R: Lanes, D: Driver<M, R>> ForceSink<M, R, D> for Fastest<R> {
    #[inline(always)]
    fn take(&mut self, _: usize, driver: &D, state: M::State<R>, motion: Motion<R>) {
        self.0 = finite_or_infinite(M::relaxation(driver.parameters(), state, motion)).max(self.0);
    }

    #[inline(always)]
    fn is_settled(&self) -> bool {
        R::all(self.0.equal(R::splat(f64::INFINITY)))
    }
}
