//! Current laws: each parameter of a model as a function of the coil current.

use crate::damper::model::DamperSpec;
use crate::dual::Dual;
use crate::elementary::{exp, ln};
use crate::error::DynamicsError;
use crate::lag::Lag;
use crate::parameters::{ParamSpec, Scale};
use crate::real::{OutOfLine, Real};

/// Largest number of commands at which a law may have values.
pub const MOST_NODES: usize = 8;

/// One parameter as a function of the current `u` [A or V].
#[derive(Clone, Debug, PartialEq)]
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
    /// Values at several commands, and the curve through them.
    Values(Nodes),
    /// Values at several commands, and the curve through their logarithms if the scale of the parameter is logarithmic.
    Logarithms(Nodes),
}

impl CurrentLaw {
    /// The laws that have a name of their own.
    pub const NAMED: [Self; 5] =
        [Self::Constant, Self::Linear, Self::Quadratic, Self::Cubic, Self::Exponential];

    /// Name of a law; one that has values at commands is called by it, a colon and the commands.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Constant => "constant",
            Self::Linear => "linear",
            Self::Quadratic => "quadratic",
            Self::Cubic => "cubic",
            Self::Exponential => "exponential",
            Self::Logarithms(nodes) => match nodes.count {
                _ if nodes.straight => "straight_log",
                2 => "log_linear",
                3 => "log_quadratic",
                _ => "log_cubic",
            },
            Self::Values(nodes) => match nodes.count {
                _ if nodes.straight => "straight",
                2 => "linear",
                3 => "quadratic",
                _ => "cubic",
            },
        }
    }

    /// The law of a name, such as `quadratic`, `quadratic:0,0.5,1`, `log_linear:0,1` or `straight:0,0.5,1`.
    ///
    /// # Errors
    /// If there is no such law, or its commands are not as many rising numbers as it takes.
    pub fn of_name(name: &str) -> Result<Self, DynamicsError> {
        let unknown = || DynamicsError::UnknownLaw(name.into());
        let Some((law, commands)) = name.split_once(':') else {
            return Self::NAMED.into_iter().find(|law| law.name() == name).ok_or_else(unknown);
        };
        let commands: Result<Vec<f64>, _> = commands.split(',').map(|text| text.trim().parse()).collect();
        let nodes = commands.ok().and_then(|commands| Nodes::at(&commands)).ok_or_else(unknown)?;
        match (law, nodes.count) {
            ("linear", 2) | ("quadratic", 3) | ("cubic", 4) => Ok(Self::Values(nodes)),
            ("log_linear", 2) | ("log_quadratic", 3) | ("log_cubic", 4) => Ok(Self::Logarithms(nodes)),
            ("straight", _) => Ok(Self::Values(nodes.with_straight_lines())),
            ("straight_log", _) => Ok(Self::Logarithms(nodes.with_straight_lines())),
            _ => Err(unknown()),
        }
    }

    /// Number of coefficients.
    #[must_use]
    pub const fn n_coefficients(&self) -> usize {
        match self {
            Self::Constant => 1,
            Self::Linear => 2,
            Self::Quadratic | Self::Exponential => 3,
            Self::Cubic => 4,
            Self::Values(nodes) | Self::Logarithms(nodes) => nodes.count,
        }
    }

    /// Degree of the polynomial in the command; `None` for a law that is not one.
    #[must_use]
    pub const fn degree(&self) -> Option<usize> {
        match self {
            Self::Constant => Some(0),
            Self::Linear => Some(1),
            Self::Quadratic => Some(2),
            Self::Cubic => Some(3),
            Self::Exponential | Self::Values(_) | Self::Logarithms(_) => None,
        }
    }

    /// What [`Self::value`] takes in place of the coefficients; worked out once, it saves the logarithms of every step.
    #[inline(always)]
    fn prepare<R: Real>(&self, coefficients: &mut [R], scale: Scale) {
        let (Self::Values(nodes) | Self::Logarithms(nodes)) = self else { return };
        if self.takes_logarithms(scale) {
            for value in &mut *coefficients {
                *value = ln(*value);
            }
        }
        nodes.prepare(coefficients);
    }

    /// Whether it interpolates logarithms of a parameter of this scale.
    #[inline(always)]
    fn takes_logarithms(&self, scale: Scale) -> bool {
        matches!(self, Self::Logarithms(_)) && scale == Scale::Log
    }

    /// The parameter at `u` from prepared coefficients; not a number for a wrong number of them.
    #[inline(always)]
    fn value<R: Real>(&self, prepared: &[R], u: R, scale: Scale) -> R {
        let (offset, factor, exponent) = match (self, prepared) {
            (Self::Constant, &[a]) => return a,
            (Self::Linear, &[a, b]) => return b.mul_add(u, a),
            (Self::Quadratic, &[a, b, c]) => return c.mul_add(u, b).mul_add(u, a),
            (Self::Cubic, &[a, b, c, d]) => return d.mul_add(u, c).mul_add(u, b).mul_add(u, a),
            (Self::Exponential, &[a, b, c]) => (a, b, c * u),
            (Self::Values(nodes) | Self::Logarithms(nodes), prepared) if prepared.len() == nodes.count => {
                let curve = nodes.value(prepared, u);
                if !self.takes_logarithms(scale) {
                    return curve;
                }
                (R::splat(0.0), R::splat(1.0), curve)
            }
            _ => return R::splat(f64::NAN),
        };
        // Written once: an exponential is much code, in every model and for every instruction set.
        factor.mul_add(exp(exponent), offset)
    }

    /// The parameter at `u` from prepared coefficients, limited to its range where it depends on the command.
    #[inline(always)]
    fn limited_value<R: Real>(&self, prepared: &[R], u: R, parameter: &ParamSpec) -> R {
        let free = self.value(prepared, u, parameter.scale);
        if matches!(self, Self::Constant) {
            return free;
        }
        let (lower, upper) = (R::splat(parameter.lower), R::splat(parameter.upper));
        upper.min(lower.max(free))
    }
}

/// Commands at which a law has values, and the polynomial through values there, or straight lines between them.
///
/// Beyond the first and the last command the curve continues along its tangent.
#[derive(Clone, Debug, PartialEq)]
pub struct Nodes {
    count: usize,
    centre: f64,
    per_half: f64,
    /// The commands as t, from -1 at the first to 1 at the last.
    places: Vec<f64>,
    straight: bool,
    /// Coefficients of t^m for a value of 1 at node j, row m; of straight lines the value at the first node, the first
    /// slope, and the change of the slope at each inner node.
    basis: Vec<f64>,
}

impl Nodes {
    /// Nodes at rising commands [A or V]; `None` where they are not 2 to [`MOST_NODES`] finite, rising numbers.
    #[must_use]
    pub fn at(commands: &[f64]) -> Option<Self> {
        let (&[first, ..], &[.., last]) = (commands, commands) else { return None };
        let rising = commands.iter().zip(&commands[1..]).all(|(before, after)| before < after);
        if !(2..=MOST_NODES).contains(&commands.len()) || !rising || !(last - first).is_finite() {
            return None;
        }
        let (centre, per_half) = (0.5 * (first + last), 2.0 / (last - first));
        if !per_half.is_finite() {
            return None;
        }
        let places: Vec<f64> = commands.iter().map(|command| (command - centre) * per_half).collect();
        let count = places.len();
        let mut basis = vec![0.0; count * count];
        for (node, &place) in places.iter().enumerate() {
            // The product of (t - t_i)/(t_j - t_i) over the other nodes i, one factor after the other.
            let mut product = vec![0.0; count];
            product[0] = 1.0;
            for (_, &other) in places.iter().enumerate().filter(|&(other, _)| other != node) {
                let mut lower = 0.0;
                for coefficient in &mut product {
                    let raised = (lower - other * *coefficient) / (place - other);
                    lower = *coefficient;
                    *coefficient = raised;
                }
            }
            for (row, coefficient) in basis.chunks_exact_mut(count).zip(product) {
                row[node] = coefficient;
            }
        }
        Some(Self { count, centre, per_half, places, straight: false, basis })
    }

    /// The same nodes with straight lines between the values.
    #[must_use]
    fn with_straight_lines(mut self) -> Self {
        let count = self.count;
        self.straight = true;
        self.basis = vec![0.0; count * count];
        self.basis[0] = 1.0;
        for (piece, ends) in self.places.windows(2).enumerate() {
            let per_value = 1.0 / (ends[1] - ends[0]);
            // The slope of a piece is added where it begins, and taken away where the next one does.
            for (column, share) in [(piece, -per_value), (piece + 1, per_value)] {
                self.basis[(piece + 1) * count + column] += share;
                if piece + 2 < count {
                    self.basis[(piece + 2) * count + column] -= share;
                }
            }
        }
        self
    }

    /// Replaces values at the nodes by the coefficients of the curve through them.
    #[inline(always)]
    fn prepare<R: Real>(&self, values: &mut [R]) {
        let given = values.to_vec();
        for (coefficient, row) in values.iter_mut().zip(self.basis.chunks_exact(self.count)) {
            *coefficient = R::splat(0.0);
            for (&value, &share) in given.iter().zip(row) {
                *coefficient = value.mul_add(R::splat(share), *coefficient);
            }
        }
    }

    /// The curve at `u`, beyond the nodes its tangent.
    #[inline(always)]
    fn value<R: Real>(&self, coefficients: &[R], u: R) -> R {
        let one = R::splat(1.0);
        let t = (u - R::splat(self.centre)) * R::splat(self.per_half);
        if let (true, &[first, slope, ref changes @ ..]) = (self.straight, coefficients) {
            let mut value = slope.mul_add(t + one, first);
            for (&change, &place) in changes.iter().zip(self.places.iter().skip(1)) {
                value = change.mul_add(R::splat(0.0).max(t - R::splat(place)), value);
            }
            return value;
        }
        let inside = one.min((-one).max(t));
        let (mut value, mut slope) = (R::splat(0.0), R::splat(0.0));
        for &coefficient in coefficients.iter().rev() {
            slope = slope.mul_add(inside, value);
            value = value.mul_add(inside, coefficient);
        }
        slope.mul_add(t - inside, value)
    }
}

/// The current laws of all parameters of a model, and the lag of the driver.
///
/// The columns of `theta` are the coefficients, parameter by parameter, and the rates of the [`Lag`]. A parameter that depends on the current is limited to the range that its model admits,
/// because a polynomial may leave it between or beyond the currents it was fitted at.
#[derive(Clone, Debug)]
pub struct CurrentLaws {
    parameters: &'static [ParamSpec],
    laws: Vec<CurrentLaw>,
    lag: Lag,
    /// Parameters that depend on the command, and the first column of each.
    following: Vec<(usize, usize)>,
    /// Whether each parameter depends on the command.
    follows: Vec<bool>,
}

impl CurrentLaws {
    /// Every parameter constant, no lag: the plain model.
    #[must_use]
    pub fn constant(spec: &DamperSpec) -> Self {
        let parameters = spec.parameters;
        let laws = vec![CurrentLaw::Constant; parameters.len()];
        let follows = vec![false; parameters.len()];
        Self { parameters, laws, lag: Lag::None, following: Vec::new(), follows }
    }

    /// One law per parameter, in spec order.
    ///
    /// # Errors
    /// If their number differs from that of the parameters.
    pub fn new(spec: &DamperSpec, laws: Vec<CurrentLaw>, lag: Lag) -> Result<Self, DynamicsError> {
        let (found, expected) = (laws.len(), spec.parameters.len());
        if found != expected {
            return Err(DynamicsError::LawCount { model: spec.name, found, expected });
        }
        let follows: Vec<bool> = laws.iter().map(|law| !matches!(law, CurrentLaw::Constant)).collect();
        let (mut following, mut first) = (Vec::new(), 0);
        for (parameter, law) in laws.iter().enumerate() {
            if follows[parameter] {
                following.push((parameter, first));
            }
            first += law.n_coefficients();
        }
        Ok(Self { parameters: spec.parameters, laws, lag, following, follows })
    }

    /// Number of columns of `theta`.
    #[must_use]
    pub fn n_columns(&self) -> usize {
        self.laws.iter().map(CurrentLaw::n_coefficients).sum::<usize>() + self.lag.n_rates()
    }

    /// Number of parameters of the model.
    pub(crate) fn n_params(&self) -> usize {
        self.parameters.len()
    }

    /// Whether no parameter depends on the command.
    #[must_use]
    pub fn are_constant(&self) -> bool {
        self.following.is_empty()
    }

    /// Whether each parameter depends on the command.
    pub(crate) fn follows(&self) -> &[bool] {
        &self.follows
    }

    /// Whether the driver has a lag.
    pub(crate) fn are_lagged(&self) -> bool {
        self.lag != Lag::None
    }

    /// The rates of the driver among the columns.
    #[inline(always)]
    pub(crate) fn rates<'a, R>(&self, columns: &'a [R]) -> &'a [R] {
        &columns[columns.len().saturating_sub(self.lag.n_rates())..]
    }

    /// The parameter on which a column acts, and the first column of its law; `None` for a rate of the driver.
    pub(crate) fn parameter_of(&self, column: usize) -> Option<(usize, usize)> {
        let mut first = 0;
        for (parameter, law) in self.laws.iter().enumerate() {
            let next = first + law.n_coefficients();
            if column < next {
                return Some((parameter, first));
            }
            first = next;
        }
        None
    }

    /// Value of a parameter that does not depend on the command, of a row of `theta`.
    pub(crate) fn constant_value(&self, theta: &[f64], parameter: usize) -> Option<f64> {
        let column: usize = self.laws[..parameter].iter().map(CurrentLaw::n_coefficients).sum();
        matches!(self.laws[parameter], CurrentLaw::Constant).then(|| theta[column])
    }

    /// Derivative of a parameter at the command `u` with respect to a column, from a row of `theta`; zero for a rate of the driver.
    pub(crate) fn slope(&self, theta: &[f64], column: usize, u: f64) -> f64 {
        let Some((index, first)) = self.parameter_of(column) else { return 0.0 };
        let (law, parameter) = (&self.laws[index], &self.parameters[index]);
        let mut own: Vec<Dual<f64, 1>> = theta[first..][..law.n_coefficients()]
            .iter()
            .map(|&coefficient| Dual::constant(coefficient))
            .collect();
        own[column - first].tangents = [1.0];
        law.prepare(&mut own, parameter.scale);
        law.limited_value(&own, Dual::constant(u), parameter).tangents[0]
    }

    /// Turns columns of `theta` into those that [`Self::evaluate`] takes; the rates of the driver stay.
    #[inline(always)]
    pub(crate) fn prepare<R: Real>(&self, columns: &mut [R]) {
        let mut rest = columns;
        for (law, parameter) in self.laws.iter().zip(self.parameters) {
            let count = law.n_coefficients().min(rest.len());
            let (own, others) = rest.split_at_mut(count);
            rest = others;
            law.prepare(own, parameter.scale);
        }
    }

    /// Parameters at the current `u` from prepared columns, written to `values`.
    #[inline(always)]
    pub(crate) fn evaluate<R: Real>(&self, prepared: &[R], u: R, values: &mut [R]) {
        let mut rest = prepared;
        for ((law, parameter), value) in self.laws.iter().zip(self.parameters).zip(values) {
            let (own, others) = rest.split_at(law.n_coefficients().min(rest.len()));
            rest = others;
            *value = law.limited_value(own, u, parameter);
        }
    }

    /// Writes the parameters that depend on the current anew; the others in `values` stay as [`Self::evaluate`] wrote them.
    #[inline(always)]
    pub(crate) fn follow<R: Real>(&self, prepared: &[R], u: R, values: &mut [R]) {
        for &(parameter, first) in &self.following {
            let law = &self.laws[parameter];
            let own = &prepared[first..first + law.n_coefficients()];
            values[parameter] = law.limited_value(own, u, &self.parameters[parameter]);
        }
    }
}

/// Writes the parameters that depend on the current anew, see [`CurrentLaws::follow`]: compiled once for all models.
pub(crate) struct Follow<'a, R> {
    pub(crate) laws: &'a CurrentLaws,
    pub(crate) prepared: &'a [R],
    pub(crate) current: &'a R,
    pub(crate) values: &'a mut [R],
}

impl<R: Real> OutOfLine for Follow<'_, R> {
    type Home = Self;
    #[inline(always)]
    fn run(self) {
        self.laws.follow(self.prepared, *self.current, self.values);
    }
}

/// Evaluates all parameters at a current, see [`CurrentLaws::evaluate`].
pub(crate) struct Evaluate<'a, R> {
    pub(crate) laws: &'a CurrentLaws,
    pub(crate) prepared: &'a [R],
    pub(crate) current: R,
    pub(crate) values: &'a mut [R],
}

impl<R: Real> OutOfLine for Evaluate<'_, R> {
    type Home = Self;
    #[inline(always)]
    fn run(self) {
        self.laws.evaluate(self.prepared, self.current, self.values);
    }
}

/// Turns columns into those that laws are evaluated from, see [`CurrentLaws::prepare`].
pub(crate) struct Prepare<'a, R> {
    pub(crate) laws: &'a CurrentLaws,
    pub(crate) columns: &'a mut [R],
}

impl<R: Real> OutOfLine for Prepare<'_, R> {
    type Home = Self;
    #[inline(always)]
    fn run(self) {
        self.laws.prepare(self.columns);
    }
}
