/*
 * Conflict monitor: two paths are loaded, then each wakeup spends a fixed budget on the search and reports
 * each conflict, and the time up to which all are known.  See cfs/ and fprime/ for the same in a framework.
 *
 *   gcc -std=c99 -ffp-contract=off -Iflight/include flight/examples/conflict_monitor.c flight/src/[a-z]*.c -lm
 */
#include <math.h>
#include <stdio.h>

#include "closeform_flight.h"

#define BUDGET 256U /* evaluations of a wakeup */
#define ROOM 8U     /* conflicts of a wakeup */

static cff_arc_t own_arc;
static cff_arc_t other_arc;
static cff_conflict_search_t search;

/* Spend one budget; return whether the search goes on. */
static bool wakeup(cff_conflict_t *last)
{
    cff_conflict_t conflicts[ROOM];
    uint32_t count = 0U;
    const cff_status_t status = cff_conflicts_continue(&search, BUDGET, conflicts, ROOM, &count);
    for (uint32_t k = 0U; k < count; k++) {
        printf("conflict from %.3f s to %.3f s\n", conflicts[k].start_s, conflicts[k].end_s);
        *last = conflicts[k];
    }
    printf("all conflicts known until %.3f s, %u evaluations\n", search.certified_until_s, (unsigned)search.evaluations_used);
    return (status == CFF_MORE) || (status == CFF_FULL);
}

int main(void)
{
    const double mean_motion = 1.1086e-3; /* rad/s, 500 km */
    const cff_state_t here = {{0.0, 200.0, 0.0}, {0.0, 0.0, 0.0}};
    const cff_state_t there = {{0.0, -200.0, 0.0}, {0.0, 0.0, 0.0}};
    const cff_state_t client = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    const cff_zone_t zone = {CFF_ELLIPSOID, {{1.0 / 20.0, 0.0, 0.0}, {0.0, 1.0 / 40.0, 0.0}, {0.0, 0.0, 1.0 / 20.0}}};
    const cff_path_t own = {.arcs = &own_arc, .count = 1U};
    const cff_path_t other = {.arcs = &other_arc, .count = 1U};
    cff_conflict_t last = {0.0, 0.0};
    if ((cff_transfer(mean_motion, 0.0, 300.0, &here, &there, &own_arc) != CFF_OK) ||
        (cff_drift(mean_motion, 0.0, 300.0, &client, &other_arc) != CFF_OK) ||
        (cff_conflicts_begin(&search, &own, &other, &zone) != CFF_OK)) {
        return 1;
    }
    while (wakeup(&last)) {
    }
    return ((fabs(last.start_s - 138.680) < 0.01) && (fabs(last.end_s - 161.320) < 0.01)) ? 0 : 1;
}
