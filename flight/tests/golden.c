/*
 * Replays the golden vectors of the Python package; the exit status is 0 if all agree.
 *
 * Counts, sets and legs must be equal; times agree to 1e-8 s, lengths to 1e-9 of the size of the motion, ratios
 * to 1e-9.  The digest is that of the bits of all answers: with the library's own sine it is the same on every
 * machine with IEEE doubles.
 *
 * With -DDIGEST=n another digest is a failure.  With -DCFF_FREESTANDING it needs no library and prints nothing (see
 * start_*.c).  To count instructions, the work is repeated -DREPEAT=n times, and -DWORK=k leaves one kind of it:
 * 1 conflicts, 2 closest approaches, 3 transfers, 4 locks, 5 avoidances, 6 losses of thrust, 7 plans of impulses;
 * -DTABLE=0 leaves Hill's equations, 1 tables of chiefs.
 */
#include "golden_vectors.h"

#ifndef CFF_FREESTANDING
#include <stdio.h>
#endif
#ifndef REPEAT
#define REPEAT 1
#endif
#ifndef WORK
#define WORK 0
#endif
#ifndef TABLE
#define TABLE 2
#endif
#define BUDGET 100000U
#define AVOID_BUDGET 4000000U
#define LOSS_BUDGET 10000000U
#define CRAFT 8U
#define ROOM 8U

typedef struct {
    double time_s;
    double ratio;
    double length;
    double energy;
    double attitude;
    double delta_v;
    double bound; /* of a plan of impulses over the minimum, relative; and its cost */
    double cost;
} worst_t;

static worst_t worst;
static unsigned long used[8]; /* evaluations of each kind of work */
static uint64_t digest = 1469598103934665603U;

static void note(double x)
{
    union {
        double number;
        uint64_t bits;
    } same;
    same.number = x;
    digest = (digest ^ same.bits) * 1099511628211U;
}

static double size(double x) { return (x < 0.0) ? -x : x; }

/* Note an answer, and keep its largest difference; a nan counts as the largest. */
static void compare(double *largest, double answer, double expected, double unit)
{
    const double off = size(answer - expected) / unit;
    note(answer);
    if (!(off <= *largest)) {
        *largest = off;
    }
}

static cff_zone_t zone_of(cff_shape_t shape, const double matrix[9])
{
    cff_zone_t zone;
    zone.shape = shape;
    for (int i = 0; i < 9; i++) {
        zone.to_unit_per_m[i / 3][i % 3] = matrix[i];
    }
    return zone;
}

static cff_path_t path_of(int orbit, const double arcs[][30], unsigned count)
{
    const cff_path_t path = {(const cff_arc_t *)(const void *)arcs, count, golden_orbits[orbit].chief};
    return path;
}

static int conflicts(const golden_pair_t *pair)
{
    const cff_path_t one = path_of(pair->orbit, pair->one, pair->one_count);
    const cff_path_t other = path_of(pair->orbit, pair->other, pair->other_count);
    const cff_zone_t zone = zone_of(pair->shape, pair->matrix);
    cff_conflict_search_t search;
    cff_conflict_t found[ROOM];
    uint32_t count = 0U;
    int bad = (cff_conflicts_begin(&search, &one, &other, &zone) != CFF_OK);
    bad += (cff_conflicts_continue(&search, BUDGET, found, ROOM, &count) != CFF_OK) || (count != pair->conflicts);
    for (uint32_t k = 0U; (k < count) && (k < pair->conflicts); k++) {
        compare(&worst.time_s, found[k].start_s, pair->conflict[k][0], 1.0);
        compare(&worst.time_s, found[k].end_s, pair->conflict[k][1], 1.0);
    }
    used[1] += search.evaluations_used;
    return bad;
}

static int approach(const golden_pair_t *pair)
{
    const cff_path_t one = path_of(pair->orbit, pair->one, pair->one_count);
    const cff_path_t other = path_of(pair->orbit, pair->other, pair->other_count);
    const cff_zone_t zone = zone_of(pair->shape, pair->matrix);
    const double end = one.arcs[one.count - 1U].end_s;
    const double other_end = other.arcs[other.count - 1U].end_s;
    cff_approach_t near;
    const int bad = cff_closest_approach(&one, &other, &zone, other.arcs[0].start_s, (end < other_end) ? end : other_end,
                                         BUDGET, &near) != CFF_OK;
    compare(&worst.ratio, near.ratio, pair->ratio, 1.0);
    used[2] += near.evaluations_used;
    return bad;
}

static void compare_states(const cff_state_t *state, const double expected[6], double duration, double length)
{
    for (int i = 0; i < 3; i++) {
        compare(&worst.length, state->position_m[i], expected[i], length);
        compare(&worst.length, state->velocity_m_s[i] * duration, expected[3 + i] * duration, length);
    }
}

static int transfer(const golden_transfer_t *given)
{
    const golden_orbit_t *orbit = &golden_orbits[given->orbit];
    const cff_state_t *initial = (const cff_state_t *)(const void *)given->initial;
    const cff_state_t *final = (const cff_state_t *)(const void *)given->final;
    const double s = given->start, d = given->duration;
    double energy = 0.0, length = 0.0;
    cff_arc_t arc, drift;
    cff_state_t middle, later;
    const cff_path_t path = {&arc, 1U, orbit->chief};
    const cff_path_t coast = {&drift, 1U, orbit->chief};
    int bad = 0;
    if (orbit->chief == NULL) {
        bad += cff_transfer(orbit->mean_motion, s, d, initial, final, &arc) != CFF_OK;
        bad += cff_drift(orbit->mean_motion, s, d, initial, &drift) != CFF_OK;
    } else {
        bad += cff_transfer_beside(orbit->chief, s, d, initial, final, &arc) != CFF_OK;
        bad += cff_drift_beside(orbit->chief, s, d, initial, &drift) != CFF_OK;
    }
    bad += (cff_state_at(&path, s + (0.5 * d), &middle) != CFF_OK) + (cff_energy(&path, &energy) != CFF_OK);
    bad += cff_state_at(&coast, s + d, &later) != CFF_OK;
    for (int i = 0; i < 3; i++) {
        length += size(given->initial[i]) + size(given->final[i]) + size(given->coasted[i]);
    }
    compare_states(&middle, given->middle, d, length);
    compare_states(&later, given->coasted, d, length);
    compare(&worst.energy, energy, given->energy, given->energy);
    return bad;
}

/* The path costs what that of the package costs, but for a side that only one of them tries; none costs less than the bound. */
static int avoided(const golden_avoid_t *given, int *dearer)
{
    static cff_avoid_work_t work;
    static cff_avoidance_t found;
    cff_path_t obstacles[2];
    cff_zone_t zones[2];
    for (unsigned k = 0U; k < given->obstacles; k++) {
        obstacles[k] = path_of(given->orbit, &given->obstacle[k], 1U);
        zones[k] = zone_of(CFF_ELLIPSOID, given->matrix);
    }
    int bad = cff_avoid((const cff_arc_t *)(const void *)given->direct, obstacles, zones, given->obstacles, AVOID_BUDGET, &work,
                        &found) != CFF_OK;
    bad += found.energy_m2_s3 < (given->bound * (1.0 - 1e-6));
    *dearer += found.energy_m2_s3 > (given->energy * (1.0 + 1e-6));
    note(found.energy_m2_s3);
    used[5] += found.evaluations_used;
    return bad;
}

/* The same path is refused if an obstacle is where it begins. */
static int begins_inside(const golden_avoid_t *given)
{
    static cff_avoid_work_t work;
    static cff_avoidance_t found;
    cff_arc_t drift;
    const cff_arc_t *direct = (const cff_arc_t *)(const void *)given->direct;
    const cff_path_t obstacle = {&drift, 1U, golden_orbits[given->orbit].chief};
    const cff_zone_t zone = zone_of(CFF_ELLIPSOID, given->matrix);
    drift = *direct;
    drift.state.velocity_m_s[0] += 1.0;
    for (int i = 0; i < 3; i++) {
        drift.thrust_m_s2[i] = 0.0;
        drift.thrust_rate_m_s3[i] = 0.0;
    }
    return cff_avoid(direct, &obstacle, &zone, 1U, AVOID_BUDGET, &work, &found) != CFF_END_INSIDE;
}

/* A plan of impulses, in slices of the budget; its bound is below the minimum and its cost above, both closely. */
static int pushed(const golden_impulses_t *given)
{
    static cff_impulses_t plan;
    const golden_orbit_t *orbit = &golden_orbits[given->orbit];
    cff_status_t status = cff_impulses_begin(&plan, orbit->chief, orbit->mean_motion, given->start, given->duration,
                                             (const cff_state_t *)(const void *)given->initial,
                                             (const cff_state_t *)(const void *)given->final);
    int bad = (status != CFF_OK);
    for (int k = 0; (k < 1000) && (bad == 0); k++) {
        status = cff_impulses_continue(&plan, 1000U);
        if (status != CFF_MORE) {
            break;
        }
    }
    bad += (status != CFF_OK);
    compare(&worst.bound, plan.lower_bound_m_s, given->least, given->least);
    compare(&worst.cost, plan.delta_v_m_s, given->least, given->least);
    used[7] += plan.evaluations_used;
    return bad;
}

static int lost_thrust(const golden_loss_t *given)
{
    static cff_circle_t room;
    const double n = golden_orbits[given->orbit].mean_motion;
    cff_path_t path = path_of(given->orbit, &given->path, 1U);
    cff_path_t other = path_of(given->orbit, &given->other, 1U);
    const cff_zone_t zone = zone_of(given->shape, given->matrix);
    cff_table_t circle;
    cff_drift_t found;
    int bad = 0;
    if (path.chief == NULL) { /* a circular orbit or deep space */
        bad += cff_circular_table(n, (n > 0.0) ? (0.78 / n) : given->until, &room, &circle) != CFF_OK;
        path.chief = &circle;
        other.chief = &circle;
    }
    bad += cff_loss_of_thrust(&path, &other, &zone, path.arcs[0].start_s, given->until, LOSS_BUDGET, &found) != CFF_OK;
    bad += ((found.verdict == CFF_SAFE) != (given->safe != 0));
    note(found.failure_s);
    used[6] += found.evaluations_used;
    return bad;
}

static int legs_of(const golden_search_t *given, cff_leg_t legs[CFF_MOST_LEGS])
{
    uint32_t count = 0U;
    cff_attitude_t middle;
    int bad = (given->basic ? cff_basic_search : cff_modified_search)(&given->schedule, legs, CFF_MOST_LEGS, &count) != CFF_OK;
    bad += (count != given->legs) || (cff_attitude_at(legs, count, 0.5 * given->end, CFF_GROUP_B, &middle) != CFF_OK);
    compare(&worst.time_s, legs[count - 1U].end_s, given->end, 1.0);
    for (int i = 0; i < 3; i++) {
        compare(&worst.attitude, middle.body_x[i], given->middle[i], 1.0);
        compare(&worst.attitude, middle.body_y[i], given->middle[3 + i], 1.0);
        compare(&worst.attitude, middle.boresight[i], given->middle[6 + i], 1.0);
    }
    return bad;
}

static int locks(void)
{
    cff_leg_t legs[CFF_MOST_LEGS];
    int bad = 0;
    int made = -1;
    for (int p = 0; p < GOLDEN_LOCK_COUNT; p++) {
        const golden_lock_t *given = &golden_lock[p];
        const golden_search_t *search = &golden_search[given->search];
        cff_lock_t lock;
        if (given->search != made) {
            made = given->search;
            bad += legs_of(search, legs);
        }
        bad += cff_first_lock(legs, search->legs, &search->sensor, (const cff_state_t *)(const void *)given->state, 0.0,
                              BUDGET, &lock) != CFF_OK;
        bad += (lock.leg != given->leg);
        if (lock.leg >= 0) {
            compare(&worst.time_s, lock.time_s, given->time, 1.0);
        }
        used[4] += lock.evaluations_used;
    }
    return bad;
}

static int joins(void)
{
    cff_gathering_t gathering;
    cff_join_t join;
    int bad = 0;
    for (int p = 0; p < GOLDEN_JOIN_COUNT; p++) {
        const golden_join_t *given = &golden_join[p];
        bad += given->first && (cff_gathering_begin(&gathering, CRAFT, CFF_BOTH_BURN) != CFF_OK);
        bad += cff_gathering_lock(&gathering, given->time, given->i, given->j, given->velocities, &join) != CFF_OK;
        bad += (join.label != given->label) || (join.table_case != given->table_case);
        for (uint32_t m = 0U; m < CRAFT; m++) {
            for (int i = 0; i < 3; i++) {
                compare(&worst.delta_v, join.delta_v_m_s[m][i], given->delta_v[m][i], 1.0);
            }
        }
    }
    return bad;
}

static bool wanted(int work, int orbit)
{
    return ((WORK == 0) || (WORK == work)) && ((TABLE == 2) || ((TABLE == 1) == (golden_orbits[orbit].chief != NULL)));
}

static int replay(void)
{
    int bad = 0;
    int dearer = 0;
    for (int p = 0; p < GOLDEN_PAIR_COUNT; p++) {
        bad += wanted(1, golden_pair[p].orbit) ? conflicts(&golden_pair[p]) : 0;
    }
    for (int p = 0; p < GOLDEN_PAIR_COUNT; p++) {
        bad += wanted(2, golden_pair[p].orbit) ? approach(&golden_pair[p]) : 0;
    }
    for (int p = 0; p < GOLDEN_TRANSFER_COUNT; p++) {
        bad += wanted(3, golden_transfer[p].orbit) ? transfer(&golden_transfer[p]) : 0;
    }
    if ((WORK == 0) || (WORK == 4)) {
        bad += locks();
    }
    for (int p = 0; p < GOLDEN_AVOID_COUNT; p++) {
        bad += wanted(5, golden_avoid[p].orbit) ? avoided(&golden_avoid[p], &dearer) : 0;
        bad += (WORK == 0) ? begins_inside(&golden_avoid[p]) : 0;
    }
    for (int p = 0; p < GOLDEN_IMPULSES_COUNT; p++) {
        bad += wanted(7, golden_impulses[p].orbit) ? pushed(&golden_impulses[p]) : 0;
    }
    for (int p = 0; p < GOLDEN_LOSS_COUNT; p++) {
        bad += wanted(6, golden_loss[p].orbit) ? lost_thrust(&golden_loss[p]) : 0;
    }
    bad += (20 * dearer) > GOLDEN_AVOID_COUNT;
    return bad + ((WORK == 0) ? joins() : 0);
}

int main(void)
{
    int bad = 0;
    for (int k = 0; k < REPEAT; k++) {
        bad += replay();
    }
    bad += (worst.time_s > 1e-8) + (worst.ratio > 1e-9) + (worst.length > 1e-9) + (worst.energy > 1e-8);
    bad += (worst.attitude > 1e-12) + (worst.delta_v > 1e-12) + (worst.bound > 2e-6) + (worst.cost > 2e-6);
#ifndef CFF_FREESTANDING
    printf("%d pairs, %d transfers, %d avoidances, %d plans of impulses, %d losses of thrust, %d locks, %d joins: %d bad\n",
           GOLDEN_PAIR_COUNT, GOLDEN_TRANSFER_COUNT, GOLDEN_AVOID_COUNT, GOLDEN_IMPULSES_COUNT, GOLDEN_LOSS_COUNT,
           GOLDEN_LOCK_COUNT, GOLDEN_JOIN_COUNT, bad);
    printf("largest differences: time %.2g s, ratio %.2g, length %.2g, energy %.2g, attitude %.2g, delta-v %.2g m/s, "
           "cost of impulses %.2g, their bound %.2g\n",
           worst.time_s, worst.ratio, worst.length, worst.energy, worst.attitude, worst.delta_v, worst.cost, worst.bound);
    printf("evaluations: conflicts %lu, closest approaches %lu, locks %lu, avoidances %lu, losses of thrust %lu, impulses %lu\n",
           used[1], used[2], used[4], used[5], used[6], used[7]);
    printf("digest %016llx\n", (unsigned long long)digest);
#endif
#ifdef DIGEST
    bad += (digest != DIGEST);
#endif
    return (bad == 0) ? 0 : 1;
}
