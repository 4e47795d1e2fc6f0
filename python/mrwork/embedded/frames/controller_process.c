/* The controller as the program of
 *     mr.closed_loop.ProcessLaw(
 *         name="$name", program=["./$name"], readings=[$names], replaces_readings=True
 *     )
 * Little-endian doubles: message, sample, time, missed and the readings in; message and commands out.
 */
#include "$name.h"

#include <stdio.h>
#include <string.h>

enum { MESSAGE, SAMPLE, TIME, MISSED, READINGS, IN = READINGS + $width, OUT = 1 + $n_devices };

int main(void)
{
    double in[IN], out[OUT];
    ${name}_memory memory;
    ${name}_start(&memory);
    while (fread(in, sizeof in, 1, stdin) == 1) {
        ${name}_input input;
        $real command[$n_devices];
        int column = READINGS;
        if (in[SAMPLE] == 0.0)
            ${name}_start(&memory);
$filled        if (column != IN)
            return 1;
        ${name}_step(&memory, &${name}_designed, &input, command);
        out[0] = in[MESSAGE];
        for (int device = 0; device < $n_devices; ++device)
            out[1 + device] = command[device];
        if (fwrite(out, sizeof out, 1, stdout) != 1 || fflush(stdout))
            return 1;
    }
    return 0;
}
