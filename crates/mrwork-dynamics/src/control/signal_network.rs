//! Bounded feedback of measured signals: a small network, with numbers that are given.

use super::clipped_optimal::GAIN;
use super::law::Formula;
use super::measurement::Measurement;
use super::spec::{GainSpec, Gains, LawSpec, Shape, Unit};
use crate::elementary::tanh;
use crate::lanes::Lanes;

/// Deformation, rate, force, desired force.
const SIGNALS: usize = 4;
/// Hidden units of the network.
const UNITS: usize = 4;
/// Numbers of a hidden unit: its bias, the weights of its inputs, its weight in the output.
const OF_UNIT: usize = SIGNALS + 2;

/// One hidden layer of hyperbolic tangents, even in its signals.
pub struct SignalNetwork;

impl Formula for SignalNetwork {
    const SPEC: LawSpec = LawSpec {
        name: "signal_network",
        title: "Network of measured signals",
        equation: "i = i_max (1 + tanh(b + sum_k v_k (tanh(b_k + w_k'c) + tanh(b_k - w_k'c))))/2, \
                   c = (d, d', f, f_c), f_c = -K s",
        description: "A small network of the damper displacement, its rate, the damper force and the desired force of a \
                      regulator, of numbers that are learned. It sends the same command where all signals change \
                      sign, and between 0 and i_max whatever its numbers are, so a semi-active damper only resists \
                      motion. Needs the measured force.",
        source: "our definition",
        gains: &[
            GAIN,
            GainSpec {
                name: "network",
                unit: Unit::Of("inputs in SI units"),
                shape: Shape::Numbers(UNITS * OF_UNIT + 1),
                description: "for each of four hidden units its bias b_k, the weights w_k of its four inputs and its \
                              weight v_k in the output; last the bias b of the output",
            },
        ],
        ..LawSpec::PLAIN
    };

    #[inline(always)]
    fn command<R: Lanes>(gains: &Gains<'_, R>, measured: &Measurement<'_, R>, command: &mut [R]) {
        let (half, one) = (R::splat(0.5), R::splat(1.0));
        for (device, command) in command.iter_mut().enumerate() {
            let desired = -gains.of_state(0, device, measured);
            let inputs =
                [measured.deformation[device], measured.rate[device], measured.force[device], desired];
            let (units, bias) = gains.numbers(1, device).split_at(UNITS * OF_UNIT);
            let mut sum = bias[0];
            for unit in units.chunks_exact(OF_UNIT) {
                let (mut inner, bias) = (R::splat(0.0), unit[0]);
                for (&input, &weight) in inputs.iter().zip(&unit[1..=SIGNALS]) {
                    inner = input.mul_add(weight, inner);
                }
                let even = tanh(bias + inner) + tanh(bias - inner);
                sum = even.mul_add(unit[SIGNALS + 1], sum);
            }
            *command = half * (one + tanh(sum)) * R::splat(measured.largest[device]);
        }
    }
}
