/*
 * Passive safety: a loss of thrust at any instant (theory 8; closeform/safety/drift_beside_chief.py).
 *
 * The drift after a failure at u of a window is natural motion.  Taken back to the beginning of the window its
 * state y is a polynomial of u, or linear in the share of an impulse that was fired.  In a later window the
 * relative position is a polynomial in the failure and in time, which lies in the hull of 12 x 12 control
 * points.  A cell of failures and times is clear if a plane keeps these out of the zone; others are halved.
 */
#include <math.h>
#include <stddef.h>

#include "cff_internal.h"

#define COSTATE 6U
#define ROUNDING 1.0e-14 /* of a control point, relative to the sum of the terms it is made of */
#define NARROWEST 9.5367431640625e-07 /* cells, of a window: 2^-20 */
#define CELL_EVALUATIONS 40U
#define PROBE_EVALUATIONS 600U
#define PROBES 18U /* up to a quarter of a window */
#define ON_JOINT 1.0e-14

/* Failures within one window: states at its beginning, bounds of their errors, and the window's share in time. */
typedef struct {
    double y[6][CFF_TERMS];
    double wrong[6];
    double first; /* where failures begin and end in the window of `same`, -1 before it */
    double last;
} failures_t;

/* One window of the drift: the other's columns, and the interval that is judged. */
typedef struct {
    const cff_table_t *chief;
    const cff_zone_t *zone;
    const failures_t *failures;
    const cff_cursor_t *other;
    double low; /* of the window, in [0, 1] */
    double high;
    bool same; /* it is the window of the failures */
} drift_t;

typedef struct {
    double failure; /* in [0, 1] of the failures */
    double failure_width;
    double time; /* in [0, 1] of the interval */
    double time_width;
} cell_t;

static double rows_of(const drift_t *drift, uint32_t j, uint32_t axis, uint32_t b)
{
    return drift->chief->rows[((((size_t)drift->other->window * CFF_COLUMNS) + j) * 72U) + ((size_t)axis * CFF_TERMS) + b];
}

/* The relative position, in zone units, of a failure and a time in [0, 1]. */
static void position(const drift_t *drift, double failure, double time, double q[3])
{
    double at_time[CFF_TERMS];
    double r[3] = {0.0, 0.0, 0.0};
    cfi_weights(drift->low + (time * (drift->high - drift->low)), at_time);
    for (uint32_t j = 0U; j < CFF_COLUMNS; j++) {
        double slope;
        const double drifts = (j < COSTATE) ? cfi_value(drift->failures->y[j], failure, &slope) : 0.0;
        const double z = drifts - drift->other->columns[j];
        const bool moves = (z != 0.0);
        for (uint32_t axis = 0U; (axis < 3U) && moves; axis++) {
            for (uint32_t b = 0U; b < CFF_TERMS; b++) {
                r[axis] += z * at_time[b] * rows_of(drift, j, axis, b);
            }
        }
    }
    for (uint32_t i = 0U; i < 3U; i++) {
        q[i] = cfi_dot(drift->zone->to_unit_per_m[i], r);
    }
}

/* The control points of column j along direction m, over the interval of a cell; returns their largest. */
static double along(const drift_t *drift, const cell_t *cell, uint32_t j, const double m[3], double out[CFF_TERMS])
{
    const double low = drift->low + (cell->time * (drift->high - drift->low));
    const double high = drift->low + ((cell->time + cell->time_width) * (drift->high - drift->low));
    double whole[CFF_TERMS];
    double largest = 0.0;
    for (uint32_t b = 0U; b < CFF_TERMS; b++) {
        whole[b] = ((m[0] * rows_of(drift, j, 0U, b)) + (m[1] * rows_of(drift, j, 1U, b))) + (m[2] * rows_of(drift, j, 2U, b));
    }
    cfi_cut(whole, low, high, out);
    for (uint32_t b = 0U; b < CFF_TERMS; b++) {
        largest = cfi_max(largest, fabs(out[b]));
    }
    return largest;
}

/* Whether the plane across w, in zone units, keeps a cell beyond `reach`. */
static bool beyond(const drift_t *drift, const cell_t *cell, const double w[3], double reach)
{
    const double *errors = &drift->chief->errors[(size_t)drift->other->window * CFF_COLUMNS];
    double m[3] = {0.0, 0.0, 0.0}; /* w in metres */
    double points[CFF_TERMS][CFF_TERMS] = {0};
    double off = 0.0;
    for (uint32_t i = 0U; i < 3U; i++) {
        for (uint32_t k = 0U; k < 3U; k++) {
            m[i] += w[k] * drift->zone->to_unit_per_m[k][i];
        }
    }
    const double stretch = (fabs(m[0]) + fabs(m[1])) + fabs(m[2]);
    for (uint32_t j = 0U; j < CFF_COLUMNS; j++) {
        const double z = drift->other->columns[j];
        if ((j < COSTATE) || (z != 0.0)) {
            double g[CFF_TERMS];
            double y[CFF_TERMS] = {0};
            double largest = 0.0;
            const double size = along(drift, cell, j, m, g);
            if (j < COSTATE) {
                cfi_cut(drift->failures->y[j], cell->failure, cell->failure + cell->failure_width, y);
                off += size * drift->failures->wrong[j];
            }
            for (uint32_t i = 0U; i < CFF_TERMS; i++) {
                largest = cfi_max(largest, fabs(y[i]) + fabs(z));
                for (uint32_t b = 0U; b < CFF_TERMS; b++) {
                    points[i][b] += (y[i] - z) * g[b];
                }
            }
            off += largest * ((errors[j] * stretch) + (ROUNDING * size));
        }
    }
    double least = CFF_FOREVER;
    for (uint32_t i = 0U; i < CFF_TERMS; i++) {
        for (uint32_t b = 0U; b < CFF_TERMS; b++) {
            least = cfi_min(least, points[i][b]);
        }
    }
    return least > ((reach * (1.0 + 1e-12)) + off);
}

/* Whether a plane across the position of the cell's centre keeps the cell out of the zone. */
static bool is_clear(const drift_t *drift, const cell_t *cell, const double q[3])
{
    const cff_shape_t shape = drift->zone->shape;
    const uint32_t axes = cfi_round_axes(shape, 0U);
    bool clear = false;
    if (axes > 0U) {
        double w[3] = {q[0], q[1], (axes == 3U) ? q[2] : 0.0};
        const double size = sqrt(cfi_dot(w, w));
        clear = (size > 1.0) && beyond(drift, cell, w, size);
    }
    for (uint32_t axis = axes; (axis < 3U) && !clear; axis++) {
        double w[3] = {0.0, 0.0, 0.0};
        w[axis] = (q[axis] > 0.0) ? 1.0 : -1.0;
        clear = (fabs(q[axis]) > 1.0) && beyond(drift, cell, w, 1.0);
    }
    return clear;
}

/* How far the position changes over a cell, from failure to failure and in time. */
static void changes(const drift_t *drift, const cell_t *cell, double *by_failure, double *by_time)
{
    double corners[3][3];
    position(drift, cell->failure, cell->time, corners[0]);
    position(drift, cell->failure + cell->failure_width, cell->time, corners[1]);
    position(drift, cell->failure, cell->time + cell->time_width, corners[2]);
    *by_failure = 0.0;
    *by_time = 0.0;
    for (uint32_t i = 0U; i < 3U; i++) {
        *by_failure += fabs(corners[1][i] - corners[0][i]);
        *by_time += fabs(corners[2][i] - corners[0][i]);
    }
}

/* Whether the last time after the first failure of a cell, which does come after it, is inside the zone. */
static bool last_is_inside(const drift_t *drift, const cell_t *cell)
{
    double q[3];
    position(drift, cell->failure, cell->time + cell->time_width, q);
    return cfi_norm(drift->zone->shape, q) <= 1.0;
}

/*
 * Look for a failure that leads inside near a narrow cell, ever farther away: the first narrow cells lie along the
 * edge of the unsafe ones.  If there is one the cell moves there.
 */
static bool probe(const drift_t *drift, cell_t *cell)
{
    static const double way[8][2] = {{1.0, 0.0}, {1.0, 1.0}, {0.0, 1.0}, {-1.0, 1.0}, {-1.0, 0.0}, {-1.0, -1.0}, {0.0, -1.0}, {1.0, -1.0}};
    double scale = NARROWEST;
    bool inside = false;
    for (uint32_t turn = 0U; (turn < PROBES) && !inside; turn++) {
        scale *= 2.0;
        for (uint32_t k = 0U; (k < 8U) && !inside; k++) {
            const double failure = cfi_min(cfi_max(cell->failure + (scale * way[k][0]), 0.0), 1.0);
            const double time = cfi_min(cfi_max(cell->time + (scale * way[k][1]), 0.0), 1.0);
            const double lost = drift->failures->first + (failure * (drift->failures->last - drift->failures->first));
            double q[3];
            position(drift, failure, time, q);
            inside = (!drift->same || ((drift->low + (time * (drift->high - drift->low))) >= lost)) &&
                     (cfi_norm(drift->zone->shape, q) <= 1.0);
            if (inside) {
                const cell_t there = {failure, 0.0, time, 0.0};
                *cell = there;
            }
        }
    }
    return inside;
}

/* Judge the times of a cell's failures; false if the failures are to be halved. */
static bool judge_times(const drift_t *drift, cell_t *cell, cff_verdict_t *verdict, uint32_t *evaluations)
{
    bool on = true;
    bool done = true;
    cell->time = 0.0;
    cell->time_width = 1.0;
    while (on && (*evaluations >= CELL_EVALUATIONS)) { /* each turn costs evaluations */
        double q[3];
        const double middle = cell->failure + (0.5 * cell->failure_width);
        const double time = cell->time + (0.5 * cell->time_width);
        const double lost = drift->failures->first + (middle * (drift->failures->last - drift->failures->first));
        const double earliest = drift->failures->first + (cell->failure * (drift->failures->last - drift->failures->first));
        const double end = drift->low + ((cell->time + cell->time_width) * (drift->high - drift->low));
        cfi_spend(evaluations, CELL_EVALUATIONS);
        position(drift, middle, time, q);
        const bool after = !drift->same || ((drift->low + (time * (drift->high - drift->low))) >= lost);
        const bool ever = !drift->same || (end > earliest);
        if (!ever || is_clear(drift, cell, q)) {
            on = cfi_next_interval(&cell->time, &cell->time_width);
        } else if ((after && (cfi_norm(drift->zone->shape, q) <= 1.0)) || last_is_inside(drift, cell)) {
            *verdict = CFF_UNSAFE;
            on = false;
        } else if (cfi_max(cell->failure_width, cell->time_width) <= NARROWEST) {
            cfi_spend(evaluations, PROBE_EVALUATIONS);
            *verdict = probe(drift, cell) ? CFF_UNSAFE : CFF_UNDECIDED;
            on = false;
        } else {
            double by_failure;
            double by_time;
            changes(drift, cell, &by_failure, &by_time);
            const bool of_time = (cell->failure_width <= NARROWEST) || ((by_time >= by_failure) && (cell->time_width > NARROWEST));
            cell->time_width *= of_time ? 0.5 : 1.0;
            done = of_time;
            on = of_time;
        }
    }
    return done;
}

/* Judge one window of the drift after all failures; the cell says where it ended. */
static cff_verdict_t judge_window(const drift_t *drift, cell_t *cell, uint32_t *evaluations)
{
    cff_verdict_t verdict = CFF_SAFE;
    bool on = true;
    cell->failure = 0.0;
    cell->failure_width = 1.0;
    while (on && (*evaluations >= CELL_EVALUATIONS)) { /* each turn costs evaluations */
        if (judge_times(drift, cell, &verdict, evaluations)) {
            on = (verdict == CFF_SAFE) && (*evaluations >= CELL_EVALUATIONS) && cfi_next_interval(&cell->failure, &cell->failure_width);
        } else {
            cell->failure_width *= 0.5;
        }
    }
    return verdict;
}

/* Take the failures on to the beginning of the next window. */
static void advance(const cff_table_t *chief, uint32_t window, failures_t *failures)
{
    const double *step = &chief->steps[(size_t)window * 6U * CFF_COLUMNS];
    for (uint32_t b = 0U; b <= CFF_TERMS; b++) { /* and last the errors */
        double to[6] = {0};
        for (uint32_t i = 0U; i < 6U; i++) {
            for (uint32_t j = 0U; j < 6U; j++) {
                const double a = step[(i * CFF_COLUMNS) + j];
                to[i] += (b < CFF_TERMS) ? (a * failures->y[j][b]) : (fabs(a) * failures->wrong[j]);
            }
        }
        for (uint32_t i = 0U; i < 6U; i++) {
            if (b < CFF_TERMS) {
                failures->y[i][b] = to[i];
            } else {
                failures->wrong[i] = to[i];
            }
        }
    }
}

/* Judge all drifts after failures in the window of `place`, from time `begin` until another. */
static cff_verdict_t judge_drifts(const cff_path_t *other, const cff_zone_t *zone, const cff_cursor_t *place, double begin,
                                  double until, failures_t *failures, cff_drift_t *found, uint32_t *evaluations)
{
    const cff_table_t *chief = other->chief;
    const double last = cfi_angle(chief, until);
    cff_cursor_t at = *place;
    cff_cursor_t its;
    double t = begin;
    cff_verdict_t verdict = CFF_SAFE;
    bool on = true;
    drift_t drift = {chief, zone, failures, &its, 0.0, 0.0, true};
    its.arc = cfi_locate(other, t);
    (void)cfi_place(chief, &other->arcs[its.arc], t, &its);
    while (on && (*evaluations >= CELL_EVALUATIONS)) { /* each turn costs evaluations */
        const double end = cfi_min(cfi_window_end(chief, &at), last);
        const double its_end = other->arcs[its.arc].end_s;
        const double its_last = cfi_angle(chief, its_end);
        const double high = cfi_min(end, its_last);
        cell_t cell = {0.0, 1.0, 0.0, 1.0};
        cfi_spend(evaluations, cfi_view_cost(other));
        drift.low = cfi_share(chief, &at, cfi_angle(chief, t));
        drift.high = cfi_share(chief, &at, high);
        if (drift.high > drift.low) {
            verdict = judge_window(&drift, &cell, evaluations);
        }
        if (verdict != CFF_SAFE) {
            const double u = drift.low + ((cell.time + (0.5 * cell.time_width)) * (drift.high - drift.low));
            found->failure_s = cell.failure + (0.5 * cell.failure_width); /* a share yet */
            found->time_s = cfi_time(chief, at.origin_rad + (u * (cfi_window_end(chief, &at) - at.origin_rad)));
        }
        if (high >= its_last) {
            t = its_end;
        } else {
            t = (high >= last) ? until : cfi_time(chief, high);
        }
        on = (verdict == CFF_SAFE) && (high < (last - ON_JOINT));
        if (on && (high >= (cfi_window_end(chief, &at) - ON_JOINT))) {
            advance(chief, at.window, failures);
            cfi_next_window(chief, &at);
            drift.same = false;
        }
        if (on) {
            cfi_follow(other, &its, t);
        }
    }
    return verdict;
}

/* The failures over [u0, u1] of a window; with u0 = u1 and an impulse, those that fire a share of it. */
static void fill(const cff_table_t *chief, const cff_cursor_t *place, double u0, double u1, const double impulse[3],
                 failures_t *failures)
{
    cff_cursor_t lost = *place;
    double wrong = 0.0;
    for (uint32_t j = 0U; j < CFF_COLUMNS; j++) {
        lost.columns[j] = ((j >= 3U) && (j < 6U)) ? (impulse[j - 3U] / chief->rate_rad_s) : 0.0;
    }
    if (u0 > 0.0) {
        (void)cfi_go_back(chief, &lost, u0);
    }
    for (uint32_t q = 0U; q < 9U; q++) {
        wrong += fabs(place->columns[COSTATE + q]) * chief->return_errors[((size_t)place->window * 9U) + q];
    }
    for (uint32_t i = 0U; i < 6U; i++) {
        double line[CFF_TERMS];
        for (uint32_t b = 0U; b < CFF_TERMS; b++) {
            line[b] = place->columns[i];
            for (uint32_t q = 0U; q < 9U; q++) {
                line[b] += place->columns[COSTATE + q] *
                           chief->returns[((((size_t)place->window * 9U) + q) * 72U) + ((size_t)i * CFF_TERMS) + b];
            }
        }
        cfi_cut(line, u0, u1, failures->y[i]);
        for (uint32_t b = 0U; b < CFF_TERMS; b++) {
            failures->y[i][b] -= (1.0 - ((double)b / ((double)CFF_TERMS - 1.0))) * lost.columns[i];
        }
        failures->wrong[i] = wrong;
    }
    failures->first = u0;
    failures->last = u1;
}

/* Judge the failures of one window of an arc from time t on; `*t` goes on to its end. */
static cff_verdict_t judge_failures(const cff_path_t *path, const cff_path_t *other, const cff_zone_t *zone,
                                    const cff_cursor_t *place, double until, double *t, cff_drift_t *found,
                                    uint32_t *evaluations)
{
    static const double nothing[3] = {0.0, 0.0, 0.0};
    const cff_table_t *chief = path->chief;
    const cff_arc_t *arc = &path->arcs[place->arc];
    const double begin = cfi_angle(chief, *t);
    const double arc_end = cfi_angle(chief, arc->end_s);
    const double window_end = cfi_window_end(chief, place);
    const double end = (window_end < (arc_end - ON_JOINT)) ? cfi_time(chief, window_end) : arc->end_s;
    const double u0 = cfi_share(chief, place, begin);
    const double u1 = cfi_share(chief, place, cfi_min(window_end, arc_end));
    failures_t failures;
    cff_verdict_t verdict = CFF_SAFE;
    if (*t <= arc->start_s) { /* before the arc, or with a share of its impulse */
        fill(chief, place, u0, u0, arc->impulse_m_s, &failures);
        verdict = judge_drifts(other, zone, place, *t, until, &failures, found, evaluations);
        found->failure_s = *t;
    }
    if ((verdict == CFF_SAFE) && cfi_thrusts(arc)) {
        fill(chief, place, u0, u1, nothing, &failures);
        verdict = judge_drifts(other, zone, place, *t, until, &failures, found, evaluations);
        found->failure_s = cfi_time(chief, begin + (found->failure_s * (cfi_min(window_end, arc_end) - begin)));
    }
    *t = end;
    return verdict;
}

/* The first arc from time t on, which may have no duration. */
static uint32_t arc_from(const cff_path_t *path, double t)
{
    uint32_t k = 0U;
    while (((k + 1U) < path->count) && (path->arcs[k].end_s <= t) && (path->arcs[k].start_s < t)) { /* at most all arcs */
        k++;
    }
    return k;
}

/* Go on to the next window or arc of a path after time t; false at its end. */
static bool go_on(const cff_path_t *path, cff_cursor_t *place, double t)
{
    bool on = true;
    if (t < path->arcs[place->arc].end_s) {
        cfi_go_on(path->chief, place, t);
    } else {
        place->arc++;
        on = (place->arc < path->count);
        if (on) {
            (void)cfi_place(path->chief, &path->arcs[place->arc], t, place);
        }
    }
    return on;
}

cff_status_t cff_loss_of_thrust(const cff_path_t *path, const cff_path_t *other, const cff_zone_t *zone, double from_s,
                                double until_s, uint32_t evaluations, cff_drift_t *found)
{
    cff_status_t status = cfi_check_pair(path, other, zone);
    if ((status == CFF_OK) && ((path->chief == NULL) || (evaluations < CFF_LEAST_EVALUATIONS) ||
                               (path->chief->returns == NULL) || (path->chief->return_errors == NULL) ||
                               !cfi_within_table(path->chief, from_s, until_s) || !(from_s >= path->arcs[0].start_s) ||
                               !(from_s >= other->arcs[0].start_s) || !(until_s >= path->arcs[path->count - 1U].end_s) ||
                               !(until_s <= other->arcs[other->count - 1U].end_s))) {
        status = CFF_BAD_INPUT;
    }
    if (status == CFF_OK) {
        uint32_t left = evaluations;
        cff_cursor_t place;
        double t = from_s;
        bool on = true;
        cff_drift_t result = {CFF_SAFE, from_s, from_s, from_s, 0U};
        place.arc = arc_from(path, t);
        (void)cfi_place(path->chief, &path->arcs[place.arc], t, &place);
        while (on) { /* each turn costs evaluations */
            cfi_spend(&left, cfi_view_cost(path));
            result.verdict = judge_failures(path, other, zone, &place, until_s, &t, &result, &left);
            if ((result.verdict == CFF_SAFE) && (left < CELL_EVALUATIONS)) {
                status = CFF_MORE;
                result.verdict = CFF_UNDECIDED;
                on = false;
            } else if (result.verdict != CFF_SAFE) {
                on = false;
            } else {
                result.certified_until_s = t;
                on = go_on(path, &place, t);
            }
        }
        result.evaluations_used = evaluations - left;
        *found = result;
    }
    return status;
}
