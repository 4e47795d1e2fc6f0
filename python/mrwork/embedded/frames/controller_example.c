/* A program around the controller, to copy: a timer of one sample, a watchdog, scaling of sensors, a hand-over from and to manual
 * without a bump, and a ramp to zero. What is between the marks is of a board: here it is a record that the program makes itself.
 */
#include "$name.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { READINGS = $width, DEVICES = ${macro}_N_DEVICES, SAMPLES = 4000 };

/* ---- yours: sensors in counts, drivers, a timer, a switch ---- */

/* Reading [SI] = scale (counts - zero). */
static const double scale[READINGS] = {$scales};
static const long zero[READINGS] = {0};  /* counts at rest */

static long now;

/* Waits for the timer; how many samples have passed since the last call, 1 as a rule. */
static unsigned wait_for_sample(void)
{
    const unsigned passed = now % 1000 == 999 ? 4 : 1;
    now += passed;
    return passed;
}

/* Counts of the converter; a sensor that is broken off shows the largest. */
static long counts_of(int reading)
{
    if (reading == 0 && now > 2000 && now < 2200)
        return 32767;
    return (long)(8000.0 * sin(0.01 * (double)now * (1.0 + 0.1 * reading)));
}

static int is_manual(void) { return now < 500 || (now > 3000 && now < 3200); }
static double manual_command(int device) { return 0.1 * (device + 1); }
static int is_asked_to_stop(void) { return now > 3600; }

static double driven[DEVICES];
static void drive(int device, double command) { driven[device] = command; }

/* Feeds the watchdog of the board: where this is not called in time, the board sets its drivers to zero. */
static void feed_watchdog(void) {}

/* ---- up to here ---- */

/* A converter at the end of its range tells nothing: the controller replaces what is not a number. */
static double reading_of(int reading, long counts)
{
    return counts >= 32767 || counts <= -32768 ? (double)NAN : scale[reading] * (double)(counts - zero[reading]);
}

/* Samples in which a command goes from manual to automatic, or to zero; missed samples and dead sensors beyond which it stops. */
enum { RAMP = 200, MOST_MISSED = 20, MOST_AGE = 500 };

int main(void)
{
    static ${name}_memory memory;
    double share = 0.0, largest = 0.0, jump = 0.0, sent[DEVICES] = {0.0};
    unsigned long replaced = 0, missed = 0;
    unsigned seen = 0;
    int is_stopped = 0;
    ${name}_start(&memory);
    while (now < SAMPLES) {
        const unsigned passed = wait_for_sample();
        ${name}_input input;
        $real automatic[DEVICES];
        double in[READINGS];
        int column = 0;
        for (int reading = 0; reading < READINGS; ++reading)
            in[reading] = reading_of(reading, counts_of(reading));
$filled        (void)column;
        ${name}_miss(&memory, passed - 1);
        ${name}_step(&memory, &${name}_designed, &input, automatic);
        seen |= memory.status;
        missed += passed - 1;
        for (int reading = 0; reading < READINGS; ++reading)
            is_stopped |= memory.age[reading] > MOST_AGE;
        is_stopped |= passed > MOST_MISSED || is_asked_to_stop();
        /* The controller runs along in manual, so that its estimate is right when it takes over. */
        share += (is_manual() || is_stopped ? -1.0 : 1.0) / RAMP;
        share = share < 0.0 ? 0.0 : share > 1.0 ? 1.0 : share;
        for (int device = 0; device < DEVICES; ++device) {
            const double other = is_stopped ? 0.0 : manual_command(device);
            const double command = other + share * ((double)automatic[device] - other);
            const double before = sent[device];
            /* A stop from manual is a ramp, too. */
            sent[device] = is_stopped && share == 0.0 ? before - before / RAMP : command;
            drive(device, sent[device]);
            largest = fmax(largest, fabs(driven[device]));
            jump = fmax(jump, fabs(sent[device] - before) / passed);
        }
        replaced = memory.replaced;
        feed_watchdog();
    }
    printf("%ld samples, %lu missed, %lu readings replaced, status seen %#x, largest command %.3g, last %.3g\n", now, missed,
           replaced, seen, largest, driven[0]);
    return !(isfinite(largest) && fabs(driven[0]) < 1e-3 + 0.1 * largest && isfinite(jump));
}
