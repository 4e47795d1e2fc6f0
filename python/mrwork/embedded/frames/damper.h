/* $title
 *
$head
 */
#ifndef ${macro}_H
#define ${macro}_H

#define ${macro}_N_STATES $n_states
#define ${macro}_LAGGED $lagged
#define ${macro}_SAMPLE_TIME $sample_time
#define ${macro}_SUBSTEPS $substeps
#define ${macro}_SUBSTEP $substep_seconds

/* Coefficients, in SI. */
typedef struct {
$fields
} ${name}_parameters;

/* Displacement [m] and velocity [m/s] of the damper, positive as it lengthens, and the command [$unit] at a sample. */
typedef struct {
    $real displacement;
    $real velocity;
    $real command;
} ${name}_input;

/* Largest sizes that are believed; a reading beyond, or not finite, is replaced by the last good one and counted. */
typedef ${name}_input ${name}_limits;

/* What the damper keeps: give each damper its own. */
typedef struct {
    $real state[$n_kept];
    $real current;               /* in the coil [$unit] */
    ${name}_input before;        /* of the sample before */
    unsigned long replaced;      /* readings that were replaced */
    int begun;
    $real prepared[$n_prepared];  /* coefficients as the laws take them */
    $real p[$n_params];          /* parameters at the current */
    $real decay[$n_decays];              /* of the driver's lag in half a sub-step, rising and falling */
    ${name}_limits limits;
} ${name}_memory;

extern const ${name}_parameters ${name}_fitted;
extern const ${name}_limits ${name}_believed;

/* At rest, with this command in the coil. */
void ${name}_start(${name}_memory *m, const ${name}_parameters *parameters, $real command);

/* Force [N] with which the damper resists at a sample; the samples are ${macro}_SAMPLE_TIME apart, the motion between two is
   straight, and a command acts from its sample on. */
$real ${name}_step(${name}_memory *m, const ${name}_input *input);

/* The parts of a step, for who knows the motion within a sample or integrates the states himself. */
void ${name}_carry(${name}_memory *m, $real current);
$real ${name}_force(const ${name}_memory *m, $real x, $real v);
void ${name}_rate(const ${name}_memory *m, $real command, $real x, $real v, $real *rate);
void ${name}_substep(${name}_memory *m, $real command, const $real motion[6]);

#endif
