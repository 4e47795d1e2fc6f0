#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__)
#error "This code tells readings that are not numbers from others, which -ffast-math takes for granted: compile without it."
#endif
/* Contraction would round otherwise than the lanes; gcc wants -std=c99, or -ffp-contract=off in its gnu modes. */
#ifdef __clang__
#pragma STDC FP_CONTRACT OFF
#endif
#if defined(__GNUC__)
#define MR_UNUSED __attribute__((unused))
#else
#define MR_UNUSED
#endif

MR_UNUSED static $real mr_min($real a, $real b) { return a < b ? a : b; }
MR_UNUSED static $real mr_cell($real x, $real most) { return x >= $one ? (x < most ? ($real)(int)x : most) : $zero; }
MR_UNUSED static $real mr_max($real a, $real b) { return a > b ? a : b; }
