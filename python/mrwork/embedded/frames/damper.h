/* $title
 *
$head
 */
#ifndef ${macro}_H
#define ${macro}_H

#ifdef __cplusplus
extern "C" {
#endif

#define ${macro}_N_STATES $n_states
#define ${macro}_LAGGED $lagged
#define ${macro}_SAMPLE_TIME $sample_time
#define ${macro}_SUBSTEPS $substeps
#define ${macro}_SUBSTEP $substep_seconds
/* A fast sub-step is halved so often at most, and of more missed samples than these the last ones are bridged. */
#define ${macro}_MOST_HALVINGS $most_halvings
#define ${macro}_MOST_MISSED 100

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

/* What is believed: sizes of displacement [m], velocity [m/s] and acceleration [m/s^2], and commands [$unit]. Those of an instance
   may be narrowed. A reading beyond its limit is held to it; one that is not finite, or that jumps faster than the limits say, is
   replaced by the last good one, where it jumps twice in a row not the second time. */
typedef struct {
    $real displacement;
    $real velocity;
    $real acceleration;
    $real lowest_command;
    $real highest_command;
} ${name}_limits;

/* The word of status of a step: what happened in it. */
typedef enum {
    ${macro}_OK = 0,
$status
} ${name}_status;

/* What the damper keeps: give each damper its own. */
typedef struct {
    $real state[$n_kept];
    $real current;               /* in the coil [$unit] */
    ${name}_input before;        /* of the sample before, as it was believed */
    unsigned status;             /* of the last step: bits of ${name}_status */
    unsigned doubted;            /* readings that jumped in the last step */
    unsigned long age[3];        /* samples since displacement, velocity and command were good */
    unsigned long replaced;      /* readings that were replaced or held to a limit */
    unsigned long healed;        /* states that were not finite, and began anew at rest */
    unsigned long missed;        /* samples that the next step bridges */
    int begun;
    $real fastest;               /* speed that decides on sub-steps [m/s] */
    $real prepared[$n_prepared];  /* coefficients as the laws take them */
    $real p[$n_params];          /* parameters at the current */
    $real decay[${macro}_MOST_HALVINGS + 1][$n_decays]; /* of the driver's lag in half a step, rising and falling */
    ${name}_limits limits;
} ${name}_memory;

extern const ${name}_parameters ${name}_fitted;
extern const ${name}_limits ${name}_believed;
extern const ${name}_limits ${name}_tested;

/* At rest, with this command in the coil. Parameters that are not numbers are those that were fitted: see the word of status. */
void ${name}_start(${name}_memory *m, const ${name}_parameters *parameters, $real command);

/* Other parameters in a running damper, which keeps its states: 0 where they are taken, and 1 where one of them, or of what follows
   from them, is not a number, or where the damper is too stiff for the sub-steps of the fitted ones; then nothing changes. It takes as
   long as 3000 sub-steps: call it between samples that do not wait. */
int ${name}_retune(${name}_memory *m, const ${name}_parameters *parameters);

/* Says before a step that so many samples were missed since the last one: the step bridges them by a straight motion. */
void ${name}_miss(${name}_memory *m, unsigned samples);

/* Force [N] with which the damper resists at a sample; the samples are ${macro}_SAMPLE_TIME apart, the motion between two is
   straight, and a command acts from its sample on. */
$real ${name}_step(${name}_memory *m, const ${name}_input *input);

/* The parts of a step, for who knows the motion within a sample or integrates the states himself. */
void ${name}_carry(${name}_memory *m, $real current);
$real ${name}_force(const ${name}_memory *m, $real x, $real v);
void ${name}_rate(const ${name}_memory *m, $real command, $real x, $real v, $real *rate);
void ${name}_substep(${name}_memory *m, $real command, const $real motion[6]);
void ${name}_heal(${name}_memory *m, $real command);

#ifdef __cplusplus
}
#endif
#endif
