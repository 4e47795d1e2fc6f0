/* $title: see the header. C99, math.h, no allocation, no globals that change. */
#include "$name.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

$runtime
$elementary
const ${name}_parameters ${name}_designed = {
$values
};
const ${name}_limits ${name}_believed = {$limits};

$tables
static const $real kept_at_start[$n_kept] = {$kept};

$observer
void ${name}_start(${name}_memory *m)
{
    memset(m, 0, sizeof *m);
    memcpy(m->law, kept_at_start, sizeof m->law);
    m->limits = ${name}_believed;
}

/* Readings that are believed, the last good ones in the place of others; `first` is the place of their ages. */
MR_UNUSED static void believe(${name}_memory *m, unsigned bit, int first, const $real *read, $real *good, int count, $real limit)
{
    for (int entry = 0; entry < count; ++entry) {
        ++m->age[first + entry];
        if (limit == ($real)INFINITY || $fabs(read[entry]) <= limit) {
            good[entry] = read[entry];
            m->age[first + entry] = 0;
        } else {
            ++m->replaced;
            m->status |= bit;
        }
    }
}

static int are_finite(const $real *value, unsigned long count)
{
    for (unsigned long i = 0; i < count; ++i)
        if (!isfinite(value[i]))
            return 0;
    return 1;
}

static int are_numbers(const $real *value, unsigned long count)
{
    for (unsigned long i = 0; i < count; ++i)
        if (isnan(value[i]))
            return 0;
    return 1;
}

/* What is kept from sample to sample is finite, or begins anew at rest; not where readings are taken as they are. */
static void heal(${name}_memory *m)
{
    if (!are_finite((const $real *)&m->limits, sizeof m->limits / sizeof($real)) || (are_finite(m->state, $n_estimated) && are_numbers(m->law, $n_kept) && are_finite(m->sent, $n_all)$plan_is_sound))
        return;
    memset(m->state, 0, sizeof m->state);
    memset(m->sent, 0, sizeof m->sent);
    memcpy(m->law, kept_at_start, sizeof m->law);
$plan_anew    ++m->healed;
    m->status |= ${macro}_STATE_HEALED;
}

${rollout}static void send(${name}_memory *m, const ${name}_parameters *gains, const ${name}_input *in)
{
    (void)gains;
    (void)in;
$command}

void ${name}_miss(${name}_memory *m, unsigned samples)
{
    m->missed += samples;
}

/* A sample without readings: the ones before it stay, as does the command that was sent. */
static void bridge(${name}_memory *m, const ${name}_parameters *gains)
{
    $real sent[$n_all];
    memcpy(sent, m->sent, sizeof sent);
    (void)gains;
$bridge    memcpy(m->sent, sent, sizeof sent);
}

void ${name}_step(${name}_memory *m, const ${name}_parameters *gains, const ${name}_input *input, $real command[$n_devices])
{
    const unsigned long most = ${macro}_MOST_MISSED, missed = m->missed < most ? m->missed : most;
    const int length = (m->queue < 0 ? 0 : m->queue < ${macro}_MOST_QUEUE ? m->queue : ${macro}_MOST_QUEUE) + 1;
    $real sent[$n_all];
    (void)input;
    m->status = m->missed ? ${macro}_SAMPLE_MISSED : ${macro}_OK;
    m->missed = 0;
    if (!are_numbers((const $real *)gains, sizeof *gains / sizeof($real))) {
        gains = &${name}_designed;
        m->status |= ${macro}_PARAMETERS_REFUSED;
    }
    heal(m);
    /* Before the first sample nothing was sent. */
    m->furthest = m->begun ? $furthest : ($real)INFINITY;
    for (unsigned long sample = 0; m->begun && sample < missed; ++sample)
        bridge(m, gains);
$believed    memcpy(sent, m->sent, sizeof sent);
    send(m, gains, &m->before);
    for (int device = 0; device < $n_devices; ++device)
        if (m->begun && $fabs(m->sent[device] - sent[device]) >= $nearly * m->furthest)
            m->status |= ${macro}_RATE_LIMITED;
$estimate    heal(m);
    if (!m->begun)
        for (int place = 0; place <= ${macro}_MOST_QUEUE; ++place)
            memcpy(m->waiting[place], m->sent, sizeof m->sent);
    m->begun = 1;
    m->place %= length;
    memcpy(m->waiting[m->place], m->sent, sizeof m->sent);
    m->place = (m->place + 1) % length;
    memcpy(command, m->waiting[m->place], $n_devices * sizeof *command);
}
