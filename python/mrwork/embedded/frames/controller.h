/* $title
 *
$head
 */
#ifndef ${macro}_H
#define ${macro}_H

#ifdef __cplusplus
extern "C" {
#endif

#define ${macro}_N_DEVICES $n_devices
#define ${macro}_SAMPLE_TIME $sample_time
/* Most samples for which a command may wait, see the queue of the memory, and most missed samples that a step makes up for. */
#define ${macro}_MOST_QUEUE 32
#define ${macro}_MOST_MISSED 100

/* Gains, in SI. */
typedef struct {
$gains
} ${name}_parameters;

/* Readings at a sample, in SI. */
typedef struct {
$readings
} ${name}_input;

/* Largest sizes that are believed, set to the ranges of your sensors; a reading beyond, or not finite, is replaced by the last
   good one and counted. INFINITY takes every reading as it is, and what follows from it is not healed. */
typedef struct {
$limit_fields
} ${name}_limits;

/* The word of status of a step: what happened in it. */
typedef enum {
    ${macro}_OK = 0,
$status
} ${name}_status;

$plan_types/* What the controller keeps: one for each loop. */
typedef struct {
    $real state[$n_estimated];  /* estimate of the observer */
    $real sent[$n_all];  /* commands of the sample before */
    $real law[$n_kept];  /* what the law keeps */
$plan    $real furthest;
    $real waiting[${macro}_MOST_QUEUE + 1][$n_all];
    int place;
    int queue;                   /* samples for which a command waits beyond the delay that the law was designed for; yours to set */
    ${name}_input before;
    unsigned status;             /* of the last step: bits of ${name}_status */
    unsigned long age[$n_ages];         /* samples since each reading was good */
    unsigned long replaced;      /* readings that were replaced */
    unsigned long healed;        /* states that were not finite, and began anew at rest */
    unsigned long missed;        /* samples that the next step makes up for */
    int begun;
    ${name}_limits limits;
} ${name}_memory;

extern const ${name}_parameters ${name}_designed;
extern const ${name}_limits ${name}_believed;

/* At rest, before the first sample. */
void ${name}_start(${name}_memory *m);

/* Says before a step that so many samples were missed since the last one: the step first lets $bridged
   with the readings before them. */
void ${name}_miss(${name}_memory *m, unsigned samples);

/* Commands [$unit] from the readings of a sample; the samples are ${macro}_SAMPLE_TIME apart. A command that is not a number is
   zero, and each lies between those that its damper takes. Gains may change from step to step; of gains with one that is not a
   number the designed ones are taken. */
void ${name}_step(${name}_memory *m, const ${name}_parameters *gains, const ${name}_input *input, $real command[$n_devices]);

#ifdef __cplusplus
}
#endif
#endif
