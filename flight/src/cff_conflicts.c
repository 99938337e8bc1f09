/*
 * Conflicts and closest approaches of two paths (closeform/conflicts/beside_chief.py).
 *
 * A view is searched piece by piece.  A piece is outside if hulls show it, and decided if the coefficients of
 * each part of the zone change signs at most once: then a part begins or ceases to hold at one root
 * (Descartes' rule), and the piece is inside between the last beginning and the first end.  Others are halved.
 */
#include <math.h>
#include <stddef.h>

#include "cff_internal.h"

#define LEVEL 1.0e-13    /* within it a squared norm is on the surface: the rounding of positions of a zone's size */
#define ROUNDING 4.0e-15 /* of a coefficient, relative to the largest */
#define SAME 1.0e-12     /* conflicts that follow each other so soon, relative to the time, are one */
#define ROOT_STEPS 60U

/* What the coefficients of a part say. */
typedef enum { OUT, IN, ENTERS, LEAVES, OPEN } part_state_t;

static part_state_t judge(const double f[], uint32_t count, bool narrow)
{
    double least = f[0];
    double most = f[0];
    double last = 0.0;
    double first = 0.0;
    uint32_t changes = 0U;
    for (uint32_t k = 0U; k < count; k++) {
        least = cfi_min(least, f[k]);
        most = cfi_max(most, f[k]);
        if (f[k] != 0.0) {
            changes += ((last != 0.0) && ((f[k] > 0.0) != (last > 0.0))) ? 1U : 0U;
            first = (last == 0.0) ? f[k] : first;
            last = f[k];
        }
    }
    const double level = LEVEL + (ROUNDING * cfi_max(fabs(least), fabs(most)));
    part_state_t state = OPEN;
    if (changes == 0U) {
        state = (most > 0.0) ? OUT : IN;
    } else if (changes == 1U) {
        state = (first > 0.0) ? ENTERS : LEAVES;
    } else if (narrow || ((most <= level) && (least >= -level))) {
        state = IN; /* it touches the level within rounding */
    } else {
        /* open */
    }
    return state;
}

/* The only root of a part, by Newton's method in a bracket: it ends where steps are rounding. */
static double root(cff_shape_t shape, uint32_t part, const cfi_piece_t *piece, bool rising, uint32_t *evaluations)
{
    double low = 0.0;
    double high = 1.0;
    double last = 1.0;
    double u = 0.5;
    bool on = true;
    for (uint32_t k = 0U; (k < ROOT_STEPS) && on; k++) {
        double rate;
        const double value = cfi_height(shape, part, piece, u, &rate);
        cfi_spend(evaluations, 1U);
        if ((value > 0.0) == rising) {
            high = u;
        } else {
            low = u;
        }
        double there = (rate != 0.0) ? (u - (value / rate)) : -1.0;
        if (!((there > low) && (there < high))) {
            there = 0.5 * (low + high);
        }
        const double step = fabs(there - u);
        on = (step > 2e-16) && !((step < 1e-12) && ((2.0 * step) >= last));
        u = there;
        last = step;
    }
    return u;
}

/* When a piece is inside, in [0, 1], `low` >= `high` if never; false if it is to be halved. */
static bool decide(cff_shape_t shape, const cfi_piece_t *piece, bool narrow, double *low, double *high, uint32_t *evaluations)
{
    part_state_t states[6] = {OUT, OUT, OUT, OUT, OUT, OUT};
    bool decided = true;
    bool out = cfi_excluded(shape, piece);
    *low = 0.0;
    *high = 1.0;
    for (uint32_t part = 0U; (part < cfi_part_count(shape)) && !out; part++) {
        double f[CFF_SQUARE] = {0};
        const uint32_t count = cfi_level(shape, part, piece, f);
        states[part] = judge(f, count, narrow);
        out = (states[part] == OUT);
        decided = decided && (states[part] != OPEN);
    }
    for (uint32_t part = 0U; (part < cfi_part_count(shape)) && decided && !out; part++) {
        if (states[part] == ENTERS) {
            *low = cfi_max(*low, root(shape, part, piece, false, evaluations));
        } else if (states[part] == LEAVES) {
            *high = cfi_min(*high, root(shape, part, piece, true, evaluations));
        } else {
            /* it holds everywhere */
        }
    }
    if (out) {
        *low = 1.0;
        *high = 0.0;
    }
    return decided || out;
}

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

/* Whether both paths are one arc of natural motion each, which keep apart by bounds in closed form. */
static bool coast_apart(const cff_conflict_search_t *search)
{
    const cff_arc_t *a = &search->one.arcs[search->place_of_one.arc];
    const cff_arc_t *b = &search->other.arcs[search->place_of_other.arc];
    const double t = search->certified_until_s;
    return (search->one.chief == NULL) && (a->end_s >= search->end_s) && (b->end_s >= search->end_s) &&
           cfi_coasts_apart(a, b, t, search->zone, search->end_s - t);
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
        (void)cfi_begin_places(one, &search->place_of_one, other, &search->place_of_other, t);
        search->finished = coast_apart(search);
        if (search->finished) {
            search->certified_until_s = search->end_s;
        }
    }
    return status;
}

/* Append the open conflict; false if there is no space. */
static bool close_conflict(cff_conflict_search_t *search, cff_conflict_t conflicts[], uint32_t capacity, uint32_t *count)
{
    bool space = false;
    if (*count < capacity) {
        conflicts[*count].start_s = search->entry_s;
        conflicts[*count].end_s = search->exit_s;
        *count += 1U;
        search->inside = false;
        space = true;
    }
    return space;
}

/* Add the time inside of a piece that ends at `end`; false if an earlier conflict finds no space. */
static bool add_piece(cff_conflict_search_t *search, const cfi_view_t *view, const cfi_piece_t *piece, double low,
                      double high, cff_conflict_t conflicts[], uint32_t capacity, uint32_t *count)
{
    const double entry = cfi_time_in(view, piece->low + (low * piece->width));
    const double end = cfi_time_in(view, piece->low + piece->width);
    const double gap = SAME * (1.0 + fabs(end));
    const bool some = (low < high) || ((low <= high) && (view->length <= 0.0));
    const double next = some ? entry : end;
    bool space = true;
    if (search->inside && (next > (search->exit_s + gap))) {
        space = close_conflict(search, conflicts, capacity, count);
    }
    if (space && some) {
        search->entry_s = search->inside ? search->entry_s : entry;
        search->exit_s = cfi_time_in(view, piece->low + (high * piece->width));
        search->inside = true;
    }
    if (space) {
        search->certified_until_s = end;
    }
    return space;
}

/* Search one view, until its end or until the evaluations or the space are spent; false for the latter. */
static bool search_view(cff_conflict_search_t *search, const cfi_view_t *view, cff_conflict_t conflicts[], uint32_t capacity,
                        uint32_t *count, uint32_t *evaluations)
{
    cfi_piece_t piece;
    bool space = true;
    bool on = true;
    piece.low = 0.0;
    piece.width = 1.0;
    while (((piece.width * view->length) > search->step) && cfi_halve_piece(&piece)) { /* at most 30 turns */
        /* go on with the width with which the evaluations ended */
    }
    while (on && space && (*evaluations >= CFF_PIECE_EVALUATIONS)) { /* each turn costs evaluations */
        double low;
        double high;
        const bool narrow = ((piece.width * CFF_FINEST) <= 1.0);
        cfi_spend(evaluations, CFF_PIECE_EVALUATIONS);
        cfi_take_piece(view, &piece);
        if (decide(search->zone->shape, &piece, narrow, &low, &high, evaluations)) {
            space = add_piece(search, view, &piece, low, high, conflicts, capacity, count);
            on = cfi_next_interval(&piece.low, &piece.width);
        } else {
            (void)cfi_halve_piece(&piece);
        }
    }
    search->step = on ? (piece.width * view->length) : CFF_FOREVER;
    return space;
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
            status = search_view(search, &view, conflicts, capacity, count, &left) ? CFF_OK : CFF_FULL;
        } else if (search->inside && !close_conflict(search, conflicts, capacity, count)) {
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
        (void)cfi_begin_places(one, &at_one, other, &at_other, t);
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
