/*
 * Views: the relative position of two arcs as polynomials, and its pieces.
 *
 * By Hill's equations the relative position is known by its first derivatives, of which the later ones
 * follow.  Its power series over an angle n t of at most REACH, cut to degree 11 so that the largest error is
 * least, becomes a Bernstein polynomial.  Beside a table it is the polynomial of a window.
 */
#include <math.h>
#include <stddef.h>

#include "cff_internal.h"

#define REACH 0.7853981633974483 /* rad: eight views an orbit; with six, errors reach 1e-10 of far positions */
#define ROUNDING 4.0e-15         /* of a coordinate, relative to the largest coefficient */
#define ON_JOINT 1.0e-14

static bool both_coast(const cff_arc_t *a, const cff_arc_t *b) { return !cfi_thrusts(a) && !cfi_thrusts(b); }

/* The derivatives of the relative position at time t, in zone units; how many fix the motion. */
static uint32_t derivatives(const cff_arc_t *a, const cff_arc_t *b, double t, const cff_zone_t *zone,
                            double q[CFF_ORDER][3])
{
    const uint32_t order = both_coast(a, b) ? CFF_COAST_ORDER : CFF_ORDER;
    for (uint32_t k = 0U; k < CFF_ORDER; k++) {
        for (uint32_t i = 0U; i < 3U; i++) {
            q[k][i] = 0.0;
        }
    }
    cfi_add_derivatives(a, t, order, 1.0, q);
    cfi_add_derivatives(b, t, order, -1.0, q);
    for (uint32_t k = 0U; k < order; k++) {
        const double r[3] = {q[k][0], q[k][1], q[k][2]};
        for (uint32_t i = 0U; i < 3U; i++) {
            q[k][i] = cfi_dot(zone->to_unit_per_m[i], r);
        }
    }
    return order;
}

/* Fill the polynomials of a view by Hill's equations, from its start over its length. */
static void see_hill(const cff_arc_t *a, const cff_arc_t *b, const cff_zone_t *zone, cfi_view_t *view)
{
    const double h = view->length;
    const double angle = a->mean_motion_rad_s * h;
    const double zz = angle * angle;
    double q[CFF_ORDER][3];
    const uint32_t order = derivatives(a, b, view->from_s, zone, q);
    const double first = (order == CFF_COAST_ORDER) ? 1.0 : 2.0;
    const double second = (order == CFF_COAST_ORDER) ? 0.0 : 1.0;
    for (uint32_t i = 0U; i < 3U; i++) {
        double powers[CFF_POWERS] = {0};
        double scale = 1.0;
        for (uint32_t k = 0U; k < CFF_ORDER; k++) {
            scale *= (k > 0U) ? (h / (double)k) : 1.0;
            powers[k] = q[k][i] * scale;
        }
        for (uint32_t k = order; k < CFF_POWERS; k++) { /* by (D^2 + n^2) or its square */
            const double kk = (double)k * ((double)k - 1.0);
            powers[k] = -(zz * first / kk) * powers[k - 2U];
            powers[k] -= (second * zz * zz / (kk * ((double)k - 2.0) * ((double)k - 3.0))) * powers[k - 4U];
        }
        cfi_from_powers(powers, view->c[i], &view->off[i]);
    }
}

/* Fill the polynomials of a view beside a table, from angle `view->first` over its length. */
static void see_table(const cff_cursor_t *one, const cff_cursor_t *other, const cff_zone_t *zone, cfi_view_t *view)
{
    const cff_table_t *chief = view->chief;
    const double size = cfi_window_end(chief, one) - one->origin_rad;
    const double low = cfi_min(cfi_max((view->first - one->origin_rad) / size, 0.0), 1.0);
    const double high = cfi_min(low + (view->length / size), 1.0);
    const double *errors = &chief->errors[(size_t)one->window * CFF_COLUMNS];
    double r[3][CFF_TERMS] = {0};
    double off = 0.0;
    for (uint32_t j = 0U; j < CFF_COLUMNS; j++) {
        const double z = one->columns[j] - other->columns[j];
        const double *row = &chief->rows[(((size_t)one->window * CFF_COLUMNS) + j) * 72U];
        const bool moves = (z != 0.0);
        for (uint32_t i = 0U; (i < 3U) && moves; i++) {
            for (uint32_t k = 0U; k < CFF_TERMS; k++) {
                r[i][k] += z * row[(i * CFF_TERMS) + k];
            }
        }
        off += fabs(z) * errors[j];
    }
    for (uint32_t i = 0U; i < 3U; i++) {
        const double *m = zone->to_unit_per_m[i];
        double whole[CFF_TERMS];
        for (uint32_t k = 0U; k < CFF_TERMS; k++) {
            whole[k] = ((m[0] * r[0][k]) + (m[1] * r[1][k])) + (m[2] * r[2][k]);
        }
        view->off[i] += off * (fabs(m[0]) + fabs(m[1]) + fabs(m[2]));
        cfi_cut(whole, low, high, view->c[i]);
    }
}

/* Move a place on to the arc and the window in which a path goes on after time t. */
bool cfi_follow(const cff_path_t *path, cff_cursor_t *place, double t)
{
    bool good = true;
    uint32_t arc = place->arc;
    while (((arc + 1U) < path->count) && (path->arcs[arc].end_s <= t)) { /* at most CFF_MOST_ARCS turns */
        arc++;
    }
    if (path->chief != NULL) {
        if (arc != place->arc) {
            good = cfi_place(path->chief, &path->arcs[arc], t, place);
        } else {
            cfi_go_on(path->chief, place, t);
        }
    }
    place->arc = arc;
    return good;
}

/* Set places to where two paths are at time t. */
bool cfi_begin_places(const cff_path_t *one, cff_cursor_t *at_one, const cff_path_t *other, cff_cursor_t *at_other, double t)
{
    bool good = true;
    at_one->arc = cfi_locate(one, t);
    at_other->arc = cfi_locate(other, t);
    if (one->chief != NULL) {
        good = cfi_place(one->chief, &one->arcs[at_one->arc], t, at_one);
        good = cfi_place(one->chief, &other->arcs[at_other->arc], t, at_other) && good;
    }
    return good;
}

/* View two paths from time t on, for as long as one polynomial serves, at most until `end`. */
void cfi_see(const cff_path_t *one, cff_cursor_t *at_one, const cff_path_t *other, cff_cursor_t *at_other, double t,
             double end, const cff_zone_t *zone, cfi_view_t *view)
{
    (void)cfi_follow(one, at_one, t);
    (void)cfi_follow(other, at_other, t);
    const cff_arc_t *a = &one->arcs[at_one->arc];
    const cff_arc_t *b = &other->arcs[at_other->arc];
    double stop = cfi_max(t, cfi_min(cfi_min(end, a->end_s), b->end_s));
    view->chief = one->chief;
    view->from_s = t;
    for (uint32_t i = 0U; i < 3U; i++) {
        view->off[i] = 0.0;
    }
    if (view->chief != NULL) {
        const double finish = cfi_min(cfi_window_end(view->chief, at_one), cfi_window_end(view->chief, at_other));
        view->first = cfi_angle(view->chief, t);
        double last = cfi_angle(view->chief, stop);
        if (finish < (last - ON_JOINT)) {
            last = finish;
            stop = cfi_max(t, cfi_min(stop, cfi_time(view->chief, finish)));
        }
        view->length = cfi_max(last - view->first, 0.0);
        view->until_s = stop;
        see_table(at_one, at_other, zone, view);
    } else {
        const double n = a->mean_motion_rad_s;
        view->until_s = (n > 0.0) ? cfi_min(stop, t + (REACH / n)) : stop;
        view->first = t;
        view->length = view->until_s - t;
        see_hill(a, b, zone, view);
    }
    for (uint32_t i = 0U; i < 3U; i++) {
        double largest = 0.0;
        for (uint32_t k = 0U; k < CFF_TERMS; k++) {
            largest = cfi_max(largest, fabs(view->c[i][k]));
        }
        view->off[i] += ROUNDING * largest;
    }
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

/* Whether natural motion stays beyond reach along direction w, on one side, all over [0, h]. */
static bool apart_along(double q[CFF_ORDER][3], double n, double h, const double w[3], double reach)
{
    const double square = 1.0 / (n * n);
    const double place = cfi_dot(w, q[0]);
    const double speed = cfi_dot(w, q[1]);
    const double cosine = cfi_dot(w, q[2]) * square;
    const double sine = cfi_dot(w, q[3]) * square;
    const double first = place + cosine;
    const double last = first + ((speed + sine) * h);
    const double least = (first < 0.0) ? -cfi_max(first, last) : cfi_min(first, last);
    const double clear = least - (reach * (1.0 + 1e-9));
    return (clear > 0.0) && ((clear * clear) > (((cosine * cosine) + (sine * sine * square)) * (1.0 + 1e-9)));
}

/* A lower bound of the distance from the origin over [0, h] of natural motion: a drifting ellipse. */
static double ring_clearance(double q[CFF_ORDER][3], double n, double h)
{
    const double square = 1.0 / (n * n);
    double cc = 0.0;
    double ca = 0.0;
    double cb = 0.0;
    double aa = 0.0;
    double bb = 0.0;
    double ab = 0.0;
    double dd = 0.0;
    for (uint32_t i = 0U; i < 3U; i++) {
        const double a = -q[2][i] * square;
        const double b = -q[3][i] * square / n;
        const double d = 0.5 * (q[1][i] + (q[3][i] * square)) * h;
        const double c = q[0][i] - a + d;
        cc += c * c;
        dd += d * d;
        ca += c * a;
        cb += c * b;
        aa += a * a;
        bb += b * b;
        ab += a * b;
    }
    const double mean = cc + (0.5 * (aa + bb));
    const double first = 2.0 * sqrt((ca * ca) + (cb * cb));
    const double second = sqrt((0.25 * (aa - bb) * (aa - bb)) + (ab * ab));
    const double least = (mean * (1.0 - 1e-13)) - first - second; /* less what rounding can have taken */
    return (least > 0.0) ? (sqrt(least) - sqrt(dd)) : -1.0;
}

/* Whether two arcs of natural motion keep apart for h from time t on, by bounds in closed form. */
bool cfi_coasts_apart(const cff_arc_t *a, const cff_arc_t *b, double t, const cff_zone_t *zone, double h)
{
    static const double axes[3][3] = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}};
    const double n = a->mean_motion_rad_s;
    bool apart = false;
    if (both_coast(a, b) && ((n * h) >= 1e-3)) { /* below, centre and oscillation cancel, and nothing is gained */
        const bool ball = (zone->shape == CFF_ELLIPSOID);
        const double farthest = ball ? 1.0 : 1.7320509; /* point of the zone */
        double q[CFF_ORDER][3];
        (void)derivatives(a, b, t, zone, q);
        const double w[3] = {(q[2][1] * q[3][2]) - (q[2][2] * q[3][1]), (q[2][2] * q[3][0]) - (q[2][0] * q[3][2]),
                             (q[2][0] * q[3][1]) - (q[2][1] * q[3][0])};
        const double support = ball ? sqrt(cfi_dot(w, w)) : (fabs(w[0]) + fabs(w[1]) + fabs(w[2]));
        apart = (ring_clearance(q, n, h) > (farthest * (1.0 + 1e-9))) || apart_along(q, n, h, w, support);
        for (uint32_t i = 0U; (i < 3U) && !apart; i++) {
            apart = apart_along(q, n, h, axes[i], 1.0);
        }
    }
    return apart;
}
