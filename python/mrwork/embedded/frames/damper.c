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
const ${name}_limits ${name}_believed = {$limits};

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

void ${name}_start(${name}_memory *m, const ${name}_parameters *parameters, $real command)
{
    memset(m, 0, sizeof *m);
    m->limits = ${name}_believed;
$prepare    m->before.command = command;
    ${name}_carry(m, command);
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

void ${name}_substep(${name}_memory *m, $real command, const $real motion[6])
{
    (void)m;
    (void)command;
    (void)motion;
$substep}

static int is_believed($real value, $real limit) { return $fabs(value) <= limit; }

static $real believed(${name}_memory *m, $real value, $real limit, $real before)
{
    if (is_believed(value, limit))
        return value;
    ++m->replaced;
    return before;
}

$real ${name}_step(${name}_memory *m, const ${name}_input *input)
{
    const ${name}_input from = m->before;
    ${name}_input to;
    to.displacement = believed(m, input->displacement, m->limits.displacement, from.displacement);
    to.velocity = believed(m, input->velocity, m->limits.velocity, from.velocity);
    to.command = believed(m, input->command, m->limits.command, from.command);
    if (m->begun) {
        const $real per = $one / ${macro}_SUBSTEPS;
        for (int substep = 0; substep < ${macro}_SUBSTEPS; ++substep) {
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
$take    return ${name}_force(m, to.displacement, to.velocity);
}
