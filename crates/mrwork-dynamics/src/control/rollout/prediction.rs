//! The controller's own model of the loop: building, dampers and driver by the equations of the loop itself, with a
//! longer step.

use crate::building::Building;
use crate::control::loop_model::LoopModel;
use crate::coupled::{Coupled, DeviceState, Devices, Group, Plant, devices_at_rest};
use crate::lanes::Lanes;

/// Motion of the model at an instant, with currents and states of its dampers.
#[derive(Clone)]
pub(super) struct Moment<R> {
    pub(super) displacement: Vec<R>,
    pub(super) velocity: Vec<R>,
    pub(super) devices: DeviceState<R>,
    /// Loops of the passive elements.
    pub(super) loops: Vec<R>,
}

/// The model during a prediction.
pub(super) struct Prediction<'a, R: Lanes>(Coupled<'a, R>);

impl<'a, R: Lanes + 'a> Prediction<'a, R> {
    /// At rest; `None` for a model of dampers that is not registered.
    pub(super) fn of(model: &LoopModel<'a>) -> Option<Self> {
        let plant = Plant::at_rest(model.building, &[&model.building.springs.rows], 0.0);
        Some(Self(Coupled { plant, devices: devices(model)? }))
    }
}

impl<'a, R: Lanes> Prediction<'a, R> {
    pub(super) fn building(&self) -> &'a Building {
        self.0.plant.building()
    }

    /// Factors on the forces of the devices.
    pub(super) fn scale(&mut self) -> &mut [R] {
        self.0.devices.scale()
    }

    /// Accelerations relative to the ground, as evaluated last.
    pub(super) fn acceleration(&self) -> &[R] {
        self.0.plant.motion().acceleration
    }

    pub(super) fn displacement(&self) -> &[R] {
        &self.0.plant.displacement
    }

    /// q'K q + q''M q' with twice the energy in the loops [J]: of a drift, that of its elastic part.
    #[inline(always)]
    pub(super) fn twice_energy(&self) -> R {
        self.0.plant.twice_held()
    }

    /// Square of the largest drift that storeys which yield keep when they unload [m^2].
    #[inline(always)]
    pub(super) fn left_squared(&self) -> R {
        self.0.plant.left_squared()
    }

    /// Evaluates the accelerations at a motion with these forces of the devices and states of the loops.
    #[inline(always)]
    pub(super) fn accelerate(&mut self, [displacement, velocity, loops]: [&[R]; 3], force: &[R], ground: &R) {
        self.0.plant.offset.clear();
        self.0.plant.place(displacement, velocity);
        self.0.plant.place_loops(loops);
        self.0.plant.accelerate(force, ground);
    }

    /// Visits strength and inverse strength of each loop.
    pub(super) fn each_strength(&mut self, visit: &mut dyn FnMut(&mut R)) {
        self.0.plant.each_strength(visit);
    }

    /// Goes on with what the last accelerations miss of measured ones.
    #[inline(always)]
    pub(super) fn offset(&mut self, missed: &[R]) {
        self.0.plant.offset.clear();
        self.0.plant.offset.extend_from_slice(missed);
    }

    /// Follows the loops along a change of the coordinates.
    #[inline(always)]
    pub(super) fn follow(&mut self, loops: &mut [R], change: &[R]) {
        self.0.plant.place_loops(loops);
        self.0.plant.follow(change);
        self.0.plant.save_loops(loops);
    }

    /// Adapts the strength of the loops to what storeys resist beyond the model [N].
    #[inline(always)]
    pub(super) fn adapt(&mut self, shears: &[R], share: f64, limits: [R; 2]) {
        self.0.plant.adapt(shears, share, limits);
    }

    /// Goes on from a moment in steps of this length [s].
    #[inline(always)]
    pub(super) fn begin(&mut self, from: &Moment<R>, step: f64) {
        self.0.plant.place(&from.displacement, &from.velocity);
        self.0.plant.place_loops(&from.loops);
        self.0.devices.restore(&from.devices);
        self.set_step(step);
    }

    /// Sets the length of a step [s].
    #[inline(always)]
    pub(super) fn set_step(&mut self, step: f64) {
        self.0.plant.set_step(step);
        self.0.devices.set_step(step);
    }

    /// Evaluates forces and accelerations at the start of a step under this command, which acts on a driver without a lag
    /// at once.
    #[inline(always)]
    pub(super) fn evaluate(&mut self, command: &[R], ground: &R) {
        self.0.devices.receive(command, false);
        self.0.evaluate(ground);
    }

    /// A step from where it was evaluated; the ground acceleration is given in its middle and at its end.
    #[inline(always)]
    pub(super) fn advance(&mut self, middle: &R, end: &R) {
        self.0.advance(middle, end, None);
    }

    /// Writes the present moment.
    #[inline(always)]
    pub(super) fn save(&self, into: &mut Moment<R>) {
        into.displacement.copy_from_slice(&self.0.plant.displacement);
        into.velocity.copy_from_slice(&self.0.plant.velocity);
        self.0.plant.save_loops(&mut into.loops);
        self.0.devices.save(&mut into.devices);
    }
}

/// The devices of the model.
pub(super) fn devices<'a, R: Lanes + 'a>(model: &LoopModel<'a>) -> Option<Box<dyn Devices<R> + 'a>> {
    let column = |group: &Group<'a>, device, column: usize| R::splat(group.theta_of(0, device)[column]);
    devices_at_rest(&model.dampers, column).ok()
}
