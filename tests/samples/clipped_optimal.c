/* Clipped-optimal control, or its modified form, with or without an observer, over stdin and stdout, or, with an argument, at a UDP port.
   `design.h` has the numbers; sums are fused and in the order of the crate. */
#define _POSIX_C_SOURCE 200112L
#include <arpa/inet.h>
#include <math.h>
#include <netinet/in.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "design.h"

#define HEAD 4
#if OBSERVER
#define READINGS (2 * N_DEVICES + N_FLOORS + 1 + N_DRIFTS)
#else
#define READINGS (N_STATES + N_DEVICES)
#endif
#define IN (HEAD + READINGS)
#define OUT (1 + N_DEVICES)

static double state[N_STATES];

static double add_products(double sum, const double *row, const double *values, int count)
{
    for (int i = 0; i < count; i++)
        sum = fma(values[i], row[i], sum);
    return sum;
}

static void command(const double *known, const double *force, double *commands)
{
    for (int device = 0; device < N_DEVICES; device++) {
        const double desired = -add_products(0.0, gain_k[device], known, N_STATES);
        const double product = (desired - force[device]) * force[device];
#if MODIFIED
        const double full = fmin(fabs(desired) / full_force[device], 1.0) * largest[device];
#else
        const double full = largest[device];
#endif
        commands[device] = 0.0 < product ? full : product == product ? 0.0 : (double)NAN;
    }
}

#if OBSERVER
static double or_zero(double value, double reading) { return fabs(reading) < INFINITY ? value : 0.0; }

static void estimate(const double *readings)
{
    const double *deformation = readings, *force = deformation + N_DEVICES, *acceleration = force + N_DEVICES;
    const double *ground = acceleration + N_FLOORS, *drift = ground + 1;
    const double shaking = or_zero(*ground, *ground);
    double next[N_STATES], innovation[N_MEASURED];
    for (int row = 0; row < N_MEASURED; row++) {
        const int at = row - N_ACCELERATIONS;
        const double measured = at < 0           ? acceleration[measured_floors[row]]
                                : at < N_DEVICES ? deformation[at]
                                                 : drift[at - N_DEVICES];
        double expected = add_products(0.0, output[row], state, N_STATES);
        expected = add_products(expected, direct[row], force, N_DEVICES);
        if (KNOWN_GROUND)
            expected = fma(shaking, direct_ground[row], expected);
        innovation[row] = or_zero(measured - expected, measured - expected);
    }
    for (int row = 0; row < N_STATES; row++) {
        double sum = add_products(0.0, transition[row], state, N_STATES);
        for (int device = 0; device < N_DEVICES; device++)
            sum = fma(or_zero(force[device], force[device]), input[row][device], sum);
        if (KNOWN_GROUND)
            sum = fma(shaking, moved[row], sum);
        next[row] = add_products(sum, gain_l[row], innovation, N_MEASURED);
    }
    memcpy(state, next, sizeof state);
}
#endif

static void answer(const double *in, double *out)
{
    const double *readings = in + HEAD;
    if (in[1] == 0.0)
        memset(state, 0, sizeof state);
    out[0] = in[0];
#if OBSERVER
    command(state, readings + N_DEVICES, out + 1);
    estimate(readings);
#else
    command(readings, readings + N_STATES, out + 1);
#endif
}

static int serve(void)
{
    struct sockaddr_in at;
    socklen_t length = sizeof at;
    const int port = socket(AF_INET, SOCK_DGRAM, 0);
    double in[IN], out[OUT];
    memset(&at, 0, sizeof at);
    at.sin_family = AF_INET;
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (port < 0 || bind(port, (struct sockaddr *)&at, sizeof at) || getsockname(port, (struct sockaddr *)&at, &length))
        return 1;
    printf("%d\n", ntohs(at.sin_port));
    fflush(stdout);
    for (;;) {
        length = sizeof at;
        if (recvfrom(port, in, sizeof in, 0, (struct sockaddr *)&at, &length) != (ssize_t)sizeof in)
            return 1;
        answer(in, out);
        if (sendto(port, out, sizeof out, 0, (struct sockaddr *)&at, length) < 0)
            return 1;
    }
}

int main(int count, char **arguments)
{
    double in[IN], out[OUT];
    (void)arguments;
    if (count > 1)
        return serve();
    while (fread(in, sizeof in, 1, stdin) == 1) {
        answer(in, out);
        if (fwrite(out, sizeof out, 1, stdout) != 1 || fflush(stdout))
            return 1;
    }
    return 0;
}
