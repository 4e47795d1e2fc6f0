//! The inverse of the damper as a small network: from motion and wanted force to command.

use super::clipped_optimal::GAIN;
use super::{ControlLaw, Gains, LawSpec, Seen};
use crate::elementary::tanh;
use crate::lanes::Lanes;

/// One hidden layer of hyperbolic tangents.
pub struct InverseNetwork;

/// Deformation, rate, wanted force.
const FEWEST_INPUTS: usize = 3;

impl ControlLaw for InverseNetwork {
    const SPEC: LawSpec = LawSpec {
        name: "inverse_network",
        title: "Linear regulator, network as inverse",
        equation: "i = w2' tanh(W1 (d, d', f_c, and the same a sample before) + b1) + b2, f_c = -K s",
        description: "The inverse model as the literature has it. `layer` has a row for each hidden unit: its bias, the \
                      weights of its inputs in SI units, its weight in the output; `output` is b2 and the number of \
                      inputs: with three the previous sample is left out.",
        source: "after Chang, Zhou, J. Struct. Eng. 128(2), 2002; form our own",
        gains: &[GAIN],
        tables: &["layer", "output"],
        memory: FEWEST_INPUTS,
        wants_curve: false,
    };

    #[inline(always)]
    fn command<R: Lanes>(gains: &Gains<'_, R>, seen: &Seen<'_, R>, memory: &mut [R], command: &mut [R]) {
        let (layer, output) = (&gains.tables[0], &gains.tables[1]);
        let n_inputs = if output[1] > 3.0 { 2 * FEWEST_INPUTS } else { FEWEST_INPUTS };
        for (device, (command, before)) in
            command.iter_mut().zip(memory.chunks_exact_mut(FEWEST_INPUTS)).enumerate()
        {
            let wanted = -gains.of_state(0, device, seen.state);
            let now = [seen.deformation[device], seen.rate[device], wanted];
            let mut sum = R::splat(output[0]);
            for unit in layer.chunks_exact(n_inputs + 2) {
                let mut inner = R::splat(unit[0]);
                for (&input, &weight) in now.iter().chain(before.iter()).zip(&unit[1..=n_inputs]) {
                    inner = input.mul_add(R::splat(weight), inner);
                }
                sum = tanh(inner).mul_add(R::splat(unit[n_inputs + 1]), sum);
            }
            before.copy_from_slice(&now);
            *command = sum;
        }
    }
}
