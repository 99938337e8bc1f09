/*
 * Views: the relative position of two arcs as polynomials, and its pieces.
 *
 * By Hill's equations the relative position has a power series; that over an angle n t of at most CFF_REACH, cut to
 * degree 11 so that the largest error is least, becomes a Bernstein polynomial.  Beside a table it is the
 * polynomial of a window.
 */
#include <math.h>
#include <stddef.h>

#include "cff_internal.h"

/* Fill the polynomials of a view by Hill's equations, from its start over its length. */
static void see_hill(const cff_arc_t *a, const cff_arc_t *b, const cff_zone_t *zone, cfi_view_t *view)
{
    cfi_start_t start = {0};
    const double angle = a->mean_motion_rad_s * view->length;
    cfi_add_start(a, view->from_s, view->length, 1.0, &start);
    if (b != NULL) {
        cfi_add_start(b, view->from_s, view->length, -1.0, &start);
    }
    for (uint32_t k = 0U; k < CFF_POWERS; k++) {
        for (uint32_t i = 0U; i < 3U; i++) {
            cfi_add_power(k, cfi_dot(zone->to_unit_per_m[i], start.r), view->c[i], &view->off[i]);
        }
        cfi_step(angle, k, &start);
    }
    for (uint32_t i = 0U; i < 3U; i++) {
        cfi_end_powers(view->c[i]);
    }
}

/* Fill the polynomials of a view beside a table, from angle `view->first` over its length. */
static void see_table(const cff_cursor_t *one, const cff_cursor_t *other, const cff_zone_t *zone, cfi_view_t *view)
{
    const cff_table_t *chief = view->chief;
    const double size = cfi_window_end(chief, one) - one->origin_rad;
    const double low = cfi_min(cfi_max((view->first - one->origin_rad) / size, 0.0), 1.0);
    const double high = cfi_min(low + (view->length / size), 1.0);
    double columns[CFF_COLUMNS];
    for (uint32_t j = 0U; j < CFF_COLUMNS; j++) {
        columns[j] = one->columns[j] - ((other != NULL) ? other->columns[j] : 0.0);
    }
    cfi_see_window(chief, one->window, columns, zone, view);
    for (uint32_t i = 0U; i < 3U; i++) {
        cfi_cut(view->c[i], low, high, view->c[i]);
    }
}

/* Move a place on to the arc and the window in which a path goes on after time t. */
void cfi_follow(const cff_path_t *path, cff_cursor_t *place, double t)
{
    uint32_t arc = place->arc;
    while (((arc + 1U) < path->count) && (path->arcs[arc].end_s <= t)) { /* at most CFF_MOST_ARCS turns */
        arc++;
    }
    if ((path->chief != NULL) && (arc != place->arc)) {
        cfi_place(path->chief, &path->arcs[arc], t, place);
    } else if (path->chief != NULL) {
        cfi_go_on(path->chief, place, t);
    } else {
        /* by Hill's equations there are no windows */
    }
    place->arc = arc;
}

/* The place where a path is at time t. */
void cfi_begin_place(const cff_path_t *path, cff_cursor_t *place, double t)
{
    place->arc = cfi_locate(path, t);
    if (path->chief != NULL) {
        cfi_place(path->chief, &path->arcs[place->arc], t, place);
    }
}

/*
 * View two paths from time t on, for as long as one polynomial serves, at most until `end`; without another path,
 * the one relative to the chief.
 */
void cfi_see(const cff_path_t *one, cff_cursor_t *at_one, const cff_path_t *other, cff_cursor_t *at_other, double t,
             double end, const cff_zone_t *zone, cfi_view_t *view)
{
    const bool pair = (other != NULL) && (at_other != NULL);
    const cff_arc_t *b = NULL;
    cfi_follow(one, at_one, t);
    const cff_arc_t *a = &one->arcs[at_one->arc];
    double stop = cfi_min(end, a->end_s);
    if (pair) {
        cfi_follow(other, at_other, t);
        b = &other->arcs[at_other->arc];
        stop = cfi_min(stop, b->end_s);
    }
    stop = cfi_max(t, stop);
    view->chief = one->chief;
    view->from_s = t;
    for (uint32_t i = 0U; i < 3U; i++) {
        view->off[i] = 0.0;
        for (uint32_t k = 0U; k < CFF_TERMS; k++) {
            view->c[i][k] = 0.0;
        }
    }
    if (view->chief != NULL) {
        double finish = cfi_window_end(view->chief, at_one);
        finish = pair ? cfi_min(finish, cfi_window_end(view->chief, at_other)) : finish;
        view->first = cfi_angle(view->chief, t);
        double last = cfi_angle(view->chief, stop);
        if (finish < (last - CFF_ON_JOINT)) {
            last = finish;
            stop = cfi_max(t, cfi_min(stop, cfi_time(view->chief, finish)));
        }
        view->length = cfi_max(last - view->first, 0.0);
        view->until_s = stop;
        see_table(at_one, pair ? at_other : NULL, zone, view);
    } else {
        const double n = a->mean_motion_rad_s;
        view->until_s = (n > 0.0) ? cfi_min(stop, t + (CFF_REACH / n)) : stop;
        view->first = t;
        view->length = view->until_s - t;
        see_hill(a, b, zone, view);
    }
    for (uint32_t i = 0U; i < 3U; i++) {
        double largest = 0.0;
        for (uint32_t k = 0U; k < CFF_TERMS; k++) {
            largest = cfi_max(largest, fabs(view->c[i][k]));
        }
        view->off[i] += CFF_ROUNDING * largest;
    }
}

/* View one path relative to the chief, in metres. */
void cfi_see_coast(const cff_path_t *coast, cff_cursor_t *place, double t, double end, cfi_view_t *view)
{
    static const cff_zone_t metres = {CFF_ELLIPSOID, {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}}};
    cfi_see(coast, place, NULL, NULL, t, end, &metres, view);
}

/* The time of u. */
double cfi_time_in(const cfi_view_t *view, double u)
{
    double t = view->first + (u * view->length);
    if (view->chief != NULL) {
        t = cfi_time(view->chief, t);
    }
    if (u <= 0.0) {
        t = view->from_s;
    }
    return (u >= 1.0) ? view->until_s : cfi_min(cfi_max(t, view->from_s), view->until_s);
}

/* The change of time by u. */
double cfi_pace(const cfi_view_t *view, double u)
{
    double pace = view->length;
    if (view->chief != NULL) {
        double sine;
        double cosine;
        cfi_sine_cosine(view->first + (u * view->length), &sine, &cosine);
        pace *= (1.0 - (view->chief->eccentricity * cosine)) / view->chief->rate_rad_s;
    }
    return pace;
}

/* Fill in the coefficients of a piece from `low` over `width`. */
void cfi_take_piece(const cfi_view_t *view, cfi_piece_t *piece)
{
    for (uint32_t i = 0U; i < 3U; i++) {
        cfi_cut(view->c[i], piece->low, piece->low + piece->width, piece->c[i]);
        piece->off[i] = view->off[i];
    }
}

/* Go on behind an interval, twice as wide where halves of [0, 1] allow it; false at the end. */
bool cfi_next_interval(double *low, double *width)
{
    const double twice = 2.0 * *width;
    *low += *width;
    const double number = *low / twice; /* whole at every second multiple of a width: exact in binary */
    if ((cfi_whole(number) == number) && ((*low + twice) <= 1.0)) {
        *width = twice;
    }
    return *low < 1.0;
}

/* Halve a piece; false if it is too narrow. */
bool cfi_halve_piece(cfi_piece_t *piece)
{
    const bool wide = ((piece->width * CFF_FINEST) > 1.0);
    if (wide) {
        piece->width *= 0.5;
    }
    return wide;
}
