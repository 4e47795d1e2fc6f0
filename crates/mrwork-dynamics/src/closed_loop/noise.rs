//! Sensor noise: a standard normal number for every stream, sensor and sample, by a counter-based generator.
//!
//! The noise of a run does not depend on the runs beside it. The logarithm is our own, so the bits are the same on every
//! platform.

use crate::elementary::ln;

/// A standard normal number for a stream, sensor and sample.
pub(crate) fn normal(stream: u64, sensor: u64, sample: u64) -> f64 {
    let mut counter = mixed(mixed(mixed(stream) ^ sensor) ^ sample);
    // Marsaglia's polar method: a point in the unit disc, found in the first draws of the counter that hit it.
    loop {
        counter = mixed(counter);
        let x = signed_unit(counter);
        counter = mixed(counter);
        let y = signed_unit(counter);
        let square = x.mul_add(x, y * y);
        if square > 0.0 && square < 1.0 {
            return x * (-2.0 * ln(square) / square).sqrt();
        }
    }
}

/// The finaliser of `SplitMix64` (Steele, Lea, Flood, OOPSLA 2014), after its increment.
const fn mixed(number: u64) -> u64 {
    let mut z = number.wrapping_add(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// The upper 53 bits as a number between -1 and 1.
#[allow(clippy::cast_precision_loss)] // 53 bits fit
fn signed_unit(bits: u64) -> f64 {
    ((bits >> 11) as f64).mul_add(2.0 / 9_007_199_254_740_992.0, -1.0)
}
