/* $title
 *
$head
 */
#ifndef ${macro}_H
#define ${macro}_H

#define ${macro}_N_DEVICES $n_devices
#define ${macro}_SAMPLE_TIME $sample_time
/* Samples for which a command waits beyond the delay of the hardware that the law was designed for. */
#ifndef ${macro}_QUEUE
#define ${macro}_QUEUE 0
#endif

/* Gains, in SI. */
typedef struct {
$gains
} ${name}_parameters;

/* Readings at a sample, in SI. */
typedef struct {
$readings
} ${name}_input;

/* Largest sizes that are believed, set to the ranges of your sensors; a reading beyond, or not finite, is replaced by the last
   good one and counted. INFINITY takes every reading as it is. */
typedef struct {
$limit_fields
} ${name}_limits;

$plan_types/* What the controller keeps: one for each loop. */
typedef struct {
    $real state[$n_estimated];  /* estimate of the observer */
    $real sent[$n_all];  /* commands of the sample before */
    $real law[$n_kept];  /* what the law keeps */
$plan    $real furthest;
    $real waiting[${macro}_QUEUE + 1][$n_all];
    int place;
    ${name}_input before;
    unsigned long replaced;
    int begun;
    ${name}_limits limits;
} ${name}_memory;

extern const ${name}_parameters ${name}_designed;
extern const ${name}_limits ${name}_believed;

/* At rest, before the first sample. */
void ${name}_start(${name}_memory *m);

/* Commands [$unit] from the readings of a sample; the samples are ${macro}_SAMPLE_TIME apart. A command that is not a number is
   zero, and each lies between those that its damper takes. */
void ${name}_step(${name}_memory *m, const ${name}_parameters *gains, const ${name}_input *input, $real command[$n_devices]);

#endif
