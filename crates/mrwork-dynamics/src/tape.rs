//! A formula of a user as a list of operations on slots, walked over any number.
//!
//! A tape is data: one that [`Tape::is_sound`] does arithmetic on its own slots and nothing else, whatever it was read from.
//! Every operation is one of [`Real`] or of [`crate::elementary`], so a walk has the same bits in every lane and on every
//! instruction set, and its terms print as C.

use crate::elementary::{Exponent, exp, ln, powf, tanh};
use crate::real::{OutOfLine, Real, if_known};

/// Most operations of a tape.
pub const MOST_OPERATIONS: usize = 20_000;
/// Most slots of a tape: a block of lanes holds up to 512 B of each.
pub const MOST_SLOTS: usize = 2_000;

/// What an operand of an operation is the number of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Operand {
    /// A slot.
    Slot,
    /// A number of the table, the same for all lanes.
    Number,
}

use Operand::{Number, Slot};

macro_rules! operations {
    ($($(#[$doc:meta])* $name:ident $word:literal [$($operand:ident),+];)+) => {
        /// What an entry of a tape does with its operands.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Operation {
            $($(#[$doc])* $name,)+
        }

        impl Operation {
            /// Every operation.
            pub const ALL: &[Self] = &[$(Self::$name,)+];

            /// Its name on tapes.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$name => $word,)+
                }
            }

            const fn operands(self) -> &'static [Operand] {
                match self {
                    $(Self::$name => &[$($operand,)+],)+
                }
            }
        }
    };
}

operations! {
    /// a + b.
    Sum "add" [Slot, Slot];
    /// a - b.
    Difference "subtract" [Slot, Slot];
    /// a b.
    Product "multiply" [Slot, Slot];
    /// a / b.
    Quotient "divide" [Slot, Slot];
    /// -a.
    Negative "negative" [Slot];
    /// |a|.
    Magnitude "absolute" [Slot];
    /// Square root of a.
    Root "sqrt" [Slot];
    /// |a| with the sign of b.
    CopySign "copysign" [Slot, Slot];
    /// The smaller one; b where either is not a number.
    Smaller "minimum" [Slot, Slot];
    /// The larger one; b where either is not a number.
    Larger "maximum" [Slot, Slot];
    /// Nearest whole number, ties to even.
    Rounded "rint" [Slot];
    /// 1 where a < b, else 0.
    Less "less" [Slot, Slot];
    /// 1 where a = b, else 0.
    Equal "equal" [Slot, Slot];
    /// b where a is above zero, else c.
    Choice "where" [Slot, Slot, Slot];
    /// e^a.
    Exponential "exp" [Slot];
    /// ln a.
    Logarithm "log" [Slot];
    /// a^b; not a number where a is below zero, and a subnormal a counts as zero.
    Power "power" [Slot, Slot];
    /// Hyperbolic tangent of a.
    Tangent "tanh" [Slot];
    /// a b + c, rounded once.
    Fused "multiply_add" [Slot, Slot, Slot];
    /// a and a number of the table.
    Shifted "add_number" [Slot, Number];
    /// a times a number of the table.
    Scaled "multiply_number" [Slot, Number];
    /// a times a number of the table, and c, rounded once.
    FusedScaled "multiply_number_add" [Slot, Number, Slot];
}

impl Operation {
    /// Number of operands.
    #[must_use]
    pub const fn arity(self) -> usize {
        self.operands().len()
    }
}

/// An operation, the slot of its result, and the numbers of its operands; those beyond its arity are not looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry {
    /// What is done.
    pub operation: Operation,
    /// Slot of the result.
    pub to: u16,
    /// Slots of the operands, or places in the table.
    pub of: [u16; 3],
}

/// A formula: inputs stand in the first slots, constants follow them, and neither is written.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tape {
    /// Operations in order.
    pub entries: Vec<Entry>,
    /// Constants, each with a slot.
    pub constants: Vec<f64>,
    /// Factors and addends without a slot.
    pub table: Vec<f64>,
    /// Slots of the results.
    pub ends: Vec<u16>,
    /// Number of inputs.
    pub n_inputs: usize,
    /// Number of slots.
    pub n_slots: usize,
}

impl Entry {
    /// Slots that it reads.
    #[must_use]
    pub fn slots(&self) -> Vec<u16> {
        let operands = self.operation.operands().iter().zip(self.of);
        operands.filter(|(operand, _)| **operand == Slot).map(|(_, place)| place).collect()
    }
}

impl Tape {
    /// Whether it has a size that can be walked, and writes every slot before it reads it.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        let first = self.n_inputs.saturating_add(self.constants.len());
        if first > self.n_slots
            || self.n_slots > MOST_SLOTS
            || self.entries.len() > MOST_OPERATIONS
            || self.table.len() > MOST_OPERATIONS
        {
            return false;
        }
        let mut written = vec![false; self.n_slots];
        written[..first].fill(true);
        for entry in &self.entries {
            let reads = |(&operand, &place): (&Operand, &u16)| match operand {
                Slot => written.get(usize::from(place)) == Some(&true),
                Number => usize::from(place) < self.table.len(),
            };
            let to = usize::from(entry.to);
            if !entry.operation.operands().iter().zip(&entry.of).all(reads)
                || to < first
                || to >= self.n_slots
            {
                return false;
            }
            written[to] = true;
        }
        self.ends.iter().all(|&end| written.get(usize::from(end)) == Some(&true))
    }

    /// Slots before the first walk: inputs are zero.
    #[must_use]
    pub fn slots<R: Real>(&self) -> Vec<R> {
        let mut slots = vec![R::splat(0.0); self.n_slots];
        for (slot, &constant) in slots[self.n_inputs..].iter_mut().zip(&self.constants) {
            *slot = R::splat(constant);
        }
        slots
    }
}

/// A walk of a sound tape over its slots, compiled once for each number.
pub struct Walk<'a, R> {
    /// The tape.
    pub tape: &'a Tape,
    /// Its slots, with its inputs in the first ones.
    pub slots: &'a mut [R],
}

/// Writes an expression of operands piece by piece, so that wide packs stay in registers.
macro_rules! each_piece {
    ($slots:ident[$to:expr] = |$($operand:ident of $place:ident),+| $value:expr) => {{
        let mut number = 0;
        while number < R::PIECES {
            $(let $operand = $slots[$place].piece(number);)+
            let value = $value;
            $slots[$to].set_piece(number, value);
            number += 1;
        }
    }};
}

impl<R: Real> OutOfLine for Walk<'_, R> {
    type Home = Self;
    #[inline(always)]
    fn run(self) {
        let Self { tape, slots } = self;
        let r = &mut slots[..tape.n_slots];
        let table = &tape.table[..];
        let (one, zero) = (<R::Piece as Real>::splat(1.0), <R::Piece as Real>::splat(0.0));
        for entry in &tape.entries {
            // Written out: what an array maps is compiled apart from the vectors.
            let (a, b, c) = (usize::from(entry.of[0]), usize::from(entry.of[1]), usize::from(entry.of[2]));
            let to = usize::from(entry.to);
            match entry.operation {
                Operation::Sum => each_piece!(r[to] = |x of a, y of b| x + y),
                Operation::Difference => each_piece!(r[to] = |x of a, y of b| x - y),
                Operation::Product => each_piece!(r[to] = |x of a, y of b| x * y),
                Operation::Quotient => each_piece!(r[to] = |x of a, y of b| x / y),
                Operation::Negative => each_piece!(r[to] = |x of a| -x),
                Operation::Magnitude => each_piece!(r[to] = |x of a| x.abs()),
                Operation::Root => each_piece!(r[to] = |x of a| x.sqrt()),
                Operation::CopySign => each_piece!(r[to] = |x of a, y of b| x.copysign(y)),
                Operation::Smaller => each_piece!(r[to] = |x of a, y of b| x.min(y)),
                Operation::Larger => each_piece!(r[to] = |x of a, y of b| x.max(y)),
                Operation::Rounded => each_piece!(r[to] = |x of a| x.round_ties_even()),
                Operation::Less => each_piece!(r[to] = |x of a, y of b| Real::select(x.less(y), one, zero)),
                Operation::Equal => each_piece!(r[to] = |x of a, y of b| Real::select(x.equal(y), one, zero)),
                Operation::Choice => {
                    each_piece!(r[to] = |x of a, y of b, z of c| Real::select(zero.less(x), y, z));
                }
                Operation::Fused => each_piece!(r[to] = |x of a, y of b, z of c| x.mul_add(y, z)),
                Operation::Shifted => {
                    let number = <R::Piece as Real>::splat(table[b]);
                    each_piece!(r[to] = |x of a| x + number);
                }
                Operation::Scaled => {
                    let number = <R::Piece as Real>::splat(table[b]);
                    each_piece!(r[to] = |x of a| x * number);
                }
                Operation::FusedScaled => {
                    let number = <R::Piece as Real>::splat(table[b]);
                    each_piece!(r[to] = |x of a, z of c| x.mul_add(number, z));
                }
                Operation::Exponential | Operation::Logarithm | Operation::Power | Operation::Tangent => {
                    R::out_of_line(Call { entry, slots: r });
                }
            }
        }
    }
}

/// An elementary function on a tape, out of the walk so that its registers are its own.
struct Call<'a, R> {
    entry: &'a Entry,
    slots: &'a mut [R],
}

impl<R: Real> OutOfLine for Call<'_, R> {
    type Home = Self;
    #[inline(always)]
    fn run(self) {
        let Self { entry, slots } = self;
        let x = slots[usize::from(entry.of[0])];
        slots[usize::from(entry.to)] = match entry.operation {
            Operation::Exponential => exp(x),
            Operation::Logarithm => ln(x),
            Operation::Power => power(x, slots[usize::from(entry.of[1])]),
            _ => tanh(x),
        };
    }
}

/// x^n for any numbers: [`powf`] asks for a magnitude and for an exponent whose product with a logarithm is a number.
#[inline(always)]
fn power<R: Real>(x: R, n: R) -> R {
    const STEEPEST: f64 = 1_073_741_824.0;
    let (zero, one, infinite) = (R::splat(0.0), R::splat(1.0), R::splat(f64::INFINITY));
    let (smallest, largest) = (R::splat(f64::MIN_POSITIVE), R::splat(f64::MAX));
    let base = x.max(smallest).min(largest);
    let exponent = n.max(R::splat(-STEEPEST)).min(R::splat(STEEPEST));
    let found = powf(base, &Exponent::of(exponent));
    let of_zero = R::select(zero.less(n), zero, R::select(n.less(zero), infinite, one));
    let of_infinity = R::select(zero.less(n), infinite, R::select(n.less(zero), zero, one));
    let found = R::select(x.less(smallest), of_zero, found);
    let found = R::select(largest.less(x), of_infinity, found);
    let found = R::select(x.less(zero), R::splat(f64::NAN), found);
    if_known(x, if_known(n, found))
}
