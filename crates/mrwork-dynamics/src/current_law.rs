//! Current laws: each parameter of a model as a function of the coil current.

use core::ops::Range;

use crate::damper::model::DamperSpec;
use crate::dual::Dual;
use crate::elementary::{exp, ln, tanh};
use crate::error::DynamicsError;
use crate::lag::Lag;
use crate::parameters::{ParamSpec, Scale};
use crate::real::{OutOfLine, Real, where_positive};

/// Largest number of commands at which a law may have values.
pub const MOST_NODES: usize = 8;
/// Denominators of a law that saturates are at least this: far below its commands they round to zero.
const LEAST_DENOMINATOR: f64 = 1e-300;

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
    /// Values at several commands, and the cubics through them that are monotone where the values are.
    Monotone(Nodes),
    /// Values at two commands, a rate, and the curve through the values that saturates.
    Saturating(Saturation),
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
            Self::Monotone(_) => "monotone",
            Self::Saturating(saturation) => match saturation.shape {
                Saturating::Exponential => "exponential",
                Saturating::Tanh => "tanh",
            },
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

    /// The law of a name, such as `quadratic`, `quadratic:0,0.5,1`, `log_linear:0,1`, `monotone:0,0.5,1` or `tanh:0,1`.
    ///
    /// # Errors
    /// If there is no such law, or its commands are not as many rising numbers as it takes.
    pub fn of_name(name: &str) -> Result<Self, DynamicsError> {
        let unknown = || DynamicsError::UnknownLaw(name.into());
        let Some((law, commands)) = name.split_once(':') else {
            return Self::NAMED.into_iter().find(|law| law.name() == name).ok_or_else(unknown);
        };
        let commands: Result<Vec<f64>, _> = commands.split(',').map(|text| text.trim().parse()).collect();
        let commands = commands.map_err(|_| unknown())?;
        let nodes = Nodes::at(&commands).ok_or_else(unknown)?;
        let saturating = |shape| Self::Saturating(Saturation::at(&commands, shape));
        match (law, nodes.count) {
            ("exponential", 2) => Ok(saturating(Saturating::Exponential)),
            ("tanh", 2) => Ok(saturating(Saturating::Tanh)),
            ("monotone", _) => Ok(Self::Monotone(nodes)),
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
            Self::Quadratic | Self::Exponential | Self::Saturating(_) => 3,
            Self::Cubic => 4,
            Self::Values(nodes) | Self::Logarithms(nodes) | Self::Monotone(nodes) => nodes.count,
        }
    }

    /// Number of prepared numbers beyond those that take the places of the coefficients.
    #[inline(always)]
    const fn n_further(&self) -> usize {
        match self {
            // A slope at each node, and two coefficients of each piece between them.
            Self::Monotone(nodes) => nodes.count + 2 * (nodes.count - 1),
            Self::Saturating(_) => 1,
            _ => 0,
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
            Self::Exponential
            | Self::Values(_)
            | Self::Logarithms(_)
            | Self::Monotone(_)
            | Self::Saturating(_) => None,
        }
    }

    /// What [`Self::value`] takes in place of the coefficients, and [`Self::n_further`] numbers; worked out once, it saves
    /// the logarithms and quotients of every step.
    #[inline(always)]
    fn prepare<R: Real>(&self, coefficients: &mut [R], further: &mut Vec<R>, scale: Scale) {
        match self {
            Self::Values(nodes) | Self::Logarithms(nodes) => {
                if self.takes_logarithms(scale) {
                    for value in &mut *coefficients {
                        *value = ln(*value);
                    }
                }
                nodes.prepare(coefficients);
            }
            Self::Monotone(nodes) => nodes.prepare_pieces(coefficients, further),
            Self::Saturating(saturation) => saturation.prepare(coefficients, further),
            Self::Constant | Self::Linear | Self::Quadratic | Self::Cubic | Self::Exponential => {}
        }
    }

    /// Whether it interpolates logarithms of a parameter of this scale.
    #[inline(always)]
    fn takes_logarithms(&self, scale: Scale) -> bool {
        matches!(self, Self::Logarithms(_)) && scale == Scale::Log
    }

    /// The parameter at `u` from prepared coefficients and the further numbers; not a number for a wrong number of them.
    #[inline(always)]
    fn value<R: Real>(&self, prepared: &[R], further: &[R], u: R, scale: Scale) -> R {
        let (offset, factor, exponent) = match (self, prepared) {
            (Self::Constant, &[a]) => return a,
            (Self::Linear, &[a, b]) => return b.mul_add(u, a),
            (Self::Quadratic, &[a, b, c]) => return c.mul_add(u, b).mul_add(u, a),
            (Self::Cubic, &[a, b, c, d]) => return d.mul_add(u, c).mul_add(u, b).mul_add(u, a),
            (Self::Exponential, &[a, b, c]) => (a, b, c * u),
            (Self::Monotone(nodes), values)
                if values.len() == nodes.count && further.len() == self.n_further() =>
            {
                return nodes.monotone(values, further, u);
            }
            (Self::Saturating(saturation), prepared) => return saturation.value(prepared, further, u),
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

    /// The parameter at `u` from prepared numbers, limited to its range where it depends on the command.
    #[inline(always)]
    fn limited_value<R: Real>(&self, prepared: &[R], further: &[R], u: R, parameter: &ParamSpec) -> R {
        let free = self.value(prepared, further, u, parameter.scale);
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

    /// Appends the slopes at the nodes and the second and third coefficients of the cubic from each node to the next.
    ///
    /// The slopes are those of Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5, 1984, 300: harmonic means of the
    /// slopes to either side, zero at an extremum of the values; at the ends those of the parabola, limited.
    #[inline(always)]
    fn prepare_pieces<R: Real>(&self, values: &[R], further: &mut Vec<R>) {
        let count = self.count;
        let (mut widths, mut secants) = (Vec::with_capacity(count), Vec::with_capacity(count));
        for piece in 0..count - 1 {
            let width = self.places[piece + 1] - self.places[piece];
            widths.push(width);
            secants.push((values[piece + 1] - values[piece]) * R::splat(1.0 / width));
        }
        let mut slopes = Vec::with_capacity(count);
        if count == 2 {
            slopes.push(secants[0]);
            slopes.push(secants[0]);
        } else {
            slopes.push(end_slope([widths[0], widths[1]], [secants[0], secants[1]]));
            for node in 1..count - 1 {
                let (before, after) = (secants[node - 1], secants[node]);
                let share_before = 2.0 * widths[node] + widths[node - 1];
                let share_after = widths[node] + 2.0 * widths[node - 1];
                let both = after.mul_add(R::splat(share_before), before * R::splat(share_after));
                let product = before * after;
                let mean = product * R::splat(share_before + share_after) / both;
                slopes.push(where_positive(product, mean));
            }
            let last = count - 2;
            slopes.push(end_slope([widths[last], widths[last - 1]], [secants[last], secants[last - 1]]));
        }
        further.extend_from_slice(&slopes);
        for piece in 0..count - 1 {
            let per_width = 1.0 / widths[piece];
            // How far the slopes at its ends lie above its own.
            let (start, end) = (slopes[piece] - secants[piece], slopes[piece + 1] - secants[piece]);
            further.push((start + start + end) * R::splat(-per_width));
            further.push((start + end) * R::splat(per_width * per_width));
        }
    }

    /// The monotone cubics at `u`, beyond the nodes their tangents.
    #[inline(always)]
    fn monotone<R: Real>(&self, values: &[R], further: &[R], u: R) -> R {
        let (slopes, higher) = further.split_at(self.count);
        let zero = R::splat(0.0);
        let t = (u - R::splat(self.centre)) * R::splat(self.per_half);
        let (mut start, mut value, mut slope) = (R::splat(self.places[0]), values[0], slopes[0]);
        let (mut second, mut third) = (zero, zero);
        for node in 0..self.count {
            let place = R::splat(self.places[node]);
            // At a node its own value counts, to the bit.
            let before = t.less(place);
            start = R::select(before, start, place);
            value = R::select(before, value, values[node]);
            slope = R::select(before, slope, slopes[node]);
            // Beyond the last node there is no cubic.
            let own =
                if node + 1 < self.count { [higher[2 * node], higher[2 * node + 1]] } else { [zero; 2] };
            second = R::select(before, second, own[0]);
            third = R::select(before, third, own[1]);
        }
        let along = t - start;
        third.mul_add(along, second).mul_add(along, slope).mul_add(along, value)
    }
}

/// Slope at an end from the widths and slopes of the piece there and of its neighbour: that of the parabola, zero where
/// it has the other sign, and at most three times that of the piece.
#[inline(always)]
fn end_slope<R: Real>([width, next_width]: [f64; 2], [own, next]: [R; 2]) -> R {
    let next_share = -width / (width + next_width);
    let parabola = own.mul_add(R::splat(1.0 - next_share), next * R::splat(next_share));
    let rising = where_positive(parabola * own, parabola);
    let most = own * R::splat(3.0);
    R::select(most.abs().less(rising.abs()), most, rising)
}

/// Shape of a law that saturates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Saturating {
    /// A part of `1 - exp(-c u)`.
    Exponential,
    /// A part of `tanh(c u)`.
    Tanh,
}

/// Values at two commands, a rate c, and the curve of that shape through the values.
///
/// p = p0 + (p1 - p0) w(u)/w(u1) with w = t/(1 + s t): t = tanh(c (u - u0)) and s = tanh(c u0) for a hyperbolic tangent,
/// t = tanh(c (u - u0)/2) and s = 1 for an exponential. No nearly equal numbers are subtracted, whatever the rate: as it
/// goes to zero the curve becomes the straight line, digit by digit.
#[derive(Clone, Debug, PartialEq)]
pub struct Saturation {
    shape: Saturating,
    first: f64,
    span: f64,
}

impl Saturation {
    /// Through values at the first and the last of rising commands.
    fn at(commands: &[f64], shape: Saturating) -> Self {
        let ends = commands.first().zip(commands.last());
        let (first, span) = ends.map_or((0.0, f64::NAN), |(&first, &last)| (first, last - first));
        Self { shape, first, span }
    }

    /// Replaces the values and the rate by p0, the factor of w and that of u in t; appends s.
    #[inline(always)]
    fn prepare<R: Real>(&self, coefficients: &mut [R], further: &mut Vec<R>) {
        let &mut [first, ref mut last, ref mut rate] = coefficients else { return };
        let start = match self.shape {
            Saturating::Exponential => {
                *rate = *rate * R::splat(0.5);
                R::splat(1.0)
            }
            Saturating::Tanh => tanh(*rate * R::splat(self.first)),
        };
        let way = tanh(*rate * R::splat(self.span));
        *last = (*last - first) * way.mul_add(start, R::splat(1.0)) / way;
        further.push(start);
    }

    /// The curve at `u` from prepared numbers.
    #[inline(always)]
    fn value<R: Real>(&self, prepared: &[R], further: &[R], u: R) -> R {
        let (&[first, rise, rate], &[start]) = (prepared, further) else { return R::splat(f64::NAN) };
        let way = tanh(rate * (u - R::splat(self.first)));
        let denominator = R::splat(LEAST_DENOMINATOR).max(way.mul_add(start, R::splat(1.0)));
        rise.mul_add(way / denominator, first)
    }
}

/// A parameter, the columns of its law, and the places of the further numbers that are prepared from them.
#[derive(Clone, Debug)]
struct Place {
    parameter: usize,
    columns: Range<usize>,
    further: Range<usize>,
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
    /// Parameters that depend on the command.
    following: Vec<Place>,
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
        let mut made = Self { parameters: spec.parameters, laws, lag, following: Vec::new(), follows };
        let (mut following, mut column, mut further) = (Vec::new(), 0, made.n_columns());
        for (parameter, law) in made.laws.iter().enumerate() {
            if made.follows[parameter] {
                following.push(Place {
                    parameter,
                    columns: column..column + law.n_coefficients(),
                    further: further..further + law.n_further(),
                });
            }
            column += law.n_coefficients();
            further += law.n_further();
        }
        made.following = following;
        Ok(made)
    }

    /// Number of columns of `theta`.
    #[must_use]
    pub fn n_columns(&self) -> usize {
        self.laws.iter().map(CurrentLaw::n_coefficients).sum::<usize>() + self.lag.n_rates()
    }

    /// Number of prepared columns: those of `theta`, and further numbers behind them.
    pub(crate) fn n_prepared(&self) -> usize {
        self.n_columns() + self.laws.iter().map(CurrentLaw::n_further).sum::<usize>()
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

    /// The rates of the driver among the columns, prepared or not.
    #[inline(always)]
    pub(crate) fn rates<'a, R>(&self, columns: &'a [R]) -> &'a [R] {
        let end = self.n_columns().min(columns.len());
        &columns[end.saturating_sub(self.lag.n_rates())..end]
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
        let mut further = Vec::new();
        law.prepare(&mut own, &mut further, parameter.scale);
        law.limited_value(&own, &further, Dual::constant(u), parameter).tangents[0]
    }

    /// Turns columns of `theta` into those that [`Self::evaluate`] takes, and appends further numbers; the rates of the driver
    /// stay where they are.
    #[inline(always)]
    pub(crate) fn prepare<R: Real>(&self, columns: &mut Vec<R>) {
        let mut further = Vec::with_capacity(self.n_prepared() - self.n_columns());
        let mut rest = columns.as_mut_slice();
        for (law, parameter) in self.laws.iter().zip(self.parameters) {
            let count = law.n_coefficients().min(rest.len());
            let (own, others) = rest.split_at_mut(count);
            rest = others;
            law.prepare(own, &mut further, parameter.scale);
        }
        columns.append(&mut further);
    }

    /// Parameters at the current `u` from prepared columns, written to `values`.
    #[inline(always)]
    pub(crate) fn evaluate<R: Real>(&self, prepared: &[R], u: R, values: &mut [R]) {
        let (mut rest, mut further) = prepared.split_at(self.n_columns().min(prepared.len()));
        for ((law, parameter), value) in self.laws.iter().zip(self.parameters).zip(values) {
            let (own, others) = rest.split_at(law.n_coefficients().min(rest.len()));
            let (own_further, others_further) = further.split_at(law.n_further().min(further.len()));
            (rest, further) = (others, others_further);
            *value = law.limited_value(own, own_further, u, parameter);
        }
    }

    /// Writes the parameters that depend on the current anew; the others in `values` stay as [`Self::evaluate`] wrote them.
    #[inline(always)]
    pub(crate) fn follow<R: Real>(&self, prepared: &[R], u: R, values: &mut [R]) {
        for Place { parameter, columns, further } in &self.following {
            let (own, own_further) = (&prepared[columns.clone()], &prepared[further.clone()]);
            let (law, parameter, value) =
                (&self.laws[*parameter], &self.parameters[*parameter], &mut values[*parameter]);
            *value = law.limited_value(own, own_further, u, parameter);
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
    pub(crate) columns: &'a mut Vec<R>,
}

impl<R: Real> OutOfLine for Prepare<'_, R> {
    type Home = Self;
    #[inline(always)]
    fn run(self) {
        self.laws.prepare(self.columns);
    }
}
