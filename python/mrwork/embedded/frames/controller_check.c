/* Steps the controller through samples and compares its commands with those of the core: 0 where they agree$but. */
#include "$name.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* Readings, in the order of the header, then commands. */
static const double samples[$n_samples][$width] = {
$rows
};

int main(void)
{
    const double tolerance = $tolerance;
    ${name}_memory memory;
    double worst = 0.0;
    int different = 0;
    ${name}_start(&memory);
    for (int i = 0; i < $n_samples; ++i) {
        ${name}_input input;
        $real command[$n_devices];
        int column = 0;
$filled        ${name}_step(&memory, &${name}_designed, &input, command);
        for (int device = 0; device < $n_devices; ++device) {
            const double off = fabs((double)command[device] - samples[i][column + device]);
            different += !(off <= tolerance);
            worst = off > worst ? off : worst;
        }
    }
    printf("%d of %d commands differ by more than %g, at most by %g; %lu readings replaced\n", different,
           $n_samples * $n_devices, tolerance, worst, memory.replaced);
    return different > $allowed;
}
