//! Entries as statements of C99.

use std::fmt::Write;

use super::term::{Kind, Node, TAPE, Tape, Term};
use crate::elementary::{Elementary, Exponent, exp, ln, tanh};

/// Numbers of the printed text.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Precision {
    /// `double`, with the bits of the lanes.
    Double,
    /// `float`.
    Single,
}

/// Longest expression that stands within another.
const LONGEST: usize = 70;

impl Precision {
    pub(super) fn word(self) -> &'static str {
        match self {
            Self::Double => "double",
            Self::Single => "float",
        }
    }

    /// A function of `math.h`.
    fn function(self, name: &str, of: &str) -> String {
        match self {
            Self::Double => format!("{name}({of})"),
            Self::Single => format!("{name}f({of})"),
        }
    }

    /// A number that the compiler reads back to the bit.
    fn number(self, value: f64) -> String {
        let (largest, smallest) = match self {
            Self::Double => (f64::MAX, 0.0),
            Self::Single => (f64::from(f32::MAX), f64::from(f32::MIN_POSITIVE)),
        };
        let size = value.abs();
        let text = if value.is_nan() {
            return format!("({})NAN", self.word());
        } else if size > largest {
            format!("({})INFINITY", self.word())
        } else {
            let size = if size < smallest { 0.0 } else { size };
            let suffix = if self == Self::Single { "f" } else { "" };
            format!("{size:?}{suffix}")
        };
        if value.is_sign_negative() { format!("(-{text})") } else { text }
    }
}

impl Kind {
    fn arity(self) -> usize {
        match self {
            Self::Constant | Self::Input | Self::Truth => 0,
            Self::Add
            | Self::Sub
            | Self::Mul
            | Self::Div
            | Self::CopySign
            | Self::Min
            | Self::Max
            | Self::Less
            | Self::Equal
            | Self::Pow
            | Self::TimesTwo => 2,
            Self::Fma | Self::BySign | Self::Select => 3,
            _ => 1,
        }
    }
}

/// How often each entry is used on the way to `ends`.
fn uses(tape: &Tape, ends: &[(String, usize)]) -> Vec<u32> {
    let mut uses = vec![0; tape.nodes.len()];
    for (_, place) in ends {
        uses[*place] += 1;
    }
    for place in (0..tape.nodes.len()).rev() {
        if uses[place] > 0 {
            let Node { kind, of, .. } = tape.nodes[place];
            for &of in &of[..kind.arity()] {
                uses[of] += 1;
            }
        }
    }
    uses
}

/// Whether an entry is on the way to some of the ends.
pub(super) fn leads_to(place: usize, ends: &[usize]) -> bool {
    let ends: Vec<(String, usize)> = ends.iter().map(|&end| (String::new(), end)).collect();
    TAPE.with_borrow(|tape| uses(tape, &ends)[place] > 0)
}

/// An entry as an expression of others.
#[allow(clippy::cast_precision_loss)] // of a small table
fn expression(node: Node, [a, b, c]: [&str; 3], inputs: &[String], precision: Precision) -> String {
    let call = |name: &str, of: &str| precision.function(name, of);
    match node.kind {
        Kind::Constant => precision.number(f64::from_bits(node.bits)),
        Kind::Truth => node.bits.to_string(),
        Kind::Input => inputs[usize::try_from(node.bits).unwrap_or_default()].clone(),
        Kind::Add => format!("({a} + {b})"),
        Kind::Sub => format!("({a} - {b})"),
        Kind::Mul => format!("({a} * {b})"),
        Kind::Div => format!("({a} / {b})"),
        Kind::Neg => format!("(-{a})"),
        Kind::Fma => call("fma", &format!("{a}, {b}, {c}")),
        Kind::Abs => call("fabs", a),
        Kind::Sqrt => call("sqrt", a),
        Kind::CopySign => call("copysign", &format!("{a}, {b}")),
        Kind::BySign => format!("(signbit({a}) ? {c} : {b})"),
        Kind::Min => format!("mr_min({a}, {b})"),
        Kind::Max => format!("mr_max({a}, {b})"),
        Kind::Round => call("nearbyint", a),
        Kind::Less => format!("({a} < {b})"),
        Kind::Equal => format!("({a} == {b})"),
        Kind::Select => format!("({a} ? {b} : {c})"),
        Kind::Exp => format!("mr_exp({a})"),
        Kind::Ln => format!("mr_ln({a})"),
        Kind::Pow => format!("mr_pow({a}, {b})"),
        Kind::Tanh => format!("mr_tanh({a})"),
        Kind::Exponent => format!("mr_octave_exponent({a})"),
        Kind::Mantissa => format!("mr_octave_mantissa({a})"),
        Kind::Sixteenth => format!("mr_octave_sixteenth({a})"),
        Kind::Entry => format!("mr_entry({a}, mr_table_{})", node.of[1]),
        Kind::HalfTwo => format!("mr_half_of_two_to({a})"),
        Kind::TimesTwo => format!("mr_times_two_to({a}, {b})"),
        Kind::Cell => format!("mr_cell({a}, {})", precision.number(node.bits as f64)),
        Kind::LookUp => format!("table_{}[(int){a}]", node.of[1]),
    }
}

/// An expression without the brackets around all of it.
fn without_brackets(text: &str) -> &str {
    let Some(inner) = text.strip_prefix('(').and_then(|rest| rest.strip_suffix(')')) else { return text };
    let mut depth = 0_i32;
    let balanced = inner.chars().all(|letter| {
        depth += i32::from(letter == '(') - i32::from(letter == ')');
        depth >= 0
    });
    if balanced { inner } else { text }
}

/// Statements that work out `ends`, each a left-hand side and an entry; `inputs` are the expressions of the inputs.
pub(super) fn statements(inputs: &[String], ends: &[(String, usize)], precision: Precision) -> String {
    TAPE.with_borrow(|tape| {
        let uses = uses(tape, ends);
        let mut text: Vec<String> = Vec::with_capacity(tape.nodes.len());
        let (mut lines, mut count) = (String::new(), 0);
        for (&node, &used) in tape.nodes.iter().zip(&uses) {
            if used == 0 {
                text.push(String::new());
                continue;
            }
            let of = node.of.map(|of| text.get(of).map_or("", String::as_str));
            let written = expression(node, of, inputs, precision);
            if node.kind.arity() == 0 || used == 1 && written.len() <= LONGEST {
                text.push(written);
                continue;
            }
            let word = if matches!(node.kind, Kind::Less | Kind::Equal) { "int" } else { precision.word() };
            let _ = writeln!(lines, "    const {word} t{count} = {};", without_brackets(&written));
            text.push(format!("t{count}"));
            count += 1;
        }
        for (left, place) in ends {
            let _ = writeln!(lines, "    {left} {};", without_brackets(&text[*place]));
        }
        lines
    })
}

/// exp, ln, x^n and tanh of the crate in C, with their tables, from their own text; names start with `mr_`.
#[must_use]
pub fn elementary_functions() -> String {
    TAPE.take();
    let (x, n) = (Term::<true>::input(0), Term::<true>::input(1));
    let ends = [
        ("exp(double x)", exp(x)),
        ("ln(double x)", ln(x)),
        ("general_pow(double x, double n)", x.power(&Exponent::of(n))),
        ("tanh(double x)", tanh(x)),
    ];
    let mut functions = String::new();
    for (head, end) in ends {
        let lines = statements(&["x".into(), "n".into()], &[("return".into(), end.0)], Precision::Double);
        let _ = writeln!(functions, "MR_UNUSED static double mr_{head}\n{{\n{lines}}}\n");
    }
    let mut tables = String::new();
    TAPE.with_borrow(|tape| {
        for (number, table) in tape.tables.iter().enumerate() {
            let rows: Vec<String> = table
                .chunks(4)
                .map(|row| {
                    row.iter().map(|&value| Precision::Double.number(value)).collect::<Vec<_>>().join(", ")
                })
                .collect();
            let _ = writeln!(
                tables,
                "static const double mr_table_{number}[16] = {{\n    {},\n}};",
                rows.join(",\n    ")
            );
        }
    });
    format!("{tables}\n{functions}")
}
