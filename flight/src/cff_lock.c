/*
 * The first lock of two lost craft (closeform/search/lock_march.py, schedule.py).
 *
 * For i in A and j in B, with q the vector from i's sensor to j's, both see each other when
 * g = |q| cos(half-angle) - b.(r + v t) + baseline <= 0 and |q| <= range.  The march steps as far as g
 * certainly conflicts positive: it never steps over a lock, however short.
 */
#include <math.h>

#include "cff_internal.h"

#define SEEN 1.0e-12 /* of the distance: a margin that small counts as a lock */
#define CLOSE 1.0e-8 /* s */
#define TINY 1.0e-300
#define UNIT 2.3e-16
#define PI 3.14159265358979323846

/* What bounds g'' all through a leg. */
typedef struct {
    double last;     /* the swinging part at the end, squared */
    double sideways; /* the velocity's part */
    double fast;     /* |q'| */
} leg_bounds_t;

/* What a step found. */
typedef struct {
    double h;    /* how long nothing certainly happens */
    bool locked; /* both see each other now */
    bool near;   /* or surely within 1e-8 s after h */
} step_t;

/* First h > 0 with gap + slope h - bend h^2 / 2 = 0, without cancellation. */
static double before(double gap, double slope, double bend)
{
    const double root = sqrt((slope * slope) + (2.0 * bend * gap));
    const double over = (slope <= 0.0) ? (2.0 * gap) : (slope + root);
    const double under = (slope <= 0.0) ? (root - slope) : bend;
    return over / (under + TINY);
}

static leg_bounds_t limits(const cff_leg_t *leg, const cff_sensor_t *sensor, const cff_state_t *relative)
{
    leg_bounds_t out;
    double e[3];
    for (uint32_t i = 0U; i < 3U; i++) {
        e[i] = relative->position_m[i] + (relative->velocity_m_s[i] * leg->end_s);
    }
    const double *v = relative->velocity_m_s;
    const double c = cfi_dot(leg->cosine, e);
    const double s = cfi_dot(leg->sine, e);
    const double cv = cfi_dot(leg->cosine, v);
    const double sv = cfi_dot(leg->sine, v);
    const double w = fabs(leg->rate_rad_s);
    out.last = (c * c) + (s * s);
    out.sideways = 2.0 * w * sqrt((cv * cv) + (sv * sv));
    out.fast = sqrt(cfi_dot(v, v)) + (sensor->baseline_m * w);
    return out;
}

static step_t step(const cff_leg_t *leg, const leg_bounds_t *bounds, const cff_sensor_t *sensor,
                   const cff_state_t *relative, double t)
{
    const double w = leg->rate_rad_s;
    const double c = sensor->cosine;
    double sa;
    double ca;
    double b[3];
    double d[3];
    double p[3];
    double q[3];
    double u[3];
    step_t out;
    cfi_sine_cosine(w * (t - leg->start_s), &sa, &ca);
    for (uint32_t i = 0U; i < 3U; i++) {
        b[i] = leg->steady[i] + (leg->cosine[i] * ca) + (leg->sine[i] * sa);
        d[i] = w * ((leg->sine[i] * ca) - (leg->cosine[i] * sa));
        p[i] = relative->position_m[i] + (relative->velocity_m_s[i] * t);
        q[i] = p[i] - (sensor->baseline_m * b[i]);
        u[i] = relative->velocity_m_s[i] - (sensor->baseline_m * d[i]);
    }
    const double distance = sqrt(cfi_dot(q, q));
    const double gap = (c * distance) - cfi_dot(b, q);
    const double beyond = distance - sensor->range_m;
    const double nothing = SEEN * (distance + (2.0 * sensor->baseline_m));
    const double growth = cfi_dot(q, u) / (distance + TINY);
    const double slope = (c * growth) - (cfi_dot(b, relative->velocity_m_s) + cfi_dot(d, p));
    /* b.(r + v t) bends by its swinging part, greatest at one end of the leg, and the velocity's */
    const double cp = cfi_dot(leg->cosine, p);
    const double sp = cfi_dot(leg->sine, p);
    const double now = (cp * cp) + (sp * sp);
    const double turning = sensor->baseline_m * w * w;
    /* c |q| is convex but for that; where c < 0 it is concave, twice |q'|^2 / |q| before |q| is halved */
    const double curved = (2.0 * bounds->fast * bounds->fast / (distance + TINY)) + turning;
    double bend = (w * w * sqrt(cfi_max(now, bounds->last))) + bounds->sideways + (cfi_max(c, 0.0) * turning);
    double longest = CFF_FOREVER;
    if (c < 0.0) {
        bend += -c * curved;
        longest = distance / ((2.0 * bounds->fast) + TINY);
    }
    const double unseen = (gap > nothing) ? cfi_min(before(gap, slope, bend), longest) : 0.0;
    const double unreached = (beyond > nothing) ? before(beyond, growth, turning) : 0.0;
    out.h = cfi_max(unseen, unreached);
    out.locked = (gap <= nothing) && (beyond <= nothing);
    /* Newton's method has come so near that the rest is below CLOSE, and it does cross */
    const double most = bend + (fabs(c) * curved);
    const double move = 2.2 * bounds->fast * out.h;
    out.near = ((most * out.h) < (-0.4 * slope)) && ((3.0 * most * out.h * out.h) < (-CLOSE * slope)) &&
               (distance > (2.0 * move)) && ((beyond + move) <= 0.0);
    return out;
}

static bool input_is_good(const cff_leg_t legs[], uint32_t leg_count, const cff_sensor_t *sensor,
                          const cff_state_t *relative, double from_s)
{
    bool good = (leg_count > 0U) && (leg_count <= CFF_MOST_LEGS) && cfi_state_finite(relative) && cfi_finite(&from_s, 1U);
    good = good && (sensor->baseline_m >= 0.0) && (sensor->baseline_m <= CFF_LARGEST);
    good = good && (sensor->cosine > -1.0) && (sensor->cosine < 1.0) && (sensor->range_m > 0.0);
    for (uint32_t k = 0U; (k < leg_count) && good; k++) {
        const cff_leg_t *leg = &legs[k];
        good = cfi_finite(&leg->start_s, 3U) && cfi_finite(leg->steady, 3U) && cfi_finite(leg->cosine, 3U);
        good = good && cfi_finite(leg->sine, 3U) && (leg->end_s > leg->start_s);
        good = good && (fabs(leg->rate_rad_s * (leg->end_s - leg->start_s)) <= CFF_LARGEST_ANGLE_RAD);
        good = good && ((k == 0U) || (leg->start_s >= legs[k - 1U].start_s));
    }
    const double size = fabs(relative->position_m[0]) + fabs(relative->position_m[1]) + fabs(relative->position_m[2]);
    return good && (size > (1.0 / CFF_LARGEST));
}

/* First lock within a leg from time t on; false where there is none before its end, or evaluations are spent. */
static bool lock_in_leg(const cff_leg_t *leg, const cff_sensor_t *sensor, const cff_state_t *relative, double from,
                        double *reached, uint32_t *evaluations)
{
    const leg_bounds_t bounds = limits(leg, sensor, relative);
    double t = from;
    bool on = true;
    bool found = false;
    while (on && (*evaluations > 0U)) { /* each turn costs a evaluation */
        cfi_spend(evaluations, 1U);
        const step_t now = step(leg, &bounds, sensor, relative, t);
        if (now.locked) {
            found = true;
            on = false;
        } else if (t >= leg->end_s) {
            on = false;
        } else if (now.near) {
            found = ((t + now.h) <= leg->end_s);
            t = cfi_min(t + now.h, leg->end_s);
            on = false;
        } else {
            t = cfi_min(leg->end_s, cfi_max(t + now.h, t * (1.0 + UNIT)));
        }
    }
    *reached = t;
    return found;
}

cff_status_t cff_first_lock(const cff_leg_t legs[], uint32_t leg_count, const cff_sensor_t *sensor,
                            const cff_state_t *relative, double from_s, uint32_t evaluations, cff_lock_t *lock)
{
    cff_status_t status = CFF_BAD_INPUT;
    uint32_t left = evaluations;
    lock->time_s = CFF_FOREVER;
    lock->leg = -1;
    lock->certified_until_s = from_s;
    if (input_is_good(legs, leg_count, sensor, relative, from_s)) {
        status = CFF_OK;
        for (uint32_t k = 0U; (k < leg_count) && (lock->leg < 0) && (status == CFF_OK); k++) {
            if (lock->certified_until_s <= legs[k].end_s) {
                double reached = 0.0;
                const double begin = cfi_max(lock->certified_until_s, legs[k].start_s);
                if (lock_in_leg(&legs[k], sensor, relative, begin, &reached, &left)) {
                    lock->leg = (int32_t)k;
                    lock->time_s = reached;
                } else if ((left == 0U) && (reached < legs[k].end_s)) {
                    status = CFF_MORE;
                } else {
                    /* on to the next leg */
                }
                lock->certified_until_s = reached;
            }
        }
    }
    lock->evaluations_used = evaluations - left;
    return status;
}

/* Turn `v` about a unit axis. */
static void turn(const double axis[3], double angle, double v[3])
{
    double s;
    double c;
    const double along = cfi_dot(axis, v);
    const double cross[3] = {(axis[1] * v[2]) - (axis[2] * v[1]), (axis[2] * v[0]) - (axis[0] * v[2]),
                             (axis[0] * v[1]) - (axis[1] * v[0])};
    cfi_sine_cosine(angle, &s, &c);
    for (uint32_t i = 0U; i < 3U; i++) {
        const double steady = axis[i] * along;
        v[i] = steady + (c * (v[i] - steady)) + (s * cross[i]);
    }
}

cff_status_t cff_modified_search(double slew_rate_rad_s, double tip_angle_rad, cff_leg_t legs[CFF_SEARCH_LEGS])
{
    static const double sun[3] = {0.0, 0.0, -1.0};
    /* Turns about body y, in tips; 0: about the sun line, first by 3 pi, in plane, later by half a turn. */
    static const double tips[8] = {0.0, 1.0, -2.0, 0.0, 2.0, 0.0, -2.0, 1.0};
    double body_y[3] = {0.0, 1.0, 0.0};
    double boresight[3] = {1.0, 0.0, 0.0};
    double start = 0.0;
    cff_status_t status = CFF_BAD_INPUT;
    if ((slew_rate_rad_s > 0.0) && (slew_rate_rad_s <= CFF_LARGEST) && (tip_angle_rad > 0.0) &&
        (tip_angle_rad < (0.5 * PI))) {
        for (uint32_t k = 0U; k < CFF_SEARCH_LEGS; k++) {
            const uint32_t place = k % 8U;
            const bool about_sun = (tips[place] == 0.0);
            const double swung = (place == 0U) ? (3.0 * PI) : PI;
            const double angle = about_sun ? swung : (tips[place] * tip_angle_rad);
            double axis[3];
            cff_leg_t *leg = &legs[k];
            for (uint32_t i = 0U; i < 3U; i++) {
                axis[i] = about_sun ? sun[i] : body_y[i];
            }
            const double along = cfi_dot(axis, boresight);
            leg->start_s = start;
            leg->end_s = start + (fabs(angle) / slew_rate_rad_s);
            leg->rate_rad_s = angle / (leg->end_s - leg->start_s);
            leg->sine[0] = (axis[1] * boresight[2]) - (axis[2] * boresight[1]);
            leg->sine[1] = (axis[2] * boresight[0]) - (axis[0] * boresight[2]);
            leg->sine[2] = (axis[0] * boresight[1]) - (axis[1] * boresight[0]);
            for (uint32_t i = 0U; i < 3U; i++) {
                leg->steady[i] = axis[i] * along;
                leg->cosine[i] = boresight[i] - leg->steady[i];
            }
            turn(axis, angle, boresight);
            turn(axis, angle, body_y);
            start = leg->end_s;
        }
        status = CFF_OK;
    }
    return status;
}
