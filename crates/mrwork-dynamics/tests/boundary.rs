//! Calls with arguments of any size and any number return a result or an error: no panic, no memory by a size that was not
//! checked. `PROPTEST_CASES` sets how many are tried of each.

#![allow(clippy::expect_used)] // of what the tests themselves make

use mrwork_dynamics::any_damper::Damper;
use mrwork_dynamics::building::{Building, Element, Matrices, Springs};
use mrwork_dynamics::closed_loop::{
    Batch, Channel, Directions, Fault, Hardware, RUN_QUANTITIES, Run, Sensor, Shaping, respond,
    respond_with_slopes, width,
};
use mrwork_dynamics::control::{Law, LoopSizes};
use mrwork_dynamics::coupled::{Group, Mounting};
use mrwork_dynamics::current_law::{CurrentLaw, CurrentLaws};
use mrwork_dynamics::damper::{REGISTRY, find_device};
use mrwork_dynamics::dispatch::InstructionSet;
use mrwork_dynamics::error::Outcome;
use mrwork_dynamics::ground_motion::GroundMotion;
use mrwork_dynamics::lag::Lag;
use mrwork_dynamics::loading::LoadingHistory;
use mrwork_dynamics::matrix_equations::{Equations, Stack, Status, Time, solve};
use mrwork_dynamics::misfit::Target;
use mrwork_dynamics::sensitivity::sensitivities;
use mrwork_dynamics::settings::Settings;
use mrwork_dynamics::simulate::{force_histories, misfits};
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;

/// Numbers that calculations come across, and those that they should not.
fn number() -> impl Strategy<Value = f64> {
    let odd = [
        0.0,
        -0.0,
        1.0,
        -1.0,
        5e-324,
        2.2e-308,
        1e-300,
        1e300,
        f64::MAX,
        f64::MIN,
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
    ];
    prop_oneof![4 => -10.0..10.0, 1 => select(odd.to_vec())]
}

fn plain() -> impl Strategy<Value = f64> {
    prop_oneof![20 => -1.0..1.0, 1 => select(vec![0.0, 1e300, -1e300, 5e-324, f64::NAN])]
}

/// Entries of which few are not zero.
fn odd(n: usize) -> impl Strategy<Value = Vec<f64>> {
    vec(prop_oneof![12 => Just(0.0), 3 => -1.0..1.0, 1 => number()], n)
}

/// Counts about `n`, and those whose products overflow.
fn count(n: usize) -> impl Strategy<Value = usize> {
    let wrong = [0, 1, n + 1, 2 * n, 1 << 31, 1 << 32, 1 << 61, 1 << 63, usize::MAX];
    prop_oneof![8 => Just(n), 1 => select(wrong.to_vec())]
}

/// Lengths of arrays about `n`.
fn length(n: usize) -> impl Strategy<Value = usize> {
    prop_oneof![12 => Just(n), 1 => select(vec![0, 1, n.saturating_sub(1), n + 1, 2 * n])]
}

fn numbers(n: usize) -> impl Strategy<Value = Vec<f64>> {
    length(n).prop_flat_map(|n| vec(plain(), n))
}

fn set() -> impl Strategy<Value = InstructionSet> {
    select(InstructionSet::usable().collect::<Vec<_>>())
}

fn settings(step_factor: u32, threads: usize, instruction_set: InstructionSet) -> Settings<'static> {
    Settings { step_factor, threads, instruction_set, stop: &|| false }
}

fn nominal(damper: &dyn Damper) -> Vec<f64> {
    damper.spec().parameters.iter().map(|parameter| parameter.nominal).collect()
}

fn law() -> impl Strategy<Value = CurrentLaw> {
    let by_values = [
        "log_quadratic:-0.5,0.1,1",
        "linear:0,2",
        "straight:0,0.2,1",
        "straight_log:0,0.2,1",
        "monotone:-0.5,0.1,1",
        "exponential:0.2,1",
        "tanh:-0.5,1",
    ]
    .map(|name| CurrentLaw::of_name(name).expect("a law"));
    let others = [CurrentLaw::NAMED.to_vec(), by_values.to_vec()].concat();
    prop_oneof![6 => Just(CurrentLaw::Constant), 1 => select(others)]
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_loading_history_is_made_or_refused(
        dt in number(),
        displacement in vec(number(), 0..12),
        velocity in proptest::option::of(vec(number(), 0..12)),
        command in vec(number(), 0..12),
        substeps in 1_u32..5,
    ) {
        if let Ok(loading) = LoadingHistory::new(dt, &displacement, velocity.as_deref()) {
            prop_assert_eq!(loading.n_time(), displacement.len());
            let stages = loading.stages(substeps);
            prop_assert_eq!(stages.len(), (displacement.len() - 1) * (2 * substeps as usize + 1));
            let _ = loading.with_command(&command);
        }
        let _ = GroundMotion::new(dt, &displacement);
    }

    #[test]
    fn a_batch_of_dampers_is_simulated_or_refused(
        (model, laws, theta) in (0..REGISTRY.len()).prop_flat_map(|model| {
            let n = REGISTRY[model].spec().parameters.len();
            (Just(model), length(n).prop_flat_map(|n| vec(law(), n)), 0..6_usize)
        }).prop_flat_map(|(model, laws, rows)| {
            let n = laws.iter().map(CurrentLaw::n_coefficients).sum::<usize>() * rows;
            (Just(model), Just(laws), length(n).prop_flat_map(|n| vec(number(), n)))
        }),
        factors in vec(prop_oneof![10 => Just(1.0), 1 => number()], 200),
        (lag, commanded, step_factor, threads, set) in
            (select(vec![Lag::None, Lag::OneRate, Lag::TwoRates]), any::<bool>(), select(vec![0, 1, 1, 1, 2, 3, u32::MAX]), count(1), set()),
        force in numbers(12),
        (first, limits) in (count(0), proptest::option::of(numbers(3))),
        (n_force, asked) in (length(24), vec(count(0), 0..4)),
    ) {
        let damper = REGISTRY[model];
        let Ok(laws) = CurrentLaws::new(damper.spec(), laws, lag) else { return Ok(()) };
        // Candidates about the nominal one, most of which run.
        let nominal = nominal(damper);
        let theta: Vec<f64> = (0..theta.len())
            .map(|i| if i % 3 == 0 { theta[i] } else { nominal[i % nominal.len()] * factors[i % factors.len()] })
            .collect();
        let displacement: Vec<f64> = (0..12).map(|i| 0.01 * f64::from(i).sin()).collect();
        let mut loading = LoadingHistory::new(1e-3, &displacement, None).expect("a history");
        if commanded {
            loading = loading.with_command(&displacement).expect("a command");
        }
        let settings = settings(step_factor, threads, set);
        let target = Target { force: &force, first };
        if let Ok(rows) = misfits(damper, &laws, &theta, &loading, target, limits.as_deref(), settings) {
            prop_assert_eq!(rows.len() * laws.n_columns(), theta.len());
            for row in rows {
                prop_assert!(!row.squared_error.is_nan());
                prop_assert_eq!(row.squared_error.is_finite(), row.outcome == Outcome::Finished);
            }
        }
        let mut histories = vec![0.0; n_force];
        if force_histories(damper, &laws, &theta, &loading, &mut histories, settings).is_ok() {
            prop_assert!(!histories.iter().any(|force| force.is_nan()));
        }
        let mut jacobian = vec![0.0; n_force * asked.len()];
        let _ = sensitivities(damper, &laws, &theta, &asked, &loading, &mut histories, &mut jacobian, settings);
    }

    #[test]
    fn matrix_equations_are_solved_or_refused(
        (n, m, rows) in (0..5_usize, 0..3_usize, 0..4_usize),
        counts in (count(4), count(2), count(3), any::<u8>()),
        (a, b, q, r) in (numbers(64), numbers(48), numbers(64), numbers(27)),
        (each, cut) in (count(0), any::<bool>()),
        (discrete, threads, set) in (any::<bool>(), count(1), set()),
    ) {
        // One of the counts may be any.
        let (n_states, n_controls, n_batch) = match counts.3 % 12 {
            0 => (counts.0, m, rows),
            1 => (n, counts.1, rows),
            2 => (n, m, counts.2),
            _ => (n, m, rows),
        };
        let part = |entries: &[f64], wanted: usize| -> Vec<f64> {
            if cut { entries.to_vec() } else { entries.iter().copied().cycle().take(if entries.is_empty() { 0 } else { wanted }).collect() }
        };
        let (state, control) = (part(&a, rows * n * n), part(&b, rows * n * m));
        let (weight, effort) = (part(&q, rows * n * n), part(&r, rows * m * m));
        let size = |product: usize| if cut && each != 0 { each } else { product };
        let equations = Equations {
            n_batch,
            n_states,
            n_controls,
            time: if discrete { Time::Discrete } else { Time::Continuous },
            state: Stack::new(&state, size(n_states.wrapping_mul(n_states))),
            control: Stack::new(&control, size(n_states.wrapping_mul(n_controls))),
            state_weight: Stack::new(&weight, size(n_states.wrapping_mul(n_states))),
            control_weight: Stack::new(&effort, size(n_controls.wrapping_mul(n_controls))),
            cross_weight: None,
            scaling: None,
        };
        let (mut gain, mut riccati) = (vec![0.0; rows * n * m], vec![0.0; rows * n * n]);
        if let Ok(solutions) = solve(&equations, &mut gain, &mut riccati, threads, set, &|| false) {
            prop_assert_eq!(solutions.len(), n_batch);
            prop_assert!(!gain.iter().chain(&riccati).any(|value| value.is_nan()));
            let solved = solutions.iter().all(|solution| solution.status == Status::Solved);
            prop_assert!(!solved || riccati.iter().all(|value| value.is_finite()));
        }
    }

    #[test]
    fn a_building_in_closed_loop_is_simulated_or_refused(
        (n, n_devices) in (1..4_usize, 0..3_usize),
        (mass, damping, stiffness) in (odd(9), odd(9), odd(9)),
        (influence, floors, devices) in (odd(3), odd(9), odd(6)),
        (elements, numbers) in (odd(6), vec(prop_oneof![6 => 1.0..9.0, 1 => number()], 0..13)),
        law in select(Law::ALL.to_vec()),
        (ranges, mountings) in (vec([number(), number()], 0..3), vec((number(), any::<bool>()), 0..3)),
        (gains, tables) in (vec(plain(), 0..200), vec(vec(number(), 0..20), 0..3)),
        (sample_time, steps, delay_steps, rate) in
            (prop_oneof![6 => Just(0.01), 1 => 0.001..1.0, 1 => select(vec![0.0, -1.0, f64::NAN, f64::INFINITY])], count(1), count(0), number()),
        sensors in vec([number(), number()], 4),
        fault in proptest::option::of((select(vec![Channel::Acceleration(0), Channel::Command(0), Channel::Force(usize::MAX), Channel::GroundAcceleration]), count(0), count(2), proptest::option::of(number()))),
        shaping in vec((number(), number()), 0..3),
        (factors, later, runs) in (vec(number(), 0..3), prop_oneof![6 => 0..4_u32, 1 => any::<u32>()], vec((0..2_u32, 0..2_u32, 0..2_u32), 0..5)),
        (fit, right, set) in (any::<bool>(), 0..8_u8, set()),
    ) {
        let square = |entries: &[f64], own: f64| -> Vec<f64> {
            (0..n * n).map(|i| if i % (n + 1) == 0 { own } else { 0.0 } + entries.get(i).copied().unwrap_or(0.0)).collect()
        };
        let rows = |entries: &[f64], count: usize| -> Vec<f64> {
            (0..n * count).map(|i| entries.get(i).copied().unwrap_or(1.0)).collect()
        };
        let (mass, damping, stiffness) = (square(&mass, 5.0), square(&damping, 1.0), square(&stiffness, 100.0));
        let (influence, floors, devices) = (rows(&influence, 1), rows(&floors, n), rows(&devices, n_devices));
        let (numbers, _) = numbers.as_chunks::<6>();
        let element_parameters: Vec<Element> = numbers
            .iter()
            .map(|&[stiffness, damping, head_loss, yield_force, slope, sharpness]| {
                Element { stiffness, damping, head_loss, yield_force, slope, sharpness, in_frame: slope > 1.0 }
            })
            .collect();
        let elements = rows(&elements, element_parameters.len());
        let sprung = vec![0.0; devices.len()];
        let matrices = Matrices {
            elements: &elements,
            element_parameters: &element_parameters,
            mass: &mass,
            damping: &damping,
            stiffness: &stiffness,
            influence: &influence,
            floors: &floors,
            storeys: &floors,
            unit_drifts: &floors,
            heights: &influence,
            storey_springs: &influence,
            devices: &devices,
            sprung: &sprung,
        };
        let Ok(building) = Building::new(&matrices) else { return Ok(()) };
        let scaled = |matrix: &[f64], factor: f64| -> Vec<f64> { matrix.iter().map(|entry| factor * entry).collect() };
        let springs: Vec<Springs> = factors
            .iter()
            .filter_map(|&factor| {
                building.with_springs(&scaled(&damping, factor), &scaled(&stiffness, factor)).ok()
            })
            .collect();
        let damper = find_device("static_hysteretic").expect("a registered model");
        let laws = CurrentLaws::constant(damper.spec());
        let theta: Vec<f64> = (0..2 * n_devices).flat_map(|_| nominal(damper)).collect();
        let mut mountings: Vec<Mounting> =
            mountings.into_iter().map(|(count, differential)| Mounting { count, differential }).collect();
        let (mut ranges, mut gains) = (ranges, gains);
        if fit {
            mountings.resize(n_devices, Mounting { count: 1.0, differential: false });
            ranges.resize(n_devices, [0.0, 1.0]);
            ranges.iter_mut().filter(|[from, to]| from > to || from.is_nan() || to.is_nan()).for_each(|range| *range = [0.0, 1.0]);
            gains.resize(2 * law.spec().n_gains(LoopSizes { n_devices, n_states: 2 * n }), 0.5);
        }
        let motion = GroundMotion::new(0.01, &[0.0, 1.0, -1.0, 0.5]).expect("a motion");
        let [acceleration, deformation, force, ground_acceleration] =
            [0, 1, 2, 3].map(|i| Sensor { noise: sensors[i][0], resolution: sensors[i][1] });
        let faults = fault
            .into_iter()
            .map(|(channel, start, end, value)| Fault { channel, start, end, value })
            .collect();
        let steps = if right > 0 { 1 } else { u32::try_from(steps).unwrap_or(u32::MAX) };
        let hardware = Hardware { sample_time, steps, delay_steps, command_rate: rate, ground_preview: if fit { 0.02 } else { sensors[0][0] }, acceleration, deformation, measured_storeys: vec![0], drift: force, force, ground_acceleration, faults };
        let runs: Vec<Run> = runs
            .into_iter()
            .map(|(candidate, motion, draw)| Run {
                candidate,
                motion: motion * u32::from(right == 1),
                draw,
                springs: motion,
                delay_steps: draw.saturating_mul(later),
                stream: 3,
            })
            .collect();
        let shaping: Vec<Shaping> =
            shaping.into_iter().map(|(dead_zone, slope)| Shaping { dead_zone, slope }).collect();
        let batch = Batch {
            building: &building,
            springs: &springs,
            dampers: &[Group { damper, laws: &laws, theta: &theta, mountings: &mountings }],
            ranges: &ranges,
            n_commanded: ranges.len(),
            law,
            own: None,
            outside: None,
            gains: &gains,
            tables: &tables,
            shaping: &shaping,
            curve: None,
            model: None,
            motions: &[motion],
            runs: &runs,
            hardware: &hardware,
            observer: None,
        };
        let mut summary = vec![0.0; runs.len() * width(RUN_QUANTITIES, &building)];
        if let Ok(results) = respond(&batch, &mut summary, None, settings(1, 1, set)) {
            prop_assert_eq!(results.len(), runs.len());
            prop_assert!(!summary.iter().any(|value| value.is_nan()));
        }
        let count = usize::from(right);
        let changes: Vec<f64> = gains.iter().cycle().take(count * gains.len()).copied().collect();
        let mut slopes = vec![0.0; count * summary.len()];
        let directions = Directions { count, changes: &changes };
        let settings = settings(1, 1, set);
        let results = respond_with_slopes(&batch, directions, &mut summary, &mut slopes, settings);
        if law.spec().switches {
            prop_assert!(results.is_err());
        }
    }
}
