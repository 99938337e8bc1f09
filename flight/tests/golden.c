/*
 * Replays the golden vectors of the package: exit status 0 if all agree.
 *
 * Counts of conflicts and legs must be equal, times to 1e-6 s, ratios to 1e-9, thrusts to 1e-9 of themselves.
 * With -DCFF_FREESTANDING it needs no library and says nothing (see start_*.c); with -DREPEAT=n the core's
 * work is done n times, for counting instructions, and with -DWORK=k only one kind of it.
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

static double worst_time, worst_ratio, worst_thrust, worst_lock, worst_energy;
static unsigned long evaluations_stays, evaluations_closest, evaluations_locks, evaluations_avoid;

static uint64_t digest = 1469598103934665603U; /* of the bits of all answers: alike on all machines */

static void note(double x)
{
    union {
        double number;
        uint64_t bits;
    } same;
    same.number = x;
    digest = (digest ^ same.bits) * 1099511628211U;
}

static double size(double x) { return x < 0.0 ? -x : x; }

static void keep(double *worst, double x)
{
    if (!(size(x) <= *worst)) {
        *worst = size(x);
    }
}

static int pairs(void)
{
    int bad = 0;
    for (int p = 0; p < GOLDEN_PAIRS; p++) {
        const golden_pair_t *g = &golden_pairs[p];
        const cff_path_t one = {(const cff_arc_t *)(const void *)g->one, g->one_count};
        const cff_path_t other = {(const cff_arc_t *)(const void *)g->other, g->other_count};
        cff_zone_t zone;
        zone.shape = (cff_shape_t)g->shape;
        for (int i = 0; i < 9; i++) {
            zone.to_unit_per_m[i / 3][i % 3] = g->matrix[i / 3][i % 3];
        }
        if (WORK == 0 || WORK == 1) {
            cff_conflict_search_t search;
            cff_conflict_t conflicts[GOLDEN_STAYS];
            uint32_t count = 0U;
            bad += cff_conflicts_begin(&search, &one, &other, &zone) != CFF_OK;
            bad += cff_conflicts_continue(&search, 100000U, conflicts, GOLDEN_STAYS, &count) != CFF_OK;
            bad += ((int)count != g->conflicts);
            for (uint32_t k = 0U; k < count && k < (uint32_t)g->conflicts; k++) {
                note(conflicts[k].start_s);
                note(conflicts[k].end_s);
                keep(&worst_time, conflicts[k].start_s - g->conflict[k][0]);
                keep(&worst_time, conflicts[k].end_s - g->conflict[k][1]);
            }
            evaluations_stays += search.evaluations_used;
        }
        if (WORK == 0 || WORK == 2) {
            cff_approach_t near;
            const double s1 = one.arcs[0].start_s, s2 = other.arcs[0].start_s;
            const double e1 = one.arcs[one.count - 1U].end_s, e2 = other.arcs[other.count - 1U].end_s;
            bad += cff_closest_approach(&one, &other, &zone, s1 > s2 ? s1 : s2, e1 < e2 ? e1 : e2, 100000U, &near) != CFF_OK;
            note(near.time_s);
            note(near.ratio);
            keep(&worst_ratio, near.ratio - g->closest_ratio);
            evaluations_closest += near.evaluations_used;
        }
    }
    return bad;
}

static int transfers(void)
{
    int bad = 0;
    for (int p = 0; p < GOLDEN_TRANSFERS; p++) {
        const golden_transfer_t *g = &golden_transfers[p];
        cff_arc_t arc;
        double energy;
        double most = 0.0;
        bad += cff_transfer(g->n, g->start, g->duration, (const cff_state_t *)(const void *)g->initial,
                            (const cff_state_t *)(const void *)g->final, &arc) != CFF_OK;
        bad += cff_energy(&arc, &energy) != CFF_OK;
        for (int i = 0; i < 3; i++) {
            keep(&most, g->thrust[i]);
        }
        for (int i = 0; i < 3; i++) {
            note(arc.thrust_m_s2[i]);
            note(arc.thrust_rate_m_s3[i]);
            keep(&worst_thrust, (arc.thrust_m_s2[i] - g->thrust[i]) / most);
        }
        keep(&worst_thrust, (energy - g->energy) / g->energy);
    }
    return bad;
}

static int locks(void)
{
    const cff_sensor_t sensor = {GOLDEN_BASELINE, GOLDEN_COSINE, GOLDEN_RANGE};
    cff_leg_t legs[CFF_SEARCH_LEGS];
    int bad = cff_modified_search(GOLDEN_SLEW, GOLDEN_TIP, legs) != CFF_OK;
    for (int p = 0; p < 100; p++) {
        cff_lock_t lock;
        bad += cff_first_lock(legs, CFF_SEARCH_LEGS, &sensor, (const cff_state_t *)(const void *)golden_locks[p].state, 0.0,
                              10000U, &lock) != CFF_OK;
        bad += (lock.leg != golden_locks[p].leg);
        if (lock.leg >= 0) {
            note(lock.time_s);
            keep(&worst_lock, lock.time_s - golden_locks[p].time);
        }
        evaluations_locks += lock.evaluations_used;
    }
    return bad;
}

static int avoided(void)
{
    int bad = 0;
    cff_zone_t zone;
    zone.shape = CFF_ELLIPSOID;
    for (int i = 0; i < 9; i++) {
        zone.to_unit_per_m[i / 3][i % 3] = golden_avoid_zone[i];
    }
    for (int p = 0; p < GOLDEN_AVOIDED; p++) {
        const cff_path_t obstacle = {(const cff_arc_t *)(const void *)golden_avoided[p].obstacle, 1U};
        cff_avoidance_t found;
        bad += cff_avoid((const cff_arc_t *)(const void *)golden_avoided[p].direct, &obstacle, &zone, 100000U, &found) != CFF_OK;
        keep(&worst_energy, found.extra_energy_m2_s3 / golden_avoided[p].extra_energy - 1.0);
        note(found.extra_energy_m2_s3);
        note(found.contact_s);
        evaluations_avoid += found.evaluations_used;
    }
    return bad;
}

int main(void)
{
    int bad = 0;
    for (int k = 0; k < REPEAT; k++) {
        if (WORK == 0 || WORK == 5) {
            bad += avoided();
        }
        if (WORK <= 2) {
            bad += pairs();
        }
        if (WORK == 0 || WORK == 3) {
            bad += transfers();
        }
        if (WORK == 0 || WORK == 4) {
            bad += locks();
        }
    }
    bad += (worst_time > 1e-6) + (worst_ratio > 1e-9) + (worst_thrust > 1e-9) + (worst_lock > 1e-6) + (worst_energy > 1e-6);
#ifndef CFF_FREESTANDING
    printf("%d pairs, %d transfers, 100 locks, %d avoided: %d bad; worst time %.2g s, ratio %.2g, thrust %.2g, lock %.2g s, "
           "extra energy %.2g; evaluations %lu, %lu, %lu, %lu; digest %016llx\n",
           GOLDEN_PAIRS, GOLDEN_TRANSFERS, GOLDEN_AVOIDED, bad, worst_time, worst_ratio, worst_thrust, worst_lock, worst_energy,
           evaluations_stays, evaluations_closest, evaluations_locks, evaluations_avoid, (unsigned long long)digest);
#endif
    return bad != 0;
}
