//! Instruction sets: the vectors of each, and the one place that enters them.
//!
//! Only here and in `dispatch/x86.rs` is code `unsafe`. Every intrinsic there needs a processor feature; it is
//! reached only through [`InstructionSet::run`], which asks the processor first.

use crate::lanes::{Lanes, Pack, Plain};

/// Vectors interleaved in one pack of a full block: enough to hide the latency of a power and a division.
const GROUPS: usize = 8;
/// The same with half as many registers, of half the width.
const AVX2_GROUPS: usize = 4;
/// Vectors of a middling pack: what a step shares among them is loaded once, and what it holds stays in the cache.
const MIDDLE_GROUPS: usize = 6;
/// The same with half as many registers, of half the width.
const AVX2_MIDDLE_GROUPS: usize = 4;
/// The same without vectors to name: two of NEON.
const PLAIN_MIDDLE: usize = 4;

/// Work that is written once for any number of lanes.
pub trait LaneJob {
    /// What the work returns.
    type Output;
    /// Runs with as many lanes as `R` has. Must be `#[inline(always)]`, and so must all that it calls.
    fn run<R: Lanes>(self) -> Self::Output;
}

/// The vector instructions a batch runs on. The choice changes speed, never a bit of a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InstructionSet {
    /// 512-bit vectors of x86-64.
    Avx512,
    /// 256-bit vectors of x86-64 with fused multiply-add.
    Avx2,
    /// What every processor of the target has (on aarch64 that includes NEON and fused multiply-add).
    Plain,
}

impl InstructionSet {
    /// All instruction sets, fastest first.
    pub const ALL: [Self; 3] = [Self::Avx512, Self::Avx2, Self::Plain];

    /// The fastest one this processor has.
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

    /// Whether this processor has it.
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

    /// This one, or [`InstructionSet::Plain`] where this processor lacks it.
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

    /// Runs `job` in the widest lanes that `candidates` fill.
    ///
    /// An instruction set that this processor lacks falls back to [`InstructionSet::Plain`].
    pub fn run<J: LaneJob>(self, candidates: usize, job: J) -> J::Output {
        match self {
            #[cfg(target_arch = "x86_64")]
            #[allow(unsafe_code)] // the features were asked for on the same line
            Self::Avx512 if self.is_supported() => unsafe { x86::run_avx512(candidates, job) },
            #[cfg(target_arch = "x86_64")]
            #[allow(unsafe_code)] // the features were asked for on the same line
            Self::Avx2 if self.is_supported() => unsafe { x86::run_avx2(candidates, job) },
            _ => job.run::<Plain>(),
        }
    }

    /// Lanes of a middling pack.
    #[must_use]
    pub const fn middle_width(self) -> usize {
        match self {
            Self::Avx512 => MIDDLE_GROUPS * 8,
            Self::Avx2 => AVX2_MIDDLE_GROUPS * 4,
            Self::Plain => PLAIN_MIDDLE,
        }
    }

    /// Runs `job` in a few vectors side by side, fewer where `runs` fill no more, for work that has independent
    /// arithmetic of its own and much to hold.
    ///
    /// An instruction set that this processor lacks falls back to [`InstructionSet::Plain`].
    pub fn run_middle<J: LaneJob>(self, runs: usize, job: J) -> J::Output {
        match self {
            #[cfg(target_arch = "x86_64")]
            #[allow(unsafe_code)] // the features were asked for on the same line
            Self::Avx512 if self.is_supported() => unsafe { x86::run_middle_avx512(runs, job) },
            #[cfg(target_arch = "x86_64")]
            #[allow(unsafe_code)] // the features were asked for on the same line
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

    /// Runs `job` in a single vector, for work whose numbers are several vectors each.
    ///
    /// An instruction set that this processor lacks falls back to [`InstructionSet::Plain`], one lane.
    pub fn run_vector<J: LaneJob>(self, job: J) -> J::Output {
        match self {
            #[cfg(target_arch = "x86_64")]
            #[allow(unsafe_code)] // the features were asked for on the same line
            Self::Avx512 if self.is_supported() => unsafe { x86::run_narrow_avx512(job) },
            #[cfg(target_arch = "x86_64")]
            #[allow(unsafe_code)] // the features were asked for on the same line
            Self::Avx2 if self.is_supported() => unsafe { x86::run_vector_avx2(job) },
            _ => job.run::<f64>(),
        }
    }

    /// Runs `job` in eight lanes, for work that is too rare to be compiled for every width.
    ///
    /// An instruction set that this processor lacks falls back to [`InstructionSet::Plain`].
    pub fn run_narrow<J: LaneJob>(self, job: J) -> J::Output {
        match self {
            #[cfg(target_arch = "x86_64")]
            #[allow(unsafe_code)] // the features were asked for on the same line
            Self::Avx512 if self.is_supported() => unsafe { x86::run_narrow_avx512(job) },
            #[cfg(target_arch = "x86_64")]
            #[allow(unsafe_code)] // the features were asked for on the same line
            Self::Avx2 if self.is_supported() => unsafe { x86::run_narrow_avx2(job) },
            _ => job.run::<Plain>(),
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code, clippy::wildcard_imports)] // some sixty intrinsics, each named where it is used
mod x86;
