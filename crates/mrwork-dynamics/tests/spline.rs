//! The loading history: the spline between samples, its velocity, and how severe it is.

#![allow(clippy::cast_precision_loss, clippy::expect_used, clippy::float_cmp)]

use std::borrow::Cow;

use mrwork_dynamics::damper::Motion;
use mrwork_dynamics::error::DynamicsError;
use mrwork_dynamics::loading::{LoadingHistory, MAX_SUBSTEPS, MIN_SAMPLES};

const DT: f64 = 0.01;

fn sampled(n_time: usize, function: impl Fn(f64) -> f64) -> Vec<f64> {
    (0..n_time).map(|i| function(i as f64 * DT)).collect()
}

fn history(displacement: &[f64], velocity: Option<&[f64]>) -> LoadingHistory<'static> {
    LoadingHistory::new(DT, displacement, velocity).expect("a valid history")
}

/// Times and motions at `per_interval` equally spaced points of every interval, both ends included.
fn dense(history: &LoadingHistory<'_>, per_interval: u32) -> Vec<(f64, Motion<f64>)> {
    let points = 2 * per_interval as usize + 1;
    let stages = history.stages(per_interval);
    assert_eq!(stages.len(), (history.n_time() - 1) * points);
    let time = |i: usize| ((i / points) as f64 + (i % points) as f64 / (points - 1) as f64) * DT;
    stages.into_iter().enumerate().map(|(i, motion)| (time(i), motion)).collect()
}

/// A rough motion: numbers in [-1, 1) that fill it evenly and jump about.
fn rough(n_time: usize) -> Vec<f64> {
    (0..n_time).map(|i| 2.0 * (0.3 + i as f64 * 0.618_033_988_749_894_9).fract() - 1.0).collect()
}

#[test]
fn cubics_are_reproduced_with_their_velocity() {
    let cubic = |t: f64| 0.3 - 2.0 * t + 5.0 * t * t - 7.0 * t * t * t;
    let slope = |t: f64| -2.0 + 10.0 * t - 21.0 * t * t;
    for n_time in [4, 5, 6, 30] {
        let history = history(&sampled(n_time, cubic), None);
        for (t, motion) in dense(&history, 4) {
            assert!((motion.displacement - cubic(t)).abs() < 1e-14);
            // The velocity divides differences of samples by dt = 0.01.
            assert!((motion.velocity - slope(t)).abs() < 1e-12);
        }
    }
}

#[test]
fn a_given_velocity_is_splined_by_itself() {
    let x = rough(20);
    let cubic = |t: f64| 1.0 + t - 4.0 * t * t + 9.0 * t * t * t;
    let history = history(&x, Some(&sampled(20, cubic)));
    for (t, motion) in dense(&history, 3) {
        assert!((motion.velocity - cubic(t)).abs() < 1e-13);
    }
}

#[test]
fn samples_are_met_exactly() {
    let (x, v) = (rough(25), rough(40)[15..].to_vec());
    let history = history(&x, Some(&v));
    for (i, interval) in history.stages(3).chunks_exact(7).enumerate() {
        assert_eq!(interval[0], Motion { displacement: x[i], velocity: v[i] });
        // The end of a piece meets the next sample to rounding of numbers of order one.
        assert!((interval[6].displacement - x[i + 1]).abs() < 4e-15);
        assert!((interval[6].velocity - v[i + 1]).abs() < 4e-15);
    }
}

#[test]
fn displacement_is_twice_continuously_differentiable() {
    // Three derivatives of each cubic from its values at u = 0, 1/3, 2/3, 1 through the finite differences,
    // which are exact for cubics; jumps at the samples are then compared with the values themselves.
    let history = history(&rough(40), None);
    let pieces: Vec<[f64; 4]> =
        history.stages(3).chunks_exact(7).map(|s| [0, 2, 4, 6].map(|i: usize| s[i].displacement)).collect();
    let first = |[a, b, c, d]: [f64; 4]| [-5.5 * a + 9.0 * b - 4.5 * c + d, -a + 4.5 * b - 9.0 * c + 5.5 * d];
    let second = |[a, b, c, d]: [f64; 4]| {
        [18.0 * a - 45.0 * b + 36.0 * c - 9.0 * d, -9.0 * a + 36.0 * b - 45.0 * c + 18.0 * d]
    };
    for pair in pieces.windows(2) {
        assert!((first(pair[0])[1] - first(pair[1])[0]).abs() < 1e-12);
        assert!((second(pair[0])[1] - second(pair[1])[0]).abs() < 1e-11);
    }
    // Not-a-knot: the first two pieces are one cubic, and so are the last two.
    let third = |[a, b, c, d]: [f64; 4]| 27.0 * (d - 3.0 * c + 3.0 * b - a);
    let last = pieces.len() - 1;
    assert!((third(pieces[0]) - third(pieces[1])).abs() < 1e-10);
    assert!((third(pieces[last]) - third(pieces[last - 1])).abs() < 1e-10);
    assert!((third(pieces[5]) - third(pieces[6])).abs() > 1e-3, "inner pieces are cubics of their own");
}

#[test]
fn velocity_is_the_derivative_of_the_displacement() {
    let history = history(&rough(30), None);
    for interval in history.stages(2).chunks_exact(5) {
        // The rise of a cubic is Simpson's rule over its derivative, exactly.
        let [start, .., end] = interval else { panic!("five stages") };
        let mean = (start.velocity + 4.0 * interval[2].velocity + end.velocity) / 6.0;
        assert!((end.displacement - start.displacement - DT * mean).abs() < 1e-14);
        let half = (start.velocity + 4.0 * interval[1].velocity + interval[2].velocity) / 6.0;
        assert!((interval[2].displacement - start.displacement - 0.5 * DT * half).abs() < 1e-14);
    }
}

#[test]
fn interpolation_error_falls_with_the_fourth_power_of_the_step() {
    let error = |n_time: usize| {
        let dt = 1.0 / (n_time - 1) as f64;
        let x: Vec<f64> = (0..n_time).map(|i| (5.0 * i as f64 * dt).sin()).collect();
        let history = LoadingHistory::new(dt, &x, None).expect("a valid history");
        let middles = history.stages(1).into_iter().skip(1).step_by(3);
        middles
            .enumerate()
            .map(|(i, motion)| (motion.displacement - (5.0 * (i as f64 + 0.5) * dt).sin()).abs())
            .fold(0.0, f64::max)
    };
    let order = (error(41) / error(81)).log2();
    assert!(order > 3.7, "order {order}");
}

#[test]
fn stages_nest() {
    let history = history(&rough(12), None);
    let coarse = history.stages(2);
    let fine = history.stages(8);
    for (coarse, fine) in coarse.chunks_exact(5).zip(fine.chunks_exact(17)) {
        for (i, motion) in coarse.iter().enumerate() {
            assert_eq!(*motion, fine[4 * i]);
        }
    }
}

#[test]
fn severity_is_that_of_a_sinusoid() {
    let (amplitude, omega) = (0.02, 12.0);
    let history = history(&sampled(400, |t| amplitude * (omega * t).sin()), None);
    let severity = history.severity();
    assert!((severity.peak_velocity / (amplitude * omega) - 1.0).abs() < 1e-3);
    // The acceleration is largest, A omega^2, where the velocity changes sign.
    assert!((severity.reversal_acceleration / (amplitude * omega * omega) - 1.0).abs() < 1e-2);
}

#[test]
fn peak_speed_between_samples_counts() {
    // The velocity peaks midway between two samples.
    let x = sampled(40, |t| 0.01 * (40.0 * (t - 0.155)).sin());
    let v = sampled(40, |t| 0.4 * (40.0 * (t - 0.155)).cos());
    let at_samples = v.iter().fold(0.0, |peak: f64, v| peak.max(v.abs()));
    assert!(history(&x, Some(&v)).severity().peak_velocity > at_samples);
}

#[test]
fn a_motion_that_never_reverses_has_no_reversal_acceleration() {
    let severity = history(&sampled(30, |t| 0.1 * t + t * t), None).severity();
    assert_eq!(severity.reversal_acceleration, 0.0);
    let still = history(&[0.02; 10], None).severity();
    assert_eq!((still.peak_velocity, still.reversal_acceleration), (0.0, 0.0));
}

#[test]
fn what_is_no_history_is_refused() {
    let x = rough(10);
    let refusal = |dt, x: &[f64], v: Option<&[f64]>| LoadingHistory::new(dt, x, v).expect_err("a refusal");
    for dt in [0.0, -1e-3, f64::INFINITY] {
        assert_eq!(refusal(dt, &x, None), DynamicsError::Step(dt));
    }
    assert!(matches!(refusal(f64::NAN, &x, None), DynamicsError::Step(_)));
    assert_eq!(refusal(DT, &x[..3], None), DynamicsError::TooShort { found: 3, needed: MIN_SAMPLES });
    assert_eq!(
        refusal(DT, &x, Some(&x[1..])),
        DynamicsError::LengthMismatch { name: "velocity", found: 9, expected: 10 }
    );
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut broken = x.clone();
        broken[7] = bad;
        assert_eq!(refusal(DT, &broken, None), DynamicsError::NotFinite { name: "displacement", sample: 7 });
        assert_eq!(refusal(DT, &x, Some(&broken)), DynamicsError::NotFinite { name: "velocity", sample: 7 });
    }
}

#[test]
fn a_history_of_borrowed_parts_is_the_one_that_they_came_from() {
    let whole = history(&rough(12), None);
    let borrowed = LoadingHistory::from_parts(
        whole.dt(),
        Cow::Borrowed(whole.coefficients()),
        whole.last(),
        whole.severity(),
    );
    assert_eq!(borrowed.n_time(), whole.n_time());
    assert_eq!(borrowed.stages(4), whole.stages(4));
    assert_eq!(borrowed.last(), whole.last());
}

#[test]
fn a_number_of_substeps_that_is_no_power_of_two_is_refused() {
    for found in [0, 3, 2 * MAX_SUBSTEPS] {
        let refusal = history(&rough(12), None).with_substeps(found).expect_err("a refusal");
        assert_eq!(refusal, DynamicsError::Substeps { found, most: MAX_SUBSTEPS });
    }
}
