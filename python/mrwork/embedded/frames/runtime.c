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
