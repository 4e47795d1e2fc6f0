//! Magnetorheological damper models and their simulation in lanes: one lane per candidate.
//!
//! A model is written once over [`real::Real`] ([`damper`]). A batch of candidates is simulated under one loading
//! history ([`loading`]) in lanes of eight or more ([`lanes`], [`dispatch`]) with one time-stepping rule
//! ([`integrate`]). The result is a misfit or a force history ([`simulate`]), or a force history with its derivatives
//! ([`dual`], [`sensitivity`]). Buildings ([`building`]) with dampers, under ground motions ([`ground_motion`]) and control
//! laws ([`control`]), are simulated in lanes too ([`closed_loop`]). A formula of a user is a [`tape`]. No Python, no files, no randomness, no printing.

pub mod any_damper;
pub mod block;
pub mod building;
pub mod closed_loop;
pub mod control;
pub mod coupled;
pub mod current_law;
pub mod damper;
#[allow(unsafe_code)] // the one module that enters an instruction set
pub mod dispatch;
mod driver;
pub mod dual;
pub mod dual_block;
pub mod elementary;
pub mod error;
pub mod ground_motion;
pub mod integrate;
pub mod lag;
pub mod lanes;
pub mod loading;
pub mod matrix_equations;
pub mod misfit;
pub mod parameters;
pub mod peak;
pub mod real;
pub mod record;
pub mod sampled;
mod schedule;
pub mod sensitivity;
pub mod settings;
pub mod simulate;
pub mod tape;
pub mod threads;
mod watch;
