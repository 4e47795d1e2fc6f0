/* Steps the damper through samples and compares its force with the one that the core gives: 0 where they agree. */
#include "$name.h"

#include <math.h>
#include <stdio.h>

/* Displacement [m], velocity [m/s], command, force [N]. */
static const double samples[$n_samples][4] = {
$rows
};

int main(void)
{
    const double tolerance = $tolerance;
    ${name}_memory memory;
    double worst = 0.0;
    int different = 0;
    ${name}_start(&memory, &${name}_fitted, ($real)samples[0][2]);
    for (int i = 0; i < $n_samples; ++i) {
        const ${name}_input input = {($real)samples[i][0], ($real)samples[i][1], ($real)samples[i][2]};
        const double off = fabs((double)${name}_step(&memory, &input) - samples[i][3]);
        different += !(off <= tolerance);
        worst = off > worst ? off : worst;
    }
    printf("%d of $n_samples samples differ by more than %g N, at most by %g N; %lu readings replaced\n", different,
           tolerance, worst, memory.replaced);
    return different != 0;
}
