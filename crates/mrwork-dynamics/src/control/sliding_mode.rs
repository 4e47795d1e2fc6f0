//! Sliding-mode control: the state is driven to a surface S s = 0 and kept there.

use super::clipped_optimal::{GAIN, clipped};
use super::law::{Beginning, ControlLaw, Formula, Kept};
use super::measurement::Measurement;
use super::spec::{GainSpec, Gains, LawSpec, Shape, Unit};
use crate::lanes::Lanes;
use crate::real::{Real, if_known, within};

const SURFACE: GainSpec = GainSpec {
    name: "surface",
    unit: Unit::Of("1"),
    shape: Shape::State,
    description: "S of the surface S s = 0, one row for each device, with the sign for which its force \
                  reduces S s",
};
const BOUNDARY: GainSpec = GainSpec {
    name: "boundary",
    unit: Unit::Of("unit of S s"),
    shape: Shape::Device,
    description: "half width of the layer in which the switching force is proportional",
};

/// First order, with a boundary layer.
pub struct SlidingMode;

impl Formula for SlidingMode {
    const SPEC: LawSpec = LawSpec {
        name: "sliding_mode",
        title: "Sliding mode",
        equation: "f_c = -K s + rho sat(S s/phi), then i = i_max H((f_c - f) f)",
        description: "The equivalent force K keeps the state on the surface, the switching force rho brings it \
                      there; the desired force is clipped.",
        source: "after Yang, Wu, Agrawal, J. Eng. Mech. 121(12), 1995; form our own",
        gains: &[
            GAIN,
            SURFACE,
            GainSpec {
                name: "switching",
                unit: Unit::Of("N"),
                shape: Shape::Device,
                description: "rho, force that brings the state to the surface",
            },
            BOUNDARY,
        ],
        switches: true,
        ..LawSpec::PLAIN
    };

    #[inline(always)]
    fn command<R: Lanes>(gains: &Gains<'_, R>, measured: &Measurement<'_, R>, command: &mut [R]) {
        for (device, command) in command.iter_mut().enumerate() {
            let layer = saturated(gains.of_state(1, device, measured), gains.of_device(3, device));
            let equivalent = gains.of_state(0, device, measured);
            let desired = gains.of_device(2, device).mul_add(layer, -equivalent);
            *command = clipped(desired, measured.force[device], R::splat(measured.largest[device]));
        }
    }
}

/// `distance / boundary`, at most 1 in magnitude; the sign where there is no layer.
#[inline(always)]
fn saturated<R: Real>(distance: R, boundary: R) -> R {
    let width = within(boundary, R::splat(f64::MIN_POSITIVE), R::splat(f64::INFINITY));
    within(distance / width, R::splat(-1.0), R::splat(1.0))
}

/// The switching force [N] of a device; zero before the first sample, which lifts it to the floor.
#[derive(Clone)]
pub(crate) struct Switching<R> {
    force: R,
}

/// The switching force grows while the state is off the surface, and shrinks while it is near.
pub struct AdaptiveSlidingMode;

impl ControlLaw for AdaptiveSlidingMode {
    const SPEC: LawSpec = LawSpec {
        name: "adaptive_sliding_mode",
        title: "Adaptive sliding mode",
        equation: "f_c = -K s + rho sat(S s/phi), rho' = a |S s| sgn(|S s| - phi) between floor and ceiling,\n\
                   then i = i_max H((f_c - f) f)",
        description: "Needs no bound of the disturbance: the switching force adapts.",
        source: "Plestan, Shtessel, Bregeault, Poznyak, Int. J. Control 83(9), 2010, 1907-1919",
        gains: &[
            GAIN,
            SURFACE,
            GainSpec {
                name: "adaptation",
                unit: Unit::Of("N/s per unit of S s"),
                shape: Shape::Device,
                description: "a, how fast the switching force grows off the surface",
            },
            BOUNDARY,
            GainSpec {
                name: "floor",
                unit: Unit::Of("N"),
                shape: Shape::Device,
                description: "least switching force, with which it begins",
            },
            GainSpec {
                name: "ceiling",
                unit: Unit::Of("N"),
                shape: Shape::Device,
                description: "largest switching force",
            },
        ],
        switches: true,
        ..LawSpec::PLAIN
    };

    type Memory<'a, R: Lanes> = Vec<Switching<R>>;

    fn start<R: Lanes>(Beginning { n_devices, .. }: Beginning<'_, R>) -> Self::Memory<'_, R> {
        vec![Switching { force: R::splat(0.0) }; n_devices]
    }

    #[inline(always)]
    fn command<R: Lanes>(
        gains: &Gains<'_, R>,
        measured: &Measurement<'_, R>,
        memory: &mut Self::Memory<'_, R>,
        command: &mut [R],
    ) {
        for (device, (command, switching)) in command.iter_mut().zip(memory).enumerate() {
            let distance = gains.of_state(1, device, measured);
            let boundary = gains.of_device(3, device);
            let growth = gains.of_device(2, device) * R::splat(measured.sample_time) * distance.abs();
            let change = R::select(boundary.less(distance.abs()), growth, -growth);
            switching.force =
                within(switching.force + change, gains.of_device(4, device), gains.of_device(5, device));
            let equivalent = gains.of_state(0, device, measured);
            let desired = switching.force.mul_add(saturated(distance, boundary), -equivalent);
            *command = clipped(desired, measured.force[device], R::splat(measured.largest[device]));
        }
    }
}

/// The integral part w of the rate of S s of a device; zero before the first sample.
#[derive(Clone)]
pub(crate) struct Integral<R> {
    rate: R,
}

/// Second order, turned into current by the damper's own curve.
pub struct SuperTwisting;

impl ControlLaw for SuperTwisting {
    const SPEC: LawSpec = LawSpec {
        name: "super_twisting",
        title: "Super-twisting sliding mode",
        equation: "(S s)' = u = -k1 |S s|^(1/2) sgn(S s) + w, w' = -k2 sgn(S s)\n\
                   i = sat((u - S A s - S B f(0)) / (S B f'))",
        description: "The rate of S s that brings it to zero in finite time without a jump, and the current that gives \
                      this rate, as far as the damper can. f' is the mean slope of the force over the current.",
        source: "after Levant, Int. J. Control 58(6), 1993, and Ha et al., IEEE/ASME Trans. Mechatronics 18, 2013; \
                 form our own",
        gains: &[
            SURFACE,
            GainSpec {
                name: "drift",
                unit: Unit::Of("unit of S s per s"),
                shape: Shape::State,
                description: "S A, rate of S s without force",
            },
            GainSpec {
                name: "push",
                unit: Unit::Of("unit of S s per N s"),
                shape: Shape::Device,
                description: "S B, rate of S s per unit of resisting force",
            },
            GainSpec {
                name: "root_gain",
                unit: Unit::Of("root of the unit of S s, per s"),
                shape: Shape::Device,
                description: "k1",
            },
            GainSpec {
                name: "integral_gain",
                unit: Unit::Of("unit of S s per s^2"),
                shape: Shape::Device,
                description: "k2",
            },
        ],
        needs_curve: true,
        switches: true,
        ..LawSpec::PLAIN
    };

    type Memory<'a, R: Lanes> = Vec<Integral<R>>;

    fn start<R: Lanes>(Beginning { n_devices, .. }: Beginning<'_, R>) -> Self::Memory<'_, R> {
        vec![Integral { rate: R::splat(0.0) }; n_devices]
    }

    #[inline(always)]
    fn command<R: Lanes>(
        gains: &Gains<'_, R>,
        measured: &Measurement<'_, R>,
        memory: &mut Self::Memory<'_, R>,
        command: &mut [R],
    ) {
        for (device, (command, integral)) in command.iter_mut().zip(memory).enumerate() {
            let distance = gains.of_state(0, device, measured);
            let side =
                R::select(distance.equal(R::splat(0.0)), R::splat(0.0), R::splat(1.0).copysign(distance));
            let rise = gains.of_device(4, device) * R::splat(-measured.sample_time);
            integral.rate = rise.mul_add(side, integral.rate);
            let reach = gains.of_device(3, device) * distance.abs().sqrt();
            let desired = integral.rate - reach * side;
            let [f_0, _, f_max] =
                measured.curves[device].points(measured.deformation[device], measured.rate[device]);
            let push = gains.of_device(2, device);
            let free = push.mul_add(f_0, gains.of_state(1, device, measured));
            let slope = push * (f_max - f_0) * R::splat(1.0 / measured.largest[device]);
            // Zero current if the force does not depend on it.
            let still = slope.equal(R::splat(0.0));
            *command = R::select(still, if_known(free, R::splat(0.0)), (desired - free) / slope);
        }
    }
}

impl<R> Kept<R> for Vec<Switching<R>> {
    fn each(&mut self, visit: &mut dyn FnMut(&mut R)) {
        for own in self {
            visit(&mut own.force);
        }
    }
}

impl<R> Kept<R> for Vec<Integral<R>> {
    fn each(&mut self, visit: &mut dyn FnMut(&mut R)) {
        for own in self {
            visit(&mut own.rate);
        }
    }
}
