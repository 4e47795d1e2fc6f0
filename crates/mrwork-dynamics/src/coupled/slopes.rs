//! Slopes of the damper force, on which the fastest motion of a building with dampers depends.

use crate::any_damper::Damper;
use crate::current_law::CurrentLaws;
use crate::damper::model::Motion;

/// Velocities and displacements at which the slopes of the force are evaluated, and the finite difference.
const VELOCITIES: [f64; 9] = [0.0, 1e-3, -1e-3, 1e-2, -1e-2, 0.1, -0.1, 0.5, -0.5];
const DISPLACEMENTS: [f64; 5] = [0.0, 1e-4, -1e-4, 1e-2, -1e-2];
const SHIFT: f64 = 1e-7;

/// Largest slopes of the force of one damper at these commands, over velocity [N s/m] and over displacement [N/m].
pub(crate) fn steepest_slopes(
    damper: &dyn Damper,
    laws: &CurrentLaws,
    theta: &[f64],
    commands: &[f64],
) -> [f64; 2] {
    let mut values = vec![f64::NAN; laws.n_params()];
    let state = vec![0.0; damper.spec().n_states];
    let mut columns = theta.to_vec();
    laws.prepare(&mut columns);
    let mut found = [0.0_f64; 2];
    for &command in commands {
        laws.evaluate(&columns, command, &mut values);
        for velocity in VELOCITIES {
            for displacement in DISPLACEMENTS {
                let at =
                    |displacement, velocity| damper.force(&values, &state, Motion { displacement, velocity });
                let here = at(displacement, velocity);
                let slopes =
                    [at(displacement, velocity + SHIFT) - here, at(displacement + SHIFT, velocity) - here];
                for (most, slope) in found.iter_mut().zip(slopes) {
                    *most = most.max((slope / SHIFT).abs());
                }
            }
        }
    }
    found
}
