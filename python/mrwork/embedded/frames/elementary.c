MR_UNUSED static uint64_t mr_bits(double x) { uint64_t bits; memcpy(&bits, &x, sizeof bits); return bits; }
MR_UNUSED static double mr_real(uint64_t bits) { double x; memcpy(&x, &bits, sizeof x); return x; }
/* 1 less 1/sqrt(2), as bits: shifted by it, the exponent steps at 1/sqrt(2). */
#define MR_SHIFT (UINT64_C(0x3FF0000000000000) - UINT64_C(0x3FE6A09E667F3BCD))
MR_UNUSED static double mr_octave_exponent(double x)
{
    return mr_real(((mr_bits(x) + MR_SHIFT) >> 52) | UINT64_C(0x4330000000000000)) - 4503599627371519.0;
}
MR_UNUSED static double mr_octave_mantissa(double x)
{
    return mr_real(((mr_bits(x) + MR_SHIFT) & UINT64_C(0x000FFFFFFFFFFFFF)) + UINT64_C(0x3FE6A09E667F3BCD));
}
MR_UNUSED static double mr_octave_sixteenth(double x) { return mr_real((mr_bits(x) + MR_SHIFT) >> 48); }
MR_UNUSED static double mr_entry(double j, const double table[16]) { return table[mr_bits(j) & 15u]; }
MR_UNUSED static double mr_half_of_two_to(double k) { return mr_real(mr_bits(k + 4503599627371518.0) << 52); }
MR_UNUSED static double mr_times_two_to(double x, double aligned)
{
    const double half = mr_real(mr_bits(x) + ((mr_bits(aligned) >> 4) << 52));
    return aligned < 422212465065983.0 + 1025.0 ? half + half : (double)INFINITY;
}

$functions
MR_UNUSED static double mr_pow(double x, double n) { return n == 2.0 ? x * x : mr_general_pow(x, n); }
