//! Two dampers in opposition may be counted as one of twice the force where a model says that it is odd and that its
//! offsets only add to the force: here every model that says so is held to it, all over its box.

use mrwork_dynamics::damper::{Motion, REGISTRY};
use mrwork_dynamics::parameters::{ParamSpec, Scale};

const POINTS: usize = 400;

/// Numbers between 0 and 1, as even as few can be (the generalised golden ratio in each dimension).
fn share(point: usize, dimension: usize) -> f64 {
    #[allow(clippy::cast_precision_loss)] // a few hundred points
    let (point, dimension) = (point as f64, dimension as f64);
    (0.5 + point * 0.618_033_988_749_894_9 * (1.0 + 0.414_213_562_373_095 * dimension)).fract()
}

/// A parameter within a hundredfold of its nominal value, as far as the box goes.
fn near(parameter: &ParamSpec, share: f64) -> f64 {
    let reach = match parameter.scale {
        Scale::Log => parameter.nominal * 100f64.powf(2.0 * share - 1.0),
        _ => parameter.nominal + (2.0 * share - 1.0) * parameter.nominal.abs().max(1e-3),
    };
    reach.clamp(parameter.lower, parameter.upper)
}

#[test]
fn odd_models_are_odd_but_for_offsets_that_add_to_the_force() {
    let mut judged = 0;
    for &damper in REGISTRY {
        let spec = damper.spec();
        if !(spec.odd && spec.offset_adds) {
            continue;
        }
        judged += 1;
        let rest = vec![0.0; spec.n_states];
        for point in 0..POINTS {
            let theta: Vec<f64> = spec
                .parameters
                .iter()
                .enumerate()
                .map(|(index, parameter)| near(parameter, share(point, index)))
                .collect();
            let centred: Vec<f64> = spec
                .parameters
                .iter()
                .zip(&theta)
                .map(|(parameter, &value)| if parameter.scale == Scale::Offset { 0.0 } else { value })
                .collect();
            let state: Vec<f64> =
                (0..spec.n_states).map(|index| 2e-2 * (share(point, 20 + index) - 0.5)).collect();
            let mirrored: Vec<f64> = state.iter().map(|value| -value).collect();
            let motion = Motion {
                displacement: 0.1 * (share(point, 30) - 0.5),
                velocity: (share(point, 31) - 0.5) * 10f64.powf(-4.0 * share(point, 32)),
            };
            let opposed = Motion { displacement: -motion.displacement, velocity: -motion.velocity };
            let force = damper.force(&theta, &state, motion);
            let other = damper.force(&theta, &mirrored, opposed);
            let still = damper.force(&theta, &rest, Motion { displacement: 0.0, velocity: 0.0 });
            let size = force.abs() + other.abs() + still.abs() + f64::MIN_POSITIVE;
            assert!(
                (force + other - 2.0 * still).abs() <= 1e-12 * size,
                "{}: {force} and {other} around {still} at {theta:?}, {state:?}, {motion:?}",
                spec.name
            );
            // So one of twice the force without offsets is two in opposition: half of their difference.
            let alone = damper.force(&centred, &state, motion);
            assert!((0.5 * (force - other) - alone).abs() <= 1e-12 * size, "{} without offsets", spec.name);
            // States that begin at rest stay mirrored.
            let rates = [
                damper.rate(&theta, &state, motion),
                damper.rate(&theta, &mirrored, opposed),
                damper.rate(&centred, &state, motion),
            ];
            let [own, opposed, centred] = &rates;
            for ((one, mirror), without) in own.iter().zip(opposed).zip(centred) {
                assert!((one + mirror).abs() <= 1e-12 * one.abs(), "{}: {one}, {mirror}", spec.name);
                assert!((one - without).abs() <= 1e-12 * one.abs(), "{}: {one}, {without}", spec.name);
            }
        }
    }
    assert!(judged > 10);
}
