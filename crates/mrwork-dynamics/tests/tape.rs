//! Random tapes have the bits of one number in every lane and on every instruction set, and a damaged one is refused or harmless.

use mrwork_dynamics::dispatch::{InstructionSet, LaneJob};
use mrwork_dynamics::lanes::Lanes;
use mrwork_dynamics::real::{Bits, Real};
use mrwork_dynamics::tape::{Entry, MOST_OPERATIONS, MOST_SLOTS, Operation, Tape, Walk};
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};

/// Runs that reach every width of pack: one number, then 8, 16, 32 and 48 lanes.
const RUNS: [usize; 5] = [1, 8, 16, 32, 48];

fn config(cases: u32) -> Config {
    Config { failure_persistence: None, ..Config::with_cases(cases) }
}

/// A walk for the inputs of some runs, shape (runs, inputs); the ends, shape (runs, ends).
struct Walked<'a> {
    tape: &'a Tape,
    inputs: &'a [f64],
}

impl LaneJob for Walked<'_> {
    type Home = Self;
    type Output = Vec<f64>;
    #[inline(always)]
    fn run<R: Lanes + Bits>(self) -> Vec<f64> {
        let Self { tape, inputs } = self;
        let n_runs = inputs.len() / tape.n_inputs;
        let mut ends = vec![0.0; n_runs * tape.ends.len()];
        for first in (0..n_runs).step_by(R::WIDTH) {
            let mut slots = tape.slots::<R>();
            for place in 0..tape.n_inputs {
                slots[place] =
                    R::from_fn(|lane| inputs[(first + lane).min(n_runs - 1) * tape.n_inputs + place]);
            }
            R::out_of_line(Walk { tape, slots: &mut slots });
            for (place, &end) in tape.ends.iter().enumerate() {
                slots[usize::from(end)].for_each(|lane, value| {
                    if first + lane < n_runs {
                        ends[(first + lane) * tape.ends.len() + place] = value;
                    }
                });
            }
        }
        ends
    }
}

/// Same bits, where any NaN is as good as another.
fn same(left: f64, right: f64) -> bool {
    left.to_bits() == right.to_bits() || (left.is_nan() && right.is_nan())
}

fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        6 => -4.0..4.0_f64,
        2 => prop::num::f64::ANY,
        1 => prop::sample::select(vec![0.0, -0.0, 1.0, f64::INFINITY, f64::NEG_INFINITY, f64::NAN, 1e-310]),
    ]
}

/// A sound tape: each operand is the slot of an input, a constant or an earlier result, and slots are taken again.
fn sound() -> impl Strategy<Value = Tape> {
    let entry = (0..Operation::ALL.len(), any::<[u16; 3]>(), any::<u16>());
    let entries = prop::collection::vec(entry, 1..60);
    let constants = prop::collection::vec(number(), 0..6);
    let table = prop::collection::vec(number(), 1..6);
    (1..6_usize, constants, table, entries, any::<[u16; 3]>()).prop_map(
        |(n_inputs, constants, table, drawn, ends)| {
            let first = n_inputs + constants.len();
            let mut written = first;
            let entries = drawn
                .into_iter()
                .map(|(operation, of, to)| {
                    let operation = Operation::ALL[operation];
                    let mut of = of.map(|place| place % u16::try_from(written).unwrap_or(1));
                    if operation.name().contains("number") {
                        of[1] %= u16::try_from(table.len()).unwrap_or(1);
                    }
                    // A new slot, or one of an earlier result.
                    let to = first + usize::from(to) % (written - first + 1);
                    written = written.max(to + 1);
                    Entry { operation, to: u16::try_from(to).unwrap_or(0), of }
                })
                .collect();
            let ends = ends.iter().map(|&end| end % u16::try_from(written).unwrap_or(1)).collect();
            Tape { entries, constants, table, ends, n_inputs, n_slots: written }
        },
    )
}

proptest! {
    #![proptest_config(config(300))]
    #[test]
    fn a_tape_has_the_bits_of_one_number_in_every_lane(
        tape in sound(),
        drawn in prop::collection::vec(number(), 5 * 50),
    ) {
        prop_assert!(tape.is_sound());
        let inputs = &drawn[..50 * tape.n_inputs];
        let alone: Vec<f64> = inputs
            .chunks_exact(tape.n_inputs)
            .flat_map(|row| {
                let mut slots = tape.slots::<f64>();
                slots[..tape.n_inputs].copy_from_slice(row);
                f64::out_of_line(Walk { tape: &tape, slots: &mut slots });
                tape.ends.iter().map(|&end| slots[usize::from(end)]).collect::<Vec<_>>()
            })
            .collect();
        for set in InstructionSet::usable() {
            for runs in RUNS {
                let found = set.run(runs, Walked { tape: &tape, inputs });
                prop_assert!(found.iter().zip(&alone).all(|(&found, &alone)| same(found, alone)), "{}", set.name());
            }
        }
    }
}

/// What is done to a tape: one of its numbers is another one.
fn damage(tape: &mut Tape, what: usize, place: usize, other: u16) {
    let number = place % tape.entries.len();
    let entry = &mut tape.entries[number];
    match what {
        0 => entry.to = other,
        1..=3 => entry.of[what - 1] = other,
        4 => entry.operation = Operation::ALL[usize::from(other) % Operation::ALL.len()],
        5 => tape.n_inputs = usize::from(other),
        6 => tape.n_slots = usize::from(other),
        7 => tape.ends[place % 3] = other,
        8 => drop(tape.entries.remove(number)),
        9 => tape.entries.swap(number, usize::from(other) % (number + 1)),
        10 => tape.constants.truncate(place % 6),
        11 => tape.table.truncate(place % 3),
        12 => tape.n_inputs = usize::MAX - usize::from(other),
        _ => {
            let copied = tape.entries[number];
            tape.entries.extend(std::iter::repeat_n(copied, usize::from(other)));
        }
    }
}

/// Whether it reads a slot or number that is not there, or writes an input, a constant or beyond its slots: by following
/// what is known of each slot.
fn is_wrong(tape: &Tape) -> bool {
    let Some(first) = tape.n_inputs.checked_add(tape.constants.len()) else { return true };
    if first > tape.n_slots || tape.n_slots > MOST_SLOTS || tape.entries.len() > MOST_OPERATIONS {
        return true;
    }
    let mut known: Vec<usize> = (0..first).collect();
    for Entry { operation, to, of } in &tape.entries {
        for (place, &operand) in of.iter().enumerate().take(operation.arity()) {
            let is_number = place == 1 && operation.name().contains("number");
            if is_number && usize::from(operand) >= tape.table.len() {
                return true;
            }
            if !is_number && !known.contains(&usize::from(operand)) {
                return true;
            }
        }
        if usize::from(*to) < first || usize::from(*to) >= tape.n_slots {
            return true;
        }
        known.push(usize::from(*to));
    }
    tape.ends.iter().any(|&end| !known.contains(&usize::from(end)))
}

/// What makes any tape unsound, by its number.
fn break_it(tape: &mut Tape, what: usize, place: usize, other: u16) {
    let first = tape.n_inputs + tape.constants.len();
    let beyond = u16::try_from(tape.n_slots).unwrap_or(u16::MAX).saturating_add(other % 1_000);
    let number = place % tape.entries.len();
    let entry = &mut tape.entries[number];
    match what {
        // Over an input or a constant.
        0 => entry.to = u16::try_from(usize::from(other) % first).unwrap_or(0),
        1 => entry.to = beyond,
        2 => (entry.operation, entry.of[0]) = (Operation::Negative, beyond),
        3 => (entry.operation, entry.of[2]) = (Operation::Fused, beyond),
        // A slot that is there and was never written.
        4 => {
            (entry.operation, entry.of[0]) = (Operation::Root, beyond);
            tape.n_slots = usize::from(beyond) + 1;
        }
        5 => {
            let past = u16::try_from(tape.table.len()).unwrap_or(u16::MAX).saturating_add(other % 1_000);
            (entry.operation, entry.of[1]) = (Operation::Scaled, past);
        }
        6 => tape.ends[place % 3] = beyond,
        7 => tape.n_slots = first - 1,
        8 => tape.n_inputs = usize::MAX - usize::from(other),
        9 => tape.n_slots = MOST_SLOTS + 1 + usize::from(other),
        10 => {
            let copied = *entry;
            tape.entries.extend(std::iter::repeat_n(copied, MOST_OPERATIONS));
        }
        _ => tape.table = vec![0.0; MOST_OPERATIONS + 1 + usize::from(other)],
    }
}

#[test]
fn every_tape_that_leaves_its_slots_is_refused() {
    let (cases, refused) = (1_000, std::cell::Cell::new(0));
    let damages = (sound(), 0..12_usize, any::<usize>(), any::<u16>());
    let outcome = TestRunner::new(config(cases)).run(&damages, |(mut tape, what, place, other)| {
        prop_assert!(tape.is_sound());
        break_it(&mut tape, what, place, other);
        prop_assert!(!tape.is_sound(), "damage {}", what);
        refused.set(refused.get() + 1);
        Ok(())
    });
    assert!(outcome.is_ok(), "{outcome:?}");
    assert_eq!(refused.get(), cases);
}

#[test]
fn a_damaged_tape_is_refused_or_does_arithmetic_on_its_own_slots() {
    let cases = 1_000;
    let mut runner = TestRunner::new(config(cases));
    let damages = (sound(), 0..14_usize, any::<usize>(), prop_oneof![0..70_u16, any::<u16>()]);
    let refusals = std::cell::Cell::new(0);
    let outcome = runner.run(&damages, |(mut tape, what, place, other)| {
        damage(&mut tape, what, place, other);
        prop_assert_eq!(tape.is_sound(), !is_wrong(&tape));
        if tape.is_sound() {
            // Nothing panics, and inputs and constants are as they were.
            let first = tape.n_inputs + tape.constants.len();
            let mut slots = tape.slots::<f64>();
            slots[..tape.n_inputs].fill(0.5);
            let before = slots[..first].to_vec();
            f64::out_of_line(Walk { tape: &tape, slots: &mut slots });
            prop_assert!(slots[..first].iter().zip(&before).all(|(&now, &before)| same(now, before)));
        } else {
            refusals.set(refusals.get() + 1);
        }
        Ok(())
    });
    let refused = refusals.get();
    assert!(outcome.is_ok(), "{outcome:?}");
    assert!(refused > cases / 3, "{refused} of {cases} were refused");
}
