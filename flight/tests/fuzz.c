/*
 * A fuzzer of all public functions, for libFuzzer or AFL, or with random inputs of its own:
 *
 *   clang -g -O1 -fsanitize=fuzzer,address,undefined -Iinclude src/[a-z]*.c tests/fuzz.c -lm -o fuzz && ./fuzz -max_total_time=600
 *   gcc -O2 -DCASES=1000000 -Iinclude src/[a-z]*.c tests/fuzz.c -lm -o fuzz && ./fuzz
 *
 * Each input becomes arcs, zones and a table whose numbers are sensible, extreme, infinite or nan.  The claims: a
 * call that returns CFF_BAD_INPUT leaves its outputs unchanged, no call spends more than its budget and one step,
 * what is certified grows, an answer is finite, and a table with a number that is not finite is refused.  The digest
 * is that of all answers, for mutants.py.
 */
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "closeform_flight.h"

#define ONE_STEP 1200U /* evaluations that a call may spend beyond its budget: the step that it is in */

static const uint8_t *bytes;
static size_t left;
static unsigned long calls[7], good[7], most; /* of motion, conflicts, approaches, avoidance, losses, locks, impulses */
static uint64_t digest = 1469598103934665603U;

static uint32_t byte(void)
{
    if (left == 0U) {
        return 0U;
    }
    left--;
    return *bytes++;
}

/* A number of about a size; one in 256 is anything. */
static double number(double size)
{
    static const double odd[] = {NAN, INFINITY, -INFINITY, 0.0, -0.0, 1e-320, 1e300, -1e60, 1e61, 1e-150, 1.0, -1.0};
    const uint32_t kind = byte();
    if (kind < 1U) {
        return odd[byte() % (sizeof odd / sizeof odd[0])];
    }
    const double value = ((double)((byte() << 8) + byte()) / 32768.0) - 1.0;
    return (kind < 2U) ? value * 1e12 * size : ((kind < 6U) ? value * 1e-12 * size : value * size);
}

static void numbers(double *out, int count, double size)
{
    for (int k = 0; k < count; k++) {
        out[k] = number(size);
    }
}

static void claim(int holds, const char *what)
{
    if (!holds) {
        fprintf(stderr, "%s\n", what);
        abort();
    }
}

static int same(const void *a, const void *b, size_t size) { return memcmp(a, b, size) == 0; }

static void note(const void *answer, size_t size)
{
    for (size_t k = 0; k < size; k++) {
        digest = (digest ^ ((const uint8_t *)answer)[k]) * 1099511628211U;
    }
}

static void tally(int which, cff_status_t status, uint32_t used, uint32_t budget)
{
    note(&status, sizeof status);
    note(&used, sizeof used);
    calls[which]++;
    good[which] += (status >= 0);
    claim(used <= budget, "spent more than the budget");
    most = (used > most) ? used : most;
}

/* A table of two windows as it is uploaded: five numbers, then the arrays. */
#define LENGTH (5U + 3U + 2160U + 180U + 30U + 1296U + 18U)
static double block[LENGTH];
static double *const joints = &block[5], *const table_rows = &block[8], *const table_steps = &block[2168],
                     *const table_errors = &block[2348], *const table_returns = &block[2378], *const return_errors = &block[3674];

/* Upload a table like that of deep space, with numbers of the fuzzer's; whether it is taken. */
static int fill_table(cff_table_t *table)
{
    for (int k = 0; k < 2; k++) {
        for (int j = 0; j < 15; j++) {
            for (int i = 0; i < 6; i++) {
                for (int b = 0; b < 12; b++) {
                    const double u = b / 11.0;
                    double value = (i == j) ? 1.0 : 0.0;
                    value += ((j < 6) && (j == i + 3)) ? u : 0.0;
                    value += (j >= 6) ? 0.1 * ((i + j) % 3) * u : 0.0;
                    table_rows[((k * 15 + j) * 6 + i) * 12 + b] = value;
                    if (j >= 6) {
                        table_returns[((k * 9 + j - 6) * 6 + i) * 12 + b] = value * u;
                    }
                }
                table_steps[k * 90 + i * 15 + j] = table_rows[((k * 15 + j) * 6 + i) * 12 + 11];
            }
        }
    }
    for (int k = 0; k < 4; k++) {
        const uint32_t at = byte();
        table_rows[(at * 256 + byte()) % (2 * 15 * 72)] = number(10.0);
        table_steps[byte() % 180] = number(2.0);
    }
    joints[0] = number(1.0);
    joints[1] = joints[0] + fabs(number(1.0));
    joints[2] = joints[1] + fabs(number(1.0));
    numbers(table_errors, 30, (byte() & 1U) ? 1e-12 : 1e-3);
    numbers(return_errors, 18, (byte() & 1U) ? 1e-12 : 1e-3);
    block[0] = fabs(number(1e-2));
    block[1] = fabs(number(0.9));
    block[2] = number(3.0);
    block[3] = (byte() & 3U) ? joints[2] - joints[0] : 0.0;
    block[4] = (byte() & 63U) ? 2.0 : number(5000.0);
    double *const arrays[6] = {joints, table_rows, table_steps, table_errors, table_returns, return_errors};
    static const uint32_t lengths[6] = {3U, 2160U, 180U, 30U, 1296U, 18U};
    const uint32_t which = byte();
    const int poisoned = which < 6U; /* one number of one array, the last as often as any */
    if (poisoned) {
        const uint32_t at = (byte() & 1U) ? lengths[which] - 1U : (byte() * 256U + byte()) % lengths[which];
        arrays[which][at] = (byte() & 1U) ? NAN : INFINITY;
    }
    const uint32_t count = (byte() & 63U) ? LENGTH : byte() * 20U % LENGTH;
    memset(table, 7, sizeof *table);
    const cff_table_t before = *table;
    const int good = cff_uploaded_table(block, count, table) == CFF_OK;
    claim(good ? !poisoned && block[4] == 2.0 && count == LENGTH : same(table, &before, sizeof before), "cff_uploaded_table took a bad table or wrote");
    table->returns = (byte() & 7U) ? table->returns : NULL;
    return good;
}

/* The time at which a window begins. */
static double time_of(const cff_table_t *chief, uint32_t joint)
{
    const double s = joints[joint];
    return (s - chief->eccentricity * sin(s) - chief->phase_rad) / chief->rate_rad_s;
}

static void fill_arcs(cff_arc_t arcs[], uint32_t count, const cff_table_t *chief)
{
    double t = number(100.0);
    const double n = (byte() & 3U) ? fabs(number(2e-3)) : 0.0;
    memset(arcs, 0, count * sizeof arcs[0]);
    for (uint32_t k = 0U; k < count; k++) {
        cff_arc_t *arc = &arcs[k];
        const uint32_t kind = byte();
        arc->start_s = t;
        arc->end_s = t + fabs(number(chief ? ((byte() & 15U) ? 100.0 : 1e6) : 5000.0)); /* some last too many windows */
        if (chief && !(byte() & 7U) && (time_of(chief, 1U) > t)) {
            arc->end_s = time_of(chief, 1U);
        }
        arc->mean_motion_rad_s = n;
        numbers(arc->state.position_m, 3, 100.0);
        numbers(arc->state.velocity_m_s, 3, 0.2);
        if (kind & 1U) {
            numbers(arc->thrust_m_s2, 6, 1e-4);
        }
        if (kind & 2U) {
            numbers(arc->push_m_s2, 3, 1e-4);
        }
        if ((kind & 4U) && !chief) {
            numbers(arc->push_rate_m_s3, 9, 1e-7);
        }
        if ((k > 0U) && (kind & 120U)) { /* joined to the one before */
            const cff_path_t before = {&arcs[k - 1U], 1U, chief};
            (void)cff_state_at(&before, t, &arc->state);
        }
        t = arc->end_s;
    }
}

/* A coast that stays 10 m from the chief, or nearly: it slides along a sphere. */
static void slide(cff_arc_t *arc, cff_arc_t *chief, cff_zone_t *zone)
{
    const double n = arc->mean_motion_rad_s, off = (byte() & 1U) ? 1.0 : 1.0 + number(1e-12);
    const double circle[6] = {5.0 * off, 0.0, 8.660254037844386 * off, 0.0, -10.0 * n * off, 0.0};
    memset(arc->state.position_m, 0, sizeof *arc - offsetof(cff_arc_t, state));
    memset(chief->state.position_m, 0, sizeof *chief - offsetof(cff_arc_t, state));
    memcpy(arc->state.position_m, circle, sizeof circle);
    memset(zone, 0, sizeof *zone);
    for (int i = 0; i < 3; i++) {
        zone->to_unit_per_m[i][i] = 0.1;
    }
}

static void fill_zone(cff_zone_t *zone)
{
    memset(zone, 0, sizeof *zone);
    zone->shape = (cff_shape_t)(byte() % 3U);
    for (int i = 0; i < 3; i++) {
        zone->to_unit_per_m[i][i] = 0.05;
        zone->to_unit_per_m[i][byte() % 3U] = number(0.1);
    }
}

static void try_motion(const cff_path_t *path)
{
    cff_state_t a, b, before;
    cff_arc_t arc, kept;
    double energy = 0.5;
    memset(&arc, 7, sizeof arc);
    numbers(a.position_m, 3, 100.0);
    numbers(a.velocity_m_s, 3, 0.2);
    memset(&b, 7, sizeof b);
    before = b;
    cff_status_t status = cff_state_at(path, number(1000.0), &b);
    claim(status != CFF_BAD_INPUT || same(&b, &before, sizeof b), "cff_state_at wrote");
    note(&b, sizeof b);
    before = b;
    status = cff_coast(fabs(number(2e-3)), number(1e4), &a, &b);
    claim(status != CFF_BAD_INPUT || same(&b, &before, sizeof b), "cff_coast wrote");
    note(&b, sizeof b);
    kept = arc;
    status = path->chief ? cff_transfer_beside(path->chief, number(10.0), number(100.0), &a, &b, &arc)
                         : cff_transfer(fabs(number(2e-3)), number(10.0), number(3000.0), &a, &b, &arc);
    claim(status == CFF_OK || same(&arc, &kept, sizeof arc), "cff_transfer wrote");
    note(&arc, sizeof arc);
    double thrust[3] = {0.5, 0.5, 0.5};
    status = cff_thrust_at(path, number(1000.0), thrust);
    claim(status != CFF_BAD_INPUT || thrust[0] == 0.5, "cff_thrust_at wrote");
    note(thrust, sizeof thrust);
    status = cff_energy(path, &energy);
    claim(status != CFF_BAD_INPUT || energy == 0.5, "cff_energy wrote");
    note(&energy, sizeof energy);
    tally(0, status, 0U, 0U);
}

static void try_conflicts(const cff_path_t *one, const cff_path_t *other, const cff_zone_t *zone, uint32_t budget)
{
    cff_conflict_search_t search, kept;
    cff_conflict_t conflicts[3];
    cff_approach_t near, before;
    uint32_t count = 0U;
    memset(&search, 7, sizeof search);
    kept = search;
    cff_status_t status = cff_conflicts_begin(&search, one, other, zone);
    claim(status != CFF_BAD_INPUT || same(&search, &kept, sizeof search), "cff_conflicts_begin wrote");
    double from = 0.0;
    if (status == CFF_OK) {
        from = search.certified_until_s;
        for (int k = 0; (k < 20) && !search.finished; k++) {
            const uint32_t used = search.evaluations_used;
            const double until = search.certified_until_s;
            status = cff_conflicts_continue(&search, budget, conflicts, 3U, &count);
            tally(1, status, search.evaluations_used - used, budget + ONE_STEP);
            claim(status == CFF_BAD_INPUT || search.certified_until_s >= until, "conflicts went back");
            note(&search.certified_until_s, sizeof until);
            note(conflicts, count * sizeof conflicts[0]);
            count = (status == CFF_FULL) ? 0U : count;
        }
    }
    memset(&near, 7, sizeof near);
    before = near;
    status = cff_closest_approach(one, other, zone, (byte() & 7U) ? from : number(100.0), (byte() & 7U) ? search.end_s : number(5000.0),
                                  budget, &near);
    claim(status != CFF_BAD_INPUT || same(&near, &before, sizeof near), "cff_closest_approach wrote");
    if (status >= 0 && status != CFF_NO_COMMON_TIME) {
        tally(2, status, near.evaluations_used, budget + ONE_STEP);
        note(&near.time_s, 3U * sizeof(double));
    }
}

static void try_avoid(const cff_path_t *one, const cff_path_t *other, cff_zone_t *zone, uint32_t budget)
{
    static cff_avoid_work_t work;
    static cff_avoidance_t found, kept;
    const cff_path_t obstacles[2] = {*other, *other};
    const cff_zone_t zones[2] = {*zone, *zone};
    memset(&found, 7, sizeof found);
    kept = found;
    const cff_status_t status = cff_avoid(one->arcs, obstacles, zones, 1U + (byte() & 1U), budget, &work, &found);
    claim(status != CFF_BAD_INPUT || same(&found, &kept, sizeof found), "cff_avoid wrote");
    if (status >= 0) {
        tally(3, status, found.evaluations_used, budget + ONE_STEP);
        note(&found.energy_m2_s3, sizeof(double));
        claim(isfinite(found.energy_m2_s3), "energy");
    }
}

static void try_loss(cff_path_t *one, cff_path_t *other, cff_arc_t its_arcs[], const cff_zone_t *zone, uint32_t budget)
{
    cff_drift_t found, kept;
    memset(&found, 7, sizeof found);
    double from = (byte() & 15U) ? one->arcs[0].start_s : number(100.0);
    if (byte() & 15U) { /* the other path lasts longer */
        other->count = 1U;
        its_arcs[0].start_s = from;
        its_arcs[0].end_s = one->arcs[one->count - 1U].end_s + fabs(number(100.0));
    }
    const double until = (byte() & 15U) ? other->arcs[other->count - 1U].end_s : number(100.0);
    cff_status_t status = CFF_MORE;
    for (int k = 0; (k < 3) && (status == CFF_MORE); k++) {
        kept = found;
        status = cff_loss_of_thrust(one, other, zone, from, until, budget, &found);
        claim(status != CFF_BAD_INPUT || same(&found, &kept, sizeof found), "cff_loss_of_thrust wrote");
        tally(4, status, (status == CFF_OK || status == CFF_MORE) ? found.evaluations_used : 0U, budget + ONE_STEP);
        if (status == CFF_OK || status == CFF_MORE) {
            claim(found.certified_until_s >= from, "went back");
            note(&found.verdict, sizeof found.verdict);
            note(&found.failure_s, 3U * sizeof(double));
            budget *= (found.certified_until_s == from) ? 2U : 1U;
            from = found.certified_until_s;
        }
    }
}

/* The bound grows and stays below the delta-v. */
static void try_impulses(const cff_table_t *chief, uint32_t budget)
{
    static cff_impulses_t plan, kept;
    cff_state_t ends[2];
    double bound = 0.0;
    numbers(ends[0].position_m, 12, 100.0);
    memset(&plan, 7, sizeof plan);
    kept = plan;
    cff_status_t status = cff_impulses_begin(&plan, chief, (byte() & 3U) ? fabs(number(2e-3)) : 0.0, number(100.0),
                                             number(chief ? 100.0 : 5000.0), &ends[0], &ends[1]);
    claim(status != CFF_BAD_INPUT || same(&plan, &kept, sizeof plan), "cff_impulses_begin wrote");
    tally(6, status, 0U, 0U);
    status = (status == CFF_OK) ? CFF_MORE : status;
    for (int k = 0; (k < 4) && (status == CFF_MORE); k++) {
        const uint32_t used = plan.evaluations_used;
        status = cff_impulses_continue(&plan, budget);
        if (status != CFF_BAD_INPUT) {
            tally(6, status, plan.evaluations_used - used, budget + ONE_STEP);
            claim(plan.lower_bound_m_s >= bound, "a bound went back");
            /* the fuzzer's tables are of no motion */
            claim(chief || !(plan.lower_bound_m_s > plan.delta_v_m_s * (1.0 + 1e-6)), "a bound is above the plan");
            note(&plan.delta_v_m_s, 2U * sizeof(double));
            bound = plan.lower_bound_m_s;
        }
    }
}

static void try_fleet(const cff_path_t *one, const cff_path_t *other, const cff_zone_t *zone, uint32_t budget)
{
    static cff_conflict_search_t searches[2];
    cff_fleet_conflict_t conflicts[2];
    uint32_t count = 0U;
    double until = 0.0;
    if ((cff_conflicts_begin(&searches[0], one, other, zone) == CFF_OK) && (cff_conflicts_begin(&searches[1], other, one, zone) == CFF_OK)) {
        cff_status_t status = CFF_MORE;
        for (int k = 0; (k < 20) && ((status == CFF_MORE) || (status == CFF_FULL)); k++) {
            const uint32_t used = searches[0].evaluations_used + searches[1].evaluations_used;
            status = cff_fleet_continue(searches, 2U, budget, conflicts, 2U, &count, &until);
            tally(1, status, searches[0].evaluations_used + searches[1].evaluations_used - used, budget + ONE_STEP);
            note(&until, sizeof until);
            count = (status == CFF_FULL) ? 0U : count;
        }
    }
}

static void try_search(uint32_t budget)
{
    cff_schedule_t schedule = {fabs(number(1.6)), fabs(number(0.01)), fabs(number(1.5)), number(10.0), fabs(number(0.5)), byte() % 8U, (byte() & 1U) != 0U};
    const cff_sensor_t sensor = {fabs(number(3.0)), fabs(number(10.0)), (byte() & 1U) ? CFF_LARGEST : fabs(number(500.0))};
    cff_leg_t legs[CFF_MOST_LEGS];
    cff_attitude_t attitude;
    cff_state_t relative;
    cff_lock_t lock, kept;
    cff_gathering_t gathering;
    cff_join_t join;
    double velocities[CFF_MOST_CRAFT][3];
    uint32_t count = 0U;
    schedule.half_angle_rad = (byte() & 1U) ? sensor.half_angle_rad : schedule.half_angle_rad;
    const uint32_t capacity = (byte() & 15U) ? CFF_MOST_LEGS : byte() % 20U;
    const cff_status_t made = (byte() & 1U) ? cff_modified_search(&schedule, legs, capacity, &count)
                                            : cff_basic_search(&schedule, legs, capacity, &count);
    numbers(relative.position_m, 3, 300.0);
    numbers(relative.velocity_m_s, 3, 0.2);
    if (made == CFF_OK) {
        memset(&lock, 7, sizeof lock);
        kept = lock;
        for (int k = byte() % 8; k > 0; k--) {
            legs[byte() % count].axis[byte() % 3U] = number(1.0);
        }
        memset(&attitude, 7, sizeof attitude);
        (void)cff_attitude_at(legs, count, number(10000.0), (cff_group_t)(byte() & 1U), &attitude);
        note(&attitude, sizeof attitude);
        budget = (byte() & 1U) ? budget : budget % 8U; /* a pair takes ten evaluations */
        const double from = fabs(number(100.0));
        const cff_status_t status = cff_first_lock(legs, count, &sensor, &relative, from, budget, &lock);
        claim(status != CFF_BAD_INPUT || same(&lock, &kept, sizeof lock), "cff_first_lock wrote");
        claim(status < 0 || lock.certified_until_s >= from, "a lock went back");
        tally(5, status, (status >= 0) ? lock.evaluations_used : 0U, budget);
        note(&lock.time_s, sizeof(double));
    }
    numbers(&velocities[0][0], 3 * CFF_MOST_CRAFT, 0.1);
    double t = 0.0;
    const uint32_t craft = (byte() & 1U) ? byte() % 8U : byte();
    const uint32_t burn = byte() % 4U;
    const int begun = cff_gathering_begin(&gathering, craft, (cff_first_burn_t)burn) == CFF_OK;
    claim(begun == (craft >= 2U && craft <= CFF_MOST_CRAFT && burn < 3U), "cff_gathering_begin");
    for (int k = 0; begun && (k < 12); k++) {
        memset(&join, 7, sizeof join);
        const cff_join_t before = join;
        t += fabs(number(10.0)) - 1.0;
        const cff_status_t status = cff_gathering_lock(&gathering, t, byte() % 8U, byte() % 8U, velocities, &join);
        claim(status != CFF_BAD_INPUT || same(&join, &before, sizeof join), "cff_gathering_lock wrote");
        note(&status, sizeof status);
        note(join.joins, sizeof join.joins);
        note(join.delta_v_m_s, sizeof join.delta_v_m_s);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    cff_table_t table;
    cff_arc_t arcs[2][3];
    cff_zone_t zone;
    bytes = data;
    left = size;
    const uint32_t what = byte();
    const uint32_t budget = (byte() & 15U) ? 64U + byte() * 16U : byte();
    const uint32_t kind = (what >> 2) & 7U;
    int good_table = fill_table(&table);
    note(&good_table, sizeof good_table);
    static cff_circle_t room;
    if (!good_table && (byte() & 1U)) {
        good_table = cff_circular_table((byte() & 3U) ? fabs(number(2e-3)) : 0.0, number(1000.0), &room, &table) == CFF_OK;
        claim(!good_table || cff_check_table(&table) == CFF_OK, "the table of a circle");
        note(&good_table, sizeof good_table);
    }
    const cff_table_t *chief = (good_table && ((what & 3U) == 0U || kind > 5U)) ? &table : NULL;
    fill_arcs(arcs[0], 3U, chief);
    fill_arcs(arcs[1], 3U, chief);
    if (byte() & 7U) {
        for (int k = 0; k < 3; k++) {
            arcs[1][k].mean_motion_rad_s = arcs[0][0].mean_motion_rad_s;
        }
    }
    fill_zone(&zone);
    cff_path_t one = {arcs[0], (byte() & 31U) ? 1U + byte() % 3U : byte() % 4U, chief};
    cff_path_t other = {arcs[1], (byte() & 31U) ? 1U + byte() % 3U : byte() % 4U, chief};
    if (!chief && !(byte() & 15U)) {
        slide(&arcs[0][0], &arcs[1][0], &zone);
    }
    if (kind == 0U && (byte() & 1U)) {
        try_impulses(chief, budget);
    } else if (kind == 0U) {
        try_motion(&one);
    } else if (kind == 1U) {
        try_fleet(&one, &other, &zone, budget);
    } else if (kind == 2U) {
        try_search(budget);
    } else if (kind < 4U) {
        try_conflicts(&one, &other, &zone, budget);
    } else if (kind < 6U) {
        zone.shape = (byte() & 31U) ? CFF_ELLIPSOID : zone.shape;
        const cff_path_t direct = {arcs[0], 1U, chief};
        const cff_path_t obstacle = {arcs[1], 1U, chief};
        memset(arcs[0][0].push_m_s2, 0, 12 * sizeof(double));
        try_avoid(&direct, &obstacle, &zone, budget * 8U);
    } else if (one.count > 0U && other.count > 0U) {
        try_loss(&one, &other, arcs[1], &zone, budget);
    }
    return 0;
}

#ifdef CASES
int main(int argc, char **argv)
{
    static uint8_t data[1024];
    uint64_t seed = (argc > 1) ? strtoull(argv[1], NULL, 10) : 1U;
    for (long k = 0; k < CASES; k++) {
        for (size_t i = 0; i < sizeof data; i++) { /* xorshift */
            seed ^= seed << 13;
            seed ^= seed >> 7;
            seed ^= seed << 17;
            data[i] = (uint8_t)(seed >> 32);
        }
        (void)LLVMFuzzerTestOneInput(data, sizeof data);
    }
    printf("%ld inputs; accepted calls of all: motion %lu of %lu, conflicts %lu of %lu, approaches %lu of %lu, avoidance %lu of %lu, "
           "loss of thrust %lu of %lu, locks %lu of %lu, impulses %lu of %lu; most evaluations of a call %lu; digest %016llx\n",
           (long)CASES, good[0], calls[0], good[1], calls[1], good[2], calls[2], good[3], calls[3], good[4], calls[4], good[5],
           calls[5], good[6], calls[6], most, (unsigned long long)digest);
    return 0;
}
#endif
