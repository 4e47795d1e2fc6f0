//! Every operation of every instruction set, in packs of every width, against the same operation on one `f64`.

#![allow(clippy::cast_precision_loss, clippy::float_cmp)]

use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

use mrwork_dynamics::dispatch::{InstructionSet, LaneJob};
use mrwork_dynamics::elementary::{self, exp, ln, powf, tanh};
use mrwork_dynamics::error::DynamicsError;
use mrwork_dynamics::lanes::Lanes;
use mrwork_dynamics::real::{Bits, Pairs, Real, SIXTEENTH_ALIGNER};

/// Batch sizes that reach every width of pack: one number, then 8, 16, 32 and 48 lanes.
const BATCHES: [usize; 5] = [1, 8, 16, 32, 48];

const SPECIAL: [f64; 24] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    0.5,
    1.5,
    2.5,
    -2.5,
    0.499_999_999_999_999_94,
    1.0e-300,
    -1.0e-300,
    5e-324,
    -5e-324,
    2.225_073_858_507_201_4e-308,
    1.797_693_134_862_315_7e308,
    -1.797_693_134_862_315_7e308,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::NAN,
    4_503_599_627_370_497.5,
    -4_503_599_627_370_495.5,
    9_007_199_254_740_993.0,
    FRAC_1_SQRT_2,
    SQRT_2,
];

/// An operation on three numbers, written for any number of lanes.
trait Operation: Copy {
    fn apply<R: Bits>(self, a: R, b: R, c: R) -> R;
}

macro_rules! operations {
    ($($name:ident: |$a:ident, $b:ident, $c:ident| $value:expr;)+) => {
        $(
            #[derive(Clone, Copy)]
            struct $name;
            impl Operation for $name {
                #[inline(always)]
                #[allow(unused_variables)] // not every operation takes three numbers
                fn apply<R: Bits>(self, $a: R, $b: R, $c: R) -> R {
                    $value
                }
            }
        )+

        /// Where each operation differs from the scalar over these numbers.
        pub fn differences(set: InstructionSet, numbers: &[[f64; 3]]) -> Vec<String> {
            let mut found = Vec::new();
            $(found.extend(difference(stringify!($name), $name, set, numbers));)+
            found
        }
    };
}

operations! {
    Addition: |a, b, c| a + b;
    Subtraction: |a, b, c| a - b;
    Multiplication: |a, b, c| a * b;
    Division: |a, b, c| a / b;
    Negation: |a, b, c| -a;
    FusedMultiplyAdd: |a, b, c| a.mul_add(b, c);
    Magnitude: |a, b, c| a.abs();
    SignOfAnother: |a, b, c| a.copysign(b);
    BySign: |a, b, c| a.by_sign(b, c);
    Smaller: |a, b, c| Real::min(a, b);
    Larger: |a, b, c| Real::max(a, b);
    Rounding: |a, b, c| a.round_ties_even();
    Less: |a, b, c| R::select(a.less(b), R::splat(1.0), R::splat(0.0));
    Equal: |a, b, c| R::select(a.equal(b), R::splat(1.0), R::splat(0.0));
    EqualToItself: |a, b, c| R::select(a.equal(a), R::splat(1.0), R::splat(0.0));
    Selection: |a, b, c| R::select(a.less(b), b, c);
    Splat: |a, b, c| R::splat(-0.1);
}

/// Operations that take positive normal numbers, or small integers, only.
mod of_normal {
    use super::*;

    static SIXTEEN: [f64; 16] =
        [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0];
    static PAIRS: Pairs = Pairs::of(SIXTEEN, [1.5; 16]);

    operations! {
        Exponent: |a, b, c| a.octave().0;
        Mantissa: |a, b, c| a.octave().1;
        Entry: |a, b, c| a.octave().2.entry_of(&SIXTEEN);
        FirstOfPair: |a, b, c| a.octave().2.pair_of(&PAIRS).0;
        SecondOfPair: |a, b, c| a.octave().2.pair_of(&PAIRS).1;
        TimesTwoTo: |a, b, c| a.times_two_to(b + R::splat(SIXTEENTH_ALIGNER));
        ZeroWhere: |a, b, c| R::zero_where(b.less(c), a);
        HalfOfTwoTo: |a, b, c| R::half_of_two_to(Real::min(R::splat(900.0), Real::max(R::splat(-900.0), b)).round_ties_even());
        Exponential: |a, b, c| exp(b);
        Logarithm: |a, b, c| ln(a);
        Power: |a, b, c| powf(a, &elementary::Exponent::of(c));
        HyperbolicTangent: |a, b, c| tanh(b);
    }
}

struct OverLanes<'a, O> {
    operation: O,
    numbers: &'a [[f64; 3]],
}

impl<O: Operation> LaneJob for OverLanes<'_, O> {
    type Home = Self;
    type Output = (usize, Vec<f64>);
    #[inline(always)]
    fn run<R: Lanes + Bits>(self) -> (usize, Vec<f64>) {
        let mut results = Vec::with_capacity(self.numbers.len());
        for chunk in self.numbers.chunks(R::WIDTH) {
            let last = chunk.len() - 1;
            let [a, b, c] = [0, 1, 2].map(|i: usize| R::from_fn(|lane| chunk[lane.min(last)][i]));
            self.operation.apply(a, b, c).for_each(|lane, value| {
                if lane < chunk.len() {
                    results.push(value);
                }
            });
        }
        (R::WIDTH, results)
    }
}

/// Same bits, where any NaN is as good as another: no operation promises which one it returns.
fn same(left: f64, right: f64) -> bool {
    left.to_bits() == right.to_bits() || (left.is_nan() && right.is_nan())
}

fn difference<O: Operation>(
    name: &str,
    operation: O,
    set: InstructionSet,
    numbers: &[[f64; 3]],
) -> Option<String> {
    BATCHES.into_iter().find_map(|batch| {
        let (width, results) = set.run(batch, OverLanes { operation, numbers });
        results.into_iter().zip(numbers).find_map(|(found, &[a, b, c])| {
            let expected = operation.apply(a, b, c);
            (!same(found, expected)).then(|| {
                format!(
                    "{name}({a:e}, {b:e}, {c:e}) on {width} lanes of {}: {found:e}, not {expected:e}",
                    set.name()
                )
            })
        })
    })
}

/// Any bit pattern: a linear congruential generator over 64 bits, top half kept and mixed.
fn random_bits(n: usize) -> impl Iterator<Item = f64> {
    let mut state = 0x9E37_79B9_7F4A_7C15_u64;
    (0..n).map(move |_| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        f64::from_bits(state ^ (state >> 29))
    })
}

/// Numbers in [0, 1).
fn random_unit(n: usize) -> impl Iterator<Item = f64> {
    random_bits(n).map(|x| (x.to_bits() >> 11) as f64 / (1_u64 << 53) as f64)
}

#[test]
fn operations_on_lanes_are_those_on_one_number() {
    let mut numbers: Vec<[f64; 3]> = Vec::new();
    for a in SPECIAL {
        for b in SPECIAL {
            numbers.extend(SPECIAL.map(|c| [a, b, c]));
        }
    }
    let bits: Vec<f64> = random_bits(9_000).collect();
    numbers.extend(bits.chunks_exact(3).map(|x| [x[0], x[1], x[2]]));
    let near_one: Vec<f64> = random_unit(9_000).map(|u| 8.0 * u - 4.0).collect();
    numbers.extend(near_one.chunks_exact(3).map(|x| [x[0], x[1], x[2]]));
    for set in InstructionSet::usable() {
        assert_eq!(differences(set, &numbers), Vec::<String>::new());
    }
}

#[test]
fn operations_on_normal_numbers_are_those_on_one_number() {
    // A positive number over 600 decades, a small integer, an exponent of the models.
    let unit: Vec<f64> = random_unit(9_000).collect();
    let mut numbers: Vec<[f64; 3]> = unit
        .chunks_exact(3)
        .map(|u| [10f64.powf(600.0 * u[0] - 300.0), (40.0 * u[1] - 20.0).round(), 1.0 + 5.0 * u[2]])
        .collect();
    numbers
        .extend(unit.chunks_exact(3).map(|u| [u[0] + 1e-9, (6.0 * u[1] - 3.0).round(), (6.0 * u[2]).ceil()]));
    // Scaling by whole sixteenths, from the smallest result to beyond the largest.
    numbers.extend(
        unit.chunks_exact(3)
            .map(|u| [0.5 + 1.5 * u[0], (16.0 * (2100.0 * u[1] - 1020.0)).round() / 16.0, 1.0 + u[2]]),
    );
    // The exponent steps at 1/sqrt(2): its neighbours on either side, and the edges of a binade.
    let step = [FRAC_1_SQRT_2.next_down(), FRAC_1_SQRT_2, FRAC_1_SQRT_2.next_up(), SQRT_2, SQRT_2.next_up()];
    for edge in step.into_iter().chain([f64::MIN_POSITIVE, 1.0, 1.0_f64.next_down()]) {
        numbers.push([edge, 1.0, 2.0]);
    }
    for set in InstructionSet::usable() {
        assert_eq!(of_normal::differences(set, &numbers), Vec::<String>::new());
    }
}

struct Quantifiers<'a>(&'a [f64]);

impl LaneJob for Quantifiers<'_> {
    type Home = Self;
    type Output = Vec<[bool; 4]>;
    #[inline(always)]
    fn run<R: Lanes>(self) -> Vec<[bool; 4]> {
        // Each lane in turn is the odd one out.
        (0..R::WIDTH)
            .map(|odd| {
                let one = R::from_fn(|lane| if lane == odd { self.0[0] } else { self.0[1] });
                let mask = one.less(R::splat(0.0));
                let negated = (-one).less(R::splat(0.0));
                [R::any(mask), R::all(mask), R::any(negated), R::all(negated)]
            })
            .collect()
    }
}

#[test]
fn one_lane_decides_any_and_all() {
    // Of several: without vectors a pack is one number.
    for set in InstructionSet::usable().filter(|set| set.run(1, Width) > 1) {
        for batch in &BATCHES[1..] {
            for answer in set.run(*batch, Quantifiers(&[-1.0, 1.0])) {
                assert_eq!(answer, [true, false, true, false], "{}", set.name());
            }
            for answer in set.run(*batch, Quantifiers(&[-1.0, -1.0])) {
                assert_eq!(answer, [true, true, false, false], "{}", set.name());
            }
            // A comparison with NaN holds in neither direction.
            for answer in set.run(*batch, Quantifiers(&[f64::NAN, f64::NAN])) {
                assert_eq!(answer, [false; 4], "{}", set.name());
            }
        }
    }
}

struct Width;

impl LaneJob for Width {
    type Home = Self;
    type Output = usize;
    #[inline(always)]
    fn run<R: Lanes>(self) -> usize {
        R::WIDTH
    }
}

#[test]
fn candidates_run_in_lanes_that_hold_them_and_a_full_block_in_one_pack() {
    // Without vectors a pack is one number, and a block is several packs side by side.
    for set in InstructionSet::usable().filter(|set| set.run(1, Width) > 1) {
        assert_eq!(set.run(1, Width), 8);
        assert_eq!(set.run_narrow(Width), 8);
        assert_eq!(set.run(set.block_width(), Width), set.block_width());
        assert!(set.side_by_side_width() >= set.block_width());
        for candidates in 1..=set.block_width() {
            assert!(set.run(candidates, Width) >= candidates, "{candidates} candidates on {}", set.name());
        }
    }
}

#[test]
fn batches_run_on_the_fastest_set_of_build_and_processor() {
    let usable: Vec<_> = InstructionSet::usable().map(InstructionSet::name).collect();
    assert_eq!(InstructionSet::detect().map(InstructionSet::name), Ok(usable[0]));
    let of_both =
        InstructionSet::of_build().filter(|name| InstructionSet::of_processor().any(|other| other == *name));
    assert_eq!(of_both.collect::<Vec<_>>(), usable);
}

#[test]
fn a_processor_without_the_sets_of_the_build_is_told_what_to_build() {
    let error = DynamicsError::Processor { of_build: vec!["avx512"], of_processor: vec!["avx2", "plain"] };
    let sentence = error.to_string();
    for part in ["for processors with avx512", "this one has avx2 and plain", "MRWORK_BUILD_SETS=avx2 "] {
        assert!(sentence.contains(part), "{sentence}");
    }
}
