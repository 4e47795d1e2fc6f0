//! The inverse of the damper as a small neural network: command as a function of motion and desired force.

use super::clipped_optimal::GAIN;
use super::law::{Beginning, ControlLaw, Kept};
use super::measurement::Measurement;
use super::spec::{Gains, LawSpec};
use crate::elementary::tanh;
use crate::error::DynamicsError;
use crate::lanes::Lanes;
use crate::real::within;

/// Inputs of a device at the sample before; zero before the first sample.
#[derive(Clone)]
pub(crate) struct Earlier<R> {
    deformation: R,
    rate: R,
    desired: R,
}

/// One hidden layer of hyperbolic tangents.
pub struct InverseNetwork;

/// Deformation, rate, desired force.
const SIGNALS: usize = 3;

impl ControlLaw for InverseNetwork {
    const SPEC: LawSpec = LawSpec {
        name: "inverse_network",
        title: "Linear regulator, network as inverse",
        equation: "i = w2' tanh(W1 c + b1) + b2, c = (d, d', f_c, and the same a sample before), each within the range of \
                   its training; f_c = -K s",
        description: "The inverse model of the literature. `layer` has a row for each hidden unit: its bias, the \
                      weights of its inputs in SI units, its weight in the output; `output` is b2; `reach` the largest \
                      magnitude of each input. With three inputs the previous sample is left out.",
        source: "after Chang, Zhou, J. Struct. Eng. 128(2), 2002; form our own",
        gains: &[GAIN],
        tables: &["layer", "output", "reach"],
        ..LawSpec::PLAIN
    };

    type Memory<'a, R: Lanes> = Vec<Earlier<R>>;

    fn start<R: Lanes>(Beginning { n_devices, .. }: Beginning<'_, R>) -> Self::Memory<'_, R> {
        let zero = R::splat(0.0);
        vec![Earlier { deformation: zero, rate: zero, desired: zero }; n_devices]
    }

    #[inline(always)]
    fn command<R: Lanes>(
        gains: &Gains<'_, R>,
        measured: &Measurement<'_, R>,
        memory: &mut Self::Memory<'_, R>,
        command: &mut [R],
    ) {
        let [layer, output, reach] = gains.tables else { return };
        let n_inputs = reach.len();
        for (device, (command, earlier)) in command.iter_mut().zip(memory).enumerate() {
            let desired = -gains.of_state(0, device, measured);
            let now =
                Earlier { deformation: measured.deformation[device], rate: measured.rate[device], desired };
            let inputs: [&R; 2 * SIGNALS] = [
                &now.deformation,
                &now.rate,
                &now.desired,
                &earlier.deformation,
                &earlier.rate,
                &earlier.desired,
            ];
            let mut sum = R::splat(output.iter().sum());
            for unit in layer.chunks_exact(n_inputs + 2) {
                let mut inner = R::splat(unit[0]);
                for ((&&input, &weight), &reach) in inputs.iter().zip(&unit[1..=n_inputs]).zip(reach) {
                    let known = within(input, R::splat(-reach), R::splat(reach));
                    inner = known.mul_add(R::splat(weight), inner);
                }
                sum = tanh(inner).mul_add(R::splat(unit[n_inputs + 1]), sum);
            }
            *earlier = now;
            *command = sum;
        }
    }

    fn check_tables(tables: &[Vec<f64>]) -> Result<(), DynamicsError> {
        let law = Self::SPEC.name;
        let (layer, output, inputs) = (tables[0].len(), tables[1].len(), tables[2].len());
        if inputs != SIGNALS && inputs != 2 * SIGNALS {
            let expected = "3, or 6 with the sample before";
            return Err(DynamicsError::TableSize { law, table: "reach", found: inputs, expected });
        }
        if layer == 0 || !layer.is_multiple_of(inputs + 2) {
            let expected = "two more than `reach`, for each hidden unit";
            return Err(DynamicsError::TableSize { law, table: "layer", found: layer, expected });
        }
        if output != 1 {
            return Err(DynamicsError::TableSize { law, table: "output", found: output, expected: "1" });
        }
        Ok(())
    }
}

impl<R> Kept<R> for Vec<Earlier<R>> {
    fn each(&mut self, visit: &mut dyn FnMut(&mut R)) {
        for own in self {
            visit(&mut own.deformation);
            visit(&mut own.rate);
            visit(&mut own.desired);
        }
    }
}
