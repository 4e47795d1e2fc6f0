//! Vectors of x86-64 and the functions that enter them, by intrinsics; reached only through their parent.
//!
//! # Safety
//! An intrinsic must not run on a processor without its features. [`Avx512`] and [`Avx2`] are private, and outside of
//! their own methods are named only in functions that enable their features, which are safe to call only where the
//! processor has them. Other code gets such a type as the parameter of [`LaneJob::run`] or [`OutOfLine::run`], within
//! one of these functions. Hence every method of a vector runs on a processor with its features: AVX-512 F, DQ and VL
//! for [`Avx512`], AVX2 and FMA for both. All intrinsics but `load` and `store` compute on registers and
//! require no more.

use core::arch::x86_64::*;
use core::ops::{Add, Div, Mul, Neg, Sub};

use super::job::LaneJob;
use crate::lanes::{Lanes, Pack};
use crate::real::{
    Bits, EXPONENT_BIAS_AT_TWO_TO_52, HALF_EXPONENT_BIAS, MANTISSA_BITS, ONE_BITS, OutOfLine, Pairs, Real,
    SIXTEENTH_ALIGNER, SQRT_HALF_BITS, TWO_TO_52,
};

/// Vectors in the widest pack: enough to hide the latency of a power and a division.
pub(super) const GROUPS: usize = 8;
/// Pairs of vectors in a pack of the loop: shared data are loaded once, and the state of a step stays in the cache. Work that
/// keeps its numbers in registers takes one pair after the other.
pub(super) const MIDDLE_PAIRS: usize = 2;

/// Entry into an instruction set, compiled in the module of `Self`: modules are compiled side by side, and a function that
/// stands here would be compiled here, with all its models.
pub(super) trait Entry {
    /// Runs a job in the pack that so many candidates fill.
    ///
    /// # Safety
    /// The processor has the features.
    #[target_feature(enable = "avx512f,avx512dq,avx512vl,avx2,fma")]
    unsafe fn run_avx512<J: LaneJob>(candidates: usize, job: J) -> J::Output {
        match candidates {
            ..=8 => job.run::<Avx512>(),
            9..=16 => job.run::<Pack<Avx512, 2>>(),
            17..=32 => job.run::<Pack<Avx512, 4>>(),
            33..=48 => job.run::<Pack<Avx512, 6>>(),
            _ => job.run::<Pack<Avx512, GROUPS>>(),
        }
    }

    /// Runs a job in a single vector.
    ///
    /// # Safety
    /// The processor has the features.
    #[target_feature(enable = "avx512f,avx512dq,avx512vl,avx2,fma")]
    unsafe fn run_vector_avx512<J: LaneJob>(job: J) -> J::Output {
        job.run::<Avx512>()
    }

    /// Runs a job of the loop.
    ///
    /// # Safety
    /// The processor has the features.
    #[target_feature(enable = "avx512f,avx512dq,avx512vl,avx2,fma")]
    unsafe fn run_middle_avx512<J: LaneJob>(runs: usize, job: J) -> J::Output {
        match runs {
            ..=16 => job.run::<Pack<Avx512, 2>>(),
            _ => job.run::<Pack<Pack<Avx512, 2>, MIDDLE_PAIRS>>(),
        }
    }

    /// Work that is not inlined.
    ///
    /// # Safety
    /// The processor has the features.
    #[target_feature(enable = "avx512f,avx512dq,avx512vl,avx2,fma")]
    #[inline(never)]
    unsafe fn out_of_line_avx512<W: OutOfLine>(work: W) {
        work.run();
    }

    /// Runs a job in the pack that so many candidates fill.
    ///
    /// # Safety
    /// The processor has the features.
    #[target_feature(enable = "avx2,fma")]
    unsafe fn run_avx2<J: LaneJob>(candidates: usize, job: J) -> J::Output {
        match candidates {
            ..=8 => job.run::<Pack<Avx2, 2>>(),
            9..=16 => job.run::<Pack<Avx2, 4>>(),
            _ => job.run::<Pack<Avx2, GROUPS>>(),
        }
    }

    /// Runs a job of the loop.
    ///
    /// # Safety
    /// The processor has the features.
    #[target_feature(enable = "avx2,fma")]
    unsafe fn run_middle_avx2<J: LaneJob>(runs: usize, job: J) -> J::Output {
        match runs {
            ..=8 => job.run::<Pack<Avx2, 2>>(),
            _ => job.run::<Pack<Pack<Avx2, 2>, MIDDLE_PAIRS>>(),
        }
    }

    /// Runs a job in eight lanes.
    ///
    /// # Safety
    /// The processor has the features.
    #[target_feature(enable = "avx2,fma")]
    unsafe fn run_narrow_avx2<J: LaneJob>(job: J) -> J::Output {
        job.run::<Pack<Avx2, 2>>()
    }

    /// Runs a job in a single vector.
    ///
    /// # Safety
    /// The processor has the features.
    #[target_feature(enable = "avx2,fma")]
    unsafe fn run_vector_avx2<J: LaneJob>(job: J) -> J::Output {
        job.run::<Avx2>()
    }

    /// Work that is not inlined.
    ///
    /// # Safety
    /// The processor has the features.
    #[target_feature(enable = "avx2,fma")]
    #[inline(never)]
    unsafe fn out_of_line_avx2<W: OutOfLine>(work: W) {
        work.run();
    }
}

impl<T: ?Sized> Entry for T {}

const SIGN_BIT: i64 = i64::MIN;

macro_rules! vector {
    ($name:ident, $width:literal, $inner:ty,
     $add:ident $sub:ident $mul:ident $div:ident $load:ident $store:ident) => {
        #[derive(Clone, Copy)]
        pub(super) struct $name($inner);

        vector!(@operator $name Add add $add);
        vector!(@operator $name Sub sub $sub);
        vector!(@operator $name Mul mul $mul);
        vector!(@operator $name Div div $div);

        impl Lanes for $name {
            const WIDTH: usize = $width;
            #[inline(always)]
            fn from_fn(mut value: impl FnMut(usize) -> f64) -> Self {
                let mut values = [0.0; $width];
                for (lane, entry) in values.iter_mut().enumerate() {
                    *entry = value(lane);
                }
                // SAFETY: the processor has the features of this vector; `values` has as many numbers as it has
                // lanes, and the load takes any alignment.
                Self(unsafe { $load(values.as_ptr()) })
            }
            #[inline(always)]
            fn for_each(self, mut receive: impl FnMut(usize, f64)) {
                let mut values = [0.0; $width];
                // SAFETY: as in `from_fn`; nothing else borrows `values`.
                unsafe { $store(values.as_mut_ptr(), self.0) };
                for (lane, value) in values.into_iter().enumerate() {
                    receive(lane, value);
                }
            }
        }
    };
    (@operator $name:ident $trait:ident $method:ident $intrinsic:ident) => {
        impl $trait for $name {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                // SAFETY: the processor has the features of this vector.
                Self(unsafe { $intrinsic(self.0, other.0) })
            }
        }
    };
}

vector!(Avx512, 8, __m512d,
    _mm512_add_pd _mm512_sub_pd _mm512_mul_pd _mm512_div_pd _mm512_loadu_pd _mm512_storeu_pd);
vector!(Avx2, 4, __m256d,
    _mm256_add_pd _mm256_sub_pd _mm256_mul_pd _mm256_div_pd _mm256_loadu_pd _mm256_storeu_pd);

impl Neg for Avx512 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        // SAFETY: the processor has the features of `Avx512`.
        Self(unsafe { _mm512_xor_pd(self.0, _mm512_set1_pd(-0.0)) })
    }
}

impl Neg for Avx2 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        // SAFETY: the processor has the features of `Avx2`.
        Self(unsafe { _mm256_xor_pd(self.0, _mm256_set1_pd(-0.0)) })
    }
}

impl Real for Avx512 {
    type Mask = __mmask8;
    type Piece = Self;
    const PIECES: usize = 1;
    #[inline(always)]
    fn piece(&self, _: usize) -> Self {
        *self
    }
    #[inline(always)]
    fn set_piece(&mut self, _: usize, piece: Self) {
        *self = piece;
    }

    #[inline(always)]
    fn out_of_line<W: OutOfLine>(work: W) {
        // SAFETY: the processor has the features of `Avx512`.
        unsafe { <W::Home as Entry>::out_of_line_avx512(work) }
    }
    #[inline(always)]
    fn splat(value: f64) -> Self {
        // SAFETY: the processor has the features of `Avx512`.
        Self(unsafe { _mm512_set1_pd(value) })
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        // SAFETY: the processor has the features of `Avx512`.
        Self(unsafe { _mm512_fmadd_pd(self.0, factor.0, addend.0) })
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: the processor has the features of `Avx512`.
        Self(unsafe { _mm512_sqrt_pd(self.0) })
    }
    #[inline(always)]
    fn abs(self) -> Self {
        // SAFETY: the processor has the features of `Avx512`.
        Self(unsafe { _mm512_abs_pd(self.0) })
    }
    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        // One ternary logic: bits of `sign` under the sign mask, of `self` elsewhere.
        // SAFETY: the processor has the features of `Avx512`.
        Self(unsafe {
            _mm512_castsi512_pd(_mm512_ternarylogic_epi64::<0xCA>(
                _mm512_set1_epi64(SIGN_BIT),
                _mm512_castpd_si512(sign.0),
                _mm512_castpd_si512(self.0),
            ))
        })
    }
    #[inline(always)]
    fn by_sign(self, positive: Self, negative: Self) -> Self {
        // SAFETY: the processor has the features of `Avx512`.
        Self(unsafe {
            // Sign bits spread over their lanes stay in a vector: a mask register takes longer to reach.
            let negative_lanes = _mm512_srai_epi64::<63>(_mm512_castpd_si512(self.0));
            _mm512_castsi512_pd(_mm512_ternarylogic_epi64::<0xCA>(
                negative_lanes,
                _mm512_castpd_si512(negative.0),
                _mm512_castpd_si512(positive.0),
            ))
        })
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // SAFETY: the processor has the features of `Avx512`.
        Self(unsafe { _mm512_min_pd(self.0, other.0) })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // SAFETY: the processor has the features of `Avx512`.
        Self(unsafe { _mm512_max_pd(self.0, other.0) })
    }
    #[inline(always)]
    fn round_ties_even(self) -> Self {
        // SAFETY: the processor has the features of `Avx512`.
        Self(unsafe { _mm512_roundscale_pd::<{ _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC }>(self.0) })
    }
    #[inline(always)]
    fn less(self, other: Self) -> __mmask8 {
        // SAFETY: the processor has the features of `Avx512`.
        unsafe { _mm512_cmp_pd_mask::<_CMP_LT_OQ>(self.0, other.0) }
    }
    #[inline(always)]
    fn equal(self, other: Self) -> __mmask8 {
        // SAFETY: the processor has the features of `Avx512`.
        unsafe { _mm512_cmp_pd_mask::<_CMP_EQ_OQ>(self.0, other.0) }
    }
    #[inline(always)]
    fn select(mask: __mmask8, yes: Self, no: Self) -> Self {
        // SAFETY: the processor has the features of `Avx512`.
        Self(unsafe { _mm512_mask_blend_pd(mask, no.0, yes.0) })
    }
    #[inline(always)]
    fn all(mask: __mmask8) -> bool {
        mask == __mmask8::MAX
    }
    #[inline(always)]
    fn any(mask: __mmask8) -> bool {
        mask != 0
    }
}

impl Bits for Avx512 {
    #[inline(always)]
    fn octave(self) -> (Self, Self, Self) {
        // SAFETY: the processor has the features of `Avx512`.
        unsafe {
            let bits = _mm512_add_epi64(
                _mm512_castpd_si512(self.0),
                _mm512_set1_epi64((ONE_BITS - SQRT_HALF_BITS).cast_signed()),
            );
            let exponent =
                _mm512_or_epi64(_mm512_srli_epi64::<52>(bits), _mm512_set1_epi64(TWO_TO_52.cast_signed()));
            let mantissa = _mm512_add_epi64(
                _mm512_and_epi64(bits, _mm512_set1_epi64(MANTISSA_BITS.cast_signed())),
                _mm512_set1_epi64(SQRT_HALF_BITS.cast_signed()),
            );
            (
                Self(_mm512_castsi512_pd(exponent)) - Self::splat(EXPONENT_BIAS_AT_TWO_TO_52),
                Self(_mm512_castsi512_pd(mantissa)),
                Self(_mm512_castsi512_pd(_mm512_srli_epi64::<48>(bits))),
            )
        }
    }
    #[inline(always)]
    fn entry_of(self, table: &'static [f64; 16]) -> Self {
        // SAFETY: the processor has the features of `Avx512`; the loads, of any alignment, are the two halves of the
        // sixteen numbers, and the permutation uses no more than four bits of an index.
        Self(unsafe {
            let low = _mm512_loadu_pd(table.as_ptr());
            let high = _mm512_loadu_pd(table.as_ptr().add(8));
            _mm512_permutex2var_pd(low, _mm512_castpd_si512(self.0), high)
        })
    }
    #[inline(always)]
    fn pair_of(self, pairs: &'static Pairs) -> (Self, Self) {
        (self.entry_of(&pairs.first), self.entry_of(&pairs.second))
    }
    #[inline(always)]
    fn half_of_two_to(k: Self) -> Self {
        // SAFETY: the processor has the features of `Avx512`.
        Self(unsafe { _mm512_scalef_pd(_mm512_set1_pd(0.5), k.0) })
    }
    #[inline(always)]
    fn times_two_to(self, aligned: Self) -> Self {
        let k = aligned - Self::splat(SIXTEENTH_ALIGNER);
        // SAFETY: the processor has the features of `Avx512`.
        Self(unsafe { _mm512_scalef_pd(self.0, k.0) })
    }
}

impl Real for Avx2 {
    type Mask = __m256d;
    type Piece = Self;
    const PIECES: usize = 1;
    #[inline(always)]
    fn piece(&self, _: usize) -> Self {
        *self
    }
    #[inline(always)]
    fn set_piece(&mut self, _: usize, piece: Self) {
        *self = piece;
    }

    #[inline(always)]
    fn out_of_line<W: OutOfLine>(work: W) {
        // SAFETY: the processor has the features of `Avx2`.
        unsafe { <W::Home as Entry>::out_of_line_avx2(work) }
    }
    #[inline(always)]
    fn splat(value: f64) -> Self {
        // SAFETY: the processor has the features of `Avx2`.
        Self(unsafe { _mm256_set1_pd(value) })
    }
    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        // SAFETY: the processor has the features of `Avx2`.
        Self(unsafe { _mm256_fmadd_pd(self.0, factor.0, addend.0) })
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: the processor has the features of `Avx2`.
        Self(unsafe { _mm256_sqrt_pd(self.0) })
    }
    #[inline(always)]
    fn abs(self) -> Self {
        // SAFETY: the processor has the features of `Avx2`.
        Self(unsafe { _mm256_andnot_pd(_mm256_set1_pd(-0.0), self.0) })
    }
    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        // SAFETY: the processor has the features of `Avx2`.
        unsafe {
            let sign = _mm256_and_pd(sign.0, _mm256_set1_pd(-0.0));
            Self(_mm256_or_pd(self.abs().0, sign))
        }
    }
    #[inline(always)]
    fn by_sign(self, positive: Self, negative: Self) -> Self {
        // SAFETY: the processor has the features of `Avx2`.
        Self(unsafe { _mm256_blendv_pd(positive.0, negative.0, self.0) })
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // SAFETY: the processor has the features of `Avx2`.
        Self(unsafe { _mm256_min_pd(self.0, other.0) })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // SAFETY: the processor has the features of `Avx2`.
        Self(unsafe { _mm256_max_pd(self.0, other.0) })
    }
    #[inline(always)]
    fn round_ties_even(self) -> Self {
        // SAFETY: the processor has the features of `Avx2`.
        Self(unsafe { _mm256_round_pd::<{ _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC }>(self.0) })
    }
    #[inline(always)]
    fn less(self, other: Self) -> __m256d {
        // SAFETY: the processor has the features of `Avx2`.
        unsafe { _mm256_cmp_pd::<_CMP_LT_OQ>(self.0, other.0) }
    }
    #[inline(always)]
    fn equal(self, other: Self) -> __m256d {
        // SAFETY: the processor has the features of `Avx2`.
        unsafe { _mm256_cmp_pd::<_CMP_EQ_OQ>(self.0, other.0) }
    }
    #[inline(always)]
    fn select(mask: __m256d, yes: Self, no: Self) -> Self {
        // SAFETY: the processor has the features of `Avx2`.
        Self(unsafe { _mm256_blendv_pd(no.0, yes.0, mask) })
    }
    #[inline(always)]
    fn all(mask: __m256d) -> bool {
        // SAFETY: the processor has the features of `Avx2`.
        unsafe { _mm256_movemask_pd(mask) == 0b1111 }
    }
    #[inline(always)]
    fn any(mask: __m256d) -> bool {
        // SAFETY: the processor has the features of `Avx2`.
        unsafe { _mm256_movemask_pd(mask) != 0 }
    }
}

impl Avx2 {
    /// The low four bits of each lane, times two to `TIMES`.
    #[inline(always)]
    fn indices<const TIMES: i32>(self) -> [usize; 4] {
        // SAFETY: the processor has the features of `Avx2`.
        let [a, b, c, d] = unsafe {
            let bits = _mm256_slli_epi64::<TIMES>(_mm256_castpd_si256(self.0));
            let index = _mm256_and_si256(bits, _mm256_set1_epi64x(15 << TIMES));
            let (low, high) = (_mm256_castsi256_si128(index), _mm256_extracti128_si256::<1>(index));
            [
                _mm_cvtsi128_si64(low).cast_unsigned(),
                _mm_extract_epi64::<1>(low).cast_unsigned(),
                _mm_cvtsi128_si64(high).cast_unsigned(),
                _mm_extract_epi64::<1>(high).cast_unsigned(),
            ]
        };
        // Masked once more for the bounds, which costs nothing: the compiler knows the bits.
        [(a & 31) as usize, (b & 31) as usize, (c & 31) as usize, (d & 31) as usize]
    }
}

impl Bits for Avx2 {
    const FEW_REGISTERS: bool = true;

    #[inline(always)]
    fn octave(self) -> (Self, Self, Self) {
        // SAFETY: the processor has the features of `Avx2`.
        unsafe {
            let bits = _mm256_add_epi64(
                _mm256_castpd_si256(self.0),
                _mm256_set1_epi64x((ONE_BITS - SQRT_HALF_BITS).cast_signed()),
            );
            let exponent =
                _mm256_or_si256(_mm256_srli_epi64::<52>(bits), _mm256_set1_epi64x(TWO_TO_52.cast_signed()));
            let mantissa = _mm256_add_epi64(
                _mm256_and_si256(bits, _mm256_set1_epi64x(MANTISSA_BITS.cast_signed())),
                _mm256_set1_epi64x(SQRT_HALF_BITS.cast_signed()),
            );
            (
                Self(_mm256_castsi256_pd(exponent)) - Self::splat(EXPONENT_BIAS_AT_TWO_TO_52),
                Self(_mm256_castsi256_pd(mantissa)),
                Self(_mm256_castsi256_pd(_mm256_srli_epi64::<48>(bits))),
            )
        }
    }
    // By a load for each lane: a gather takes longer on processors of both makers.
    #[inline(always)]
    fn entry_of(self, table: &'static [f64; 16]) -> Self {
        let [a, b, c, d] = self.indices::<0>();
        // SAFETY: the processor has the features of `Avx2`.
        Self(unsafe { _mm256_set_pd(table[d], table[c], table[b], table[a]) })
    }
    #[inline(always)]
    fn pair_of(self, pairs: &'static Pairs) -> (Self, Self) {
        let ([a, b, c, d], pairs) = (self.indices::<1>(), pairs.side_by_side.as_ptr());
        // SAFETY: the processor has the features of `Avx2`; each load, of any alignment, is of the two numbers of a pair, whose
        // place is at most twice 15.
        unsafe {
            let [a, b] = [_mm_loadu_pd(pairs.add(a)), _mm_loadu_pd(pairs.add(b))];
            let [c, d] = [_mm_loadu_pd(pairs.add(c)), _mm_loadu_pd(pairs.add(d))];
            let even = _mm256_insertf128_pd::<1>(_mm256_castpd128_pd256(a), c);
            let odd = _mm256_insertf128_pd::<1>(_mm256_castpd128_pd256(b), d);
            (Self(_mm256_unpacklo_pd(even, odd)), Self(_mm256_unpackhi_pd(even, odd)))
        }
    }
    #[inline(always)]
    fn half_of_two_to(k: Self) -> Self {
        let field = k + Self::splat(HALF_EXPONENT_BIAS);
        // SAFETY: the processor has the features of `Avx2`.
        Self(unsafe { _mm256_castsi256_pd(_mm256_slli_epi64::<52>(_mm256_castpd_si256(field.0))) })
    }
    #[inline(always)]
    fn times_two_to(self, aligned: Self) -> Self {
        // SAFETY: the processor has the features of `Avx2`.
        let half = Self(unsafe {
            let floor = _mm256_srli_epi64::<4>(_mm256_castpd_si256(aligned.0));
            _mm256_castsi256_pd(_mm256_add_epi64(_mm256_castpd_si256(self.0), _mm256_slli_epi64::<52>(floor)))
        });
        let bounded = aligned.less(Self::splat(SIXTEENTH_ALIGNER + 1025.0));
        Self::select(bounded, half + half, Self::splat(f64::INFINITY))
    }
    #[inline(always)]
    fn zero_where(mask: __m256d, number: Self) -> Self {
        // SAFETY: the processor has the features of `Avx2`.
        Self(unsafe { _mm256_andnot_pd(mask, number.0) })
    }
}
