/*
 * Zones: all that a march knows of a ball and a cube, in zone units (closeform/zones/shapes.py).
 *
 * The norm is 1 on the surface.  Outside, a norm s with rate D and an acceleration below A keeps
 * s(t + h) >= s(t) + D h - A h^2 / 2; inside, each flat part and the square of a round one do the same
 * upside down.
 */
#include <math.h>

#include "cff_internal.h"

static double length(const double v[3]) { return sqrt((v[0] * v[0]) + (v[1] * v[1]) + (v[2] * v[2])); }

double cfi_norm(cff_shape_t shape, const double r[3])
{
    return (shape == CFF_ELLIPSOID) ? length(r) : cfi_max(cfi_max(fabs(r[0]), fabs(r[1])), fabs(r[2]));
}

/* Rate of the norm, to the right where it has a kink: the greatest of the parts that attain it. */
double cfi_rate(cff_shape_t shape, const cfi_motion_t *m)
{
    const double s = cfi_norm(shape, m->r);
    double rate = -CFF_FOREVER;
    if (shape == CFF_ELLIPSOID) {
        rate = (s > 0.0) ? (cfi_dot(m->r, m->v) / s) : length(m->v);
    } else {
        for (uint32_t i = 0U; i < 3U; i++) {
            if (fabs(m->r[i]) >= s) {
                const double away = (m->r[i] > 0.0) ? m->v[i] : -m->v[i];
                rate = cfi_max(rate, (s > 0.0) ? away : fabs(m->v[i]));
            }
        }
    }
    return rate;
}

/* First h > 0 with gap + rate h - curvature h^2 / 2 = 0, without cancellation. */
static double time_to_level(double gap, double rate, double curvature)
{
    const double root = sqrt((rate * rate) + (2.0 * curvature * gap));
    double h = CFF_FOREVER;
    if (rate < 0.0) {
        h = 2.0 * gap / (root - rate);
    } else if (curvature > 0.0) {
        h = (rate + root) / curvature;
    } else {
        /* it never falls */
    }
    return h;
}

/* How long the norm certainly conflicts above the target, which it is: the best of the parts above it. */
double cfi_outside_step(cff_shape_t shape, const cfi_motion_t *m, const cfi_bounds_t *b, double target)
{
    double h = 0.0;
    if (shape == CFF_ELLIPSOID) {
        const double s = length(m->r);
        h = time_to_level(s - target, cfi_dot(m->r, m->v) / s, b->acceleration);
    } else {
        for (uint32_t i = 0U; i < 3U; i++) {
            const double s = fabs(m->r[i]);
            if (s > target) {
                h = cfi_max(h, time_to_level(s - target, (m->r[i] > 0.0) ? m->v[i] : -m->v[i], b->axis[i]));
            }
        }
    }
    return h;
}

/* How long the norm certainly conflicts below the target, which it is: the least of the parts. */
double cfi_inside_step(cff_shape_t shape, const cfi_motion_t *m, const cfi_bounds_t *b, double target)
{
    double h = CFF_FOREVER;
    if (shape == CFF_ELLIPSOID) {
        const double gap = (target * target) - cfi_dot(m->r, m->r);
        h = time_to_level(gap, -2.0 * cfi_dot(m->r, m->v),
                          2.0 * ((b->speed * b->speed) + (target * b->acceleration)));
    } else {
        for (uint32_t i = 0U; i < 3U; i++) {
            h = cfi_min(h, time_to_level(target - m->r[i], -m->v[i], b->axis[i]));
            h = cfi_min(h, time_to_level(target + m->r[i], m->v[i], b->axis[i]));
        }
    }
    return h;
}
