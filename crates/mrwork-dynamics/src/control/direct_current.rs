//! Direct-current laws of the thesis: the current itself is chosen by the model of the damper, not a force.
//!
//! The thesis takes the force as F0 + G i + H i^2, which holds where no parameter inside the tanh depends on the current.
//! `lyapunov_direct` and `inverse_direct` use the force of the model itself; the laws named after the parabola use the one
//! through the forces at 0, half and all of the largest current.

use super::clipped_optimal::GAIN;
use super::law::Formula;
use super::lyapunov::WEIGHT;
use super::measurement::Measurement;
use super::spec::{GainSpec, Gains, LawSpec, Shape, Unit};
use crate::lanes::Lanes;
use crate::real::{Real, if_known, where_positive, within};

const THESIS: &str =
    "after M. T. Nguyen, PhD thesis, University of Technology, Sydney, 2009, ch. 6; form our own";

/// The current that makes V = s'Ps/2 fall fastest.
pub struct LyapunovDirect;

impl Formula for LyapunovDirect {
    const SPEC: LawSpec = LawSpec {
        name: "lyapunov_direct",
        title: "Lyapunov, current directly",
        equation: "i = argmin over [0, i_max] of sigma f(i), sigma = s'P B",
        description: "Minimises with the force of the damper's model itself. Needs that model instead of the \
                      measured force.",
        source: THESIS,
        gains: &[WEIGHT],
        needs_curve: true,
        switches: true,
        ..LawSpec::PLAIN
    };

    #[inline(always)]
    fn command<R: Lanes>(gains: &Gains<'_, R>, measured: &Measurement<'_, R>, command: &mut [R]) {
        for (device, command) in command.iter_mut().enumerate() {
            *command = measured.minimiser(device, gains.of_state(0, device, measured));
        }
    }
}

/// The same with the parabola of the thesis.
pub struct LyapunovParabola;

impl Formula for LyapunovParabola {
    const SPEC: LawSpec = LawSpec {
        name: "lyapunov_parabola",
        title: "Lyapunov, current by a parabola",
        equation: "i = argmin over [0, i_max] of sigma f(i), sigma = s'P B, f(i) = F0 + G i + H i^2",
        description: "The best of 0, i_max and, if it lies between them, -G/(2H); the parabola passes through the \
                      forces at 0, i_max/2 and i_max. It differs from `lyapunov_direct` where a parameter \
                      inside the tanh depends on the current.",
        source: THESIS,
        gains: &[WEIGHT],
        needs_curve: true,
        switches: true,
        ..LawSpec::PLAIN
    };

    #[inline(always)]
    fn command<R: Lanes>(gains: &Gains<'_, R>, measured: &Measurement<'_, R>, command: &mut [R]) {
        let zero = R::splat(0.0);
        for (device, command) in command.iter_mut().enumerate() {
            let sigma = gains.of_state(0, device, measured);
            let [_, slope, bend] = measured.parabola(device);
            let largest = R::splat(measured.largest[device]);
            let at_largest = gain_of(sigma, slope, bend, largest);
            let best = R::select(at_largest.less(zero), largest, zero);
            // Not a number for a straight line, and then not better.
            let vertex = within(slope / (R::splat(-2.0) * bend), zero, largest);
            let better = gain_of(sigma, slope, bend, vertex).less(at_largest.min(zero));
            *command = if_known(at_largest, R::select(better, vertex, best));
        }
    }
}

/// sigma (f(i) - f(0)).
#[inline(always)]
fn gain_of<R: Real>(sigma: R, slope: R, bend: R, i: R) -> R {
    sigma * i * bend.mul_add(i, slope)
}

/// On or off by the sign of sigma G.
pub struct LyapunovDirectBangBang;

impl Formula for LyapunovDirectBangBang {
    const SPEC: LawSpec = LawSpec {
        name: "lyapunov_direct_bang_bang",
        title: "Lyapunov, current directly, on or off",
        equation: "i = i_max H(-sigma G), sigma = s'P B, f(i) = F0 + G i + H i^2",
        description: "Full current where a larger current makes V = s'Ps/2 fall faster. G is the slope at i = 0 of the \
                      parabola through the forces at 0, i_max/2 and i_max.",
        source: THESIS,
        gains: &[WEIGHT],
        needs_curve: true,
        switches: true,
        ..LawSpec::PLAIN
    };

    #[inline(always)]
    fn command<R: Lanes>(gains: &Gains<'_, R>, measured: &Measurement<'_, R>, command: &mut [R]) {
        for (device, command) in command.iter_mut().enumerate() {
            let sigma = gains.of_state(0, device, measured);
            let [_, slope, _] = measured.parabola(device);
            *command = where_positive(-sigma * slope, R::splat(measured.largest[device]));
        }
    }
}

/// Current in proportion to -sigma G.
pub struct ProportionalDirect;

impl Formula for ProportionalDirect {
    const SPEC: LawSpec = LawSpec {
        name: "proportional_direct",
        title: "Direct current, proportional",
        equation: "i = sat(-kappa sigma G), sigma = s'P B, f(i) = F0 + G i + H i^2",
        description: "Smooth. With P of a Lyapunov equation it is the first controller of the thesis, with P of \
                      a Riccati equation and kappa = 1/R the second. G is the slope at i = 0 of the parabola \
                      through the forces at 0, i_max/2 and i_max.",
        source: THESIS,
        gains: &[
            WEIGHT,
            GainSpec {
                name: "slope",
                unit: Unit::CommandPer("unit of sigma G"),
                shape: Shape::Device,
                description: "kappa, or 1/R",
            },
        ],
        needs_curve: true,
        ..LawSpec::PLAIN
    };

    #[inline(always)]
    fn command<R: Lanes>(gains: &Gains<'_, R>, measured: &Measurement<'_, R>, command: &mut [R]) {
        for (device, command) in command.iter_mut().enumerate() {
            let sigma = gains.of_state(0, device, measured);
            let [_, slope, _] = measured.parabola(device);
            *command = -gains.of_device(1, device) * sigma * slope;
        }
    }
}

/// The current at which the damper exerts the desired force.
pub struct InverseDirect;

impl Formula for InverseDirect {
    const SPEC: LawSpec = LawSpec {
        name: "inverse_direct",
        title: "Linear regulator, damper inverted",
        equation: "f(i) = f_c, f_c = -K s; where no i in [0, i_max] has this force, the one nearest in force",
        description: "Inverts the force of the damper's model itself; of several currents it takes the least.",
        source: THESIS,
        gains: &[GAIN],
        needs_curve: true,
        switches: true,
        ..LawSpec::PLAIN
    };

    #[inline(always)]
    fn command<R: Lanes>(gains: &Gains<'_, R>, measured: &Measurement<'_, R>, command: &mut [R]) {
        for (device, command) in command.iter_mut().enumerate() {
            *command = measured.inverse(device, -gains.of_state(0, device, measured));
        }
    }
}

/// The same with the parabola of the thesis.
pub struct InverseParabola;

impl Formula for InverseParabola {
    const SPEC: LawSpec = LawSpec {
        name: "inverse_parabola",
        title: "Linear regulator, damper inverted by a parabola",
        equation: "H i^2 + G i + F0 = f_c, f_c = -K s; where no root lies in [0, i_max], the end point nearest in force",
        description: "The parabola passes through the forces at 0, i_max/2 and i_max. It differs from `inverse_direct` \
                      where a parameter inside the tanh depends on the current.",
        source: THESIS,
        gains: &[GAIN],
        needs_curve: true,
        switches: true,
        ..LawSpec::PLAIN
    };

    #[inline(always)]
    fn command<R: Lanes>(gains: &Gains<'_, R>, measured: &Measurement<'_, R>, command: &mut [R]) {
        let (zero, two) = (R::splat(0.0), R::splat(2.0));
        for (device, command) in command.iter_mut().enumerate() {
            let desired = -gains.of_state(0, device, measured);
            let [offset, slope, bend] = measured.parabola(device);
            let largest = R::splat(measured.largest[device]);
            let missing = offset - desired;
            let at_largest = largest.mul_add(bend.mul_add(largest, slope), missing);
            let nearest = R::select(at_largest.abs().less(missing.abs()), largest, zero);
            // The root on the branch through i = 0, in the form that stays finite for a straight line.
            let square = slope.mul_add(slope, R::splat(-4.0) * bend * missing);
            let fall = slope + square.abs().sqrt().copysign(slope);
            let other = if_inside(fall / (-two * bend), largest, nearest);
            let inverted = if_inside(-two * missing / fall, largest, other);
            *command = if_known(at_largest, R::select(square.less(zero), nearest, inverted));
        }
    }
}

/// `i` if it lies in [0, largest], else `otherwise`.
#[inline(always)]
fn if_inside<R: Real>(i: R, largest: R, otherwise: R) -> R {
    let from_above = R::select(largest.less(i), otherwise, i);
    let inside = R::select(i.less(R::splat(0.0)), otherwise, from_above);
    R::select(i.equal(i), inside, otherwise)
}
