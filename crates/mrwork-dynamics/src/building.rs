//! A plane building: its matrices as sparse rows.

use nalgebra::{Cholesky, DMatrix, Dyn, SymmetricEigen};

use crate::error::DynamicsError;
use crate::lanes::Lanes;
use crate::real::Real;

/// A sparse matrix by rows.
#[derive(Clone, Debug)]
pub struct SparseRows {
    starts: Vec<usize>,
    entries: Vec<(usize, f64)>,
}

impl SparseRows {
    /// From a row-major matrix with `columns` columns.
    #[must_use]
    pub fn new(matrix: &[f64], columns: usize) -> Self {
        let mut starts = vec![0];
        let mut entries = Vec::new();
        for row in matrix.chunks_exact(columns) {
            entries.extend(row.iter().copied().enumerate().filter(|&(_, value)| value != 0.0));
            starts.push(entries.len());
        }
        Self { starts, entries }
    }

    /// From a matrix, which may have no columns.
    fn of(matrix: &DMatrix<f64>) -> Self {
        let mut starts = vec![0];
        let mut entries = Vec::new();
        for row in matrix.row_iter() {
            entries.extend(row.iter().copied().enumerate().filter(|&(_, value)| value != 0.0));
            starts.push(entries.len());
        }
        Self { starts, entries }
    }

    /// The diagonal of a square matrix; `None` if it has other entries or lacks one.
    fn diagonal(&self) -> Option<Vec<f64>> {
        (0..self.len())
            .map(|row| match self.row(row) {
                &[(column, value)] if column == row => Some(value),
                _ => None,
            })
            .collect()
    }

    /// Whether it is ones on the diagonal and nothing else.
    fn is_identity(&self) -> bool {
        self.diagonal()
            .is_some_and(|diagonal| diagonal.iter().all(|entry| entry.to_bits() == 1_f64.to_bits()))
    }

    /// Number of rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// Whether there are no rows.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Whether no row has an entry.
    pub(crate) fn is_blank(&self) -> bool {
        self.entries.is_empty()
    }

    /// Non-zero entries of a row: column and value.
    #[inline(always)]
    pub(crate) fn row(&self, row: usize) -> &[(usize, f64)] {
        &self.entries[self.starts[row]..self.starts[row + 1]]
    }

    /// The product of a row with `vector`.
    #[inline(always)]
    pub(crate) fn dot<R: Real>(&self, row: usize, vector: &[R]) -> R {
        self.add_dot(row, vector, R::splat(0.0))
    }

    /// The product of a row with `vector`, added to `sum`.
    #[inline(always)]
    pub(crate) fn add_dot<R: Real>(&self, row: usize, vector: &[R], sum: R) -> R {
        let mut sum = sum;
        for &(column, value) in self.row(row) {
            sum = vector[column].weighted(R::splat(value), sum);
        }
        sum
    }
}

/// A coefficient of equations in lanes: one that all lanes share, or one of each lane.
pub(crate) trait Coefficient<R: Lanes>: Copy {
    /// The coefficient of every lane.
    fn in_lanes(self) -> R;
    /// The coefficients of a vector.
    fn in_piece(&self, number: usize) -> R::Piece;
}

impl<R: Lanes> Coefficient<R> for f64 {
    #[inline(always)]
    fn in_lanes(self) -> R {
        R::splat(self)
    }
    #[inline(always)]
    fn in_piece(&self, _: usize) -> R::Piece {
        R::Piece::splat(*self)
    }
}

/// A coefficient of each lane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OfLanes<R>(R);

impl<R: Lanes> Coefficient<R> for OfLanes<R> {
    #[inline(always)]
    fn in_lanes(self) -> R {
        self.0
    }
    #[inline(always)]
    fn in_piece(&self, number: usize) -> R::Piece {
        self.0.piece(number)
    }
}

/// An entry of the stiffness and the damping matrix.
#[derive(Clone, Copy, Debug)]
struct Spring<N> {
    column: usize,
    stiffness: N,
    damping: N,
}

/// A row of a tridiagonal building: coefficients of the neighbour below, the coordinate itself and the neighbour above.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Link<N> {
    stiffness: [N; 3],
    damping: [N; 3],
}

impl<N: Copy> Link<N> {
    /// Forces of the stiffness and of the damping on a coordinate in a vector [N], from displacement and velocity of the
    /// neighbour below, the coordinate itself and the neighbour above.
    #[inline(always)]
    pub(crate) fn coupling<R: Lanes>(
        &self,
        vector: usize,
        [x_below, v_below]: [R::Piece; 2],
        [x, v]: [R::Piece; 2],
        [x_above, v_above]: [R::Piece; 2],
    ) -> [R::Piece; 2]
    where
        N: Coefficient<R>,
    {
        let mut sprung = x_below * self.stiffness[0].in_piece(vector);
        let mut damped = v_below * self.damping[0].in_piece(vector);
        sprung = x.weighted(self.stiffness[1].in_piece(vector), sprung);
        damped = v.weighted(self.damping[1].in_piece(vector), damped);
        sprung = x_above.weighted(self.stiffness[2].in_piece(vector), sprung);
        damped = v_above.weighted(self.damping[2].in_piece(vector), damped);
        [sprung, damped]
    }
}

/// Stiffness and damping matrices by rows, entries where either is not zero.
#[derive(Clone, Debug)]
pub(crate) struct SpringRows<N> {
    starts: Vec<usize>,
    entries: Vec<Spring<N>>,
    /// The same for a tridiagonal building; `None` if a coordinate is connected to others than its neighbours.
    links: Option<Vec<Link<N>>>,
}

impl SpringRows<f64> {
    fn new(stiffness: &[f64], damping: &[f64], columns: usize) -> Self {
        let mut starts = vec![0];
        let mut entries = Vec::new();
        for (stiffness, damping) in stiffness.chunks_exact(columns).zip(damping.chunks_exact(columns)) {
            for (column, (&stiffness, &damping)) in stiffness.iter().zip(damping).enumerate() {
                if stiffness != 0.0 || damping != 0.0 {
                    entries.push(Spring { column, stiffness, damping });
                }
            }
            starts.push(entries.len());
        }
        let links = links_of(&starts, &entries);
        Self { starts, entries, links }
    }

    /// Whether the entries stand in the same places, so that both are simulated by the same operations.
    pub(crate) fn has_pattern_of(&self, other: &Self) -> bool {
        let columns = |rows: &Self| rows.entries.iter().map(|entry| entry.column).collect::<Vec<_>>();
        self.starts == other.starts && columns(self) == columns(other)
    }
}

/// The rows of a tridiagonal building; `None` if a coordinate is connected to others than its neighbours.
fn links_of(starts: &[usize], entries: &[Spring<f64>]) -> Option<Vec<Link<f64>>> {
    let mut links = vec![Link { stiffness: [0.0; 3], damping: [0.0; 3] }; starts.len() - 1];
    for (row, link) in links.iter_mut().enumerate() {
        for spring in &entries[starts[row]..starts[row + 1]] {
            let neighbour = (spring.column + 1).checked_sub(row).filter(|&neighbour| neighbour < 3)?;
            link.stiffness[neighbour] = spring.stiffness;
            link.damping[neighbour] = spring.damping;
        }
    }
    Some(links)
}

impl<R: Lanes> SpringRows<OfLanes<R>> {
    /// The rows of a lane each, all of one pattern; the last ones are those of the lanes that are left.
    pub(crate) fn of_lanes(each: &[&SpringRows<f64>]) -> Self {
        let (first, last) = (each[0], each.len() - 1);
        let gathered = |number: &dyn Fn(&SpringRows<f64>) -> f64| {
            OfLanes(R::from_fn(|lane| number(each[lane.min(last)])))
        };
        let entries = first.entries.iter().enumerate().map(|(place, entry)| Spring {
            column: entry.column,
            stiffness: gathered(&|rows| rows.entries[place].stiffness),
            damping: gathered(&|rows| rows.entries[place].damping),
        });
        let link = |row: usize| {
            let number = |of: fn(&Link<f64>) -> &[f64; 3], neighbour: usize| {
                gathered(&|rows| rows.links.as_ref().map_or(f64::NAN, |links| of(&links[row])[neighbour]))
            };
            Link {
                stiffness: [0, 1, 2].map(|neighbour| number(|link| &link.stiffness, neighbour)),
                damping: [0, 1, 2].map(|neighbour| number(|link| &link.damping, neighbour)),
            }
        };
        Self {
            starts: first.starts.clone(),
            entries: entries.collect(),
            links: first.links.as_ref().map(|links| (0..links.len()).map(link).collect()),
        }
    }
}

impl<N: Copy> SpringRows<N> {
    #[inline(always)]
    fn row(&self, row: usize) -> &[Spring<N>] {
        &self.entries[self.starts[row]..self.starts[row + 1]]
    }

    /// Whether the coordinates are a chain, each connected to its neighbours alone.
    pub(crate) fn is_chain(&self) -> bool {
        self.links.is_some()
    }

    /// The links of a chain; none of another building.
    #[inline(always)]
    pub(crate) fn links(&self) -> &[Link<N>] {
        self.links.as_deref().unwrap_or_default()
    }

    /// Forces of the stiffness and of the damping on a coordinate [N].
    #[inline(always)]
    pub(crate) fn coupling<R: Lanes>(&self, coordinate: usize, displacement: &[R], velocity: &[R]) -> [R; 2]
    where
        N: Coefficient<R>,
    {
        let (mut sprung, mut damped) = (R::splat(0.0), R::splat(0.0));
        for spring in self.row(coordinate) {
            sprung = displacement[spring.column].weighted(spring.stiffness.in_lanes(), sprung);
            damped = velocity[spring.column].weighted(spring.damping.in_lanes(), damped);
        }
        [sprung, damped]
    }

    /// Force of the stiffness on a coordinate [N].
    #[inline(always)]
    pub(crate) fn sprung<R: Lanes>(&self, coordinate: usize, displacement: &[R]) -> R
    where
        N: Coefficient<R>,
    {
        let mut sum = R::splat(0.0);
        for spring in self.row(coordinate) {
            sum = displacement[spring.column].weighted(spring.stiffness.in_lanes(), sum);
        }
        sum
    }
}

/// Stiffness and damping of a building; a batch of runs may have others of the same building.
#[derive(Clone, Debug)]
pub struct Springs {
    pub(crate) rows: SpringRows<f64>,
    /// The larger of the largest natural frequency [rad/s] and the largest eigenvalue of M^-1 C [1/s].
    pub(crate) fastest: f64,
}

impl Springs {
    fn new(root: &Cholesky<f64, Dyn>, damping: &[f64], stiffness: &[f64], n: usize) -> Self {
        let frequency = largest_eigenvalue(root, stiffness, n).abs().sqrt();
        let decay = largest_eigenvalue(root, damping, n).abs();
        Self { rows: SpringRows::new(stiffness, damping, n), fastest: frequency.max(decay) }
    }

    /// Number of coordinates.
    pub(crate) fn n_coordinates(&self) -> usize {
        self.rows.starts.len() - 1
    }
}

/// The matrices of a building, row-major: `M q'' + C q' + K q = -sum_d e_d' f_d - M r a_g`.
#[derive(Clone, Copy, Debug)]
pub struct Matrices<'a> {
    /// M [kg], shape (n, n).
    pub mass: &'a [f64],
    /// C [N s/m], shape (n, n).
    pub damping: &'a [f64],
    /// K [N/m], shape (n, n).
    pub stiffness: &'a [f64],
    /// r, displacements of the coordinates for a unit displacement of the ground, shape (n,).
    pub influence: &'a [f64],
    /// Floor displacements from coordinates, shape (floors, n).
    pub floors: &'a [f64],
    /// Storey drifts from coordinates, shape (storeys, n).
    pub storeys: &'a [f64],
    /// Coordinates under a unit drift of each storey alone, on which all above it moves, shape (storeys, n); zeros where
    /// storey shears are not asked for.
    pub unit_drifts: &'a [f64],
    /// Height of each storey [m], shape (storeys,).
    pub heights: &'a [f64],
    /// Stiffness of the springs of each storey [N/m], shape (storeys,).
    pub storey_springs: &'a [f64],
    /// e, elongation of each device from coordinates, shape (devices, n).
    pub devices: &'a [f64],
    /// Displacement of the sprung mass of each device from coordinates, shape (devices, n); zeros where it has none.
    pub sprung: &'a [f64],
    /// Elongation of each passive element from coordinates, shape (elements, n).
    pub elements: &'a [f64],
    /// What each element does.
    pub element_parameters: &'a [Element],
}

/// A passive element `f = k x + c v + d |v| v + f_y w`, `w' = rho (v - (|v| |w|^(n-1) w + v |w|^n) / 2)`.
///
/// Its spring and its dashpot are in K and C of the building already; they are here for its force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Element {
    /// k [N/m].
    pub stiffness: f64,
    /// c [N s/m].
    pub damping: f64,
    /// d [N s2/m2].
    pub head_loss: f64,
    /// Yield force [N].
    pub yield_force: f64,
    /// rho, the yield force over the initial stiffness of the loop is 1/rho [1/m].
    pub slope: f64,
    /// n, sharpness of the knee [1].
    pub sharpness: f64,
    /// Whether it is a part of the frame, which yields.
    pub in_frame: bool,
}

impl Element {
    /// Its whole force at elongation x and rate v, from that without spring and dashpot.
    #[inline(always)]
    pub(crate) fn with_spring<R: Real>(&self, force: R, x: R, v: R) -> R {
        x.weighted(R::splat(self.stiffness), v.weighted(R::splat(self.damping), force))
    }

    /// Whether its numbers are those of an element that can be simulated.
    fn is_sound(&self) -> bool {
        let Self { stiffness, damping, head_loss, yield_force, slope, sharpness, .. } = *self;
        let positive = [stiffness, damping, head_loss, yield_force].iter().all(|number| *number >= 0.0);
        let sum = stiffness + damping + head_loss + yield_force * slope + sharpness;
        positive && slope > 0.0 && sharpness >= 1.0 && sum.is_finite()
    }
}

/// A building with the rows of its devices.
#[derive(Clone, Debug)]
pub struct Building {
    /// Number of coordinates.
    pub(crate) n: usize,
    pub(crate) mass: SparseRows,
    mass_inverse: SparseRows,
    /// Its diagonal; `None` if it has other entries.
    pub(crate) per_mass: Option<Vec<f64>>,
    pub(crate) springs: Springs,
    pub(crate) influence: Vec<f64>,
    /// M r [kg].
    pub(crate) pushed_mass: Vec<f64>,
    /// r' M r [kg].
    pub(crate) total_mass: f64,
    pub(crate) floors: SparseRows,
    /// Whether the floors are the first coordinates, in order.
    pub(crate) floors_are_coordinates: bool,
    pub(crate) storeys: SparseRows,
    pub(crate) shears: Shears,
    pub(crate) devices: SparseRows,
    /// Rows x of the absolute motion that laws read for each device: of its sprung mass, else its elongation.
    pub(crate) absolute: SparseRows,
    /// Whether each device has a sprung mass.
    pub(crate) has_sprung: Vec<bool>,
    /// Weights of the floors' accelerations that add up to `x (q'' + r a_g)` of each device; `None` if floors do not.
    pub(crate) device_floors: Option<SparseRows>,
    /// Effective mass of each device, 1 / (e M^-1 e') [kg].
    pub(crate) device_mass: Vec<f64>,
    pub(crate) elements: SparseRows,
    pub(crate) element_parameters: Vec<Element>,
    /// Effective mass of each element [kg].
    pub(crate) element_mass: Vec<f64>,
}

/// What does virtual work on a unit drift of each storey.
#[derive(Clone, Debug)]
pub(crate) struct Shears {
    /// Momentum of what moves with the drift of a storey and not with that of the next one; sums from the top down are
    /// of all above a storey.
    pub(crate) mass: SparseRows,
    /// The same under unit motion of the ground [kg].
    pub(crate) pushed: Vec<f64>,
    /// Motion of each floor with the drift of a storey and not with that of the next one.
    pub(crate) floors: SparseRows,
    /// Share of each element.
    pub(crate) elements: SparseRows,
    /// Of these, the parts of the frame that yield.
    pub(crate) yielding: SparseRows,
    /// Stiffness of the springs of each storey [N/m].
    pub(crate) springs: Vec<f64>,
    /// Height of each storey [m], and whether one is known.
    pub(crate) heights: Vec<f64>,
    pub(crate) has_heights: bool,
}

impl Shears {
    fn of(matrices: &Matrices<'_>, mass: &DMatrix<f64>, n: usize) -> Result<Self, DynamicsError> {
        for (name, found) in [
            ("unit_drifts", matrices.unit_drifts.len()),
            ("heights", matrices.heights.len() * n),
            ("storey_springs", matrices.storey_springs.len() * n),
        ] {
            let expected = matrices.storeys.len();
            if found != expected {
                return Err(DynamicsError::MatrixSize { name, found, expected });
            }
        }
        let drifts = DMatrix::from_row_slice(matrices.unit_drifts.len() / n, n, matrices.unit_drifts);
        let mut between = drifts.clone();
        for row in 1..between.nrows() {
            let mut below = between.row_mut(row - 1);
            below -= drifts.row(row);
        }
        let elements = DMatrix::from_row_slice(matrices.elements.len() / n, n, matrices.elements);
        let shares = &drifts * elements.transpose();
        let mut yielding = shares.clone();
        for (mut column, element) in yielding.column_iter_mut().zip(matrices.element_parameters) {
            if !element.in_frame {
                column.fill(0.0);
            }
        }
        let carried = &between * mass;
        let pushed = &carried * DMatrix::from_column_slice(n, 1, matrices.influence);
        let floors =
            &between * DMatrix::from_row_slice(matrices.floors.len() / n, n, matrices.floors).transpose();
        Ok(Self {
            elements: SparseRows::of(&shares),
            yielding: SparseRows::of(&yielding),
            mass: SparseRows::of(&carried),
            pushed: pushed.as_slice().to_vec(),
            floors: SparseRows::of(&floors),
            springs: matrices.storey_springs.to_vec(),
            heights: matrices.heights.to_vec(),
            has_heights: matrices.heights.iter().any(|&height| height > 0.0),
        })
    }
}

impl Building {
    /// Prepares a building for simulation.
    ///
    /// # Errors
    /// If shapes do not match, a number is not finite, or the mass matrix is not positive definite.
    pub fn new(matrices: &Matrices<'_>) -> Result<Self, DynamicsError> {
        let n = matrices.influence.len();
        let square =
            [("mass", matrices.mass), ("damping", matrices.damping), ("stiffness", matrices.stiffness)];
        check_square(&square, n)?;
        let rows = [
            ("floors", matrices.floors),
            ("storeys", matrices.storeys),
            ("unit_drifts", matrices.unit_drifts),
            ("devices", matrices.devices),
            ("sprung", matrices.sprung),
            ("elements", matrices.elements),
        ];
        for (name, matrix) in rows {
            if n == 0 || !matrix.len().is_multiple_of(n) {
                return Err(DynamicsError::MatrixSize { name, found: matrix.len(), expected: n });
            }
        }
        let vectors = [
            ("influence", matrices.influence),
            ("heights", matrices.heights),
            ("storey_springs", matrices.storey_springs),
        ];
        check_finite(square.into_iter().chain(rows).chain(vectors))?;
        if matrices.sprung.len() != matrices.devices.len() {
            let (found, expected) = (matrices.sprung.len(), matrices.devices.len());
            return Err(DynamicsError::MatrixSize { name: "sprung", found, expected });
        }
        let (found, expected) = (matrices.element_parameters.len(), matrices.elements.len() / n);
        if found != expected {
            return Err(DynamicsError::MatrixSize { name: "element_parameters", found, expected });
        }
        if let Some(element) = matrices.element_parameters.iter().position(|each| !each.is_sound()) {
            return Err(DynamicsError::Element(element));
        }
        let mass = DMatrix::from_row_slice(n, n, matrices.mass);
        let root = Cholesky::new(mass.clone()).ok_or(DynamicsError::SingularMass)?;
        let mut inverse = root.inverse();
        clear_rounding(&mut inverse);
        let pushed = &mass * DMatrix::from_column_slice(n, 1, matrices.influence);
        let total_mass = pushed.iter().zip(matrices.influence).map(|(m, r)| m * r).sum();
        let moved_masses = |rows: &[f64]| {
            let moved = |row| {
                let row = DMatrix::from_row_slice(1, n, row);
                1.0 / (&row * &inverse * row.transpose())[(0, 0)]
            };
            rows.chunks_exact(n).map(moved).collect()
        };
        let has_sprung: Vec<bool> =
            matrices.sprung.chunks_exact(n).map(|row| row.iter().any(|&entry| entry != 0.0)).collect();
        let rows = matrices.sprung.chunks_exact(n).zip(matrices.devices.chunks_exact(n)).zip(&has_sprung);
        let absolute: Vec<f64> =
            rows.flat_map(|((sprung, device), &has)| if has { sprung } else { device }).copied().collect();
        let (device_mass, element_mass) = (moved_masses(matrices.devices), moved_masses(matrices.elements));
        let floors = SparseRows::new(matrices.floors, n);
        let mass_inverse = SparseRows::new(inverse.transpose().as_slice(), n);
        Ok(Self {
            n,
            mass: SparseRows::new(matrices.mass, n),
            per_mass: mass_inverse.diagonal(),
            mass_inverse,
            springs: Springs::new(&root, matrices.damping, matrices.stiffness, n),
            influence: matrices.influence.to_vec(),
            pushed_mass: pushed.as_slice().to_vec(),
            total_mass,
            floors_are_coordinates: floors.is_identity(),
            floors,
            storeys: SparseRows::new(matrices.storeys, n),
            shears: Shears::of(matrices, &mass, n)?,
            devices: SparseRows::new(matrices.devices, n),
            device_floors: weights_of_floors(matrices.floors, &absolute, n),
            absolute: SparseRows::new(&absolute, n),
            has_sprung,
            device_mass,
            elements: SparseRows::new(matrices.elements, n),
            element_parameters: matrices.element_parameters.to_vec(),
            element_mass,
        })
    }

    /// Other stiffness and damping of the building, as of a realisation.
    ///
    /// # Errors
    /// If a matrix is not that of as many coordinates, or has a number that is not finite.
    pub fn with_springs(&self, damping: &[f64], stiffness: &[f64]) -> Result<Springs, DynamicsError> {
        let n = self.n;
        let matrices = [("damping", damping), ("stiffness", stiffness)];
        check_square(&matrices, n)?;
        check_finite(matrices)?;
        let mut mass = DMatrix::zeros(n, n);
        for row in 0..n {
            for &(column, entry) in self.mass.row(row) {
                mass[(row, column)] = entry;
            }
        }
        let root = Cholesky::new(mass).ok_or(DynamicsError::SingularMass)?;
        Ok(Springs::new(&root, damping, stiffness, n))
    }

    /// Acceleration of a coordinate relative to the ground, under these resisting forces.
    #[inline(always)]
    pub(crate) fn acceleration<R: Real>(&self, coordinate: usize, resisting: &[R], ground: R) -> R {
        let mut carried = ground * R::splat(-self.influence[coordinate]);
        for &(column, mobility) in self.mass_inverse.row(coordinate) {
            carried = resisting[column].weighted(R::splat(-mobility), carried);
        }
        carried
    }

    /// Number of coordinates.
    #[must_use]
    pub fn n_coordinates(&self) -> usize {
        self.n
    }

    /// Number of devices.
    #[must_use]
    pub fn n_devices(&self) -> usize {
        self.devices.len()
    }

    /// Number of passive elements.
    #[must_use]
    pub fn n_elements(&self) -> usize {
        self.elements.len()
    }

    /// Number of floors.
    #[must_use]
    pub fn n_floors(&self) -> usize {
        self.floors.len()
    }

    /// Number of storeys.
    #[must_use]
    pub fn n_storeys(&self) -> usize {
        self.storeys.len()
    }
}

fn check_square(matrices: &[(&'static str, &[f64])], n: usize) -> Result<(), DynamicsError> {
    for &(name, matrix) in matrices {
        let (found, expected) = (matrix.len(), n * n);
        if found != expected {
            return Err(DynamicsError::MatrixSize { name, found, expected });
        }
    }
    Ok(())
}

fn check_finite<'a>(
    matrices: impl IntoIterator<Item = (&'static str, &'a [f64])>,
) -> Result<(), DynamicsError> {
    for (name, matrix) in matrices {
        if let Some(sample) = matrix.iter().position(|value| !value.is_finite()) {
            return Err(DynamicsError::NotFinite { name, sample });
        }
    }
    Ok(())
}

/// Rows w of the devices with w F = x for the rows F of the floors; `None` if there are none.
fn weights_of_floors(floors: &[f64], absolute: &[f64], n: usize) -> Option<SparseRows> {
    let floors = DMatrix::from_row_slice(floors.len() / n, n, floors);
    let devices = DMatrix::from_row_slice(absolute.len() / n, n, absolute);
    let root = Cholesky::new(&floors * floors.transpose())?;
    let weights = root.solve(&(&floors * devices.transpose()));
    // Without rounding a row has few entries: the floors at the ends of the device.
    let weights = weights.map(|weight| (weight * 1e12).round() / 1e12);
    let missed = (floors.transpose() * &weights - devices.transpose()).abs().max();
    (missed <= 1e-9 * devices.abs().max()).then(|| SparseRows::new(weights.as_slice(), floors.nrows()))
}

/// Sets entries at the level of rounding to zero, so that the inverse of a diagonal or banded mass matrix stays sparse.
fn clear_rounding(inverse: &mut DMatrix<f64>) {
    let diagonal: Vec<f64> = inverse.diagonal().iter().copied().collect();
    for row in 0..diagonal.len() {
        for column in 0..diagonal.len() {
            let scale = (diagonal[row] * diagonal[column]).sqrt();
            if inverse[(row, column)].abs() < 1e-15 * scale {
                inverse[(row, column)] = 0.0;
            }
        }
    }
}

/// Eigenvalue of `M^-1 A` of largest magnitude, for the symmetric part of A; `root` is the Cholesky factor of M.
fn largest_eigenvalue(root: &Cholesky<f64, Dyn>, matrix: &[f64], n: usize) -> f64 {
    let matrix = DMatrix::from_row_slice(n, n, matrix);
    let symmetric = (&matrix + matrix.transpose()) * 0.5;
    let lower = root.l();
    let Some(half) = lower.solve_lower_triangular(&symmetric) else { return f64::INFINITY };
    let Some(whole) = lower.solve_lower_triangular(&half.transpose()) else { return f64::INFINITY };
    let symmetric = (&whole + whole.transpose()) * 0.5;
    SymmetricEigen::new(symmetric)
        .eigenvalues
        .iter()
        .fold(0.0, |largest: f64, &value| if value.abs() > largest.abs() { value } else { largest })
}
