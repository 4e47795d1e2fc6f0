//! A number that records what a formula does with it, and the record printed as C99.
//!
//! A formula of the crate is written once over [`Real`]. With [`Term`] for its number it leaves a list of operations, each an
//! entry that refers to earlier ones: what is printed from it rounds where the lanes round, and gives their bits.

mod damper;
mod formula;
mod print;
mod term;

pub use damper::{DamperText, damper_text};
pub(crate) use formula::Formula;
pub use print::{Precision, elementary_functions};
pub(crate) use term::Term;
