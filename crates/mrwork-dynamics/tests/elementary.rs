//! The elementary functions against multi-precision values, and their exact cases.

// Exact comparison is what an exact case claims; counters and mantissas become numbers on purpose.
#![allow(
    clippy::float_cmp,
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::expect_used
)]

use astro_float::{BigFloat, Consts, RoundingMode};
use mrwork_dynamics::dispatch::{InstructionSet, LaneJob};
use mrwork_dynamics::dual::Dual;
use mrwork_dynamics::elementary::{Exponent, exp, ln, powf, tanh};
use mrwork_dynamics::lanes::{Lanes, Pack};

/// Bits of the reference: its own error is far below one part in 2^64 of a double's last place.
const PRECISION: usize = 128;
const POINTS: usize = 20_000;

/// `POINTS` numbers in [0, 1): the additive recurrence of the golden ratio, which fills evenly.
fn evenly() -> impl Iterator<Item = f64> {
    (0..POINTS).map(|i| (0.5 + i as f64 * 0.618_033_988_749_894_9).fract())
}

/// A second sequence, evenly spread together with the first (both steps are irrational).
fn independently() -> impl Iterator<Item = f64> {
    (0..POINTS).map(|i| (0.5 + i as f64 * std::f64::consts::SQRT_2).fract())
}

fn between(low: f64, high: f64) -> impl Iterator<Item = f64> {
    evenly().map(move |u| low + u * (high - low))
}

fn log_between(low: f64, high: f64) -> impl Iterator<Item = f64> {
    between(low.ln(), high.ln()).map(f64::exp)
}

/// `value / 2^power` to within 1e-15: the leading 64 bits of its mantissa.
fn leading(value: &BigFloat, power: i32) -> f64 {
    let (words, _, _, exponent, _) = value.as_raw_parts().expect("a finite number");
    words.last().map_or(0.0, |&top| top as f64 * 2f64.powi(exponent - 64 - power))
}

/// Distance of `computed` from `exact` in units of its last place.
fn error(computed: f64, exact: &BigFloat) -> f64 {
    assert!(computed.is_finite(), "{computed} where {} is expected", leading(exact, 0));
    let last_place = (computed.abs().to_bits() >> 52).max(1) as i32 - 1075;
    let difference = exact.sub(&big(computed), PRECISION, RoundingMode::None);
    leading(&difference, last_place)
}

/// The largest error of `computed` over the points, and where it is.
fn largest_error<T: Copy>(
    points: impl IntoIterator<Item = T>,
    computed: impl Fn(T) -> f64,
    mut exact: impl FnMut(T, &mut Consts) -> BigFloat,
) -> (f64, Option<T>) {
    let mut constants = Consts::new().expect("memory for the constants");
    points.into_iter().fold((0.0, None), |worst, point| {
        let error = error(computed(point), &exact(point, &mut constants));
        if error > worst.0 { (error, Some(point)) } else { worst }
    })
}

fn big(x: f64) -> BigFloat {
    BigFloat::from_f64(x, PRECISION)
}

macro_rules! assert_accurate {
    ($limit:expr, $worst:expr) => {
        let (error, point) = $worst;
        assert!(error <= $limit, "{error} units in the last place at {point:?}, at most {} expected", $limit);
        println!("largest error {error:.3} at {point:?}");
    };
}

#[test]
fn exp_is_accurate_to_a_unit_and_a_fifth() {
    let points = between(-707.0, 709.78)
        .step_by(2)
        .chain(between(-1.0, 1.0).step_by(2))
        .chain(log_between(1e-20, 1.0).step_by(8).flat_map(|x| [x, -x]))
        .chain([0.0, -0.0, 1.0, -707.0, 709.782, f64::MIN_POSITIVE, 5e-324]);
    assert_accurate!(1.2, largest_error(points, exp, |x, c| big(x).exp(PRECISION, RoundingMode::None, c)));
}

#[test]
fn ln_is_accurate_to_one_unit() {
    let near_one = log_between(1e-16, 0.5).flat_map(|d| [1.0 + d, 1.0 - d]);
    let points = log_between(f64::MIN_POSITIVE, 1.7e308)
        .step_by(2)
        .chain(between(0.5, 2.0).step_by(2))
        .chain(near_one.step_by(16))
        .chain([f64::MIN_POSITIVE, f64::MAX, 1.0f64.next_up(), 1.0f64.next_down(), 2.0, 0.5]);
    assert_accurate!(
        1.0,
        largest_error(points.filter(|&x| x != 1.0), ln, |x, c| {
            big(x).ln(PRECISION, RoundingMode::None, c)
        })
    );
}

#[test]
fn powf_is_accurate_to_a_unit_and_a_half() {
    let exponents = || independently().map(|u| 1.0 + 9.0 * u);
    let points = log_between(1e-12, 1e6)
        .zip(exponents())
        .step_by(2)
        .chain(between(0.0, 2.0).zip(exponents()).step_by(4))
        .chain(between(0.999, 1.001).zip(exponents()).step_by(8))
        .chain(log_between(1e-300, 1e300).zip(exponents()).step_by(8))
        // Exponents that only just miss the whole ones.
        .chain(
            log_between(1e-3, 1e3)
                .zip([1.0f64.next_up(), 2.0f64.next_down(), 3.0 + 1e-9].into_iter().cycle())
                .step_by(8),
        );
    let normal = points.filter(|&(x, n)| x > 0.0 && (n * x.ln()).abs() < 708.0);
    assert_accurate!(
        1.5,
        largest_error(
            normal,
            |(x, n)| powf(x, &Exponent::of(n)),
            |(x, n), c| {
                let exponent =
                    big(x).ln(PRECISION, RoundingMode::None, c).mul(&big(n), PRECISION, RoundingMode::None);
                exponent.exp(PRECISION, RoundingMode::None, c)
            }
        )
    );
}

#[test]
fn tanh_is_accurate_to_two_units() {
    let points = between(-1.2, 1.2)
        .step_by(2)
        .chain(between(-20.0, 20.0).step_by(4))
        .chain(log_between(1e-300, 20.0).step_by(8))
        .chain(log_between(1e-3, 1.0).step_by(4));
    assert_accurate!(
        2.0,
        largest_error(points, tanh, |x, c| {
            // e^(2x) - 1 loses as many digits as 2x has zeros in front: those are replaced by the series.
            if x.abs() < 1e-20 {
                return big(x);
            }
            let power = big(2.0 * x).exp(2 * PRECISION, RoundingMode::None, c);
            let one = BigFloat::from_f64(1.0, PRECISION);
            let above = power.sub(&one, 2 * PRECISION, RoundingMode::None);
            above.div(&power.add(&one, 2 * PRECISION, RoundingMode::None), PRECISION, RoundingMode::None)
        })
    );
}

#[test]
fn exp_keeps_its_limits() {
    assert_eq!(exp(0.0), 1.0);
    assert_eq!(exp(-0.0), 1.0);
    for x in [709.79, 1e3, f64::MAX, f64::INFINITY] {
        assert_eq!(exp(x), f64::INFINITY, "exp({x})");
        assert_eq!(exp(-x).to_bits(), 0, "exp(-{x})");
    }
    assert_eq!(exp(-708.5), 0.0);
    for nan in not_a_number() {
        assert!(exp(nan).is_nan());
    }
}

#[test]
fn ln_keeps_its_limits() {
    assert_eq!(ln(1.0).to_bits(), 0);
    assert_eq!(ln(f64::INFINITY), f64::INFINITY);
    for x in [0.0, -0.0, 5e-324, f64::MIN_POSITIVE.next_down()] {
        assert_eq!(ln(x), f64::NEG_INFINITY, "ln({x})");
    }
    for x in [-5e-324, -1.0, -f64::MAX, f64::NEG_INFINITY].into_iter().chain(not_a_number()) {
        assert!(ln(x).is_nan(), "ln({x})");
    }
}

#[test]
fn powf_keeps_its_limits() {
    for n in [1.0, 1.000_001, 1.5, 2.0, 3.0, 7.25] {
        assert_eq!(powf(0.0, &Exponent::of(n)), 0.0, "0^{n}");
        assert_eq!(powf(1.0, &Exponent::of(n)), 1.0, "1^{n}");
        assert_eq!(powf(f64::INFINITY, &Exponent::of(n)), f64::INFINITY, "inf^{n}");
        assert_eq!(powf(1e300, &Exponent::of(n + 1.5)), f64::INFINITY, "1e300^({n} + 1.5)");
        assert_eq!(powf(1e-300, &Exponent::of(n + 1.5)).to_bits(), 0, "1e-300^({n} + 1.5)");
        for nan in not_a_number() {
            assert!(!powf(nan.abs(), &Exponent::of(n)).is_finite(), "NaN^{n}");
        }
    }
}

#[test]
fn tanh_keeps_its_limits() {
    for x in [0.0, 5e-324, f64::MIN_POSITIVE, 1e-300, 1e-20] {
        assert_eq!(tanh(x).to_bits(), x.to_bits(), "tanh({x})");
    }
    for x in [20.0, 20.1, 1e3, f64::MAX, f64::INFINITY] {
        assert_eq!(tanh(x), 1.0, "tanh({x})");
    }
    for nan in not_a_number() {
        assert!(tanh(nan).is_nan());
    }
}

#[test]
fn tanh_is_odd_and_bounded() {
    for x in log_between(1e-320, 1e3) {
        assert_eq!(tanh(-x).to_bits(), (-tanh(x)).to_bits(), "tanh(-{x})");
        assert!(tanh(x) <= 1.0 && tanh(x) > 0.0, "tanh({x}) = {}", tanh(x));
    }
}

/// NaN with either sign and with a payload in its low bits, which must not leak into an exponent.
fn not_a_number() -> [f64; 4] {
    [f64::NAN, -f64::NAN, f64::from_bits(0x7FF8_0000_0000_0001), f64::from_bits(0xFFFF_FFFF_FFFF_FFFF)]
}

#[test]
fn whole_exponents_are_products_whatever_the_neighbours_hold() {
    for x in log_between(1e-12, 1e6).step_by(20) {
        let product = |n: f64| match n {
            1.0 => x,
            2.0 => x * x,
            _ => x * x * x,
        };
        let all_whole = lanes(|_| x, |i| 1.0 + (i % 3) as f64);
        let mixed = lanes(|_| x, |i| if i % 2 == 0 { 1.0 + (i % 3) as f64 } else { 1.7 + 0.1 * i as f64 });
        for (n, power) in all_whole.into_iter().chain(mixed) {
            let expected = if n.fract() == 0.0 { product(n) } else { powf(x, &Exponent::of(n)) };
            assert_eq!(power.to_bits(), expected.to_bits(), "{x}^{n}");
        }
    }
}

type EightLanes = Pack<f64, 8>;

/// Exponents and powers of eight lanes.
fn lanes(base: impl Fn(usize) -> f64, exponent: impl Fn(usize) -> f64) -> [(f64, f64); EightLanes::WIDTH] {
    let mut powers = [(0.0, 0.0); EightLanes::WIDTH];
    powf(EightLanes::from_fn(base), &Exponent::of(EightLanes::from_fn(&exponent)))
        .for_each(|i, power| powers[i] = (exponent(i), power));
    powers
}

#[test]
fn neighbouring_arguments_stay_in_order() {
    // Across the seams: where the exponent of 2 changes, in the argument (ln) or in the result (exp, tanh).
    let seams = [0.5f64.sqrt(), 1.0, 2f64.sqrt(), 2.0, 2f64.ln() / 4.0, 2f64.ln() / 2.0, 1.5 * 2f64.ln()];
    for seam in seams {
        let points = (-2000..2000).map(|i| seam * (1.0 + f64::from(i) * 1e-14));
        let values: Vec<_> = points.map(|x| [exp(x), ln(x), powf(x, &Exponent::of(1.7)), tanh(x)]).collect();
        for pair in values.windows(2) {
            for (before, after) in pair[0].into_iter().zip(pair[1]) {
                assert!(before <= after, "{before} then {after} near {seam}");
            }
        }
    }
}

/// Every function of every pair of base and exponent, as bits.
struct AllFunctions<'a> {
    pairs: &'a [(f64, f64)],
}

impl LaneJob for AllFunctions<'_> {
    type Home = Self;
    type Output = Vec<[u64; 4]>;

    #[inline(always)]
    fn run<R: Lanes>(self) -> Self::Output {
        let mut bits = vec![[0; 4]; self.pairs.len()];
        for (block, bits) in self.pairs.chunks(R::WIDTH).zip(bits.chunks_mut(R::WIDTH)) {
            let x = R::from_fn(|lane| block.get(lane).map_or(1.0, |pair| pair.0));
            let n = R::from_fn(|lane| block.get(lane).map_or(1.5, |pair| pair.1));
            for (function, value) in
                [exp(x), ln(x), powf(x, &Exponent::of(n)), tanh(x)].into_iter().enumerate()
            {
                value.for_each(|lane, value| {
                    if let Some(bits) = bits.get_mut(lane) {
                        // Which NaN it is says nothing.
                        bits[function] = if value.is_nan() { f64::NAN } else { value }.to_bits();
                    }
                });
            }
        }
        bits
    }
}

#[test]
fn every_instruction_set_gives_the_bits_of_the_scalar() {
    let ends = [0.0, -0.0, -1.0, 5e-324, f64::MIN_POSITIVE, 1e300, f64::MAX, f64::INFINITY, f64::NAN];
    let bases = log_between(1e-12, 1e6).step_by(5).chain(between(-800.0, 800.0).step_by(10)).chain(ends);
    let exponents = [0.5, 1.0, 1.3, 1.7, 2.0, 2.4, 3.0, 4.0, 6.1, 9.9, -1.5].into_iter().cycle();
    let pairs: Vec<_> = bases.zip(exponents).collect();
    let scalar = AllFunctions { pairs: &pairs }.run::<f64>();
    for set in InstructionSet::usable() {
        for candidates in [1, 8, 16, 32] {
            let lanes = set.run(candidates, AllFunctions { pairs: &pairs });
            for ((pair, expected), found) in pairs.iter().zip(&scalar).zip(&lanes) {
                assert_eq!(expected, found, "{} with {candidates} candidates at {pair:?}", set.name());
            }
        }
    }
}

/// At rest a power has the slope of its right side: 1 for n = 1, 0 above; elsewhere that of calculus.
#[test]
fn slopes_of_a_power_are_those_of_calculus() {
    let along_base = |value: f64| Dual { value, tangents: [1.0, 0.0] };
    let along_exponent = |value: f64| Dual { value, tangents: [0.0, 1.0] };
    for (n, at_rest) in [(1.0, 1.0), (1.5, 0.0), (2.0, 0.0), (7.25, 0.0)] {
        assert_eq!(powf(along_base(0.0), &Exponent::of(along_exponent(n))).tangents, [at_rest, 0.0]);
        for x in [1e-3, 0.3, 1.0, 2.5] {
            let power = powf(along_base(x), &Exponent::of(along_exponent(n)));
            let expected = [n * x.powf(n - 1.0), x.powf(n) * x.ln()];
            for (found, expected) in power.tangents.iter().zip(expected) {
                assert!((found - expected).abs() <= 1e-13 * (1.0 + expected.abs()), "{x}^{n}: {found}");
            }
        }
    }
}
