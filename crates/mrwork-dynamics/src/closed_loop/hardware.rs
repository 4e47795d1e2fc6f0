//! The hardware between the building and the coil of the damper: sampling, delay, sensors, limits, faults.

/// Sampling, delay, sensors, limits and faults of a loop.
#[derive(Clone, Debug)]
pub struct Hardware {
    /// Time from one command to the next [s].
    pub sample_time: f64,
    /// Integration steps in that time, at least one.
    pub steps: u32,
    /// Integration steps from a measurement until its command is sent.
    pub delay_steps: usize,
    /// Largest rate of the command [A/s or V/s].
    pub command_rate: f64,
    /// Time for which a law that forecasts the ground acceleration is told it ahead, zero for none [s]. No sensor tells
    /// it: a bound of what a better forecast could do.
    pub ground_preview: f64,
    /// Sensors of absolute floor acceleration [m/s^2].
    pub acceleration: Sensor,
    /// Sensors of the devices' elongation [m].
    pub deformation: Sensor,
    /// Storeys with a sensor of their drift.
    pub measured_storeys: Vec<usize>,
    /// Sensors of these drifts [m].
    pub drift: Sensor,
    /// Sensors of the devices' force [N].
    pub force: Sensor,
    /// Sensor of ground acceleration [m/s^2].
    pub ground_acceleration: Sensor,
    /// Faults of channels.
    pub faults: Vec<Fault>,
}

/// Accuracy of a sensor.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sensor {
    /// Standard deviation of the white noise.
    pub noise: f64,
    /// Quantisation step, zero for none.
    pub resolution: f64,
}

/// A fault of a channel during a range of samples.
#[derive(Clone, Copy, Debug)]
pub struct Fault {
    /// The faulty channel.
    pub channel: Channel,
    /// First sample.
    pub start: usize,
    /// First sample after the fault.
    pub end: usize,
    /// Value during the fault; `None` holds the last value before.
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
    /// Acceleration of the ground.
    GroundAcceleration,
    /// Drift of a storey.
    Drift(usize),
}

impl Channel {
    /// Number that identifies the channel in the noise generator.
    pub(crate) const fn number(self) -> u64 {
        match self {
            Self::Acceleration(floor) => floor as u64,
            Self::Deformation(device) => 0x1_0000 + device as u64,
            Self::Force(device) => 0x2_0000 + device as u64,
            Self::Command(device) => 0x3_0000 + device as u64,
            Self::GroundAcceleration => 0x4_0000,
            Self::Drift(storey) => 0x5_0000 + storey as u64,
        }
    }
}

/// An observer in discrete time: `x+ = Ad x + Bd f + Ed a_g + L (y - C x - D f - G a_g)`, row-major matrices.
///
/// y are the accelerations of some floors, the elongations of some devices, and the drifts of the measured storeys; f is the
/// measured force of every device.
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
    /// Ed, by which the measured ground acceleration moves the state, shape (states,); empty where it is not known.
    pub ground: Vec<f64>,
    /// Its part of each measurement, shape (measurements,); empty with `ground`.
    pub direct_ground: Vec<f64>,
    /// Whether the velocities that it estimates are absolute, `q' + r v_g`.
    pub is_absolute: bool,
}
