/*
 * Certified least norm along one view (closeform/motion/extrema.py).
 *
 * Every candidate is a norm that was met; that there is no lesser one is the march's to say, and the
 * time up to which it has said so is what is returned.
 */
#include <math.h>

#include "cff_internal.h"

#define PRECISION 1.0e-11 /* a least norm is certain to this fraction of itself */
#define NIL 1.0e-13       /* a norm below counts as 0 */
#define SMALLEST 32.0     /* parts of a view; what is left is marched */
#define TURN_ANGLE 0.3    /* in n t: a local minimum is looked for in steps no longer than this */
#define UNIT (2.3e-16)    /* a step that time can resolve, of time */
#define SEARCH_STEPS 128U /* growing by 1.5 from 1e-15 to 1/16 of the view, and 26 more */
#define ROOT_STEPS 200U
#define NEARER 60U
#define SECANTS 100U

/* Two times between which the norm stops falling, and how fast it falls there. */
typedef struct {
    double before;
    double after;
    double high;
    double low;
} bracket_t;

static double slope(const cfi_view_t *view, cff_shape_t shape, double t)
{
    cfi_motion_t m;
    cfi_evaluate(view, t, &m);
    return -cfi_rate(shape, &m);
}

/* Between `before`, where the norm falls, and `after`, where it does not: regula falsi, at times the middle. */
static double turning_point(const cfi_view_t *view, cff_shape_t shape, const bracket_t *bracket, uint32_t *evaluations)
{
    const double fine = (shape == CFF_ELLIPSOID) ? 1e-12 : 4e-16; /* a smooth extremum is flat */
    double before = bracket->before;
    double after = bracket->after;
    double high = bracket->high;
    double low = bracket->low;
    bool on = true;
    for (uint32_t k = 0U; (k < ROOT_STEPS) && on; k++) {
        const double width = after - before;
        on = (width > (fine * (fabs(after) + width))) && (*evaluations > 0U);
        if (on) {
            cfi_spend(evaluations, 1U);
            double middle = before + (0.5 * width);
            if (((k % 4U) != 3U) && ((high - low) > 0.0)) {
                const double guess = before + (width * high / (high - low));
                if ((before < guess) && (guess < after)) {
                    middle = guess;
                }
            }
            const double here = slope(view, shape, middle);
            if (here > 0.0) {
                before = middle;
                high = here;
                low *= 0.5;
            } else {
                after = middle;
                low = here;
                high *= 0.5;
                on = (here < 0.0);
            }
        }
    }
    return after;
}

/* The next time in [t, stop] at which the norm stops falling. */
static double next_minimum(const cfi_view_t *view, cff_shape_t shape, double t, double stop, uint32_t *evaluations)
{
    bracket_t b = {t, t, 0.0, 1.0};
    cfi_motion_t m;
    double longest = (stop - t) / 16.0;
    bool on = (t < stop);
    if (view->n > 0.0) {
        longest = cfi_min(longest, TURN_ANGLE / view->n);
    }
    longest = cfi_max(longest, 1e-15 * stop);
    cfi_evaluate(view, t, &m);
    b.high = -cfi_rate(shape, &m);
    double step = (b.high != 0.0) ? cfi_min(longest, 0.25 * cfi_norm(shape, m.r) / fabs(b.high)) : longest;
    step = cfi_max(step, 1e-15 * stop);
    for (uint32_t k = 0U; (k < SEARCH_STEPS) && on; k++) {
        cfi_spend(evaluations, 1U);
        b.after = cfi_min(b.after + step, stop);
        b.low = slope(view, shape, b.after);
        if (b.low > 0.0) {
            b.before = b.after;
            b.high = b.low;
            step = cfi_min(1.5 * step, longest);
        }
        on = (b.low > 0.0) && (b.after < stop) && (*evaluations > 0U);
    }
    return (b.low > 0.0) ? b.after : turning_point(view, shape, &b, evaluations);
}

/* A local minimum that is reached from norm s at t; one beyond a maximum may be higher: then nearer by. */
static void local_minimum(const cfi_view_t *view, cff_shape_t shape, double t, double stop, double *least,
                          double *least_time, uint32_t *evaluations)
{
    const double s = *least;
    double end = stop;
    bool on = true;
    for (uint32_t k = 0U; (k < NEARER) && on; k++) {
        cfi_motion_t m;
        cfi_spend(evaluations, 2U);
        const double there = next_minimum(view, shape, t, end, evaluations);
        cfi_evaluate(view, there, &m);
        const double found = cfi_norm(shape, m.r);
        if (found < s) {
            *least = found;
            *least_time = there;
            on = false;
        } else {
            end = t + (0.25 * (there - t));
            on = (end > (t * (1.0 + 1e-15))) && (*evaluations > 0U);
        }
    }
}

/* Greatest length of the third derivative of natural motion over [0, h]. */
static double jerk_bound(const cfi_view_t *view, double h)
{
    double square = 0.0;
    for (uint32_t i = 0U; i < 3U; i++) {
        const double b = view->n * view->q[2][i];
        const double c = fabs(view->q[3][i]);
        const double most = c + (view->n * h * fabs(view->q[2][i]));
        square += cfi_min((b * b) + (c * c), most * most);
    }
    return sqrt(square);
}

/* Lower bounds within h of time t: of |q|, and of half the second derivative of |q|^2, v.v + r.r''. */
static void nearest_and_bend(const cfi_view_t *view, double t, double h, double a, double jerk, double *nearest,
                             double *bend)
{
    cfi_motion_t m;
    cfi_evaluate(view, t, &m);
    const double distance = sqrt(cfi_dot(m.r, m.r));
    const double speed = sqrt(cfi_dot(m.v, m.v));
    const double fastest = speed + (a * h);
    const double farthest = distance + (fastest * h);
    *nearest = distance - (fastest * h);
    if (view->order == CFF_COAST_ORDER) {
        double p[3];
        cfi_oscillation(view->n, t, p);
        const double c = 1.0 - (view->n * view->n * p[1]);
        double along = 0.0;
        for (uint32_t i = 0U; i < 3U; i++) {
            along += m.r[i] * ((view->q[2][i] * c) + (view->q[3][i] * p[0]));
        }
        *bend = (speed * speed) + along - (((3.0 * fastest * a) + (farthest * jerk)) * h);
    } else {
        const double slowest = cfi_max(speed - (a * h), 0.0);
        *bend = (slowest * slowest) - (a * farthest);
    }
}

/* Half the rate of |q|^2. */
static double half_slope(const cfi_view_t *view, double t)
{
    cfi_motion_t m;
    cfi_evaluate(view, t, &m);
    return cfi_dot(m.r, m.v);
}

/* Where |q|^2 is least in [from, to], over which it is convex: by secants of its slope. */
static double bottom(const cfi_view_t *view, double from, double to, uint32_t *evaluations)
{
    double low = from;
    double high = to;
    double u = low;
    double w = high;
    double slope_u = half_slope(view, low);
    double slope_w = (slope_u < 0.0) ? half_slope(view, high) : slope_u;
    const double fine = 1e-9 * (high - low); /* a secant from as near as that is exact */
    if (slope_u >= 0.0) {
        w = low;
    } else if (slope_w <= 0.0) {
        w = high;
    } else {
        bool on = true;
        for (uint32_t k = 0U; (k < SECANTS) && on; k++) {
            double t = (slope_w != slope_u) ? (w - (slope_w * (w - u) / (slope_w - slope_u))) : w;
            if (fabs(t - w) <= fine) {
                w = cfi_min(cfi_max(t, low), high);
                on = false;
            } else {
                if (!((low < t) && (t < high)) || ((k % 8U) == 7U)) {
                    t = 0.5 * (low + high);
                }
                u = w;
                slope_u = slope_w;
                w = t;
                slope_w = half_slope(view, t);
                cfi_spend(evaluations, 1U);
                on = (slope_w != 0.0) && (*evaluations > 0U);
                if (slope_w > 0.0) {
                    high = t;
                } else {
                    low = t;
                }
            }
        }
    }
    return w;
}

/*
 * Least |q| over [0, stop], if below `best`, by pieces in which |q|^2 is convex or too large.  Returns
 * the time reached: short of the end where a part of 1/SMALLEST is neither, or where evaluations are spent.
 */
static double least_length(const cfi_view_t *view, double stop, double a, double *best, double *best_time,
                           uint32_t *evaluations)
{
    const double jerk = (view->order == CFF_COAST_ORDER) ? jerk_bound(view, stop) : 0.0;
    double t = 0.0;
    double piece = stop;
    bool on = true;
    while (on && (*evaluations > 0U)) { /* each turn costs a evaluation */
        cfi_spend(evaluations, 1U);
        const double end = cfi_min(t + piece, stop);
        double nearest;
        double bend;
        nearest_and_bend(view, 0.5 * (t + end), 0.5 * (end - t), a, jerk, &nearest, &bend);
        if ((nearest < *best) && !(bend > 0.0)) {
            piece *= 0.5;
            on = ((piece * SMALLEST) >= stop);
        } else {
            bool sure = true;
            if (nearest < *best) {
                cfi_motion_t m;
                cfi_spend(evaluations, 3U);
                const double when = bottom(view, t, end, evaluations);
                sure = (*evaluations > 0U);
                cfi_evaluate(view, when, &m);
                const double s = sqrt(cfi_dot(m.r, m.r));
                if (s < (*best * (1.0 - PRECISION))) { /* of equals the first, as orbit after orbit */
                    *best = s;
                    *best_time = when;
                }
            }
            if (!sure) {
                on = false; /* the piece is not known to have been searched to its bottom */
            } else if (*best <= NIL) {
                *best = 0.0;
                t = stop;
                on = false;
            } else {
                t = end;
                piece *= 2.0;
                on = (end < stop);
            }
        }
    }
    return t;
}

/* March towards `stop`, at most `patience` steps: the time reached. */
static double march(const cfi_view_t *view, cff_shape_t shape, const cfi_bounds_t *bounds, double from, double stop,
                    uint32_t patience, double *best, double *best_time, uint32_t *evaluations)
{
    double t = from;
    bool on = true;
    for (uint32_t k = 0U; (k < patience) && on && (*evaluations > 0U); k++) {
        cfi_motion_t m;
        cfi_spend(evaluations, 1U);
        cfi_evaluate(view, t, &m);
        const double s = cfi_norm(shape, m.r);
        if (s < *best) {
            *best = s;
            *best_time = t;
            if ((s > NIL) && (cfi_rate(shape, &m) < 0.0)) {
                local_minimum(view, shape, t, stop, best, best_time, evaluations);
            }
        }
        if (*best <= NIL) {
            *best = 0.0;
            t = stop;
            on = false;
        } else if (t >= stop) {
            on = false;
        } else {
            const double h = cfi_outside_step(shape, &m, bounds, *best * (1.0 - PRECISION));
            t = cfi_min(stop, cfi_max(t + h, t * (1.0 + UNIT)));
        }
    }
    return t;
}

/*
 * Least norm over [0, stop] of the view's own time, if below `best`.  Returns the time reached: short of
 * `stop` where the march stalls, and is to go on in another view, or where evaluations are spent.
 */
double cfi_minimum(const cfi_view_t *view, cff_shape_t shape, double stop, uint32_t patience, double *best,
                    double *best_time, uint32_t *evaluations)
{
    cfi_bounds_t bounds;
    double t = 0.0;
    cfi_bounds(view, stop, &bounds);
    if ((shape == CFF_ELLIPSOID) && (stop > 0.0)) {
        t = least_length(view, stop, bounds.acceleration, best, best_time, evaluations);
    }
    if ((t < stop) || (stop <= 0.0)) {
        const double aim = *best * (1.0 - PRECISION);
        if ((shape == CFF_ELLIPSOID) && (patience == CFF_LESS_PATIENCE) && (t == 0.0) && (aim > 0.0) &&
            (cfi_norm(shape, view->q[0]) > aim) && (*evaluations >= CFF_TAYLOR_EVALUATIONS)) {
            cfi_spend(evaluations, CFF_TAYLOR_EVALUATIONS);
            t = cfi_taylor_step(view, stop, aim, false);
        }
        t = march(view, shape, &bounds, t, stop, patience, best, best_time, evaluations);
    }
    return t;
}
