//! Riccati and Lyapunov equations in batches: solved to rounding, the same alone or among others, and failures are values.

#![allow(clippy::cast_precision_loss, clippy::expect_used, clippy::float_cmp)] // exact comparison is what is claimed

use mrwork_dynamics::dispatch::InstructionSet;
use mrwork_dynamics::error::DynamicsError;
use mrwork_dynamics::matrix_equations::{Equations, Solution, Stack, Status, Time, solve};
use nalgebra::DMatrix;

/// A batch of plants of random entries with random weights.
#[derive(Clone)]
struct Batch {
    n: usize,
    m: usize,
    time: Time,
    a: Vec<f64>,
    b: Vec<f64>,
    q: Vec<f64>,
    r: Vec<f64>,
    cross: Vec<f64>,
}

impl Batch {
    fn rows(&self) -> usize {
        self.a.len() / (self.n * self.n)
    }

    fn equations(&self) -> Equations<'_> {
        let (n, m) = (self.n, self.m);
        Equations {
            n_batch: self.rows(),
            n_states: n,
            n_controls: m,
            time: self.time,
            state: Stack::new(&self.a, n * n),
            control: Stack::new(&self.b, n * m),
            state_weight: Stack::new(&self.q, n * n),
            control_weight: Stack::new(&self.r, m * m),
            cross_weight: Some(Stack::new(&self.cross, n * m)),
            scaling: None,
        }
    }

    fn row(&self, row: usize) -> Self {
        let part = |entries: &[f64]| {
            let each = entries.len() / self.rows();
            entries[row * each..][..each].to_vec()
        };
        Self {
            a: part(&self.a),
            b: part(&self.b),
            q: part(&self.q),
            r: part(&self.r),
            cross: part(&self.cross),
            ..*self
        }
    }
}

/// Uniform numbers between -1 and 1, always the same.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn matrix(&mut self, rows: usize, columns: usize) -> DMatrix<f64> {
        DMatrix::from_fn(rows, columns, |_, _| self.next())
    }
}

fn row_major(matrix: &DMatrix<f64>) -> Vec<f64> {
    matrix.transpose().as_slice().to_vec()
}

/// Outputs y = C s + D f are weighed, so that the cost is positive and has a cross term.
fn random(n: usize, m: usize, rows: usize, time: Time) -> Batch {
    let mut numbers = Numbers(7 + n as u64);
    let mut batch = Batch { n, m, time, a: vec![], b: vec![], q: vec![], r: vec![], cross: vec![] };
    for _ in 0..rows {
        let (c, d) = (numbers.matrix(n + 1, n), numbers.matrix(n + 1, m));
        batch.a.extend(row_major(&numbers.matrix(n, n)));
        batch.b.extend(row_major(&numbers.matrix(n, m)));
        batch.q.extend(row_major(&(c.transpose() * &c)));
        batch.r.extend(row_major(&(d.transpose() * &d + DMatrix::identity(m, m) * 0.1)));
        batch.cross.extend(row_major(&(c.transpose() * &d)));
    }
    batch
}

struct Solved {
    gain: Vec<f64>,
    riccati: Vec<f64>,
    rows: Vec<Solution>,
}

fn solved_on(batch: &Batch, threads: usize, set: InstructionSet) -> Solved {
    let (n, m, rows) = (batch.n, batch.m, batch.rows());
    let (mut gain, mut riccati) = (vec![0.0; rows * n * m], vec![0.0; rows * n * n]);
    let rows = solve(&batch.equations(), &mut gain, &mut riccati, threads, set, &|| false)
        .expect("a batch of fitting shapes");
    Solved { gain, riccati, rows }
}

fn solved(batch: &Batch) -> Solved {
    solved_on(batch, 1, InstructionSet::detect().expect("a set"))
}

fn matrix(entries: &[f64], rows: usize, columns: usize, row: usize) -> DMatrix<f64> {
    DMatrix::from_row_slice(rows, columns, &entries[row * rows * columns..][..rows * columns])
}

#[test]
fn solutions_meet_their_equations_and_close_a_stable_loop() {
    for time in [Time::Continuous, Time::Discrete] {
        for (n, m) in [(1, 1), (2, 1), (3, 2), (7, 3), (10, 1), (16, 5), (23, 2)] {
            let batch = random(n, m, 11, time);
            let found = solved(&batch);
            for row in 0..batch.rows() {
                assert_eq!(found.rows[row].status, Status::Solved, "{time:?}, {n} states, row {row}");
                assert!(found.rows[row].residual < 1e-9);
                let (a, b) = (matrix(&batch.a, n, n, row), matrix(&batch.b, n, m, row));
                let (q, r) = (matrix(&batch.q, n, n, row), matrix(&batch.r, m, m, row));
                let cross = matrix(&batch.cross, n, m, row);
                let (k, p) = (matrix(&found.gain, m, n, row), matrix(&found.riccati, n, n, row));
                let closed = &a - &b * &k;
                let cost = &q - &cross * &k - k.transpose() * cross.transpose() + k.transpose() * &r * &k;
                // P is the cost of the closed loop, and K follows from P.
                let (residual, weight, driven) = match time {
                    Time::Continuous => {
                        (closed.transpose() * &p + &p * &closed + &cost, r, b.transpose() * &p)
                    }
                    Time::Discrete => (
                        closed.transpose() * &p * &closed - &p + &cost,
                        r + b.transpose() * &p * &b,
                        b.transpose() * &p * &a,
                    ),
                };
                let size = p.norm() * (1.0 + closed.norm()).powi(2);
                assert!(residual.norm() < 1e-10 * size, "{time:?}, {n} states: {}", residual.norm() / size);
                let wanted = weight * &k - (driven + cross.transpose());
                assert!(wanted.norm() < 1e-9 * size);
                for pole in closed.complex_eigenvalues().iter() {
                    match time {
                        Time::Continuous => assert!(pole.re < 0.0),
                        Time::Discrete => assert!(pole.norm() < 1.0),
                    }
                }
            }
        }
    }
}

#[test]
fn neighbours_threads_and_instruction_sets_do_not_change_a_bit() {
    for time in [Time::Continuous, Time::Discrete] {
        let batch = random(6, 2, 37, time);
        let reference = solved(&batch);
        for set in InstructionSet::usable() {
            for threads in [1, 2, 3] {
                let other = solved_on(&batch, threads, set);
                assert_eq!(reference.gain, other.gain);
                assert_eq!(reference.riccati, other.riccati);
                assert_eq!(reference.rows, other.rows);
            }
        }
        for row in [0, 5, 36] {
            let alone = solved(&batch.row(row));
            assert_eq!(alone.gain, reference.gain[row * 12..][..12]);
            assert_eq!(alone.riccati, reference.riccati[row * 36..][..36]);
            assert_eq!(alone.rows[0], reference.rows[row]);
        }
    }
}

#[test]
fn a_row_that_fails_leaves_its_neighbours_alone() {
    for time in [Time::Continuous, Time::Discrete] {
        let clean = random(4, 1, 20, time);
        let mut broken = clean.clone();
        // A mode that grows, which no control reaches.
        for j in 0..4 {
            broken.a[3 * 16 + 4 + j] = if j == 1 { 1.5 } else { 0.0 };
        }
        broken.b[3 * 4 + 1] = 0.0;
        broken.r[5] = -1.0;
        broken.q[9 * 16] = 1e300;
        let (before, after) = (solved(&clean), solved(&broken));
        assert_eq!(after.rows[3].status, Status::NoStabilisingSolution);
        assert_eq!(after.rows[5].status, Status::WeightNotPositive);
        for row in 0..20 {
            let gain = &after.gain[row * 4..][..4];
            if [3, 5].contains(&row) {
                assert!(gain.iter().all(|&entry| entry == f64::INFINITY));
                assert_eq!(after.rows[row].residual, f64::INFINITY);
            } else if row != 9 {
                assert_eq!(*gain, before.gain[row * 4..][..4]);
                assert_eq!(after.rows[row], before.rows[row]);
            }
        }
        let whole = after.gain.iter().chain(&after.riccati);
        assert!(whole.clone().all(|entry| !entry.is_nan()));
    }
}

#[test]
fn an_equation_without_controls_is_one_of_lyapunov() {
    let mut batch = random(5, 0, 9, Time::Continuous);
    for row in 0..9 {
        for i in 0..5 {
            // Row 4 keeps a pole to the right.
            batch.a[row * 25 + 6 * i] -= if row == 4 && i == 0 { -9.0 } else { 4.0 };
        }
    }
    let found = solved(&batch);
    for row in 0..9 {
        if row == 4 {
            assert_eq!(found.rows[row].status, Status::NoStabilisingSolution);
            continue;
        }
        let (a, q) = (matrix(&batch.a, 5, 5, row), matrix(&batch.q, 5, 5, row));
        let p = matrix(&found.riccati, 5, 5, row);
        let residual = a.transpose() * &p + &p * &a + &q;
        assert!(residual.norm() < 1e-14 * a.norm() * p.norm() + 1e-14 * q.norm());
    }
}

#[test]
fn a_tall_building_with_little_damping_is_solved_to_rounding() {
    for storeys in [3, 10, 20] {
        let n = 2 * storeys;
        let mut a = DMatrix::zeros(n, n);
        for i in 0..storeys {
            a[(i, storeys + i)] = 1.0;
            for j in 0..storeys {
                let roof = if i + 1 == storeys { 1.0 } else { 2.0 };
                let stiffness = match i.abs_diff(j) {
                    0 => 4e3 * roof,
                    1 => -4e3,
                    _ => 0.0,
                };
                a[(storeys + i, j)] = -stiffness;
                a[(storeys + i, storeys + j)] = -1e-5 * stiffness;
            }
        }
        let mut b = DMatrix::zeros(n, 1);
        b[(storeys, 0)] = -1e-6;
        let rows = 9;
        let q = DMatrix::identity(n, n);
        let mut batch = Batch {
            n,
            m: 1,
            time: Time::Continuous,
            a: row_major(&a).repeat(rows),
            b: row_major(&b).repeat(rows),
            q: row_major(&q).repeat(rows),
            r: (0..9).map(|row| 10_f64.powi(-row - 8)).collect(),
            cross: vec![0.0; n * rows],
        };
        let found = solved(&batch);
        for solution in &found.rows {
            assert_eq!(solution.status, Status::Solved);
            assert!(solution.residual < 1e-13, "{storeys} storeys: {}", solution.residual);
        }
        // All rows share what is given once.
        batch.a.truncate(n * n);
        batch.q.truncate(n * n);
        let equations = Equations {
            n_batch: rows,
            state: Stack::new(&batch.a, n * n),
            state_weight: Stack::new(&batch.q, n * n),
            control_weight: Stack::new(&batch.r, 1),
            cross_weight: None,
            ..batch.equations()
        };
        let (mut gain, mut riccati) = (vec![0.0; rows * n], vec![0.0; rows * n * n]);
        solve(&equations, &mut gain, &mut riccati, 1, InstructionSet::detect().expect("a set"), &|| false)
            .expect("a batch of fitting shapes");
        assert_eq!(gain, found.gain);
    }
}

#[test]
fn shapes_numbers_and_cancellation_are_errors() {
    let batch = random(3, 1, 4, Time::Continuous);
    let set = InstructionSet::detect().expect("a set");
    let (mut gain, mut riccati) = (vec![0.0; 12], vec![0.0; 36]);
    let short = Equations { state: Stack::new(&batch.a[..18], 9), ..batch.equations() };
    let error = solve(&short, &mut gain, &mut riccati, 1, set, &|| false).expect_err("two of four plants");
    assert!(matches!(error, DynamicsError::MatrixSize { name: "state", found: 18, .. }));
    let mut holed = batch.clone();
    holed.q[7] = f64::NAN;
    let error = solve(&holed.equations(), &mut gain, &mut riccati, 1, set, &|| false).expect_err("a NaN");
    assert_eq!(error, DynamicsError::NotFinite { name: "state_weight", sample: 7 });
    let error = solve(&batch.equations(), &mut gain[..3], &mut riccati, 1, set, &|| false)
        .expect_err("room for one gain");
    assert!(matches!(error, DynamicsError::MatrixSize { name: "gain", .. }));
    let error =
        solve(&batch.equations(), &mut gain, &mut riccati, 1, set, &|| true).expect_err("a cancelled call");
    assert_eq!(error, DynamicsError::Cancelled);
}
