//! Current laws: each parameter of a model as a function of the coil current.

use crate::damper::model::DamperSpec;
use crate::elementary::exp;
use crate::error::DynamicsError;
use crate::parameters::ParamSpec;
use crate::real::Real;

/// One parameter as a function of the current `u` [A or V].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CurrentLaw {
    /// `a`.
    Constant,
    /// `a + b u`.
    Linear,
    /// `a + b u + c u^2`.
    Quadratic,
    /// `a + b u + c u^2 + d u^3`.
    Cubic,
    /// `a + b exp(c u)`.
    Exponential,
}

impl CurrentLaw {
    /// All laws.
    pub const ALL: [Self; 5] =
        [Self::Constant, Self::Linear, Self::Quadratic, Self::Cubic, Self::Exponential];

    /// Its name in settings and results.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Constant => "constant",
            Self::Linear => "linear",
            Self::Quadratic => "quadratic",
            Self::Cubic => "cubic",
            Self::Exponential => "exponential",
        }
    }

    /// Number of coefficients.
    #[must_use]
    pub const fn n_coefficients(self) -> usize {
        match self {
            Self::Constant => 1,
            Self::Linear => 2,
            Self::Quadratic | Self::Exponential => 3,
            Self::Cubic => 4,
        }
    }

    /// Degree of the polynomial; `None` for a law that is not a polynomial.
    #[must_use]
    pub const fn degree(self) -> Option<usize> {
        match self {
            Self::Constant => Some(0),
            Self::Linear => Some(1),
            Self::Quadratic => Some(2),
            Self::Cubic => Some(3),
            Self::Exponential => None,
        }
    }

    /// The parameter at `u`; not a number for a wrong number of coefficients.
    #[inline(always)]
    fn value<R: Real>(self, coefficients: &[R], u: R) -> R {
        match (self, coefficients) {
            (Self::Constant, &[a]) => a,
            (Self::Linear, &[a, b]) => b.mul_add(u, a),
            (Self::Quadratic, &[a, b, c]) => c.mul_add(u, b).mul_add(u, a),
            (Self::Cubic, &[a, b, c, d]) => d.mul_add(u, c).mul_add(u, b).mul_add(u, a),
            (Self::Exponential, &[a, b, c]) => b.mul_add(exp(c * u), a),
            _ => R::splat(f64::NAN),
        }
    }
}

/// The current laws of all parameters of a model, and whether the driver has a lag.
///
/// The columns of `theta` are the coefficients, parameter by parameter; with a lag `eta` [1/s] follows, the rate of the
/// first-order driver `u' = -eta (u - command)`. A parameter that depends on the current is limited to the range that its
/// model admits, because a polynomial may leave it between or beyond the currents it was fitted at.
#[derive(Clone, Debug)]
pub struct CurrentLaws {
    parameters: &'static [ParamSpec],
    laws: Vec<CurrentLaw>,
    lagged: bool,
}

impl CurrentLaws {
    /// Every parameter constant, no lag: the plain model.
    #[must_use]
    pub fn constant(spec: &DamperSpec) -> Self {
        let parameters = spec.parameters;
        Self { parameters, laws: vec![CurrentLaw::Constant; parameters.len()], lagged: false }
    }

    /// One law per parameter, in spec order.
    ///
    /// # Errors
    /// If their number differs from that of the parameters.
    pub fn new(spec: &DamperSpec, laws: Vec<CurrentLaw>, lagged: bool) -> Result<Self, DynamicsError> {
        let (found, expected) = (laws.len(), spec.parameters.len());
        if found != expected {
            return Err(DynamicsError::LawCount { model: spec.name, found, expected });
        }
        Ok(Self { parameters: spec.parameters, laws, lagged })
    }

    /// Number of columns of `theta`.
    #[must_use]
    pub fn n_columns(&self) -> usize {
        self.laws.iter().map(|law| law.n_coefficients()).sum::<usize>() + usize::from(self.lagged)
    }

    /// Number of parameters of the model.
    pub(crate) fn n_params(&self) -> usize {
        self.parameters.len()
    }

    /// Whether no parameter depends on the command.
    #[must_use]
    pub fn are_constant(&self) -> bool {
        self.laws.iter().all(|&law| law == CurrentLaw::Constant)
    }

    /// Column of the rate of the driver, if it has a lag.
    pub(crate) fn lag_column(&self) -> Option<usize> {
        self.lagged.then(|| self.n_columns() - 1)
    }

    /// Parameters at the current `u` from the columns of `theta`, written to `values`.
    #[inline(always)]
    pub(crate) fn evaluate<R: Real>(&self, columns: &[R], u: R, values: &mut [R]) {
        let mut rest = columns;
        for ((&law, parameter), value) in self.laws.iter().zip(self.parameters).zip(values) {
            let (own, others) = rest.split_at(law.n_coefficients().min(rest.len()));
            rest = others;
            let free = law.value(own, u);
            *value = if law == CurrentLaw::Constant {
                free
            } else {
                let (lower, upper) = (R::splat(parameter.lower), R::splat(parameter.upper));
                let from_below = R::select(free.less(lower), lower, free);
                R::select(upper.less(from_below), upper, from_below)
            };
        }
    }
}
