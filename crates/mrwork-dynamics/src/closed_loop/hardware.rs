//! What stands between the building and the damper's coil: sampling, delay, sensors, limits, faults.

/// How the loop is run.
#[derive(Clone, Debug)]
pub struct Hardware {
    /// Time from one command to the next [s].
    pub sample_time: f64,
    /// Integration steps in that time, at least one.
    pub steps: u32,
    /// Steps from a measurement until its command is sent.
    pub delay_steps: usize,
    /// How fast the command may change [1/s in its unit].
    pub command_rate: f64,
    /// Sensors of absolute floor acceleration [m/s^2].
    pub acceleration: Sensor,
    /// Sensors of the devices' elongation [m].
    pub deformation: Sensor,
    /// Sensors of the devices' force [N].
    pub force: Sensor,
    /// What breaks, and when.
    pub faults: Vec<Fault>,
}

/// How well a quantity is measured.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sensor {
    /// Standard deviation of its white noise.
    pub noise: f64,
    /// Width of its steps, zero where it has none.
    pub resolution: f64,
}

/// A channel that breaks for a while.
#[derive(Clone, Copy, Debug)]
pub struct Fault {
    /// What breaks.
    pub channel: Channel,
    /// First sample.
    pub start: usize,
    /// Sample from which all is well again.
    pub end: usize,
    /// What it says meanwhile; `None` for the last value before.
    pub value: Option<f64>,
}

/// A signal of the loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// Absolute acceleration of a floor.
    Acceleration(usize),
    /// Elongation of a device.
    Deformation(usize),
    /// Force of a device.
    Force(usize),
    /// Command of a device.
    Command(usize),
}

impl Channel {
    /// A number of its own, from which its noise is drawn.
    pub(crate) const fn number(self) -> u64 {
        match self {
            Self::Acceleration(floor) => floor as u64,
            Self::Deformation(device) => 0x1_0000 + device as u64,
            Self::Force(device) => 0x2_0000 + device as u64,
            Self::Command(device) => 0x3_0000 + device as u64,
        }
    }
}

/// An observer in discrete time: `x+ = Ad x + Bd f + L (y - C x - D f)`, row-major matrices.
///
/// It measures y, the accelerations of some floors and then the elongations of some devices, and knows the force f of every
/// device as measured.
#[derive(Clone, Debug)]
pub struct Observer {
    /// Floors whose acceleration is measured.
    pub accelerations: Vec<usize>,
    /// Devices whose elongation is measured.
    pub deformations: Vec<usize>,
    /// Ad, shape (states, states).
    pub transition: Vec<f64>,
    /// Bd, shape (states, devices).
    pub input: Vec<f64>,
    /// L, shape (states, measurements).
    pub gain: Vec<f64>,
    /// C, shape (measurements, states).
    pub output: Vec<f64>,
    /// D, shape (measurements, devices).
    pub direct: Vec<f64>,
}
