/*
 * Conflicts and closest approaches of two paths (closeform/conflicts/chief/sign_changes.py).
 *
 * The common time of the paths is searched view by view: cff_inside.c finds the times inside the zone along a view,
 * and cff_extremum.c the minimum norm.  A search stops between views or pieces when its evaluations are spent.
 */
#include <math.h>
#include <stddef.h>

#include "cff_internal.h"

static bool zone_is_good(const cff_zone_t *zone)
{
    bool good = (zone->shape == CFF_ELLIPSOID) || (zone->shape == CFF_BOX) || (zone->shape == CFF_CYLINDER);
    for (uint32_t i = 0U; i < 3U; i++) {
        good = good && cfi_finite(zone->to_unit_per_m[i], 3U);
    }
    return good;
}

static double common_start(const cff_path_t *one, const cff_path_t *other)
{
    return cfi_max(one->arcs[0].start_s, other->arcs[0].start_s);
}

static double common_end(const cff_path_t *one, const cff_path_t *other)
{
    return cfi_min(one->arcs[one->count - 1U].end_s, other->arcs[other->count - 1U].end_s);
}

cff_status_t cfi_check_pair(const cff_path_t *one, const cff_path_t *other, const cff_zone_t *zone)
{
    cff_status_t status = CFF_BAD_INPUT;
    if ((cff_check_path(one) == CFF_OK) && (cff_check_path(other) == CFF_OK) && zone_is_good(zone) &&
        (one->chief == other->chief) &&
        ((one->chief != NULL) || (one->arcs[0].mean_motion_rad_s == other->arcs[0].mean_motion_rad_s))) {
        status = (common_start(one, other) <= common_end(one, other)) ? CFF_OK : CFF_NO_COMMON_TIME;
    }
    return status;
}

cff_status_t cff_conflicts_begin(cff_conflict_search_t *search, const cff_path_t *one, const cff_path_t *other,
                                 const cff_zone_t *zone)
{
    const cff_status_t status = cfi_check_pair(one, other, zone);
    if (status != CFF_BAD_INPUT) {
        static const cff_conflict_search_t nothing = {0};
        *search = nothing;
        search->finished = true;
    }
    if (status == CFF_OK) {
        const double t = common_start(one, other);
        search->one = *one;
        search->other = *other;
        search->zone = zone;
        search->certified_until_s = t;
        search->end_s = common_end(one, other);
        search->step = CFF_FOREVER;
        cfi_begin_place(one, &search->place_of_one, t);
        cfi_begin_place(other, &search->place_of_other, t);
        search->finished = false;
    }
    return status;
}

cff_status_t cff_conflicts_continue(cff_conflict_search_t *search, uint32_t evaluations, cff_conflict_t conflicts[],
                                    uint32_t capacity, uint32_t *count)
{
    uint32_t left = evaluations;
    cff_status_t status = ((evaluations >= CFF_LEAST_EVALUATIONS) && (*count <= capacity)) ? CFF_OK : CFF_BAD_INPUT;
    while ((status == CFF_OK) && !search->finished) { /* each turn costs evaluations */
        if (left < (cfi_view_cost(&search->one) + CFF_PIECE_EVALUATIONS)) {
            status = CFF_MORE;
        } else if ((search->certified_until_s < search->end_s) || !search->begun) {
            cfi_view_t view;
            cfi_spend(&left, cfi_view_cost(&search->one));
            cfi_see(&search->one, &search->place_of_one, &search->other, &search->place_of_other,
                    search->certified_until_s, search->end_s, search->zone, &view);
            search->begun = true; /* paths may share one instant only */
            status = cfi_search_view(search, &view, conflicts, capacity, count, &left) ? CFF_OK : CFF_FULL;
        } else if (search->inside && !cfi_close_conflict(search, conflicts, capacity, count)) {
            status = CFF_FULL;
        } else {
            search->finished = true;
        }
    }
    if (status != CFF_BAD_INPUT) {
        search->evaluations_used += evaluations - left;
    }
    return status;
}

cff_status_t cff_fleet_continue(cff_conflict_search_t searches[], uint32_t search_count, uint32_t evaluations,
                                cff_fleet_conflict_t conflicts[], uint32_t capacity, uint32_t *count,
                                double *certified_until_s)
{
    cff_status_t status = ((evaluations >= CFF_LEAST_EVALUATIONS) && (*count <= capacity)) ? CFF_OK : CFF_BAD_INPUT;
    uint32_t left = evaluations;
    bool on = (status == CFF_OK) && (search_count > 0U);
    while (on) { /* each turn costs evaluations, or ends a search */
        uint32_t next = 0U;
        for (uint32_t k = 1U; k < search_count; k++) {
            const bool behind = searches[k].certified_until_s < searches[next].certified_until_s;
            if (!searches[k].finished && (searches[next].finished || behind)) {
                next = k;
            }
        }
        cff_conflict_search_t *search = &searches[next];
        *certified_until_s = search->certified_until_s;
        on = !search->finished;
        if (on && (left < CFF_LEAST_EVALUATIONS)) {
            status = CFF_MORE;
            on = false;
        } else if (on && (*count >= capacity)) {
            status = CFF_FULL;
            on = false;
        } else if (on) {
            const uint32_t before = search->evaluations_used;
            cff_conflict_t conflict[1];
            uint32_t found = 0U;
            (void)cff_conflicts_continue(search, CFF_LEAST_EVALUATIONS, conflict, 1U, &found);
            cfi_spend(&left, search->evaluations_used - before);
            if (found > 0U) {
                conflicts[*count].other = next;
                conflicts[*count].conflict = conflict[0];
                *count += 1U;
            }
        } else {
            /* all are finished */
        }
    }
    return status;
}

cff_status_t cff_closest_approach(const cff_path_t *one, const cff_path_t *other, const cff_zone_t *zone,
                                  double start_s, double end_s, uint32_t evaluations, cff_approach_t *approach)
{
    cff_status_t status = cfi_check_pair(one, other, zone);
    if ((status == CFF_OK) && !((evaluations >= CFF_LEAST_EVALUATIONS) && (start_s >= common_start(one, other)) &&
                                (end_s <= common_end(one, other)) && (start_s <= end_s))) {
        status = CFF_BAD_INPUT;
    }
    if (status == CFF_OK) {
        cff_cursor_t at_one;
        cff_cursor_t at_other;
        uint32_t left = evaluations;
        double t = start_s;
        bool on = true;
        approach->time_s = start_s;
        approach->ratio = CFF_FOREVER;
        cfi_begin_place(one, &at_one, t);
        cfi_begin_place(other, &at_other, t);
        while (on) { /* each turn costs evaluations */
            cfi_view_t view;
            double u = 0.0;
            const double before = approach->ratio;
            cfi_spend(&left, cfi_view_cost(one));
            cfi_see(one, &at_one, other, &at_other, t, end_s, zone, &view);
            const double reached = cfi_minimum(&view, zone->shape, &approach->ratio, &u, &left);
            approach->time_s = (approach->ratio < before) ? cfi_time_in(&view, u) : approach->time_s;
            t = cfi_time_in(&view, reached);
            t = (approach->ratio == 0.0) ? end_s : t; /* there is no less */
            on = (t < end_s);
            if (on && (left < (cfi_view_cost(one) + CFF_PIECE_EVALUATIONS))) {
                status = CFF_MORE;
                on = false;
            }
        }
        approach->certified_until_s = t;
        approach->evaluations_used = evaluations - left;
    }
    return status;
}
