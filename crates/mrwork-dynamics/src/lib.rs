//! Magnetorheological damper models and their simulation in lanes.
//!
//! A model is written once over [`real::Real`] ([`damper`]); a batch of candidates runs through one loading
//! history ([`loading`]) in lanes of eight or more ([`lanes`], [`dispatch`]), by one time-stepping rule
//! ([`integrate`]), and leaves behind a misfit or a force history ([`block`], [`simulate`]), or a force history with its
//! derivatives ([`dual`], [`sensitivity`]). Buildings ([`building`]) that carry dampers under ground motions
//! ([`ground_motion`]) and control laws ([`control`]) run in lanes too ([`closed_loop`]). No Python, no files, no randomness, no printing.

pub mod any_damper;
pub mod block;
pub mod building;
pub mod closed_loop;
pub mod control;
pub mod current_law;
pub mod damper;
#[allow(unsafe_code)] // the one module that enters an instruction set
pub mod dispatch;
mod driver;
pub mod dual;
pub mod elementary;
pub mod error;
pub mod ground_motion;
pub mod integrate;
pub mod lanes;
pub mod loading;
pub mod misfit;
pub mod parameters;
pub mod peak;
mod plan;
pub mod real;
pub mod sensitivity;
pub mod simulate;
pub mod threads;
