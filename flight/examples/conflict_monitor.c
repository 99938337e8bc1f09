/*
 * A conflict monitor as a cFS or F' component would hold it: arcs come by table or command (rows of the
 * package's `Path.arcs`), each wakeup at 10 Hz spends at most 256 evaluations (0.2 million instructions on LEON3),
 * and each conflict, or the time up to which there is none, goes out as telemetry.
 *
 *   cFS:  monitor_load in the handler of the table or command message, monitor_wakeup in that of the
 *         scheduler's wakeup message; report_* become CFE_EVS_SendEvent and CFE_SB_TransmitMsg.
 *   F':   monitor_load in the command or data input port's handler, monitor_wakeup in the Svc.Sched port's;
 *         report_* become log_WARNING_HI_* and tlmWrite_*.
 *
 * As it stands it runs on a desktop: gcc -std=c99 examples/conflict_monitor.c src/[a-z]*.c -lm
 */
#include <stdio.h>

#include "closeform_flight.h"

#define LOOKS_A_WAKEUP 256U
#define STAYS 8U
#define ARCS 8U

typedef struct {
    cff_arc_t own[ARCS];
    cff_arc_t other[ARCS];
    cff_zone_t zone;
    cff_conflict_search_t search;
    cff_conflict_t conflicts[STAYS];
    uint32_t count;
    uint32_t told;
    bool busy;
} monitor_t;

static void report_stay(const cff_conflict_t *conflict) { printf("conflict from %.6f s to %.6f s\n", conflict->start_s, conflict->end_s); }
static void report_status(int status, double until) { printf("status %d, known until %.3f s\n", status, until); }

static cff_status_t monitor_load(monitor_t *m, uint32_t own_count, uint32_t other_count)
{
    const cff_path_t own = {m->own, own_count};
    const cff_path_t other = {m->other, other_count};
    const cff_status_t status = cff_conflicts_begin(&m->search, &own, &other, &m->zone);
    m->count = 0U;
    m->told = 0U;
    m->busy = (status == CFF_OK);
    return status;
}

static void monitor_wakeup(monitor_t *m)
{
    if (m->busy) {
        const cff_status_t status = cff_conflicts_continue(&m->search, LOOKS_A_WAKEUP, m->conflicts, STAYS, &m->count);
        while (m->told < m->count) {
            report_stay(&m->conflicts[m->told]);
            m->told += 1U;
        }
        report_status((int)status, m->search.certified_until_s);
        if (status == CFF_FULL) { /* told already: go on in the emptied array */
            m->count = 0U;
            m->told = 0U;
        }
        m->busy = (status == CFF_MORE) || (status == CFF_FULL);
    }
}

int main(void)
{
    static monitor_t m;
    const double n = 1.1086e-3;
    const cff_state_t here = {{0.0, 200.0, 0.0}, {0.0, 0.0, 0.0}};
    const cff_state_t there = {{0.0, -200.0, 0.0}, {0.0, 0.0, 0.0}};
    const cff_state_t chief = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    m.zone.shape = CFF_ELLIPSOID;
    m.zone.to_unit_per_m[0][0] = 1.0 / 20.0;
    m.zone.to_unit_per_m[1][1] = 1.0 / 40.0;
    m.zone.to_unit_per_m[2][2] = 1.0 / 20.0;
    if ((cff_transfer(n, 0.0, 300.0, &here, &there, &m.own[0]) == CFF_OK) &&
        (cff_drift(n, 0.0, 300.0, &chief, &m.other[0]) == CFF_OK) && (monitor_load(&m, 1U, 1U) == CFF_OK)) {
        while (m.busy) {
            monitor_wakeup(&m);
        }
        cff_avoidance_t shaped;
        const cff_path_t obstacle = {m.other, 1U};
        const cff_status_t status = cff_avoid(&m.own[0], &obstacle, &m.zone, 100000U, &shaped);
        printf("shaped: status %d, %u arcs, energy %.6g + %.6g m2/s3, contact at %.3f s, %u evaluations\n", (int)status,
               (unsigned)shaped.count, shaped.energy_m2_s3 - shaped.extra_energy_m2_s3, shaped.extra_energy_m2_s3,
               shaped.contact_s, (unsigned)shaped.evaluations_used);
    }
    return 0;
}
