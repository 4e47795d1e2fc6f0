//! Instruction sets: their vectors, and the selection at run time.
//!
//! Only this file and `dispatch/x86.rs` contain `unsafe` code. Every intrinsic there requires a processor feature; its
//! vectors are reached only through the methods `run` of [`InstructionSet`], which check the processor first.

mod job;

pub use job::LaneJob;
use job::{GROUPS, MIDDLE_PAIRS};

use crate::lanes::Lanes;

/// A pack of the baseline of the target: plain arrays, which the compiler turns into the vectors of NEON.
#[cfg(not(target_arch = "x86_64"))]
type Plain = crate::lanes::Pack<f64, 8>;
/// The same in the loop.
#[cfg(not(target_arch = "x86_64"))]
type PlainMiddle = crate::lanes::Pack<f64, 4>;
/// Without fused multiply-adds in hardware, more lanes gain nothing.
#[cfg(target_arch = "x86_64")]
type Plain = f64;
#[cfg(target_arch = "x86_64")]
type PlainMiddle = f64;

/// The vector instructions of a batch. The choice changes the speed, never a bit of a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InstructionSet {
    /// 512-bit vectors of x86-64.
    Avx512,
    /// 256-bit vectors of x86-64 with fused multiply-add.
    Avx2,
    /// The baseline of the target (on aarch64 it includes NEON and fused multiply-add).
    Plain,
}

impl InstructionSet {
    /// All instruction sets, fastest first.
    pub const ALL: [Self; 3] = [Self::Avx512, Self::Avx2, Self::Plain];

    /// The fastest one that this build and this processor have.
    #[must_use]
    pub fn detect() -> Self {
        Self::ALL.into_iter().find(|set| set.is_supported()).unwrap_or(Self::Plain)
    }

    /// Its name in settings and reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Avx512 => "avx512",
            Self::Avx2 => "avx2",
            Self::Plain => "plain",
        }
    }

    /// Whether this build has it, see `build.rs`.
    #[must_use]
    pub const fn is_compiled(self) -> bool {
        match self {
            Self::Avx512 => cfg!(compiled_avx512),
            Self::Avx2 => cfg!(compiled_avx2),
            Self::Plain => true,
        }
    }

    /// Whether this processor has it.
    #[must_use]
    pub fn is_of_processor(self) -> bool {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => {
                Self::Avx2.is_of_processor()
                    && is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512vl")
            }
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma"),
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx512 | Self::Avx2 => false,
            Self::Plain => true,
        }
    }

    /// Whether this build has it and this processor, too.
    #[must_use]
    pub fn is_supported(self) -> bool {
        self.is_compiled() && self.is_of_processor()
    }

    /// This one, or [`InstructionSet::Plain`] if it is not supported.
    #[must_use]
    pub fn or_plain(self) -> Self {
        if self.is_supported() { self } else { Self::Plain }
    }

    /// Candidates of a full block: those of the widest pack.
    #[must_use]
    pub const fn block_width(self) -> usize {
        match self {
            Self::Avx512 => GROUPS * 8,
            Self::Avx2 => GROUPS * 4,
            Self::Plain => 8,
        }
    }

    /// Candidates of a full block of narrow packs side by side, under one evaluation of the motion.
    #[must_use]
    pub const fn side_by_side_width(self) -> usize {
        match self {
            Self::Avx512 | Self::Avx2 => 128,
            Self::Plain => 8,
        }
    }

    /// Runs `job` in the widest pack that `candidates` fill.
    ///
    /// An instruction set that is not supported falls back to [`InstructionSet::Plain`].
    #[cfg_attr(not(compiled_avx2), allow(unused_variables))] // without vectors there is one width
    pub fn run<J: LaneJob>(self, candidates: usize, job: J) -> J::Output {
        match self {
            #[cfg(compiled_avx512)]
            // SAFETY: the guard has found every feature that the function enables.
            Self::Avx512 if self.is_supported() => unsafe {
                <J::Home as x86::Compiled>::run_avx512(candidates, job)
            },
            #[cfg(compiled_avx2)]
            // SAFETY: the guard has found both features that the function enables.
            Self::Avx2 if self.is_supported() => unsafe {
                <J::Home as x86::Compiled>::run_avx2(candidates, job)
            },
            _ => <J::Home as Plainly>::run(job),
        }
    }

    /// Lanes of a pack of medium width.
    #[must_use]
    pub const fn middle_width(self) -> usize {
        match self {
            Self::Avx512 => MIDDLE_PAIRS * 16,
            Self::Avx2 => MIDDLE_PAIRS * 8,
            Self::Plain => PlainMiddle::WIDTH,
        }
    }

    /// Runs `job` in a pack of medium width, narrower if `runs` fill no more, for work with independent arithmetic and a
    /// large state.
    ///
    /// An instruction set that is not supported falls back to [`InstructionSet::Plain`].
    #[cfg_attr(not(compiled_avx2), allow(unused_variables))] // without vectors there is one width
    pub fn run_middle<J: LaneJob>(self, runs: usize, job: J) -> J::Output {
        match self {
            #[cfg(compiled_avx512)]
            // SAFETY: the guard has found every feature that the function enables.
            Self::Avx512 if self.is_supported() => unsafe {
                <J::Home as x86::Compiled>::run_middle_avx512(runs, job)
            },
            #[cfg(compiled_avx2)]
            // SAFETY: the guard has found both features that the function enables.
            Self::Avx2 if self.is_supported() => unsafe {
                <J::Home as x86::Compiled>::run_middle_avx2(runs, job)
            },
            _ => <J::Home as Plainly>::run_middle(job),
        }
    }

    /// Lanes of a single vector.
    #[must_use]
    pub const fn vector_width(self) -> usize {
        match self {
            Self::Avx512 => 8,
            Self::Avx2 => 4,
            Self::Plain => 1,
        }
    }

    /// Runs `job` in a single vector, for numbers that are several vectors each.
    ///
    /// An instruction set that is not supported falls back to [`InstructionSet::Plain`], one lane.
    pub fn run_vector<J: LaneJob>(self, job: J) -> J::Output {
        match self {
            #[cfg(compiled_avx512)]
            // SAFETY: the guard has found every feature that the function enables.
            Self::Avx512 if self.is_supported() => unsafe {
                <J::Home as x86::Compiled>::run_vector_avx512(job)
            },
            #[cfg(compiled_avx2)]
            // SAFETY: the guard has found both features that the function enables.
            Self::Avx2 if self.is_supported() => unsafe { <J::Home as x86::Compiled>::run_vector_avx2(job) },
            _ => <J::Home as Plainly>::run_vector(job),
        }
    }

    /// Runs `job` in eight lanes, for work that is not compiled for every width.
    ///
    /// An instruction set that is not supported falls back to [`InstructionSet::Plain`].
    pub fn run_narrow<J: LaneJob>(self, job: J) -> J::Output {
        match self {
            #[cfg(compiled_avx512)]
            // SAFETY: the guard has found every feature that the function enables.
            Self::Avx512 if self.is_supported() => unsafe {
                <J::Home as x86::Compiled>::run_vector_avx512(job)
            },
            #[cfg(compiled_avx2)]
            // SAFETY: the guard has found both features that the function enables.
            Self::Avx2 if self.is_supported() => unsafe { <J::Home as x86::Compiled>::run_narrow_avx2(job) },
            _ => <J::Home as Plainly>::run(job),
        }
    }
}

/// Jobs without an instruction set of their own, compiled in the module of `Self`.
trait Plainly {
    fn run<J: LaneJob>(job: J) -> J::Output {
        job.run::<Plain>()
    }
    fn run_middle<J: LaneJob>(job: J) -> J::Output {
        job.run::<PlainMiddle>()
    }
    fn run_vector<J: LaneJob>(job: J) -> J::Output {
        job.run::<f64>()
    }
}

impl<T: ?Sized> Plainly for T {}

#[cfg(target_arch = "x86_64")]
#[allow(clippy::wildcard_imports)] // some sixty intrinsics
#[cfg_attr(not(all(compiled_avx512, compiled_avx2)), allow(dead_code))] // of a set that is not compiled
mod x86;
