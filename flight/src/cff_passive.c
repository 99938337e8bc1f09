/*
 * Passive safety: a loss of thrust at any instant (theory 8; closeform/safety/drift_beside_chief.py).
 *
 * The drift after a failure at u of a window is natural motion.  Taken back to the beginning of the window its
 * state y is a polynomial of u, or linear in the share of an impulse that was fired.  The drifts after the failures
 * of a cell lie between those after its first and its last failure, but for the bend of y.  The cell is clear where
 * a plane keeps both, and the bend, out of the zone; else it is halved in failures or in time.
 */
#include <math.h>
#include <stddef.h>

#include "cff_internal.h"

#define COSTATE 6U
#define ROUNDING 1.0e-14 /* of a position, relative to the terms that it is the sum of */
#define NARROWEST 9.5367431640625e-07 /* cells, of a window: 2^-20 */
#define CELL_EVALUATIONS 10U
#define EDGES_EVALUATIONS 30U
#define WAYS 6U    /* directions in which to look for a failure that leads inside */
#define PROBES 18U /* up to a quarter of a window */

/* Drifts after the failures of one window, in a later window or the same. */
typedef struct {
    const cff_path_t *other;
    const cff_zone_t *zone;
    double until;
    double y[6][CFF_TERMS]; /* states where the window of the drift begins, over the failures */
    double wrong[6];        /* bounds of their errors */
    double first;           /* where the failures begin and end in their window */
    double last;
    cff_cursor_t at; /* the window of the drift, and the place of the other spacecraft */
    cff_cursor_t its;
    double low; /* the share of the window that is judged */
    double high;
    bool same; /* the drift is in the window of its failure */
    uint32_t evaluations;
} drift_t;

/* Failures over an interval of [0, 1], and the positions after the first and the last, over the judged share. */
typedef struct {
    double low;
    double width;
    cfi_view_t edges[2];
} cell_t;

/* The position after one failure. */
static void see_drift(const drift_t *drift, double failure, cfi_view_t *view)
{
    double columns[CFF_COLUMNS];
    for (uint32_t j = 0U; j < CFF_COLUMNS; j++) {
        double slope;
        columns[j] = ((j < COSTATE) ? cfi_value(drift->y[j], failure, &slope) : 0.0) - drift->its.columns[j];
    }
    cfi_see_window(drift->other->chief, drift->at.window, columns, drift->zone, view);
    for (uint32_t i = 0U; i < 3U; i++) {
        cfi_cut(view->c[i], drift->low, drift->high, view->c[i]);
    }
}

/* How far the state may be from the chord of the cell, and rounding, for column j. */
static double bend(const drift_t *drift, const cell_t *cell, uint32_t j)
{
    double off = ROUNDING * fabs(drift->its.columns[j]);
    if (j < COSTATE) {
        double y[CFF_TERMS];
        double most = 0.0;
        cfi_cut(drift->y[j], cell->low, cell->low + cell->width, y);
        for (uint32_t b = 0U; b < CFF_TERMS; b++) {
            const double share = (double)b / ((double)CFF_TERMS - 1.0);
            most = cfi_max(most, fabs(y[b] - (((1.0 - share) * y[0]) + (share * y[CFF_TERMS - 1U]))));
            off = cfi_max(off, ROUNDING * fabs(y[b]));
        }
        off += most + drift->wrong[j];
    }
    return off;
}

/* See a cell: both edges, and the bend between them as their error. */
static void see_cell(const drift_t *drift, cell_t *cell)
{
    double off[3] = {0.0, 0.0, 0.0};
    see_drift(drift, cell->low, &cell->edges[0]);
    see_drift(drift, cell->low + cell->width, &cell->edges[1]);
    for (uint32_t j = 0U; j < CFF_COLUMNS; j++) {
        const double size = bend(drift, cell, j);
        for (uint32_t i = 0U; i < 3U; i++) {
            double least;
            double most;
            cfi_hull(cfi_row(drift->other->chief, drift->at.window, j, i), &least, &most);
            off[i] += size * cfi_max(-least, most);
        }
    }
    for (uint32_t i = 0U; i < 3U; i++) {
        const double *m = drift->zone->to_unit_per_m[i];
        const double more = ((fabs(m[0]) * off[0]) + (fabs(m[1]) * off[1])) + (fabs(m[2]) * off[2]);
        const double error = cfi_max(cell->edges[0].off[i], cell->edges[1].off[i]) + more;
        cell->edges[0].off[i] = error;
        cell->edges[1].off[i] = error;
    }
}

/* Whether a time in [0, 1] of the judged share is at a failure or after it. */
static bool is_after(const drift_t *drift, double failure, double time)
{
    const double lost = drift->first + (failure * (drift->last - drift->first));
    return !drift->same || ((drift->low + (time * (drift->high - drift->low))) >= lost);
}

/* Whether the drift after a failure is inside at a time, both in [0, 1]. */
static bool is_inside(const drift_t *drift, double failure, double time)
{
    cfi_view_t view;
    double q[3];
    see_drift(drift, failure, &view);
    for (uint32_t i = 0U; i < 3U; i++) {
        double slope;
        q[i] = cfi_value(view.c[i], time, &slope);
    }
    return is_after(drift, failure, time) && (cfi_norm(drift->zone->shape, q) <= 1.0);
}

/*
 * Look for a failure that leads inside near a narrow cell, ever farther away: the first narrow cells lie along the
 * edge of the unsafe ones.  If there is one the cell and the time move there.
 */
static bool probe(const drift_t *drift, cell_t *cell, double *time)
{
    static const double way[WAYS][2] = {{1.0, 0.0}, {1.0, -1.0}, {1.0, 1.0}, {-1.0, 0.0}, {-1.0, -1.0}, {-1.0, 1.0}};
    double ahead = NARROWEST;
    bool inside = false;
    for (uint32_t turn = 0U; (turn < PROBES) && !inside; turn++) {
        ahead *= 2.0;
        for (uint32_t k = 0U; (k < WAYS) && !inside; k++) {
            const double failure = cfi_min(cfi_max(cell->low + (ahead * way[k][0]), 0.0), 1.0);
            const double then = cfi_min(cfi_max(*time + (ahead * way[k][1]), 0.0), 1.0);
            inside = is_inside(drift, failure, then);
            if (inside) {
                cell->low = failure;
                *time = then;
            }
        }
    }
    return inside;
}

/* Whether one of the four corners of a cell and an interval of time is inside. */
static bool corner_inside(const drift_t *drift, const cell_t *cell, const cfi_piece_t pieces[2], double *failure, double *time)
{
    const uint32_t last = CFF_TERMS - 1U;
    bool inside = false;
    for (uint32_t k = 0U; (k < 4U) && !inside; k++) {
        const cfi_piece_t *piece = &pieces[k / 2U];
        const uint32_t b = ((k % 2U) == 0U) ? 0U : last;
        const double q[3] = {piece->c[0][b], piece->c[1][b], piece->c[2][b]};
        *failure = cell->low + (((k / 2U) == 0U) ? 0.0 : cell->width);
        *time = piece->low + ((b == 0U) ? 0.0 : piece->width);
        inside = (cfi_norm(drift->zone->shape, q) <= 1.0) && is_after(drift, *failure, *time);
    }
    return inside;
}

/* Whether the positions of a cell differ more from failure to failure than in time, or bend more. */
static bool failures_differ(const cfi_piece_t pieces[2])
{
    double by_failure = 0.0;
    double by_time = 0.0;
    for (uint32_t i = 0U; i < 3U; i++) {
        const double *a = pieces[0].c[i];
        const double *b = pieces[1].c[i];
        const uint32_t last = CFF_TERMS - 1U;
        by_failure += cfi_max(fabs(b[0] - a[0]), fabs(b[last] - a[last])) + pieces[0].off[i];
        by_time += cfi_max(fabs(a[last] - a[0]), fabs(b[last] - b[0]));
    }
    return by_failure > by_time;
}

/* Judge the times of a cell; false if its failures are to be halved.  A verdict sets the cell and `time` to the failure. */
static bool judge_cell(drift_t *drift, cell_t *cell, double *time, cff_verdict_t *verdict)
{
    const cff_shape_t shape = drift->zone->shape;
    cfi_piece_t pieces[2];
    double failure;
    bool on = true;
    bool whole = true;
    pieces[0].low = 0.0;
    pieces[0].width = 1.0;
    cfi_spend(&drift->evaluations, EDGES_EVALUATIONS);
    see_cell(drift, cell);
    while (on && (drift->evaluations >= CELL_EVALUATIONS)) { /* each turn costs evaluations */
        cfi_spend(&drift->evaluations, CELL_EVALUATIONS);
        pieces[1].low = pieces[0].low;
        pieces[1].width = pieces[0].width;
        cfi_take_piece(&cell->edges[0], &pieces[0]);
        cfi_take_piece(&cell->edges[1], &pieces[1]);
        if (!is_after(drift, cell->low, pieces[0].low + pieces[0].width) || cfi_excluded(shape, pieces, 2U)) {
            on = cfi_next_interval(&pieces[0].low, &pieces[0].width);
        } else if (corner_inside(drift, cell, pieces, &failure, time)) {
            cell->low = failure;
            cell->width = 0.0;
            *verdict = CFF_UNSAFE;
            on = false;
        } else if (cfi_max(cell->width, pieces[0].width) <= NARROWEST) {
            cfi_spend(&drift->evaluations, WAYS * PROBES * CELL_EVALUATIONS);
            *time = pieces[0].low;
            *verdict = probe(drift, cell, time) ? CFF_UNSAFE : CFF_UNDECIDED;
            on = false;
        } else {
            whole = (cell->width <= NARROWEST) || ((pieces[0].width > NARROWEST) && !failures_differ(pieces));
            pieces[0].width *= whole ? 0.5 : 1.0;
            on = whole;
        }
    }
    return whole;
}

/* Judge one window of the drift after all failures; a verdict sets the failure, in [0, 1], and the time. */
/*@ requires \valid(drift) && \valid(failure) && \valid(time); assigns *failure, *time, drift->evaluations; */
static cff_verdict_t judge_window(drift_t *drift, double *failure, double *time)
{
    cff_verdict_t verdict = CFF_SAFE;
    cell_t cell;
    bool on = true;
    cell.low = 0.0;
    cell.width = 1.0;
    while (on && (drift->evaluations >= CELL_EVALUATIONS)) { /* each turn costs evaluations */
        if (judge_cell(drift, &cell, time, &verdict)) {
            on = (verdict == CFF_SAFE) && (drift->evaluations >= CELL_EVALUATIONS) && cfi_next_interval(&cell.low, &cell.width);
        } else {
            cell.width *= 0.5;
        }
    }
    *failure = cell.low;
    return verdict;
}

/* Take the drifts on to the beginning of the next window. */
static void advance(drift_t *drift)
{
    const cff_table_t *chief = drift->other->chief;
    const double *step = &chief->steps[(size_t)drift->at.window * 6U * CFF_COLUMNS];
    for (uint32_t b = 0U; b <= CFF_TERMS; b++) { /* and last the errors */
        double to[6] = {0};
        for (uint32_t i = 0U; i < 6U; i++) {
            for (uint32_t j = 0U; j < 6U; j++) {
                const double a = step[(i * CFF_COLUMNS) + j];
                to[i] += (b < CFF_TERMS) ? (a * drift->y[j][b]) : (fabs(a) * drift->wrong[j]);
            }
        }
        for (uint32_t i = 0U; i < 6U; i++) {
            if (b < CFF_TERMS) {
                drift->y[i][b] = to[i];
            } else {
                drift->wrong[i] = to[i];
            }
        }
    }
    cfi_next_window(chief, &drift->at);
    drift->same = false;
}

/* Judge all drifts after failures in the window of `place`, from time `begin` on; a failure is a share yet. */
static cff_verdict_t judge_drifts(drift_t *drift, const cff_cursor_t *place, double begin, cff_drift_t *found)
{
    const cff_path_t *other = drift->other;
    const cff_table_t *chief = other->chief;
    const double last = cfi_angle(chief, drift->until);
    double t = begin;
    cff_verdict_t verdict = CFF_SAFE;
    bool on = true;
    drift->at = *place;
    drift->same = true;
    cfi_begin_place(other, &drift->its, t);
    while (on && (drift->evaluations >= CELL_EVALUATIONS)) { /* each turn costs evaluations */
        const double window_end = cfi_window_end(chief, &drift->at);
        const double its_end = other->arcs[drift->its.arc].end_s;
        const double its_last = cfi_angle(chief, its_end);
        const double high = cfi_min(cfi_min(window_end, last), its_last);
        cfi_spend(&drift->evaluations, cfi_view_cost(other));
        drift->low = cfi_share(chief, &drift->at, cfi_angle(chief, t));
        drift->high = cfi_share(chief, &drift->at, high);
        if (drift->high > drift->low) {
            double time = 0.0;
            verdict = judge_window(drift, &found->failure_s, &time);
            const double u = drift->low + (time * (drift->high - drift->low));
            found->time_s = cfi_time(chief, drift->at.origin_rad + (u * (window_end - drift->at.origin_rad)));
        }
        if (high >= its_last) {
            t = its_end;
        } else {
            t = (high >= last) ? drift->until : cfi_time(chief, high);
        }
        on = (verdict == CFF_SAFE) && (high < (last - CFF_ON_JOINT));
        if (on && (high >= (window_end - CFF_ON_JOINT))) {
            advance(drift);
        }
        if (on) {
            cfi_follow(other, &drift->its, t);
        }
    }
    return verdict;
}

/* The failures over [u0, u1] of a window; with u0 = u1 and an impulse, those that fire a share of it. */
static void fill(drift_t *drift, const cff_cursor_t *place, double u0, double u1, const double impulse[3])
{
    const cff_table_t *chief = drift->other->chief;
    cff_cursor_t lost = *place;
    double wrong = 0.0;
    for (uint32_t j = 0U; j < CFF_COLUMNS; j++) {
        lost.columns[j] = ((j >= 3U) && (j < 6U)) ? (impulse[j - 3U] / chief->rate_rad_s) : 0.0;
    }
    if (u0 > 0.0) {
        cfi_go_back(chief, &lost, u0);
    }
    for (uint32_t q = 0U; q < 9U; q++) {
        wrong += fabs(place->columns[COSTATE + q]) * chief->return_errors[((size_t)place->window * 9U) + q];
    }
    for (uint32_t i = 0U; i < 6U; i++) {
        double *y = drift->y[i];
        for (uint32_t b = 0U; b < CFF_TERMS; b++) {
            y[b] = place->columns[i];
            for (uint32_t q = 0U; q < 9U; q++) {
                y[b] += place->columns[COSTATE + q] *
                        chief->returns[((((size_t)place->window * 9U) + q) * 72U) + ((size_t)i * CFF_TERMS) + b];
            }
        }
        cfi_cut(y, u0, u1, y);
        for (uint32_t b = 0U; b < CFF_TERMS; b++) {
            y[b] -= (1.0 - ((double)b / ((double)CFF_TERMS - 1.0))) * lost.columns[i];
        }
        drift->wrong[i] = wrong;
    }
    drift->first = u0;
    drift->last = u1;
}

/* Judge the failures of one window of an arc from time t on; `*t` goes on to its end. */
static cff_verdict_t judge_failures(drift_t *drift, const cff_path_t *path, const cff_cursor_t *place, double *t,
                                    cff_drift_t *found)
{
    static const double nothing[3] = {0.0, 0.0, 0.0};
    const cff_table_t *chief = path->chief;
    const cff_arc_t *arc = &path->arcs[place->arc];
    const double begin = cfi_angle(chief, *t);
    const double arc_end = cfi_angle(chief, arc->end_s);
    const double window_end = cfi_window_end(chief, place);
    const double end = (window_end < (arc_end - CFF_ON_JOINT)) ? cfi_time(chief, window_end) : arc->end_s;
    const double u0 = cfi_share(chief, place, begin);
    const double u1 = cfi_share(chief, place, cfi_min(window_end, arc_end));
    cff_verdict_t verdict = CFF_SAFE;
    if (*t <= arc->start_s) { /* before the arc, or with a share of its impulse */
        fill(drift, place, u0, u0, arc->impulse_m_s);
        verdict = judge_drifts(drift, place, *t, found);
        found->failure_s = *t;
    }
    if ((verdict == CFF_SAFE) && cfi_thrusts(arc)) {
        fill(drift, place, u0, u1, nothing);
        verdict = judge_drifts(drift, place, *t, found);
        found->failure_s = cfi_time(chief, begin + (found->failure_s * (cfi_min(window_end, arc_end) - begin)));
    }
    *t = end;
    return verdict;
}

/* The place of a path at time t, in the first arc there, which may have no duration. */
static void first_place(const cff_path_t *path, double t, cff_cursor_t *place)
{
    place->arc = 0U;
    while (((place->arc + 1U) < path->count) && (path->arcs[place->arc].end_s <= t) &&
           (path->arcs[place->arc].start_s < t)) { /* at most all arcs */
        place->arc++;
    }
    cfi_place(path->chief, &path->arcs[place->arc], t, place);
}

/* Go on to the next window or arc of a path after time t; false at its end. */
static bool go_on(const cff_path_t *path, cff_cursor_t *place, double t)
{
    bool on = true;
    if (t < path->arcs[place->arc].end_s) {
        cfi_go_on(path->chief, place, t);
    } else if ((place->arc + 1U) < path->count) {
        place->arc++;
        cfi_place(path->chief, &path->arcs[place->arc], t, place);
    } else {
        on = false;
    }
    return on;
}

/* Whether a table serves passive safety, and the times are those of both paths. */
static bool can_judge(const cff_path_t *path, const cff_path_t *other, double from, double until)
{
    const cff_table_t *chief = path->chief;
    return (chief != NULL) && (chief->returns != NULL) && (chief->return_errors != NULL) &&
           cfi_within_table(chief, from, until) && (from >= path->arcs[0].start_s) && (from >= other->arcs[0].start_s) &&
           (from <= path->arcs[path->count - 1U].end_s) &&
           (until >= path->arcs[path->count - 1U].end_s) && (until <= other->arcs[other->count - 1U].end_s);
}

cff_status_t cff_loss_of_thrust(const cff_path_t *path, const cff_path_t *other, const cff_zone_t *zone, double from_s,
                                double until_s, uint32_t evaluations, cff_drift_t *found)
{
    cff_status_t status = cfi_check_pair(path, other, zone);
    if ((status == CFF_OK) && !((evaluations >= CFF_LEAST_EVALUATIONS) && can_judge(path, other, from_s, until_s))) {
        status = CFF_BAD_INPUT;
    }
    if (status == CFF_OK) {
        drift_t drift;
        cff_cursor_t place;
        double t = from_s;
        bool on = true;
        const cff_drift_t begun = {CFF_SAFE, from_s, from_s, from_s, 0U};
        *found = begun;
        drift.other = other;
        drift.zone = zone;
        drift.until = until_s;
        drift.evaluations = evaluations;
        first_place(path, t, &place);
        while (on) { /* each turn costs evaluations */
            cfi_spend(&drift.evaluations, cfi_view_cost(path));
            found->verdict = judge_failures(&drift, path, &place, &t, found);
            if ((found->verdict == CFF_SAFE) && (drift.evaluations < CELL_EVALUATIONS)) {
                status = CFF_MORE;
                found->verdict = CFF_UNDECIDED;
                on = false;
            } else if (found->verdict != CFF_SAFE) {
                on = false;
            } else {
                found->certified_until_s = t;
                on = go_on(path, &place, t);
            }
        }
        found->evaluations_used = evaluations - drift.evaluations;
    }
    return status;
}
