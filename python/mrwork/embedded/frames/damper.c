/* $title: see the header. C99, math.h, no allocation, no globals that change. */
#include "$name.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

$runtime
$elementary
const ${name}_parameters ${name}_fitted = {
$values
};
const ${name}_limits ${name}_believed = {$believed};
const ${name}_limits ${name}_tested = {$tested};

/* Largest speed of a sub-step that is not halved, halved once, twice, and so on; what follows a fast motion is as fast. */
static const $real speeds[${macro}_MOST_HALVINGS + 1] = {$speeds};
static const $real fading = $fading;

/* Parameters of the model at a current. */
static void parameters_at(const ${name}_memory *m, $real current, $real *p)
{
    (void)m;
    (void)current;
$parameters}

void ${name}_carry(${name}_memory *m, $real current)
{
    m->current = current;
    parameters_at(m, current, m->p);
}

static void prepare(${name}_memory *m, const ${name}_parameters *parameters)
{
$prepare}

static int are_finite(const $real *value, unsigned long count)
{
    for (unsigned long i = 0; i < count; ++i)
        if (!isfinite(value[i]))
            return 0;
    return 1;
}

/* Whether parameters, and what follows from them, are numbers; else the ones before stay. */
static int are_taken(${name}_memory *m, const ${name}_parameters *parameters)
{
    const ${name}_memory before = *m;
    prepare(m, parameters);
    ${name}_carry(m, m->current);
    if (are_finite((const $real *)parameters, sizeof *parameters / sizeof($real)) && are_finite(m->p, $n_params))
        return 1;
    *m = before;
    m->status |= ${macro}_PARAMETERS_REFUSED;
    return 0;
}

void ${name}_start(${name}_memory *m, const ${name}_parameters *parameters, $real command)
{
    const $real current = isfinite(command) ? command : $zero;
    memset(m, 0, sizeof *m);
    m->limits = ${name}_believed;
    m->before.command = current;
    prepare(m, &${name}_fitted);
    ${name}_carry(m, current);
    are_taken(m, parameters);
}

$real ${name}_force(const ${name}_memory *m, $real x, $real v)
{
    (void)x;
    (void)v;
$force}

void ${name}_rate(const ${name}_memory *m, $real command, $real x, $real v, $real *rate)
{
    (void)m;
    (void)command;
    (void)x;
    (void)v;
    (void)rate;
$rate}

/* A sub-step that is halved so often, or a part of it. */
static void part(${name}_memory *m, int halvings, $real command, const $real motion[6])
{
    const $real step = ${macro}_SUBSTEP / ($real)(1L << halvings);
    (void)m;
    (void)command;
    (void)motion;
    (void)step;
$substep}

void ${name}_substep(${name}_memory *m, $real command, const $real motion[6])
{
    const $real speed = mr_max(mr_max($fabs(motion[1]), $fabs(motion[3])), $fabs(motion[5]));
    /* A motion that turns within a sample is as fast as it would be before the next. */
    const $real turn = ($real)${macro}_SUBSTEPS * $fabs(motion[5] - motion[1]);
    int halvings = 0;
    m->fastest = mr_max(speed + turn, fading * m->fastest);
    while (halvings < ${macro}_MOST_HALVINGS && m->fastest > speeds[halvings])
        ++halvings;
    if (halvings == 0) {
        part(m, 0, command, motion);
        return;
    }
    const long half = 1L << (halvings - 1);
    const $real per = $one / ($real)half;
    for (long number = 0; number < 2 * half; ++number) {
        const $real *from = number < half ? motion : motion + 2;
        const $real first = ($real)(number % half) / ($real)half;
        const $real share[3] = {first, first + $half * per, first + per};
        $real within[6];
        for (int place = 0; place < 6; ++place) {
            const int which = place % 2;
            within[place] = $fma(share[place / 2], from[2 + which] - from[which], from[which]);
        }
        part(m, halvings, command, within);
    }
}

/* Whether the sub-steps suffice: halves of them give the force of a sine of the test to a hundredth. */
static int is_resolved(const ${name}_memory *m)
{
    ${name}_memory whole = *m, halves = *m;
    const $real turn = ${name}_tested.velocity / ${name}_tested.displacement * ${macro}_SUBSTEP;
    $real largest = $zero, off = $zero;
    memset(whole.state, 0, sizeof whole.state);
    memset(halves.state, 0, sizeof halves.state);
    for (int substep = 0; ${macro}_MOST_HALVINGS > 0 && substep < 1000; ++substep) {
        $real motion[10];
        for (int place = 0; place < 5; ++place) {
            const double phase = (double)turn * (substep + 0.25 * place);
            motion[2 * place] = ${name}_tested.displacement * ($real)sin(phase);
            motion[2 * place + 1] = ${name}_tested.velocity * ($real)cos(phase);
        }
        const $real over[6] = {motion[0], motion[1], motion[4], motion[5], motion[8], motion[9]};
        part(&whole, 0, whole.before.command, over);
        part(&halves, ${macro}_MOST_HALVINGS > 0, halves.before.command, motion);
        part(&halves, ${macro}_MOST_HALVINGS > 0, halves.before.command, motion + 4);
        const $real force = ${name}_force(&halves, motion[8], motion[9]);
        largest = mr_max(largest, $fabs(force));
        off = mr_max(off, $fabs(${name}_force(&whole, motion[8], motion[9]) - force));
        if (!isfinite(force) || !isfinite(off))
            return 0;
    }
    return off <= $hundredth * largest;
}

int ${name}_retune(${name}_memory *m, const ${name}_parameters *parameters)
{
    const ${name}_memory before = *m;
    if (!are_taken(m, parameters))
        return 1;
    if (is_resolved(m))
        return 0;
    *m = before;
    m->status |= ${macro}_PARAMETERS_REFUSED;
    return 1;
}

void ${name}_heal(${name}_memory *m, $real command)
{
    if (are_finite(m->state, $n_kept) && isfinite(m->current) && isfinite(m->fastest) && are_finite(m->p, $n_params))
        return;
    memset(m->state, 0, sizeof m->state);
    m->fastest = $zero;
    ${name}_carry(m, isfinite(m->current) ? m->current : command);
    ++m->healed;
    m->status |= ${macro}_STATE_HEALED;
}

void ${name}_miss(${name}_memory *m, unsigned samples)
{
    m->missed += samples;
}

static $real within($real value, $real lowest, $real highest) { return mr_min(mr_max(value, lowest), highest); }

/* The reading of that number as it is believed. */
static $real believed(${name}_memory *m, int which, $real value, $real good, $real before, int jumps)
{
    const unsigned bit = ${macro}_DISPLACEMENT_REPLACED << which;
    const int doubted = jumps && !(m->doubted & bit);
    m->doubted = doubted ? m->doubted | bit : m->doubted & ~bit;
    if (isfinite(value) && !doubted && value == good) {
        m->age[which] = 0;
        return value;
    }
    ++m->age[which];
    ++m->replaced;
    m->status |= bit;
    return isfinite(value) && !doubted ? good : before;
}

$real ${name}_step(${name}_memory *m, const ${name}_input *input)
{
    const unsigned long most = ${macro}_MOST_MISSED, missed = m->missed < most ? m->missed : most;
    const $real seconds = ${macro}_SAMPLE_TIME * ($real)(m->missed + 1);
    const ${name}_limits *limits = &m->limits;
    ${name}_input from, to;
    m->status = m->missed ? ${macro}_SAMPLE_MISSED : ${macro}_OK;
    m->missed = 0;
    if (!(isfinite(m->before.displacement) && isfinite(m->before.velocity) && isfinite(m->before.command))) {
        memset(&m->before, 0, sizeof m->before);
        m->begun = 0;
        ++m->healed;
        m->status |= ${macro}_STATE_HEALED;
    }
    from = m->before;
    ${name}_heal(m, from.command);
    to.displacement = believed(m, 0, input->displacement, within(input->displacement, -limits->displacement, limits->displacement),
                               from.displacement, m->begun && $fabs(input->displacement - from.displacement) >
                               $two * limits->velocity * seconds);
    to.velocity = believed(m, 1, input->velocity, within(input->velocity, -limits->velocity, limits->velocity), from.velocity,
                           m->begun && $fabs(input->velocity) > ${name}_tested.velocity &&
                           $fabs(input->velocity - from.velocity) > limits->acceleration * seconds);
    to.command = within(input->command, limits->lowest_command, limits->highest_command);
    if (isfinite(input->command) && to.command != input->command)
        m->status |= ${macro}_COMMAND_LIMITED;
    to.command = believed(m, 2, input->command, to.command, from.command, 0);
    if ($fabs(to.velocity) > ${name}_tested.velocity)
        m->status |= ${macro}_OUTSIDE_TESTED;
    if (seconds > ${macro}_SAMPLE_TIME * ($real)(most + 1)) {
        const $real kept = ${macro}_SAMPLE_TIME * ($real)(most + 1) / seconds;
        from.displacement = $fma(kept, from.displacement - to.displacement, to.displacement);
        from.velocity = $fma(kept, from.velocity - to.velocity, to.velocity);
    }
    if (m->begun) {
        const long count = ${macro}_SUBSTEPS * (long)(missed + 1);
        const $real per = $one / ($real)count;
        for (long substep = 0; substep < count; ++substep) {
            $real motion[6];
            for (int stage = 0; stage < 3; ++stage) {
                const $real share = (stage == 1 ? $half * per : stage == 2 ? per : $zero) + ($real)substep * per;
                motion[2 * stage] = $fma(share, to.displacement - from.displacement, from.displacement);
                motion[2 * stage + 1] = $fma(share, to.velocity - from.velocity, from.velocity);
            }
            ${name}_substep(m, from.command, motion);
        }
    }
    m->begun = 1;
    m->before = to;
$take    ${name}_heal(m, to.command);
    return ${name}_force(m, to.displacement, to.velocity);
}
