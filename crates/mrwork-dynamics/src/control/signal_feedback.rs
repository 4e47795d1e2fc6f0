//! Bounded feedback of measured signals: a small network or a polynomial, with numbers that are given.

use super::clipped_optimal::GAIN;
use super::law::{ControlLaw, Memory};
use super::measurement::Measurement;
use super::spec::{GainSpec, Gains, LawSpec, Shape, Unit};
use crate::elementary::tanh;
use crate::error::DynamicsError;
use crate::lanes::Lanes;
use crate::real::{Real, within};

/// Deformation, rate, force, desired force.
const SIGNALS: usize = 4;
/// Hidden units of the network.
const UNITS: usize = 4;
/// Numbers of a hidden unit: its bias, the weights of its inputs, its weight in the output.
const OF_UNIT: usize = SIGNALS + 2;
/// Largest power of a signal in a polynomial.
const MOST_POWERS: f64 = 9.0;

#[inline(always)]
fn signals<R: Real>(gains: &Gains<'_, R>, measured: &Measurement<'_, R>, device: usize) -> [R; SIGNALS] {
    let wanted = -gains.of_state(0, device, measured);
    [measured.deformation[device], measured.rate[device], measured.force[device], wanted]
}

/// One hidden layer of hyperbolic tangents, even in its signals.
pub struct SignalNetwork;

impl ControlLaw for SignalNetwork {
    const SPEC: LawSpec = LawSpec {
        name: "signal_network",
        title: "Network of measured signals",
        equation: "i = i_max (1 + tanh(b + sum_k v_k (tanh(b_k + u_k'r + w_k'c) + tanh(b_k + u_k'r - w_k'c))))/2, \
                   c = (d, d', f, f_c), f_c = -K s",
        description: "A small network of the damper displacement, its rate, the damper force and the desired force of a \
                      regulator, of numbers that are learned. It sends the same command where all signals change \
                      sign, and between 0 and i_max whatever its numbers are, so a semi-active damper only resists \
                      motion. Needs the measured force. Further signals, where some are given: accelerations, which \
                      are added to c, and running root mean squares r, which move the bias of each hidden unit.",
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
            GainSpec {
                name: "further",
                unit: Unit::Of("inputs in SI units"),
                shape: Shape::Signal(UNITS),
                description: "for each further signal its weight in each of the four hidden units",
            },
        ],
        tables: &[],
        memory: 0,
        needs_curve: false,
        needs_model: false,
        commands_force: false,
        reads_acceleration: false,
        takes_signals: true,
        switches: false,
    };

    #[inline(always)]
    fn command<R: Lanes>(
        gains: &Gains<'_, R>,
        measured: &Measurement<'_, R>,
        memory: &mut Memory<'_, R>,
        command: &mut [R],
    ) {
        let (half, one) = (R::splat(0.5), R::splat(1.0));
        for (device, command) in command.iter_mut().enumerate() {
            let inputs = signals(gains, measured, device);
            let (units, bias) = gains.numbers(1, device).split_at(UNITS * OF_UNIT);
            let further = gains.numbers(2, device);
            memory.further.read(measured, device);
            let mut sum = bias[0];
            for (number, unit) in units.chunks_exact(OF_UNIT).enumerate() {
                let (mut inner, mut bias) = (R::splat(0.0), unit[0]);
                for (&input, &weight) in inputs.iter().zip(&unit[1..=SIGNALS]) {
                    inner = input.mul_add(weight, inner);
                }
                for (index, (&value, signal)) in memory.further.values().enumerate() {
                    let weight = further[index * UNITS + number];
                    // A root mean square does not change its sign with the signals.
                    match signal.time_constant {
                        None => inner = value.mul_add(weight, inner),
                        Some(_) => bias = value.mul_add(weight, bias),
                    }
                }
                let even = tanh(bias + inner) + tanh(bias - inner);
                sum = even.mul_add(unit[SIGNALS + 1], sum);
            }
            *command = half * (one + tanh(sum)) * R::splat(measured.largest[device]);
        }
    }
}

/// A sum of products of powers.
pub struct SignalPolynomial;

impl ControlLaw for SignalPolynomial {
    const SPEC: LawSpec = LawSpec {
        name: "signal_polynomial",
        title: "Polynomial of measured signals",
        equation: "i = i_max sat(sum_k a_k c1^p1 c2^p2 c3^p3 c4^p4), c = (d, d', f, f_c) over their reach, within -1 to \
                   1; f_c = -K s",
        description: "A polynomial of the damper displacement, its rate, the damper force and the desired force of a regulator, \
                      limited to 0 and i_max. `terms` has a row for each term: its coefficient, and the power of each \
                      signal, a whole number from 0 to 9; `reach` is the largest magnitude of each signal. Further \
                      signals, where some are given, follow as c5 and so on: accelerations, and running root mean \
                      squares.",
        source: "our definition",
        gains: &[GAIN],
        tables: &["terms", "reach"],
        memory: 0,
        needs_curve: false,
        needs_model: false,
        commands_force: false,
        reads_acceleration: false,
        takes_signals: true,
        switches: false,
    };

    #[inline(always)]
    fn command<R: Lanes>(
        gains: &Gains<'_, R>,
        measured: &Measurement<'_, R>,
        memory: &mut Memory<'_, R>,
        command: &mut [R],
    ) {
        let [terms, reach] = gains.tables else { return };
        let (zero, one) = (R::splat(0.0), R::splat(1.0));
        for (device, command) in command.iter_mut().enumerate() {
            let mut inputs = signals(gains, measured, device);
            let further = memory.further.read(measured, device);
            let mut sum = zero;
            for (input, &reach) in inputs.iter_mut().chain(further.iter_mut()).zip(reach) {
                *input = within(*input / R::splat(reach), -one, one);
                // An input that is not a number counts, even one of which no term has a power.
                sum = input.mul_add(zero, sum);
            }
            for term in terms.chunks_exact(reach.len() + 1) {
                let mut product = R::splat(term[0]);
                for (&input, &power) in inputs.iter().chain(further.iter()).zip(&term[1..]) {
                    let mut raised = 0.0;
                    while raised < power {
                        product = product * input;
                        raised += 1.0;
                    }
                }
                sum = sum + product;
            }
            *command = within(sum, zero, one) * R::splat(measured.largest[device]);
        }
    }

    fn check_tables(tables: &[Vec<f64>], n_signals: usize) -> Result<(), DynamicsError> {
        let law = Self::SPEC.name;
        let (terms, reach) = (&tables[0], &tables[1]);
        let of_term = SIGNALS + n_signals + 1;
        let whole = |power: &f64| (0.0..=MOST_POWERS).contains(power) && power.fract() == 0.0;
        let powers = || terms.chunks_exact(of_term).flat_map(|term| &term[1..]);
        if terms.is_empty() || !terms.len().is_multiple_of(of_term) || !powers().all(whole) {
            let expected = "5 for each term, its coefficient and powers that are whole numbers from 0 to 9, and a power of \
                            each further signal";
            return Err(DynamicsError::TableSize { law, table: "terms", found: terms.len(), expected });
        }
        if reach.len() + 1 != of_term || !reach.iter().all(|&each| each > 0.0 && each.is_finite()) {
            let expected = "4, all positive: of displacement, velocity, force and desired force, and one of each further \
                            signal";
            return Err(DynamicsError::TableSize { law, table: "reach", found: reach.len(), expected });
        }
        Ok(())
    }
}
