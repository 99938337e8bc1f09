/* Batches for the comparison with Python: not part of the core. */
#include "closeform_flight.h"

/* All conflicts of pairs, with their least norms: rows (pair, start, end, time, ratio); returns the count. */
int64_t bridge_conflicts(const cff_arc_t *arcs, const int64_t *offsets, const cff_arc_t *others,
                         const int64_t *other_offsets, int64_t pairs, int64_t shape, const double *matrix,
                         uint32_t evaluations, double *rows, int64_t capacity, int64_t *evaluations_used, int64_t *status,
                         int64_t nearest, const cff_table_t *chief)
{
    cff_zone_t zone;
    int64_t total = 0;
    zone.shape = (cff_shape_t)shape;
    for (int i = 0; i < 9; i++) {
        zone.to_unit_per_m[i / 3][i % 3] = matrix[i];
    }
    for (int64_t p = 0; p < pairs; p++) {
        const cff_path_t one = {arcs + offsets[p], (uint32_t)(offsets[p + 1] - offsets[p]), chief};
        const cff_path_t other = {others + other_offsets[p], (uint32_t)(other_offsets[p + 1] - other_offsets[p]), chief};
        cff_conflict_search_t search;
        cff_conflict_t conflicts[64];
        uint32_t count = 0;
        cff_status_t s = cff_conflicts_begin(&search, &one, &other, &zone);
        int64_t calls = 0;
        if (s == CFF_OK) {
            do {
                s = cff_conflicts_continue(&search, evaluations, conflicts, 64, &count);
                calls++;
            } while (s == CFF_MORE && calls < 100000);
        }
        status[p] = s;
        evaluations_used[2 * p] = search.evaluations_used;
        evaluations_used[2 * p + 1] = 0;
        for (uint32_t k = 0; k < count && total < capacity; k++, total++) {
            cff_approach_t near = {0, 0, 0, 0};
            if (nearest) {
                s = cff_closest_approach(&one, &other, &zone, conflicts[k].start_s, conflicts[k].end_s, 1000000, &near);
                if (s != CFF_OK) {
                    status[p] = 100 + s;
                }
            }
            evaluations_used[2 * p + 1] += near.evaluations_used;
            rows[5 * total] = (double)p;
            rows[5 * total + 1] = conflicts[k].start_s;
            rows[5 * total + 2] = conflicts[k].end_s;
            rows[5 * total + 3] = near.time_s;
            rows[5 * total + 4] = near.ratio;
        }
    }
    return total;
}

/* Closest approaches over the common time: (time, ratio) for each pair. */
void bridge_approaches(const cff_arc_t *arcs, const int64_t *offsets, const cff_arc_t *others,
                       const int64_t *other_offsets, int64_t pairs, int64_t shape, const double *matrix,
                       uint32_t evaluations, double *out, int64_t *evaluations_used, int64_t *status,
                       const cff_table_t *chief)
{
    cff_zone_t zone;
    zone.shape = (cff_shape_t)shape;
    for (int i = 0; i < 9; i++) {
        zone.to_unit_per_m[i / 3][i % 3] = matrix[i];
    }
    for (int64_t p = 0; p < pairs; p++) {
        const cff_path_t one = {arcs + offsets[p], (uint32_t)(offsets[p + 1] - offsets[p]), chief};
        const cff_path_t other = {others + other_offsets[p], (uint32_t)(other_offsets[p + 1] - other_offsets[p]), chief};
        const double s1 = one.arcs[0].start_s, s2 = other.arcs[0].start_s;
        const double e1 = one.arcs[one.count - 1].end_s, e2 = other.arcs[other.count - 1].end_s;
        cff_approach_t near;
        status[p] = cff_closest_approach(&one, &other, &zone, s1 > s2 ? s1 : s2, e1 < e2 ? e1 : e2, evaluations, &near);
        out[2 * p] = near.time_s;
        out[2 * p + 1] = near.ratio;
        evaluations_used[p] = near.evaluations_used;
    }
}

void bridge_transfers(const cff_table_t *chief, int64_t count, const double *n, const double *start, const double *duration,
                      const double *initial, const double *final, cff_arc_t *arcs, double *energy, int64_t *status)
{
    for (int64_t k = 0; k < count; k++) {
        const cff_path_t path = {&arcs[k], 1, chief};
        const cff_state_t *a = (const cff_state_t *)(initial + 6 * k), *b = (const cff_state_t *)(final + 6 * k);
        status[k] = chief ? cff_transfer_beside(chief, start[k], duration[k], a, b, &arcs[k])
                          : cff_transfer(n[k], start[k], duration[k], a, b, &arcs[k]);
        if (status[k] == CFF_OK) {
            status[k] = cff_energy(&path, &energy[k]);
        }
    }
}

void bridge_states(const cff_table_t *chief, const cff_arc_t *arcs, int64_t count, const double *times, double *out)
{
    for (int64_t k = 0; k < count; k++) {
        const cff_path_t path = {arcs + k, 1, chief};
        cff_state_t s;
        (void)cff_state_at(&path, times[k], &s);
        for (int i = 0; i < 3; i++) {
            out[6 * k + i] = s.position_m[i];
            out[6 * k + 3 + i] = s.velocity_m_s[i];
        }
    }
}

/* Paths around obstacles, `each` of them for each direct arc: (status), (arc count, extra energy, contacts, evaluations). */
void bridge_avoid(const cff_table_t *chief, const cff_arc_t *direct, const cff_arc_t *obstacles, int64_t each, int64_t count,
                  const double *matrices, uint32_t evaluations, cff_arc_t *arcs, double *out, int64_t *status)
{
    static cff_avoid_work_t work;
    for (int64_t k = 0; k < count; k++) {
        cff_path_t paths[CFF_MOST_OBSTACLES];
        cff_zone_t zones[CFF_MOST_OBSTACLES];
        cff_avoidance_t found;
        for (int64_t m = 0; m < each; m++) {
            paths[m] = (cff_path_t){obstacles + k * each + m, 1U, chief};
            zones[m].shape = CFF_ELLIPSOID;
            for (int i = 0; i < 9; i++) {
                zones[m].to_unit_per_m[i / 3][i % 3] = matrices[9 * m + i];
            }
        }
        status[k] = cff_avoid(direct + k, paths, zones, (uint32_t)each, evaluations, &work, &found);
        out[4 * k] = status[k] >= 0 ? found.count : 0;
        out[4 * k + 1] = found.extra_energy_m2_s3;
        out[4 * k + 2] = found.energy_m2_s3;
        out[4 * k + 3] = found.evaluations_used;
        for (uint32_t m = 0; status[k] == CFF_OK && m < found.count; m++) {
            arcs[9 * k + m] = found.arcs[m];
        }
    }
}

/* Verdicts on a loss of thrust: (verdict, failure, time, certified, evaluations) for each pair. */
void bridge_loss(const cff_table_t *chief, const cff_arc_t *arcs, const int64_t *offsets, const cff_arc_t *others,
                 const int64_t *other_offsets, int64_t pairs, int64_t shape, const double *matrix, double until,
                 uint32_t evaluations, double *out, int64_t *status)
{
    cff_zone_t zone;
    zone.shape = (cff_shape_t)shape;
    for (int i = 0; i < 9; i++) {
        zone.to_unit_per_m[i / 3][i % 3] = matrix[i];
    }
    for (int64_t p = 0; p < pairs; p++) {
        const cff_path_t one = {arcs + offsets[p], (uint32_t)(offsets[p + 1] - offsets[p]), chief};
        const cff_path_t other = {others + other_offsets[p], (uint32_t)(other_offsets[p + 1] - other_offsets[p]), chief};
        cff_drift_t found = {CFF_UNDECIDED, 0.0, 0.0, 0.0, 0U};
        status[p] = cff_loss_of_thrust(&one, &other, &zone, one.arcs[0].start_s, until, evaluations, &found);
        out[5 * p] = found.verdict;
        out[5 * p + 1] = found.failure_s;
        out[5 * p + 2] = found.time_s;
        out[5 * p + 3] = found.certified_until_s;
        out[5 * p + 4] = found.evaluations_used;
    }
}
