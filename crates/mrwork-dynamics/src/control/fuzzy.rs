//! Fuzzy control: a rule base over deformation and velocity, tabulated.

use super::law::Formula;
use super::measurement::Measurement;
use super::spec::{GainSpec, Gains, LawSpec, Shape, Unit};
use crate::error::DynamicsError;
use crate::lanes::Lanes;
use crate::real::within;

/// A table of command shares, interpolated.
pub struct Fuzzy;

impl Formula for Fuzzy {
    const SPEC: LawSpec = LawSpec {
        name: "fuzzy",
        title: "Fuzzy",
        equation: "i = i_max T(d/d_s, d'/v_s)",
        description: "A Mamdani rule base, evaluated beforehand on a square grid over -1 to 1 in both inputs and \
                      interpolated bilinearly. Included for comparison.",
        source: "our definition",
        gains: &[
            GainSpec {
                name: "deformation_scale",
                unit: Unit::Of("m"),
                shape: Shape::Device,
                description: "d_s, deformation at the edge of the table",
            },
            GainSpec {
                name: "rate_scale",
                unit: Unit::Of("m/s"),
                shape: Shape::Device,
                description: "v_s, rate at the edge of the table",
            },
        ],
        tables: &["shares"],
        ..LawSpec::PLAIN
    };

    #[inline(always)]
    fn command<R: Lanes>(gains: &Gains<'_, R>, measured: &Measurement<'_, R>, command: &mut [R]) {
        let table = &gains.tables[0];
        let side = table.len().isqrt();
        let (lower, upper) = (R::splat(-1.0), R::splat(1.0));
        for (device, command) in command.iter_mut().enumerate() {
            let x = within(measured.deformation[device] / gains.of_device(0, device), lower, upper);
            let y = within(measured.rate[device] / gains.of_device(1, device), lower, upper);
            *command = interpolated(table, side, x, y) * R::splat(measured.largest[device]);
        }
    }

    fn check_tables(tables: &[Vec<f64>]) -> Result<(), DynamicsError> {
        let found = tables[0].len();
        let side = found.isqrt();
        if side < 2 || side * side != found {
            let expected = "the square of 2 or more";
            return Err(DynamicsError::TableSize { law: "fuzzy", table: "shares", found, expected });
        }
        Ok(())
    }
}

/// Bilinear interpolation in a square table over -1 to 1 in both directions.
#[inline(always)]
fn interpolated<R: Lanes>(table: &[f64], side: usize, x: R, y: R) -> R {
    let half = R::splat(0.5 * to_f64(side - 1));
    let (row, column) = (half.mul_add(x, half), half.mul_add(y, half));
    let (above, left) = (row.cell(side - 2), column.cell(side - 2));
    let (u, v) = (row - above, column - left);
    let first = above.mul_add(R::splat(to_f64(side)), left);
    let entry = |down: usize, right: usize| (first + R::splat(to_f64(down * side + right))).looked_up(table);
    let upper = v.mul_add(entry(0, 1) - entry(0, 0), entry(0, 0));
    let lower = v.mul_add(entry(1, 1) - entry(1, 0), entry(1, 0));
    u.mul_add(lower - upper, upper)
}

#[allow(clippy::cast_precision_loss)] // a table's side is small
#[inline(always)]
fn to_f64(count: usize) -> f64 {
    count as f64
}
