//! Ground records finer than the step: the line of a step has the mean and the first moment of the record.

#![allow(clippy::expect_used)] // a test that cannot go on fails

use mrwork_dynamics::ground_motion::GroundMotion;

/// Mean of a, and of (1 - s) a, over a step, by many points of the record.
fn moments(motion: &GroundMotion, start: f64, step: f64) -> [f64; 2] {
    let points = 400_000;
    let mut sums = [0.0; 2];
    for point in 0..points {
        let s = (f64::from(point) + 0.5) / f64::from(points);
        let value =
            if start + s * step > motion.duration() { 0.0 } else { motion.acceleration(start + s * step) };
        sums = [sums[0] + value, sums[1] + (1.0 - s) * value];
    }
    sums.map(|sum| sum / f64::from(points))
}

fn record(dt: f64) -> GroundMotion {
    let samples: Vec<f64> =
        (0..97).map(|place| (f64::from(place) * 0.71).sin() + f64::from(place % 7)).collect();
    GroundMotion::new(dt, &samples).expect("a motion")
}

#[test]
fn a_line_has_the_moments_of_the_record_wherever_its_samples_fall() {
    for (dt, step) in [(1e-4, 5e-4), (1e-4, 3.7e-4), (4e-4, 5e-4), (2.5e-4, 5e-4), (1e-4, 0.02)] {
        let motion = record(dt);
        // The last step goes beyond the end.
        let count = (1..1000_u32).find(|&count| f64::from(count) * step > motion.duration()).expect("an end");
        let lines = motion.stages(step, count as usize).expect("a finer record");
        for (number, [start, middle, end]) in (0..count).zip(lines) {
            let [mean, moment] = moments(&motion, f64::from(number) * step, step);
            assert!((middle - mean).abs() < 1e-4, "{dt} {step} {number}: {middle} {mean}");
            assert!((0.5 * (start + end) - mean).abs() < 1e-4);
            // Of a line from start to end, the mean of (1 - s) a is start / 3 + end / 6.
            assert!((start / 3.0 + end / 6.0 - moment).abs() < 1e-4, "{dt} {step} {number}");
        }
    }
}

#[test]
fn a_record_that_is_a_line_over_a_step_is_that_line() {
    let samples: Vec<f64> = (0..=40).map(|place| 3.0 - 0.25 * f64::from(place)).collect();
    let lines = GroundMotion::new(1e-4, &samples).expect("a motion").stages(5e-4, 8).expect("a finer record");
    for (number, line) in (0..8).zip(lines) {
        for (half, value) in (0..3).zip(line) {
            let expected = 3.0 - 0.25 * (5.0 * f64::from(number) + 2.5 * f64::from(half));
            assert!((value - expected).abs() < 1e-12);
        }
    }
}

#[test]
fn a_record_about_as_long_as_the_step_or_longer_has_no_lines() {
    // The last two are records of 20 ms as two networks write them, under a step of 20 ms.
    for (dt, step) in
        [(0.02, 5e-4), (5e-4, 5e-4), (0.3 / 3.0, 0.1), (0.019_999_4, 0.02), (0.020_006_67, 0.02)]
    {
        assert!(record(dt).stages(step, 4).is_none());
    }
}
