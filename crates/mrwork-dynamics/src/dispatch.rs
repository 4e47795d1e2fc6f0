//! Instruction sets: their vectors, and the selection at run time.
//!
//! Only this file and `dispatch/x86.rs` contain `unsafe` code. Every intrinsic there requires a processor feature; its
//! vectors are reached only through the methods `run` of [`InstructionSet`], which exists only where the processor has
//! been found to have the features.

mod job;

pub use job::LaneJob;

use crate::error::DynamicsError;

/// A pack of the baseline of the target: plain arrays, which the compiler turns into the vectors of NEON.
#[cfg(not(target_arch = "x86_64"))]
type Plain = crate::lanes::Pack<f64, 8>;
/// The same in the loop.
#[cfg(not(target_arch = "x86_64"))]
type PlainMiddle = crate::lanes::Pack<f64, 4>;
/// Without fused multiply-adds in hardware, more lanes gain nothing.
#[cfg(all(target_arch = "x86_64", compiled_plain))]
type Plain = f64;
#[cfg(all(target_arch = "x86_64", compiled_plain))]
type PlainMiddle = f64;

/// The vector instructions of a batch: of this build and of this processor. The choice changes the speed, never a bit of a
/// result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InstructionSet(Compiled);

/// The instruction sets of this build, fastest first; see `build.rs`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Compiled {
    /// 512-bit vectors of x86-64.
    #[cfg(compiled_avx512)]
    Avx512,
    /// 256-bit vectors of x86-64 with fused multiply-add.
    #[cfg(compiled_avx2)]
    Avx2,
    /// The baseline of the target (on aarch64 it includes NEON and fused multiply-add).
    #[cfg(compiled_plain)]
    Plain,
}

impl Compiled {
    const ALL: &[Self] = &[
        #[cfg(compiled_avx512)]
        Self::Avx512,
        #[cfg(compiled_avx2)]
        Self::Avx2,
        #[cfg(compiled_plain)]
        Self::Plain,
    ];

    const fn name(self) -> &'static str {
        match self {
            #[cfg(compiled_avx512)]
            Self::Avx512 => "avx512",
            #[cfg(compiled_avx2)]
            Self::Avx2 => "avx2",
            #[cfg(compiled_plain)]
            Self::Plain => "plain",
        }
    }
}

impl InstructionSet {
    /// Names of the instruction sets of this build, fastest first.
    pub fn of_build() -> impl Iterator<Item = &'static str> {
        Compiled::ALL.iter().map(|set| set.name())
    }

    /// Names of the instruction sets of this processor, fastest first, whether or not this build has them.
    pub fn of_processor() -> impl Iterator<Item = &'static str> {
        #[cfg(target_arch = "x86_64")]
        let avx2 = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
        #[cfg(target_arch = "x86_64")]
        let avx512 = avx2
            && is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512dq")
            && is_x86_feature_detected!("avx512vl");
        #[cfg(not(target_arch = "x86_64"))]
        let (avx512, avx2) = (false, false);
        [(avx512, "avx512"), (avx2, "avx2"), (true, "plain")]
            .into_iter()
            .filter_map(|(has, name)| has.then_some(name))
    }

    /// Those of this build that this processor has, fastest first.
    pub fn usable() -> impl Iterator<Item = Self> {
        let of_build = Compiled::ALL.iter().map(|&set| Self(set));
        of_build.filter(|set| Self::of_processor().any(|name| name == set.name()))
    }

    /// The fastest one that this build and this processor have.
    ///
    /// # Errors
    /// If they have none in common.
    pub fn detect() -> Result<Self, DynamicsError> {
        Self::usable().next().ok_or_else(|| {
            let [of_build, of_processor] = [Self::of_build().collect(), Self::of_processor().collect()];
            DynamicsError::Processor { of_build, of_processor }
        })
    }

    /// Its name in settings and reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        self.0.name()
    }

    /// Candidates of a full block: those of the widest pack.
    #[must_use]
    pub const fn block_width(self) -> usize {
        match self.0 {
            #[cfg(compiled_avx512)]
            Compiled::Avx512 => x86::GROUPS * 8,
            #[cfg(compiled_avx2)]
            Compiled::Avx2 => x86::GROUPS * 4,
            #[cfg(compiled_plain)]
            Compiled::Plain => 8,
        }
    }

    /// Candidates of a full block of narrow packs side by side, under one evaluation of the motion.
    #[must_use]
    pub const fn side_by_side_width(self) -> usize {
        match self.0 {
            #[cfg(compiled_avx512)]
            Compiled::Avx512 => 128,
            #[cfg(compiled_avx2)]
            Compiled::Avx2 => 128,
            #[cfg(compiled_plain)]
            Compiled::Plain => 8,
        }
    }

    /// Runs `job` in the widest pack that `candidates` fill.
    #[cfg_attr(not(any(compiled_avx512, compiled_avx2)), allow(unused_variables))] // without vectors there is one width
    pub fn run<J: LaneJob>(self, candidates: usize, job: J) -> J::Output {
        match self.0 {
            #[cfg(compiled_avx512)]
            // SAFETY: the processor has every feature that the function enables, as of every `InstructionSet`.
            Compiled::Avx512 => unsafe { <J::Home as x86::Entry>::run_avx512(candidates, job) },
            #[cfg(compiled_avx2)]
            // SAFETY: the processor has both features that the function enables, as of every `InstructionSet`.
            Compiled::Avx2 => unsafe { <J::Home as x86::Entry>::run_avx2(candidates, job) },
            #[cfg(compiled_plain)]
            Compiled::Plain => <J::Home as Plainly>::run(job),
        }
    }

    /// Lanes of a pack of medium width.
    #[must_use]
    pub const fn middle_width(self) -> usize {
        match self.0 {
            #[cfg(compiled_avx512)]
            Compiled::Avx512 => x86::MIDDLE_PAIRS * 16,
            #[cfg(compiled_avx2)]
            Compiled::Avx2 => x86::MIDDLE_PAIRS * 8,
            #[cfg(compiled_plain)]
            Compiled::Plain => <PlainMiddle as crate::lanes::Lanes>::WIDTH,
        }
    }

    /// Runs `job` in a pack of medium width, narrower if `runs` fill no more, for work with independent arithmetic and a
    /// large state.
    #[cfg_attr(not(any(compiled_avx512, compiled_avx2)), allow(unused_variables))] // without vectors there is one width
    pub fn run_middle<J: LaneJob>(self, runs: usize, job: J) -> J::Output {
        match self.0 {
            #[cfg(compiled_avx512)]
            // SAFETY: the processor has every feature that the function enables, as of every `InstructionSet`.
            Compiled::Avx512 => unsafe { <J::Home as x86::Entry>::run_middle_avx512(runs, job) },
            #[cfg(compiled_avx2)]
            // SAFETY: the processor has both features that the function enables, as of every `InstructionSet`.
            Compiled::Avx2 => unsafe { <J::Home as x86::Entry>::run_middle_avx2(runs, job) },
            #[cfg(compiled_plain)]
            Compiled::Plain => <J::Home as Plainly>::run_middle(job),
        }
    }

    /// Lanes of a single vector.
    #[must_use]
    pub const fn vector_width(self) -> usize {
        match self.0 {
            #[cfg(compiled_avx512)]
            Compiled::Avx512 => 8,
            #[cfg(compiled_avx2)]
            Compiled::Avx2 => 4,
            #[cfg(compiled_plain)]
            Compiled::Plain => 1,
        }
    }

    /// Runs `job` in a single vector, for numbers that are several vectors each.
    pub fn run_vector<J: LaneJob>(self, job: J) -> J::Output {
        match self.0 {
            #[cfg(compiled_avx512)]
            // SAFETY: the processor has every feature that the function enables, as of every `InstructionSet`.
            Compiled::Avx512 => unsafe { <J::Home as x86::Entry>::run_vector_avx512(job) },
            #[cfg(compiled_avx2)]
            // SAFETY: the processor has both features that the function enables, as of every `InstructionSet`.
            Compiled::Avx2 => unsafe { <J::Home as x86::Entry>::run_vector_avx2(job) },
            #[cfg(compiled_plain)]
            Compiled::Plain => <J::Home as Plainly>::run_vector(job),
        }
    }

    /// Runs `job` in eight lanes, for work that is not compiled for every width.
    pub fn run_narrow<J: LaneJob>(self, job: J) -> J::Output {
        match self.0 {
            #[cfg(compiled_avx512)]
            // SAFETY: the processor has every feature that the function enables, as of every `InstructionSet`.
            Compiled::Avx512 => unsafe { <J::Home as x86::Entry>::run_vector_avx512(job) },
            #[cfg(compiled_avx2)]
            // SAFETY: the processor has both features that the function enables, as of every `InstructionSet`.
            Compiled::Avx2 => unsafe { <J::Home as x86::Entry>::run_narrow_avx2(job) },
            #[cfg(compiled_plain)]
            Compiled::Plain => <J::Home as Plainly>::run(job),
        }
    }
}

/// Jobs without an instruction set of their own, compiled in the module of `Self`.
#[cfg(compiled_plain)]
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

#[cfg(compiled_plain)]
impl<T: ?Sized> Plainly for T {}

#[cfg(target_arch = "x86_64")]
#[allow(clippy::wildcard_imports)] // some sixty intrinsics
#[cfg_attr(not(all(compiled_avx512, compiled_avx2)), allow(dead_code))] // of a set that is not compiled
mod x86;
