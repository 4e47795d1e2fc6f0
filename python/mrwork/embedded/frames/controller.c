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

/* Readings that are believed, the last good ones in the place of others. */
MR_UNUSED static void believe(${name}_memory *m, const $real *read, $real *good, int count, $real limit)
{
    for (int entry = 0; entry < count; ++entry) {
        if (limit == ($real)INFINITY || $fabs(read[entry]) <= limit)
            good[entry] = read[entry];
        else
            ++m->replaced;
    }
}

${rollout}static void send(${name}_memory *m, const ${name}_parameters *gains, const ${name}_input *in)
{
    (void)gains;
    (void)in;
$command}

void ${name}_step(${name}_memory *m, const ${name}_parameters *gains, const ${name}_input *input, $real command[$n_devices])
{
    (void)input;
$believed    /* Before the first sample nothing was sent. */
    m->furthest = m->begun ? $furthest : ($real)INFINITY;
    send(m, gains, &m->before);
$estimate    if (!m->begun)
        for (int place = 0; place <= ${macro}_QUEUE; ++place)
            memcpy(m->waiting[place], m->sent, sizeof m->sent);
    m->begun = 1;
    memcpy(m->waiting[m->place], m->sent, sizeof m->sent);
    m->place = (m->place + 1) % (${macro}_QUEUE + 1);
    memcpy(command, m->waiting[m->place], $n_devices * sizeof *command);
}
