/* The rollout: dampers and storeys between samples, the forecast of the ground, and the trials. */
enum { N_ALL = $n_all, N_COMMANDED = $n_devices, TRIALS = $n_trials, TAILS = $n_tails, LEVELS = (TRIALS - 1) / TAILS };
enum { DECISION = $decision, HOLD = $hold_steps, HORIZON = $horizon_steps, ORDER = $order, NODES = $n_nodes };
/* Samples until a command acts, and whether it is late by a part of one. */
enum { DELAY = $delay, DEPTH = DELAY + 2, LATE = $late };

static const $real smallest[N_ALL] = {$smallest}, largest[N_ALL] = {$largest};

static void take(${name}_memory *m, const ${name}_input *in)
{
$read}

static void settle(${name}_memory *m, const $real *command)
{
$settle}

$drives
static void follow(${name}_memory *m, const ${name}_input *in)
{
    (void)m;
    (void)in;
$follow}

static void compare(${name}_memory *m, const ${name}_parameters *gains, const ${name}_input *in)
{
    (void)in;
$compare}

$moves
static $real price(const ${name}_memory *m, const ${name}_parameters *gains, const ${name}_moment *x, const $real *found)
{
    (void)m;
$price}

static $real within($real number, $real lower, $real upper) { return mr_min(upper, mr_max(lower, number)); }

/* Commands of a trial, and those that follow them. */
static void candidate(const ${name}_parameters *gains, int trial, $real *first, $real *tail)
{
    const int level = (trial - 1) / TAILS, other = (trial - 1) % TAILS - 1;
    for (int device = 0; device < N_ALL; ++device) {
        const $real lower = smallest[device], upper = largest[device];
        first[device] = tail[device] = lower;
        if (device >= N_COMMANDED)
            continue;
        first[device] = tail[device] = within(gains->base[device], lower, upper);
        if (trial > 0)
            first[device] = within(gains->levels[device * LEVELS + level], lower, upper);
        if (trial > 0 && other >= 0)
            tail[device] = within(gains->tails[device * (TAILS - 1) + other], lower, upper);
    }
}

static $real product(const $real *left, const $real *right)
{
    $real sum = $zero;
    for (int place = 0; place < ORDER; ++place)
        sum = $fma(left[place], right[place], sum);
    return sum;
}

static void shift($real *readings, $real newest)
{
    for (int place = ORDER - 1; place > 0; --place)
        readings[place] = readings[place - 1];
    readings[0] = newest;
}

/* Recursive least squares of the weights of the last readings of the ground. */
static void learn(${name}_plan *p)
{
    $real spread[ORDER + 1], trace = $zero;
    const $real expected = within(product(p->weights, p->readings), -p->strongest, p->strongest);
    const $real reading = p->ground == p->ground ? p->ground : expected;
    const $real error = reading - product(p->weights, p->readings);
    for (int row = 0; row < ORDER; ++row)
        spread[row] = product(p->covariance[row], p->readings);
    const $real inverse = $one / (product(spread, p->readings) + $forgetting);
    for (int row = 0; row < ORDER; ++row)
        trace = trace + p->covariance[row][row];
    const $real growth = trace < $largest_trace ? $growth : $one;
    for (int row = 0; row < ORDER; ++row) {
        const $real gain = spread[row] * inverse;
        p->weights[row] = $fma(gain, error, p->weights[row]);
        for (int column = row; column < ORDER; ++column) {
            const $real next = $fma(-gain, spread[column], p->covariance[row][column]) * growth;
            p->covariance[row][column] = next;
            p->covariance[column][row] = next;
        }
    }
    shift(p->readings, reading);
}

static void predict(${name}_plan *p)
{
    $real window[ORDER + 1];
    memcpy(window, p->readings, ORDER * sizeof *window);
    p->nodes[0] = window[0];
    for (int number = 1; number < NODES; ++number) {
        shift(window, within(product(p->weights, window), -p->strongest, p->strongest));
        p->nodes[number] = window[0];
    }
}

/* The forecast at a time after the present, straight between its nodes. */
static $real at(const ${name}_plan *p, $real time)
{
    const $real intervals = time / $hold;
    const int before = intervals < NODES - 1 ? (int)intervals : NODES - 1;
    const int after = before < NODES - 1 ? before + 1 : NODES - 1;
    return $fma(p->nodes[after] - p->nodes[before], intervals - ($real)before, p->nodes[before]);
}

/* Commands of an earlier sample; those of the first for samples before it. */
static const $real *sent_at(const ${name}_plan *p, int sample, int earlier)
{
    return p->sent[sample > earlier ? (sample - earlier) % DEPTH : 0];
}

/* Brings the dampers from the sample before to this one. */
static void drive(${name}_memory *m, const ${name}_plan *p)
{
    const $real whole = $before_length + $after_length;
    for (int part = LATE ? 0 : 1; part < 2; ++part) {
        const $real step = part ? $after_step : $before_step;
        for (int number = 0; number < (part ? $after_steps : $before_steps); ++number) {
            const $real start = (part ? $before_length : $zero) + step * ($real)number;
            const $real share[3] = {start / whole, (start + $half * step) / whole, (start + step) / whole};
            if (part)
                drive_$drive_after(m, sent_at(p, p->number - 1, DELAY), share);
            else
                drive_$drive_before(m, sent_at(p, p->number - 1, DELAY + 1), share);
        }
    }
}

/* The model at the instant when a command acts; x[0] is its present. */
static const ${name}_moment *foresee(const ${name}_memory *m, ${name}_moment *x)
{
    const ${name}_plan *p = &m->plan;
    $real time = $zero, found[4];
    int turn = 0;
    for (int piece = LATE ? 0 : 1; p->number > 0 && piece <= DELAY; ++piece) {
        const $real *command = sent_at(p, p->number + piece, DELAY + 1);
        const $real step = piece ? $sample_step : $on_way_step;
        for (int number = 0; number < (piece ? $sample_steps : $on_way_steps); ++number, turn = !turn) {
            const $real ground[3] = {at(p, time), at(p, $fma(step, $half, time)), at(p, time + step)};
            time += step;
            if (piece)
                move_$move_sample(m, &x[turn], &x[!turn], command, ground, found);
            else
                move_$move_on_way(m, &x[turn], &x[!turn], command, ground, found);
        }
    }
    return &x[turn];
}

/* Tries every command, and holds the one of least cost; the base where none costs less. */
static void choose(${name}_memory *m, const ${name}_parameters *gains, const ${name}_moment *start)
{
    ${name}_plan *p = &m->plan;
    $real first[N_ALL], tail[N_ALL], least = $zero;
    for (int place = 0; place < 2 * HORIZON + 1; ++place)
        p->shaking[place] = at(p, $fma($half * $model_step, ($real)place, $delay_time));
    for (int trial = 0; trial < TRIALS; ++trial) {
        ${name}_moment x[2];
        $real now[4], found[4] = {$zero, $zero, p->peaks[0], p->peaks[1]};
        x[0] = *start;
        candidate(gains, trial, first, tail);
        /* The last step is not gone: its start is the horizon. */
        for (int step = 0; step <= HORIZON; ++step) {
            move_$move_trial(m, &x[step % 2], &x[(step + 1) % 2], step < HOLD ? first : tail, p->shaking + 2 * step, now);
            for (int kind = 0; step > 0 && kind < 2; ++kind) {
                found[kind] = found[kind] + now[kind];
                found[2 + kind] = mr_max(now[2 + kind], found[2 + kind]);
            }
        }
        const $real cost = price(m, gains, &x[HORIZON % 2], found);
        if (trial == 0 || cost < least) {
            least = cost;
            memcpy(p->held, first, sizeof first);
        }
    }
}

/* Commands of the law, before their range and the limit of their rate. */
static void plan(${name}_memory *m, const ${name}_parameters *gains, const ${name}_input *in)
{
    ${name}_plan *p = &m->plan;
    take(m, in);
    if (p->number == 0) {
        $real tail[N_ALL];
        candidate(gains, 0, p->held, tail);
        settle(m, p->held);
        for (int entry = 0; entry < 2 * $max_loops; ++entry)
            p->strengths[entry] = $one;
        for (int row = 0; row < ORDER; ++row)
            p->covariance[row][row] = $covariance;
    } else {
        memcpy(p->sent[(p->number - 1) % DEPTH], m->sent, sizeof m->sent);
        if (p->number == 1)
            settle(m, m->sent);
        drive(m, p);
    }
    follow(m, in);
    if (p->number == 0)
        memset(p->now.loops, 0, sizeof p->now.loops);
    compare(m, gains, in);
    if (p->number % DECISION == 0) {
        ${name}_moment x[2];
        if (ORDER > 0) {
            learn(p);
            predict(p);
        }
        x[0] = p->now;
        choose(m, gains, foresee(m, x));
    }
    for (int device = 0; device < N_COMMANDED; ++device)
        m->law[device] = p->held[device] + p->doubt;
    /* A whole number of decisions and turns of the ring. */
    if (++p->number == 2 * DECISION * DEPTH)
        p->number = DECISION * DEPTH;
}

