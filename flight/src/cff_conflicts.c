/*
 * Conflicts and closest approaches of two paths (closeform/conflicts/entries.py).
 */
#include <math.h>
#include <stddef.h>

#include "cff_internal.h"

/*
 * A norm within 1e-12 of 1 is on the surface.  Outside ends at ENTERED, inside only at LEFT, so that
 * rounding cannot make the two searches chase each other; each aims a little further.
 */
#define TOUCH 1.0e-12
#define ENTRY_AIM (1.0 + (0.08 * TOUCH))
#define ENTERED (1.0 + (0.16 * TOUCH))
#define LEFT (1.0 + (0.4 * TOUCH))
#define EXIT_AIM (1.0 + (0.5 * TOUCH))
#define UNIT 2.3e-16

/* March through a view until the norm changes sides, for at most `patience` steps: the time reached. */
static double cross(const cfi_view_t *view, const cfi_bounds_t *bounds, cff_shape_t shape, double from, double stop,
                    bool inside, uint32_t patience, bool *crossed, uint32_t *evaluations)
{
    double t = from;
    bool on = true;
    *crossed = false;
    if ((shape == CFF_ELLIPSOID) && (patience == CFF_LESS_PATIENCE) && (t == 0.0) &&
        (*evaluations >= CFF_TAYLOR_EVALUATIONS)) {
        cfi_spend(evaluations, CFF_TAYLOR_EVALUATIONS);
        t = cfi_taylor_step(view, stop, inside ? EXIT_AIM : ENTRY_AIM, inside);
    }
    for (uint32_t k = 0U; (k < patience) && on && (*evaluations > 0U); k++) {
        cfi_motion_t m;
        cfi_spend(evaluations, 1U);
        cfi_evaluate(view, t, &m);
        const double s = cfi_norm(shape, m.r);
        if ((inside && (s > LEFT)) || (!inside && (s <= ENTERED))) {
            *crossed = true;
            on = false;
        } else if (t >= stop) {
            t = stop;
            on = false;
        } else {
            const double h = inside ? cfi_inside_step(shape, &m, bounds, EXIT_AIM)
                                    : cfi_outside_step(shape, &m, bounds, ENTRY_AIM);
            t = cfi_min(stop, cfi_max(t + h, t * (1.0 + UNIT)));
        }
    }
    return t;
}

static bool zone_is_good(const cff_zone_t *zone)
{
    bool good = (zone->shape == CFF_ELLIPSOID) || (zone->shape == CFF_BOX);
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

static cff_status_t check(const cff_path_t *one, const cff_path_t *other, const cff_zone_t *zone)
{
    cff_status_t status = CFF_BAD_INPUT;
    if ((cff_check_path(one) == CFF_OK) && (cff_check_path(other) == CFF_OK) && zone_is_good(zone)) {
        status = (common_start(one, other) <= common_end(one, other)) ? CFF_OK : CFF_NO_COMMON_TIME;
    }
    return status;
}

/* The arc that a path is on at time t, from the one it was on. */
static uint32_t arc_on(const cff_path_t *path, uint32_t from, double t)
{
    const uint32_t last = path->count - 1U;
    uint32_t k = (from < last) ? from : last;
    while ((k < last) && (path->arcs[k].end_s <= t)) { /* at most CFF_MOST_ARCS turns */
        k++;
    }
    return k;
}

/* Whether both paths are one arc of natural motion each, which conflict apart by bounds in closed form. */
static bool coast_apart(const cff_conflict_search_t *search)
{
    const cff_arc_t *a = &search->one.arcs[search->arc_of_one];
    const cff_arc_t *b = &search->other.arcs[search->arc_of_other];
    bool apart = false;
    if ((a->mean_motion_rad_s > 0.0) && (a->mean_motion_rad_s == b->mean_motion_rad_s) && !cfi_thrusts(a) &&
        !cfi_thrusts(b) && (a->end_s >= search->end_s) && (b->end_s >= search->end_s)) {
        cfi_view_t view;
        cfi_see(a, b, search->certified_until_s, search->zone, &view);
        apart = cfi_coasts_apart(&view, search->zone->shape, search->end_s - search->certified_until_s);
    }
    return apart;
}

cff_status_t cff_conflicts_begin(cff_conflict_search_t *search, const cff_path_t *one, const cff_path_t *other,
                                 const cff_zone_t *zone)
{
    const cff_status_t status = check(one, other, zone);
    const cff_conflict_search_t nothing = {{NULL, 0U}, {NULL, 0U}, NULL, 0.0, 0.0, 0.0, 0.0, 0U, 0U, 0U, 0U, false, true};
    *search = nothing; /* which is finished */
    if (status == CFF_OK) {
        search->patience = CFF_PATIENCE;
        search->one = *one;
        search->other = *other;
        search->zone = zone;
        search->certified_until_s = common_start(one, other);
        search->end_s = common_end(one, other);
        search->entry_s = search->certified_until_s;
        search->arc_of_one = cfi_locate(one, search->certified_until_s);
        search->arc_of_other = cfi_locate(other, search->certified_until_s);
        search->view_end_s = -CFF_FOREVER; /* nothing was looked at */
        search->finished = coast_apart(search);
        if (search->finished) {
            search->certified_until_s = search->end_s;
        }
    }
    return status;
}

/* March through one view; a conflict that ends is appended.  Ends at the view's end, or where it stalls. */
static void march_view(cff_conflict_search_t *search, cff_conflict_t conflicts[], uint32_t capacity, uint32_t *count,
                       uint32_t *evaluations)
{
    const double from = search->certified_until_s;
    const double length = search->view_end_s - from;
    cfi_view_t view;
    cfi_bounds_t bounds;
    double t = 0.0;
    bool crossed = true;
    cfi_see(&search->one.arcs[search->arc_of_one], &search->other.arcs[search->arc_of_other], from, search->zone, &view);
    cfi_bounds(&view, length, &bounds);
    while (crossed && (*evaluations > 0U) && !(search->inside && (*count >= capacity))) { /* each turn costs a evaluation */
        t = cross(&view, &bounds, search->zone->shape, t, length, search->inside, search->patience, &crossed, evaluations);
        if (crossed) {
            const double when = cfi_min(from + t, search->view_end_s);
            if (!search->inside) {
                search->entry_s = when;
            } else if (*count < capacity) { /* as the loop made sure */
                conflicts[*count].start_s = search->entry_s;
                conflicts[*count].end_s = when;
                *count += 1U;
            } else {
                /* no way here */
            }
            search->inside = !search->inside;
        }
    }
    if (!crossed && (t >= length)) {
        search->certified_until_s = search->view_end_s;
    } else {
        search->certified_until_s = cfi_min(from + t, search->view_end_s);
        if ((*evaluations > 0U) && !crossed) {
            search->patience = CFF_LESS_PATIENCE; /* it stalled */
        }
    }
}

cff_status_t cff_conflicts_continue(cff_conflict_search_t *search, uint32_t evaluations, cff_conflict_t conflicts[], uint32_t capacity,
                                    uint32_t *count)
{
    uint32_t left = evaluations;
    cff_status_t status = ((evaluations >= CFF_LEAST_EVALUATIONS) && (*count <= capacity)) ? CFF_OK : CFF_BAD_INPUT;
    while (!search->finished && (status == CFF_OK)) { /* each turn costs evaluations */
        const double t = search->certified_until_s;
        if (search->inside && (*count >= capacity)) {
            status = CFF_FULL;
        } else if ((t >= search->end_s) && (search->view_end_s >= search->end_s)) {
            if (search->inside && (*count < capacity)) {
                conflicts[*count].start_s = search->entry_s;
                conflicts[*count].end_s = search->end_s;
                *count += 1U;
            }
            search->finished = true;
        } else if (left <= CFF_VIEW_EVALUATIONS) {
            status = CFF_MORE;
        } else {
            cfi_spend(&left, CFF_VIEW_EVALUATIONS);
            if (t >= search->view_end_s) {
                search->arc_of_one = arc_on(&search->one, search->arc_of_one, t);
                search->arc_of_other = arc_on(&search->other, search->arc_of_other, t);
                search->view_end_s = cfi_view_end(&search->one.arcs[search->arc_of_one],
                                                   &search->other.arcs[search->arc_of_other], t, search->end_s);
                search->patience = CFF_PATIENCE;
            }
            march_view(search, conflicts, capacity, count, &left);
        }
    }
    search->evaluations_used += evaluations - left;
    return status;
}

cff_status_t cff_closest_approach(const cff_path_t *one, const cff_path_t *other, const cff_zone_t *zone,
                                  double start_s, double end_s, uint32_t evaluations, cff_approach_t *approach)
{
    cff_status_t status = check(one, other, zone);
    uint32_t left = evaluations;
    approach->time_s = start_s;
    approach->ratio = CFF_FOREVER;
    approach->certified_until_s = start_s;
    if ((status == CFF_OK) && (evaluations < CFF_LEAST_EVALUATIONS)) {
        status = CFF_BAD_INPUT;
    }
    if ((status == CFF_OK) &&
        !((start_s >= common_start(one, other)) && (end_s <= common_end(one, other)) && (start_s <= end_s))) {
        status = CFF_BAD_INPUT;
    }
    if (status == CFF_OK) {
        uint32_t i = cfi_locate(one, start_s);
        uint32_t j = cfi_locate(other, start_s);
        uint32_t patience = CFF_PATIENCE;
        double t = start_s;
        bool on = true;
        while (on) { /* each turn costs evaluations */
            if (left > CFF_VIEW_EVALUATIONS) {
                cfi_view_t view;
                cfi_spend(&left, CFF_VIEW_EVALUATIONS);
                double when = 0.0;
                const double before = approach->ratio;
                i = arc_on(one, i, t);
                j = arc_on(other, j, t);
                const double stop = cfi_view_end(&one->arcs[i], &other->arcs[j], t, end_s);
                cfi_see(&one->arcs[i], &other->arcs[j], t, zone, &view);
                const double reached =
                    cfi_minimum(&view, zone->shape, stop - t, patience, &approach->ratio, &when, &left);
                if (approach->ratio < before) {
                    approach->time_s = cfi_min(t + when, stop);
                }
                if (reached < (stop - t)) {
                    patience = CFF_LESS_PATIENCE;
                    t += reached;
                } else {
                    t = stop;
                }
                if (approach->ratio == 0.0) {
                    t = end_s; /* there is no less */
                }
                approach->certified_until_s = t;
                on = (t < end_s);
            } else {
                status = CFF_MORE;
                on = false;
            }
        }
    }
    approach->evaluations_used = evaluations - left;
    return status;
}
