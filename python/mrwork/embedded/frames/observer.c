/* x+ = transition x + input f + ground a + gain (y - output x - direct f - direct_ground a) */
$matrices

static $real products($real sum, const $real *row, const $real *values, int count)
{
    for (int column = 0; column < count; ++column)
        sum = $fma(values[column], row[column], sum);
    return sum;
}

static $real where_finite($real value) { return $fabs(value) < ($real)INFINITY ? value : $zero; }

/* The estimate for the next sample; a reading that is not finite is ignored. */
static void estimate(${name}_memory *m, const ${name}_input *in)
{
    const $real measured[$n_measured] = {$measured};
    $real innovation[$n_measured], next[$n_states];
    for (int row = 0; row < $n_measured; ++row) {
        $real expected = products($zero, output[row], m->state, $n_states);
        expected = products(expected, direct[row], in->force, $n_all);
$expects        innovation[row] = where_finite(measured[row] - expected);
    }
    for (int row = 0; row < $n_states; ++row) {
        $real sum = products($zero, transition[row], m->state, $n_states);
        for (int device = 0; device < $n_all; ++device)
            sum = $fma(where_finite(in->force[device]), input_of[row][device], sum);
$moves        next[row] = products(sum, gain[row], innovation, $n_measured);
    }
    memcpy(m->state, next, sizeof next);
}
