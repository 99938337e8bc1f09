/*
 * The first lock of two lost craft (closeform/search/lock_march.py, schedule.py).
 *
 * For i in A and j in B, with q the vector from i's sensor to j's, both see each other when
 * g = |q| cos(half-angle) - b.q <= 0 and |q| <= range.  The march steps as far as g
 * certainly stays positive: it never steps over a lock, however short.
 */
#include <math.h>

#include "cff_internal.h"

#define SEEN 1.0e-12 /* of the distance: a margin that small counts as a lock */
#define CLOSE 1.0e-8 /* s */
#define TINY 1.0e-300
#define UNIT 2.3e-16

/* A pair of sensors that look in opposite directions. */
typedef struct {
    double baseline; /* both offsets together */
    double cosine;   /* of the half-angle */
    double range;
} sensors_t;

/* A leg as its march reads it: the boresight of A is steady + cosine cos(rate t) + sine sin(rate t). */
typedef struct {
    double start;
    double end;
    double rate;
    double steady[3];
    double cosine[3];
    double sine[3];
} turn_t;

/* Bounds of the terms of g'' all through a leg. */
typedef struct {
    double last;     /* the swinging part at the end, squared */
    double sideways; /* the velocity's part */
    double turning;  /* |q''| */
    double fast;     /* |q'| */
} leg_bounds_t;

/* Result of a step. */
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

static leg_bounds_t limits(const turn_t *leg, const sensors_t *sensor, const cff_state_t *relative)
{
    leg_bounds_t out;
    double e[3];
    for (uint32_t i = 0U; i < 3U; i++) {
        e[i] = relative->position_m[i] + (relative->velocity_m_s[i] * leg->end);
    }
    const double *v = relative->velocity_m_s;
    const double c = cfi_dot(leg->cosine, e);
    const double s = cfi_dot(leg->sine, e);
    const double cv = cfi_dot(leg->cosine, v);
    const double sv = cfi_dot(leg->sine, v);
    const double w = fabs(leg->rate);
    out.last = (c * c) + (s * s);
    out.sideways = 2.0 * w * sqrt((cv * cv) + (sv * sv));
    const double fastest = w * sqrt(cfi_dot(leg->cosine, leg->cosine)); /* |b'| */
    out.turning = sensor->baseline * w * fastest;
    out.fast = sqrt(cfi_dot(v, v)) + (sensor->baseline * fastest);
    return out;
}

static step_t step(const turn_t *leg, const leg_bounds_t *bounds, const sensors_t *sensor,
                   const cff_state_t *relative, double t)
{
    const double w = leg->rate;
    const double c = sensor->cosine;
    double sa;
    double ca;
    double b[3];
    double d[3];
    double p[3];
    double q[3];
    double u[3];
    step_t out;
    cfi_sine_cosine(w * (t - leg->start), &sa, &ca);
    for (uint32_t i = 0U; i < 3U; i++) {
        b[i] = leg->steady[i] + (leg->cosine[i] * ca) + (leg->sine[i] * sa);
        d[i] = w * ((leg->sine[i] * ca) - (leg->cosine[i] * sa));
        p[i] = relative->position_m[i] + (relative->velocity_m_s[i] * t);
        q[i] = p[i] - (sensor->baseline * b[i]);
        u[i] = relative->velocity_m_s[i] - (sensor->baseline * d[i]);
    }
    const double distance = sqrt(cfi_dot(q, q));
    const double gap = (c * distance) - cfi_dot(b, q);
    const double beyond = distance - sensor->range;
    const double nothing = SEEN * (distance + (2.0 * sensor->baseline));
    const double growth = cfi_dot(q, u) / (distance + TINY);
    const double slope = (c * growth) - (cfi_dot(b, relative->velocity_m_s) + cfi_dot(d, p));
    /* b.(r + v t) bends by its swinging part, greatest at one end of the leg, and the velocity's */
    const double cp = cfi_dot(leg->cosine, p);
    const double sp = cfi_dot(leg->sine, p);
    const double now = (cp * cp) + (sp * sp);
    const double turning = bounds->turning;
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
    good = good && (sensor->offset_m >= 0.0) && (sensor->offset_m <= CFF_LARGEST) && (sensor->range_m > 0.0);
    good = good && (sensor->half_angle_rad > 0.0) && (sensor->half_angle_rad < CFF_PI);
    for (uint32_t k = 0U; (k < leg_count) && good; k++) {
        good = cfi_leg_is_good(&legs[k]) && ((k == 0U) || (legs[k].start_s >= legs[k - 1U].start_s));
    }
    const double size = fabs(relative->position_m[0]) + fabs(relative->position_m[1]) + fabs(relative->position_m[2]);
    return good && (size > (1.0 / CFF_LARGEST));
}

/* First lock within a leg from time t on; false where there is none before its end, or evaluations are spent. */
static bool lock_in_leg(const turn_t *leg, const sensors_t *sensor, const cff_state_t *relative, double from,
                        double *reached, uint32_t *evaluations)
{
    const leg_bounds_t bounds = limits(leg, sensor, relative);
    double t = from;
    bool on = true;
    bool found = false;
    while (on && (*evaluations > 0U)) { /* each turn costs an evaluation */
        cfi_spend(evaluations, 1U);
        const step_t now = step(leg, &bounds, sensor, relative, t);
        if (now.locked) {
            found = true;
            on = false;
        } else if (t >= leg->end) {
            on = false;
        } else if (now.near) {
            found = ((t + now.h) <= leg->end);
            t = cfi_min(t + now.h, leg->end);
            on = false;
        } else {
            t = cfi_min(leg->end, cfi_max(t + now.h, t * (1.0 + UNIT)));
        }
    }
    *reached = t;
    return found;
}

static turn_t turn_of(const cff_leg_t *leg)
{
    turn_t out;
    const double *b = leg->attitude.boresight;
    const double along = cfi_dot(leg->axis, b);
    out.start = leg->start_s;
    out.end = leg->end_s;
    out.rate = leg->angle_rad / (leg->end_s - leg->start_s);
    cfi_cross(leg->axis, b, out.sine);
    for (uint32_t i = 0U; i < 3U; i++) {
        out.steady[i] = leg->axis[i] * along;
        out.cosine[i] = b[i] - out.steady[i];
    }
    return out;
}

cff_status_t cff_first_lock(const cff_leg_t legs[], uint32_t leg_count, const cff_sensor_t *sensor,
                            const cff_state_t *relative, double from_s, uint32_t evaluations, cff_lock_t *lock)
{
    cff_status_t status = CFF_BAD_INPUT;
    if (input_is_good(legs, leg_count, sensor, relative, from_s)) {
        sensors_t pair;
        double sine;
        uint32_t left = evaluations;
        cfi_sine_cosine(sensor->half_angle_rad, &sine, &pair.cosine);
        pair.cosine = (fabs(pair.cosine) > 1e-15) ? pair.cosine : 0.0; /* of a right angle */
        pair.baseline = 2.0 * sensor->offset_m;
        pair.range = sensor->range_m;
        lock->time_s = CFF_FOREVER;
        lock->leg = -1;
        lock->certified_until_s = from_s;
        status = CFF_OK;
        for (uint32_t k = 0U; (k < leg_count) && (lock->leg < 0) && (status == CFF_OK); k++) {
            if (lock->certified_until_s <= legs[k].end_s) {
                const turn_t turn = turn_of(&legs[k]);
                double reached = 0.0;
                const double begin = cfi_max(lock->certified_until_s, turn.start);
                if (lock_in_leg(&turn, &pair, relative, begin, &reached, &left)) {
                    lock->leg = (int32_t)k;
                    lock->time_s = reached;
                } else if ((left == 0U) && (reached < turn.end)) {
                    status = CFF_MORE;
                } else {
                    /* on to the next leg */
                }
                lock->certified_until_s = reached;
            }
        }
        lock->evaluations_used = evaluations - left;
    }
    return status;
}
