//! Peak arithmetic rate of the machine, and arithmetic operations of a step: for benchmarks.

use core::cell::Cell;
use core::hint::black_box;
use core::ops::{Add, Div, Mul, Neg, Sub};
use std::time::{Duration, Instant};

use crate::damper::model::{DamperModel, Motion, State};
use crate::dispatch::{InstructionSet, LaneJob};
use crate::error::DynamicsError;
use crate::lanes::Lanes;
use crate::real::{Bits, OutOfLine, Pairs, Real};
use crate::threads::{on_threads, thread_count};

/// Peak rate of fused multiply-adds [flop/s], measured on `threads` threads for about `seconds` each.
///
/// # Errors
/// If the threads cannot be started.
pub fn fma_peak(set: InstructionSet, threads: usize, seconds: f64) -> Result<f64, DynamicsError> {
    let span = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::ZERO);
    let chains = vec![FmaChains { span }; thread_count(threads)];
    Ok(on_threads(threads, chains, |chains| set.run_narrow(chains))?.into_iter().sum())
}

#[derive(Clone, Copy)]
struct FmaChains {
    span: Duration,
}

/// Vectors with independent chains, which hide the latency of current processors and fit the registers of all.
const VECTORS: usize = 12;
/// Fewest packs: those of plain lanes are arrays that the compiler turns into vectors.
const FEWEST_PACKS: usize = 3;
const ROUNDS: u32 = 100_000;

impl LaneJob for FmaChains {
    type Output = f64;
    type Home = Self;
    #[inline(always)]
    #[allow(clippy::cast_precision_loss)] // operation counts stay far below 2^52
    fn run<R: Lanes>(self) -> f64 {
        let factor = R::splat(black_box(0.999_999));
        let addend = R::splat(black_box(1e-6));
        let mut chains = [R::splat(black_box(1.0)); VECTORS];
        let chains = &mut chains[..(VECTORS / R::PIECES).max(FEWEST_PACKS)];
        let start = Instant::now();
        let mut flops = 0_u64;
        while start.elapsed() < self.span {
            for _ in 0..ROUNDS {
                for chain in chains.iter_mut() {
                    *chain = chain.mul_add(factor, addend);
                }
            }
            flops += 2 * u64::from(ROUNDS) * (chains.len() * R::WIDTH) as u64;
        }
        let seconds = start.elapsed().as_secs_f64();
        for chain in chains {
            chain.for_each(|_, value| {
                black_box(value);
            });
        }
        flops as f64 / seconds
    }
}

/// Arithmetic operations of one Runge-Kutta step and one residual, counted by running them.
pub(crate) fn flops_per_step<M: DamperModel>(model: M, theta: &[f64]) -> u64 {
    let theta: Vec<Counted> = theta.iter().map(|&value| Counted(value)).collect();
    let p = model.parameters(&theta);
    let motion = Motion { displacement: 1e-3, velocity: 1e-2 };
    FLOPS.set(0);
    let mut state = M::State::<Counted>::from_fn(|_| Counted(0.5));
    if M::SPEC.n_states > 0 {
        state = M::step::<Counted, f64, false>([&p; 3], state, [motion; 3], 1e-3);
    }
    let residual = M::force(&p, state, motion.splat()) - Counted(1.0);
    let _squared = residual.mul_add(residual, Counted(0.0));
    FLOPS.get()
}

thread_local! {
    static FLOPS: Cell<u64> = const { Cell::new(0) };
}

fn count(flops: u64) {
    FLOPS.set(FLOPS.get() + flops);
}

/// An `f64` that counts its additions, multiplications and divisions.
#[derive(Clone, Copy)]
struct Counted(f64);

macro_rules! counted_operator {
    ($trait:ident $method:ident) => {
        impl $trait for Counted {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                count(1);
                Self($trait::$method(self.0, other.0))
            }
        }
    };
}
counted_operator!(Add add);
counted_operator!(Sub sub);
counted_operator!(Mul mul);
counted_operator!(Div div);

impl Neg for Counted {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl Real for Counted {
    type Mask = bool;
    type Piece = Self;
    const PIECES: usize = 1;
    fn piece(&self, _: usize) -> Self {
        *self
    }
    fn set_piece(&mut self, _: usize, piece: Self) {
        *self = piece;
    }
    fn splat(value: f64) -> Self {
        Self(value)
    }
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        count(2);
        Self(self.0.mul_add(factor.0, addend.0))
    }
    fn abs(self) -> Self {
        Self(self.0.abs())
    }
    fn sqrt(self) -> Self {
        count(1);
        Self(self.0.sqrt())
    }
    fn copysign(self, sign: Self) -> Self {
        Self(self.0.copysign(sign.0))
    }
    fn by_sign(self, positive: Self, negative: Self) -> Self {
        Self(self.0.by_sign(positive.0, negative.0))
    }
    fn min(self, other: Self) -> Self {
        Self(Real::min(self.0, other.0))
    }
    fn max(self, other: Self) -> Self {
        Self(Real::max(self.0, other.0))
    }
    fn round_ties_even(self) -> Self {
        Self(self.0.round_ties_even())
    }
    fn less(self, other: Self) -> bool {
        self.0 < other.0
    }
    fn equal(self, other: Self) -> bool {
        self.0.equal(other.0)
    }
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        if mask { yes } else { no }
    }
    fn out_of_line<W: OutOfLine>(work: W) {
        work.run();
    }
    fn all(mask: bool) -> bool {
        mask
    }
    fn any(mask: bool) -> bool {
        mask
    }
}

impl Bits for Counted {
    fn octave(self) -> (Self, Self, Self) {
        let (exponent, mantissa, sixteenth) = self.0.octave();
        (Self(exponent), Self(mantissa), Self(sixteenth))
    }
    fn entry_of(self, table: &'static [f64; 16]) -> Self {
        Self(self.0.entry_of(table))
    }
    fn pair_of(self, pairs: &'static Pairs) -> (Self, Self) {
        let (first, second) = self.0.pair_of(pairs);
        (Self(first), Self(second))
    }
    fn half_of_two_to(k: Self) -> Self {
        Self(f64::half_of_two_to(k.0))
    }
    fn times_two_to(self, aligned: Self) -> Self {
        Self(self.0.times_two_to(aligned.0))
    }
}
