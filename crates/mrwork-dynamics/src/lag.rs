//! The lag of the driver: how the current in the coil comes after its command.

use crate::elementary::exp;
use crate::real::Real;

/// Rates of a first-order driver, `u' = -eta (u - command)` for the current u in the coil.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lag {
    /// The coil has its command at once.
    None,
    /// One rate `eta` [1/s].
    OneRate,
    /// `eta_rise` [1/s] while the current is below its command, else `eta_fall` [1/s]: a driver raises a current by its
    /// voltage, and lets it fall through a diode.
    TwoRates,
}

impl Lag {
    /// The lag with so many rates; `None` for more than two.
    #[must_use]
    pub const fn with_rates(count: usize) -> Option<Self> {
        match count {
            0 => Some(Self::None),
            1 => Some(Self::OneRate),
            2 => Some(Self::TwoRates),
            _ => None,
        }
    }

    /// Number of rates, each a column of `theta`.
    #[must_use]
    pub const fn n_rates(self) -> usize {
        match self {
            Self::None => 0,
            Self::OneRate => 1,
            Self::TwoRates => 2,
        }
    }
}

/// Factors by which the lag reduces the difference of current and command in half a step.
///
/// For a held command the lag is an exponential, so it is integrated exactly and adds no stiffness.
#[derive(Clone, Copy)]
pub(crate) struct Decay<R> {
    /// Of a rising current, and of a falling one where `fall` is `None`; zero without a lag.
    rise: R,
    fall: Option<R>,
}

impl<R: Real> Decay<R> {
    /// The decay of a driver with these rates in half a step of `step` [s].
    #[inline(always)]
    pub(crate) fn of(rates: &[R], step: f64) -> Self {
        let half = R::splat(-0.5 * step);
        match *rates {
            [] => Self { rise: R::splat(0.0), fall: None },
            [rate] => Self { rise: exp(rate * half), fall: None },
            [rise, fall, ..] => Self { rise: exp(rise * half), fall: Some(exp(fall * half)) },
        }
    }

    /// The factors of a rising and of a falling current; the first alone where there is one rate.
    pub(crate) fn factors(&self) -> impl Iterator<Item = R> {
        [Some(self.rise), self.fall].into_iter().flatten()
    }

    /// The current half a step later.
    ///
    /// It approaches its command from one side, so that a current that rises does so until the command changes.
    #[inline(always)]
    pub(crate) fn moved(&self, current: R, command: R) -> R {
        let factor = match self.fall {
            None => self.rise,
            Some(fall) => R::select(current.less(command), self.rise, fall),
        };
        (current - command).mul_add(factor, command)
    }
}
