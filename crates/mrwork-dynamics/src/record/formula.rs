//! A formula under record: its inputs by name, and the statements that it becomes.

use std::fmt::Write;

use super::print::{Precision, leads_to, statements};
use super::term::{TAPE, Term};

/// The record that is being made on this thread.
pub(crate) struct Formula {
    precision: Precision,
    inputs: Vec<String>,
}

impl Formula {
    /// Begins a record, and ends the one before.
    pub(crate) fn new(precision: Precision) -> Self {
        TAPE.take();
        Self { precision, inputs: Vec::new() }
    }

    /// The input of this expression.
    pub(crate) fn input(&mut self, name: impl Into<String>) -> Term<false> {
        self.inputs.push(name.into());
        Term::input(self.inputs.len() - 1)
    }

    /// The inputs `NAME[0]`, `NAME[1]`, ...
    pub(crate) fn inputs(&mut self, name: &str, count: usize) -> Vec<Term<false>> {
        (0..count).map(|entry| self.input(format!("{name}[{entry}]"))).collect()
    }

    /// Whether what ends the formula of this thread depends on a term.
    pub(crate) fn uses(term: Term<false>, ends: &[Term<false>]) -> bool {
        leads_to(term.0, &ends.iter().map(|end| end.0).collect::<Vec<_>>())
    }

    /// The tables that entries of this thread's formula are looked up in, by their numbers.
    pub(crate) fn tables() -> Vec<Vec<f64>> {
        TAPE.with_borrow(|tape| tape.looked_up.clone())
    }

    /// Whether the formula of this thread calls an elementary function.
    pub(crate) fn calls() -> bool {
        TAPE.with_borrow(|tape| tape.nodes.iter().any(|node| node.kind.is_call()))
    }

    /// Statements, each of a left-hand side such as `y =` and what follows it.
    pub(crate) fn statements(&self, ends: impl IntoIterator<Item = (String, Term<false>)>) -> String {
        let ends: Vec<(String, usize)> = ends.into_iter().map(|(left, end)| (left, end.0)).collect();
        statements(&self.inputs, &ends, self.precision)
    }

    /// Assignments to places of which some are inputs: all are worked out before the first is made.
    pub(crate) fn assigned_at_once(&self, places: &[String], ends: &[Term<false>]) -> String {
        let word = self.precision.word();
        let next =
            ends.iter().enumerate().map(|(number, &end)| (format!("const {word} next_{number} ="), end));
        let mut text = self.statements(next);
        for (number, place) in places.iter().enumerate() {
            let _ = writeln!(text, "    {place} = next_{number};");
        }
        text
    }
}
