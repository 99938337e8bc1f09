/*
 * Schedules of synchronised searches, and the attitude at a time (closeform/search/schedule.py, leg.py).
 *
 * The sun is along -z.  Group A starts with its boresight along +x and body x towards the sun.  All craft make the
 * same turns: about the sun line in plane, then tips about body y.
 */
#include <math.h>

#include "cff_internal.h"

#define MOST_TURNS 8U /* of a pass */
#define ROUNDS 6U     /* of Newton's method for an angle: its error is cubed in each */

/* The turns of one pass: tips about body y in units of the tip angle; 0 stands for half a turn about the sun line. */
typedef struct {
    double in_plane;
    double tip;
    double tips[MOST_TURNS];
    uint32_t count;
    uint32_t passes;
} turns_t;

void cfi_cross(const double a[3], const double b[3], double out[3])
{
    out[0] = (a[1] * b[2]) - (a[2] * b[1]);
    out[1] = (a[2] * b[0]) - (a[0] * b[2]);
    out[2] = (a[0] * b[1]) - (a[1] * b[0]);
}

/* Turn `v` about a unit axis. */
static void turn(const double axis[3], double angle, double v[3])
{
    double s;
    double c;
    double cross[3];
    const double along = cfi_dot(axis, v);
    cfi_cross(axis, v, cross);
    cfi_sine_cosine(angle, &s, &c);
    for (uint32_t i = 0U; i < 3U; i++) {
        const double steady = axis[i] * along;
        v[i] = steady + (c * (v[i] - steady)) + (s * cross[i]);
    }
}

static void turn_axes(const double axis[3], double angle, cff_attitude_t *attitude)
{
    turn(axis, angle, attitude->body_x);
    turn(axis, angle, attitude->body_y);
    turn(axis, angle, attitude->boresight);
}

/* The angle from 0 to pi / 2 of the direction (x, y). */
static double angle_of(double x, double y)
{
    const double length = sqrt((x * x) + (y * y));
    double angle = 0.25 * CFF_PI;
    for (uint32_t k = 0U; k < ROUNDS; k++) {
        double s;
        double c;
        cfi_sine_cosine(angle, &s, &c);
        const double miss = ((y * c) - (x * s)) / length; /* sine of what is missing */
        angle += miss + (miss * miss * miss / 6.0);
    }
    return angle;
}

/* The tip that covers a complementary cone, S04 eq. 1; a right angle below half-angles of 45 deg, which none covers. */
static double full_tip(double half_angle)
{
    double s;
    double c;
    double tip = 0.0;
    cfi_sine_cosine(half_angle, &s, &c);
    if (half_angle < (0.5 * CFF_PI)) {
        tip = angle_of(sqrt(cfi_max(0.0, 1.0 - (2.0 * c * c))), c);
    } /* else the sensor sees half of the sky: no tips */
    return tip;
}

static bool limits_are_good(const cff_schedule_t *schedule)
{
    bool good = (schedule->half_angle_rad > 0.0) && (schedule->half_angle_rad < CFF_PI);
    good = good && (schedule->slew_rate_rad_s > (1.0 / CFF_LARGEST)) && (schedule->slew_rate_rad_s <= CFF_LARGEST);
    return good && (schedule->sun_limit_rad > 0.0) && (schedule->sun_limit_rad < (0.5 * CFF_PI));
}

static cff_status_t write_legs(const turns_t *turns, double rate, cff_leg_t legs[], uint32_t capacity, uint32_t *count)
{
    static const double sun[3] = {0.0, 0.0, -1.0};
    cff_attitude_t attitude = {{0.0, 0.0, -1.0}, {0.0, 1.0, 0.0}, {1.0, 0.0, 0.0}};
    const uint32_t needed = turns->passes * (turns->count + 1U);
    double start = 0.0;
    uint32_t written = 0U;
    cff_status_t status = CFF_FULL;
    if ((turns->passes <= CFF_MOST_LEGS) && (needed <= CFF_MOST_LEGS) && (needed <= capacity)) {
        for (uint32_t k = 0U; k < needed; k++) {
            const uint32_t place = k % (turns->count + 1U);
            const double tip = (place == 0U) ? 0.0 : turns->tips[place - 1U];
            const double half = (place == 0U) ? turns->in_plane : CFF_PI;
            const double angle = (tip == 0.0) ? half : (tip * turns->tip);
            if (angle != 0.0) { /* there are no tips for a sensor that sees half of the sky */
                cff_leg_t *leg = &legs[written];
                for (uint32_t i = 0U; i < 3U; i++) {
                    leg->axis[i] = (tip == 0.0) ? sun[i] : attitude.body_y[i];
                }
                leg->start_s = start;
                leg->end_s = start + (fabs(angle) / rate);
                leg->angle_rad = angle;
                leg->attitude = attitude;
                turn_axes(leg->axis, angle, &attitude);
                start = leg->end_s;
                written += 1U;
            }
        }
        *count = written;
        status = CFF_OK;
    }
    return status;
}

cff_status_t cff_modified_search(const cff_schedule_t *schedule, cff_leg_t legs[], uint32_t capacity, uint32_t *count)
{
    turns_t turns = {3.0 * CFF_PI, 0.0, {1.0, -2.0, 0.0, 2.0, 0.0, -2.0, 1.0, 0.0}, 7U, 2U};
    cff_status_t status = CFF_BAD_INPUT;
    if (limits_are_good(schedule)) {
        status = CFF_TOO_NARROW;
        turns.tip = full_tip(schedule->half_angle_rad);
        if (turns.tip <= schedule->sun_limit_rad) {
            status = write_legs(&turns, schedule->slew_rate_rad_s, legs, capacity, count);
        }
    }
    return status;
}

cff_status_t cff_basic_search(const cff_schedule_t *schedule, cff_leg_t legs[], uint32_t capacity, uint32_t *count)
{
    turns_t turns = {schedule->in_plane_turn_rad, 0.0, {1.0, -2.0, 0.0, 2.0, -1.0, 0.0, 0.0, 0.0}, 5U, schedule->passes};
    cff_status_t status = CFF_BAD_INPUT;
    bool good = limits_are_good(schedule) && (schedule->passes >= 1U);
    good = good && (schedule->in_plane_turn_rad > 0.0) && (schedule->in_plane_turn_rad <= CFF_LARGEST_ANGLE_RAD);
    good = good && (schedule->tip_angle_rad >= 0.0) && (schedule->tip_angle_rad <= (2.0 * CFF_PI));
    if (good) {
        double usual = schedule->sun_limit_rad;
        if (schedule->relaxed) { /* tips of twice the half-angle of a complementary cone reach its far side */
            usual = cfi_max(CFF_PI - (2.0 * schedule->half_angle_rad), 0.0);
            turns.tips[2] = 1.0;
            turns.count = 3U;
        }
        turns.tip = (schedule->tip_angle_rad > 0.0) ? schedule->tip_angle_rad : usual;
        status = CFF_TOO_NARROW;
        if (schedule->relaxed || (turns.tip <= schedule->sun_limit_rad)) {
            status = write_legs(&turns, schedule->slew_rate_rad_s, legs, capacity, count);
        }
    }
    return status;
}

bool cfi_leg_is_good(const cff_leg_t *leg)
{
    bool good = cfi_finite(&leg->start_s, 1U) && cfi_finite(&leg->end_s, 1U) && (leg->end_s > leg->start_s);
    good = good && (fabs(leg->angle_rad) <= CFF_LARGEST_ANGLE_RAD) && cfi_finite(leg->axis, 3U);
    good = good && cfi_finite(leg->attitude.body_x, 3U) && cfi_finite(leg->attitude.body_y, 3U);
    return good && cfi_finite(leg->attitude.boresight, 3U);
}

cff_status_t cff_attitude_at(const cff_leg_t legs[], uint32_t leg_count, double time_s, cff_group_t group,
                             cff_attitude_t *attitude)
{
    cff_status_t status = CFF_BAD_INPUT;
    bool good = (leg_count > 0U) && (leg_count <= CFF_MOST_LEGS) && ((group == CFF_GROUP_A) || (group == CFF_GROUP_B));
    for (uint32_t k = 0U; (k < leg_count) && good; k++) {
        good = cfi_leg_is_good(&legs[k]);
    }
    if (good && (time_s >= legs[0].start_s) && (time_s <= legs[leg_count - 1U].end_s)) {
        const cff_leg_t *leg = &legs[0];
        for (uint32_t k = 1U; k < leg_count; k++) {
            leg = (legs[k].start_s <= time_s) ? &legs[k] : leg;
        }
        *attitude = leg->attitude;
        turn_axes(leg->axis, leg->angle_rad * ((time_s - leg->start_s) / (leg->end_s - leg->start_s)), attitude);
        if (group == CFF_GROUP_B) { /* half a turn about body x */
            for (uint32_t i = 0U; i < 3U; i++) {
                attitude->body_y[i] = -attitude->body_y[i];
                attitude->boresight[i] = -attitude->boresight[i];
            }
        }
        status = CFF_OK;
    }
    return status;
}
