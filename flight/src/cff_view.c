/*
 * Views: two arcs seen at once, and how far along nothing can happen (closeform/motion/certified_march.py,
 * conflicts/exclusion.py).
 *
 * Per axis the relative position is the sum of `derivative k` times a function that is t^k/k! at n = 0.
 */
#include <math.h>

#include "cff_internal.h"

#define ANGLE 1.0       /* reach of a view of thrust, in n t: the bounds hold up to here */
#define COAST_ANGLE 3.0 /* and of natural motion */
#define TAYLOR_DEGREE 14U
#define TAYLOR_ANGLE 0.25 /* reach in n t: the terms left out are below 1e-17 of the squared norm */
#define TAYLOR_TRIES 80U

static bool both_coast(const cff_arc_t *a, const cff_arc_t *b)
{
    return (a->mean_motion_rad_s == b->mean_motion_rad_s) && !cfi_thrusts(a) && !cfi_thrusts(b);
}

/* How far both arcs are seen at once from t on: to where one ends, or the bounds get wide. */
double cfi_view_end(const cff_arc_t *a, const cff_arc_t *b, double t, double end)
{
    const double n = cfi_max(a->mean_motion_rad_s, b->mean_motion_rad_s);
    const double stop = cfi_min(cfi_min(end, a->end_s), b->end_s);
    return (n == 0.0) ? stop : cfi_min(stop, t + ((both_coast(a, b) ? COAST_ANGLE : ANGLE) / n));
}

static void to_zone_units(const cff_zone_t *zone, double q[3])
{
    const double r[3] = {q[0], q[1], q[2]};
    for (uint32_t i = 0U; i < 3U; i++) {
        q[i] = cfi_dot(zone->to_unit_per_m[i], r);
    }
}

/* See both arcs from time t on. */
void cfi_see(const cff_arc_t *a, const cff_arc_t *b, double t, const cff_zone_t *zone, cfi_view_t *view)
{
    view->n = cfi_max(a->mean_motion_rad_s, b->mean_motion_rad_s);
    for (uint32_t k = 0U; k < CFF_ORDER; k++) {
        for (uint32_t i = 0U; i < 3U; i++) {
            view->q[k][i] = 0.0;
        }
    }
    if (both_coast(a, b) && (view->n > 0.0)) { /* the difference of two natural motions is one */
        cfi_motion_t m;
        cfi_motion_t other;
        cfi_state(a, t, &m);
        cfi_state(b, t, &other);
        for (uint32_t i = 0U; i < 3U; i++) {
            m.r[i] -= other.r[i];
            m.v[i] -= other.v[i];
        }
        view->order = CFF_COAST_ORDER;
        for (uint32_t k = 0U; k < CFF_COAST_ORDER; k++) {
            double acceleration[3];
            cfi_accelerate(view->n, m.r, m.v, acceleration);
            for (uint32_t i = 0U; i < 3U; i++) {
                view->q[k][i] = m.r[i];
                m.r[i] = m.v[i];
                m.v[i] = acceleration[i];
            }
        }
    } else {
        view->order = (cfi_is_cubic(a) && cfi_is_cubic(b)) ? CFF_COAST_ORDER : CFF_ORDER;
        cfi_add_derivatives(a, t, view->order, 1.0, view->q);
        cfi_add_derivatives(b, t, view->order, -1.0, view->q);
    }
    for (uint32_t k = 0U; k < view->order; k++) {
        to_zone_units(zone, view->q[k]);
    }
}

/* Relative position and velocity at time t after the view's start. */
void cfi_evaluate(const cfi_view_t *view, double t, cfi_motion_t *out)
{
    if (view->order == CFF_COAST_ORDER) {
        double p[3];
        cfi_oscillation(view->n, t, p);
        for (uint32_t i = 0U; i < 3U; i++) {
            const double v = view->q[1][i];
            const double a = view->q[2][i];
            const double b = view->q[3][i];
            out->r[i] = view->q[0][i] + (v * t) + (a * p[1]) + (b * p[2]);
            out->v[i] = v + (a * p[0]) + (b * p[1]);
        }
    } else {
        cfi_transforms_t k;
        cfi_transforms(view->n, t, &k);
        const double b2 = 0.5 * t * t;
        const double b3 = b2 * t / 3.0;
        const double b4 = k.q1 + (2.0 * view->n * view->n * k.q3);
        const double b5 = k.q2 + (2.0 * view->n * view->n * k.q4);
        const double d4 = k.q0 + (2.0 * view->n * view->n * k.q2);
        for (uint32_t i = 0U; i < 3U; i++) {
            const double x = view->q[0][i] + (view->q[1][i] * t) + (view->q[2][i] * b2) + (view->q[3][i] * b3);
            const double v = view->q[1][i] + (view->q[2][i] * t) + (view->q[3][i] * b2) + (view->q[4][i] * d4);
            out->r[i] = x + (view->q[4][i] * b4) + (view->q[5][i] * b5) + (view->q[6][i] * k.q3) + (view->q[7][i] * k.q4);
            out->v[i] = v + (view->q[5][i] * b4) + (view->q[6][i] * k.q2) + (view->q[7][i] * k.q3);
        }
    }
}

/* Greatest |acceleration| and |velocity| of natural motion along one axis over [0, h]. */
static void bound_of_coast(const cfi_view_t *view, double h, uint32_t i, double *acceleration, double *speed)
{
    const double n = view->n;
    const double b = fabs(view->q[2][i]);
    const double c = fabs(view->q[3][i]);
    const double v = fabs(view->q[1][i]);
    if (n == 0.0) {
        *acceleration = cfi_max(b, fabs(view->q[2][i] + (view->q[3][i] * h)));
        *speed = v + (*acceleration * h);
    } else if ((n * h) < 0.1) {
        *acceleration = b + (c * h);
        *speed = v + ((b + (c * h)) * h);
    } else {
        const double swing = sqrt((b * b) + (c * c / (n * n)));
        const double mean = fabs(view->q[1][i] + (view->q[3][i] / (n * n)));
        *acceleration = cfi_min(swing, b + (c * h));
        *speed = cfi_min(v + (*acceleration * h), mean + (swing / n));
    }
}

/*
 * The same with thrust: a cubic within the hull of its Bernstein coefficients, and the rest for
 * n h <= 1: |b4'' - t^2/2| <= (nt)^4/360 t^2/2, |b5'' - t^3/6| <= (nt)^4/840 t^3/6, and the last two
 * second derivatives are below t^4/24 and t^5/120.
 */
static void bound_of_thrust(const cfi_view_t *view, double h, uint32_t i, double *acceleration, double *speed)
{
    const double hh = h * h;
    const double angle = (view->n * h) * (view->n * h);
    const double c1 = view->q[3][i] * h;
    const double c2 = 0.5 * view->q[4][i] * h * h;
    const double c3 = view->q[5][i] * h * h * h / 6.0;
    const double m0 = view->q[2][i];
    const double m1 = m0 + (c1 / 3.0);
    const double m2 = m0 + (((2.0 * c1) + c2) / 3.0);
    const double m3 = m0 + c1 + c2 + c3;
    double rest = (fabs(c2) + fabs(c3)) * (angle * angle) / 360.0;
    rest += (fabs(view->q[6][i]) * (hh * hh) / 24.0) + (fabs(view->q[7][i]) * (h * (hh * hh)) / 120.0);
    *acceleration = cfi_max(cfi_max(fabs(m0), fabs(m1)), cfi_max(fabs(m2), fabs(m3))) + rest;
    *speed = fabs(view->q[1][i]) + (*acceleration * h);
}

void cfi_bounds(const cfi_view_t *view, double h, cfi_bounds_t *out)
{
    double speed[3];
    for (uint32_t i = 0U; i < 3U; i++) {
        if (view->order == CFF_COAST_ORDER) {
            bound_of_coast(view, h, i, &out->axis[i], &speed[i]);
        } else {
            bound_of_thrust(view, h, i, &out->axis[i], &speed[i]);
        }
    }
    out->acceleration = sqrt(cfi_dot(out->axis, out->axis));
    out->speed = sqrt(cfi_dot(speed, speed));
}

/* Taylor coefficients of the relative position. */
static void expand(const cfi_view_t *view, double c[TAYLOR_DEGREE + 1U][3])
{
    const double nn = view->n * view->n;
    double factorial = 1.0;
    double d[TAYLOR_DEGREE + 1U][3];
    for (uint32_t k = 0U; k <= TAYLOR_DEGREE; k++) {
        for (uint32_t i = 0U; i < 3U; i++) {
            d[k][i] = 0.0;
        }
    }
    for (uint32_t k = 0U; k <= TAYLOR_DEGREE; k++) {
        factorial *= (k > 0U) ? (double)k : 1.0;
        for (uint32_t i = 0U; i < 3U; i++) {
            if (k < view->order) {
                d[k][i] = view->q[k][i];
            } else if (view->order == CFF_COAST_ORDER) {
                d[k][i] = -nn * d[k - 2U][i];
            } else {
                d[k][i] = -nn * ((2.0 * d[k - 2U][i]) + (nn * d[k - 4U][i]));
            }
            c[k][i] = d[k][i] / factorial;
        }
    }
}

/* How long from the view's start on a Euclidean norm certainly conflicts on its side of the target. */
double cfi_taylor_step(const cfi_view_t *view, double longest, double target, bool inside)
{
    const double sign = inside ? -1.0 : 1.0;
    double c[TAYLOR_DEGREE + 1U][3];
    double f[TAYLOR_DEGREE + 1U];
    double h = (view->n == 0.0) ? longest : cfi_min(longest, TAYLOR_ANGLE / view->n);
    double found = 0.0;
    expand(view, c);
    for (uint32_t k = 0U; k <= TAYLOR_DEGREE; k++) {
        f[k] = 0.0;
        for (uint32_t i = 0U; i <= k; i++) {
            f[k] += sign * cfi_dot(c[i], c[k - i]);
        }
    }
    const double gap = f[0] - (sign * target * target);
    for (uint32_t tries = 0U; (tries < TAYLOR_TRIES) && !(found > 0.0); tries++) {
        double lowest = 0.0;
        double power = 1.0;
        for (uint32_t k = 1U; k <= TAYLOR_DEGREE; k++) {
            power *= h;
            lowest += cfi_min(0.0, f[k] * power);
        }
        if ((gap + lowest) > 0.0) {
            found = h;
        }
        h *= 0.6;
    }
    return found;
}

/* Whether natural motion conflicts beyond reach along direction w, on one side, all over [0, h]. */
static bool apart_along(const cfi_view_t *view, double h, const double w[3], double reach)
{
    const double square = 1.0 / (view->n * view->n);
    const double place = cfi_dot(w, view->q[0]);
    const double speed = cfi_dot(w, view->q[1]);
    const double cosine = cfi_dot(w, view->q[2]) * square;
    const double sine = cfi_dot(w, view->q[3]) * square;
    const double first = place + cosine;
    const double last = first + ((speed + sine) * h);
    const double least = (first < 0.0) ? -cfi_max(first, last) : cfi_min(first, last);
    const double clear = least - (reach * (1.0 + 1e-9));
    return (clear > 0.0) && ((clear * clear) > (((cosine * cosine) + (sine * sine * square)) * (1.0 + 1e-9)));
}

/* A lower bound of the distance from the origin over [0, h] of natural motion: a drifting ellipse. */
static double ring_clearance(const cfi_view_t *view, double h)
{
    const double n = view->n;
    const double square = 1.0 / (n * n);
    double cc = 0.0;
    double ca = 0.0;
    double cb = 0.0;
    double aa = 0.0;
    double bb = 0.0;
    double ab = 0.0;
    double dd = 0.0;
    for (uint32_t i = 0U; i < 3U; i++) {
        const double a = -view->q[2][i] * square;
        const double b = -view->q[3][i] * square / n;
        const double d = 0.5 * (view->q[1][i] + (view->q[3][i] * square)) * h;
        const double c = view->q[0][i] - a + d;
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

/* Whether natural motion keeps two craft apart all over [0, h], by bounds in closed form. */
bool cfi_coasts_apart(const cfi_view_t *view, cff_shape_t shape, double h)
{
    static const double axes[3][3] = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}};
    bool apart = false;
    if ((view->n * h) >= 1e-3) { /* below, centre and oscillation cancel, and nothing is gained */
        const double farthest = (shape == CFF_ELLIPSOID) ? 1.0 : 1.7320509;
        const double *a = view->q[2];
        const double *b = view->q[3];
        const double w[3] = {(a[1] * b[2]) - (a[2] * b[1]), (a[2] * b[0]) - (a[0] * b[2]), (a[0] * b[1]) - (a[1] * b[0])};
        const double support = (shape == CFF_ELLIPSOID) ? sqrt(cfi_dot(w, w)) : (fabs(w[0]) + fabs(w[1]) + fabs(w[2]));
        apart = (ring_clearance(view, h) > (farthest * (1.0 + 1e-9))) || apart_along(view, h, w, support);
        for (uint32_t i = 0U; (i < 3U) && !apart; i++) {
            apart = apart_along(view, h, axes[i], 1.0);
        }
    }
    return apart;
}
