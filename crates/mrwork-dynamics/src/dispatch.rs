//! Instruction sets: their vectors, and the selection at run time.
//!
//! Only this file and `dispatch/x86.rs` contain `unsafe` code. Every intrinsic there requires a processor feature; its
//! vectors are reached only through the methods `run` of [`InstructionSet`], which check the processor first.

use crate::lanes::{Lanes, Pack, Plain};

/// Vectors in one pack of a full block: enough to hide the latency of a power and a division.
const GROUPS: usize = 8;
/// The same for AVX2: half as many registers of half the width.
const AVX2_GROUPS: usize = 4;
/// The same for short chains of arithmetic, whose latency more vectors hide.
const AVX2_WIDE_GROUPS: usize = 8;
/// Vectors in a pack of medium width: shared data are loaded once, and the state of a step stays in the cache.
const MIDDLE_GROUPS: usize = 4;
/// The same for AVX2.
const AVX2_MIDDLE_GROUPS: usize = 4;
/// Lanes of medium width without named vectors: two of NEON.
const PLAIN_MIDDLE: usize = 4;

/// Work that is written once for any number of lanes.
pub trait LaneJob {
    /// What the work returns.
    type Output;
    /// Whether it may come with the lanes of a wide block.
    const WIDE: bool = false;
    /// Runs with the lanes of `R`. Must be `#[inline(always)]`, and so must all functions that it calls.
    fn run<R: Lanes>(self) -> Self::Output;
}

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

    /// The fastest one that this processor supports.
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

    /// Whether this processor supports it.
    #[must_use]
    pub fn is_supported(self) -> bool {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => {
                Self::Avx2.is_supported()
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

    /// This one, or [`InstructionSet::Plain`] if the processor does not support it.
    #[must_use]
    pub fn or_plain(self) -> Self {
        if self.is_supported() { self } else { Self::Plain }
    }

    /// Lanes of a full block.
    #[must_use]
    pub const fn block_width(self) -> usize {
        match self {
            Self::Avx512 => GROUPS * 8,
            Self::Avx2 => AVX2_GROUPS * 4,
            Self::Plain => 8,
        }
    }

    /// Lanes of a full block of short chains of arithmetic, of a job that may be wide.
    #[must_use]
    pub const fn wide_block_width(self) -> usize {
        match self {
            Self::Avx2 => AVX2_WIDE_GROUPS * 4,
            _ => self.block_width(),
        }
    }

    /// Runs `job` in the widest pack that `candidates` fill.
    ///
    /// An instruction set that this processor does not support falls back to [`InstructionSet::Plain`].
    pub fn run<J: LaneJob>(self, candidates: usize, job: J) -> J::Output {
        match self {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the guard has found every feature that the function enables.
            Self::Avx512 if self.is_supported() => unsafe { x86::run_avx512(candidates, job) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the guard has found both features that the function enables.
            Self::Avx2 if self.is_supported() => unsafe { x86::run_avx2(candidates, job) },
            _ => job.run::<Plain>(),
        }
    }

    /// Lanes of a pack of medium width.
    #[must_use]
    pub const fn middle_width(self) -> usize {
        match self {
            Self::Avx512 => MIDDLE_GROUPS * 8,
            Self::Avx2 => AVX2_MIDDLE_GROUPS * 4,
            Self::Plain => PLAIN_MIDDLE,
        }
    }

    /// Runs `job` in a pack of medium width, narrower if `runs` fill no more, for work with independent arithmetic and a
    /// large state.
    ///
    /// An instruction set that this processor does not support falls back to [`InstructionSet::Plain`].
    pub fn run_middle<J: LaneJob>(self, runs: usize, job: J) -> J::Output {
        match self {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the guard has found every feature that the function enables.
            Self::Avx512 if self.is_supported() => unsafe { x86::run_middle_avx512(runs, job) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the guard has found both features that the function enables.
            Self::Avx2 if self.is_supported() => unsafe { x86::run_middle_avx2(runs, job) },
            _ => job.run::<Pack<f64, PLAIN_MIDDLE>>(),
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
    /// An instruction set that this processor does not support falls back to [`InstructionSet::Plain`], one lane.
    pub fn run_vector<J: LaneJob>(self, job: J) -> J::Output {
        match self {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the guard has found every feature that the function enables.
            Self::Avx512 if self.is_supported() => unsafe { x86::run_narrow_avx512(job) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the guard has found both features that the function enables.
            Self::Avx2 if self.is_supported() => unsafe { x86::run_vector_avx2(job) },
            _ => job.run::<f64>(),
        }
    }

    /// Runs `job` in eight lanes, for work that is not compiled for every width.
    ///
    /// An instruction set that this processor does not support falls back to [`InstructionSet::Plain`].
    pub fn run_narrow<J: LaneJob>(self, job: J) -> J::Output {
        match self {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the guard has found every feature that the function enables.
            Self::Avx512 if self.is_supported() => unsafe { x86::run_narrow_avx512(job) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the guard has found both features that the function enables.
            Self::Avx2 if self.is_supported() => unsafe { x86::run_narrow_avx2(job) },
            _ => job.run::<Plain>(),
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[allow(clippy::wildcard_imports)] // some sixty intrinsics
mod x86;
