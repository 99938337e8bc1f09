/*
 * Entry points for Frama-C/EVA: public functions with all inputs within ranges.  EVA shows that no access is
 * invalid, nothing is read before it is written, and no integer overflows.
 */
#include <stddef.h>

#include "__fc_builtin.h"
#ifdef WINDOW
#include "../src/cff_passive.c"
#else
#include "closeform_flight.h"
#endif

static double rows[2 * 15 * 72];
static double steps[2 * 90];
static double errors[2 * 15];
static double returns[2 * 9 * 72];
static double return_errors[2 * 9];
static double joints[3] = {0.0, 0.5, 1.0};

static void any(double *numbers, int count, double size)
{
    for (int k = 0; k < count; k++) {
        numbers[k] = Frama_C_double_interval(-size, size);
    }
}

static void any_state(cff_state_t *s)
{
    any(s->position_m, 3, 1e5);
    any(s->velocity_m_s, 3, 1e2);
}

static void any_arc(cff_arc_t *a, double start)
{
    a->start_s = start;
    a->end_s = start + Frama_C_double_interval(1.0, 1e4);
    a->mean_motion_rad_s = Frama_C_double_interval(0.0, 2e-3);
    any_state(&a->state);
    any(a->impulse_m_s, 3, 1e2);
    any(a->thrust_m_s2, 3, 1.0);
    any(a->thrust_rate_m_s3, 3, 1e-2);
    any(a->push_m_s2, 3, 1.0);
    any(a->push_rate_m_s3, 3, 1e-2);
    any(a->push_bend_m_s4, 3, 1e-4);
    any(a->push_twist_m_s5, 3, 1e-6);
}

int main(void)
{
    static cff_arc_t one[2];
    static cff_arc_t other[2];
    static cff_avoid_work_t work;
    static cff_avoidance_t avoided;
    const cff_table_t table = {1e-3, Frama_C_double_interval(0.0, 0.8), 0.0, 1.0, 2U, joints, rows, steps, errors, returns, return_errors};
    any(rows, 2 * 15 * 72, 10.0);
    any(steps, 2 * 90, 10.0);
    any(errors, 2 * 15, 1e-9);
    any(returns, 2 * 9 * 72, 10.0);
    any(return_errors, 2 * 9, 1e-9);
    any_arc(&one[0], 0.0);
    any_arc(&one[1], one[0].end_s);
    any_arc(&other[0], 0.0);
    any_arc(&other[1], other[0].end_s);
#ifdef BESIDE
    const cff_table_t *chief = &table;
#else
    const cff_table_t *chief = NULL;
#endif
    const cff_path_t a = {one, (unsigned)Frama_C_interval(1, 2), chief};
    const cff_path_t b = {other, (unsigned)Frama_C_interval(1, 2), chief};
    cff_zone_t zone;
    zone.shape = (cff_shape_t)Frama_C_interval(0, 2);
    any(&zone.to_unit_per_m[0][0], 3, 1.0);
    any(&zone.to_unit_per_m[1][0], 3, 1.0);
    any(&zone.to_unit_per_m[2][0], 3, 1.0);
#ifdef MOTION
    cff_state_t s;
    cff_state_t t;
    cff_arc_t made;
    double energy;
    double thrust[3];
    any_state(&s);
    any_state(&t);
    (void)cff_check_table(&table);
    (void)cff_coast(1e-3, Frama_C_double_interval(1.0, 1e5), &s, &t);
    (void)cff_transfer(Frama_C_double_interval(0.0, 2e-3), 0.0, Frama_C_double_interval(1.0, 1e5), &s, &t, &made);
    (void)cff_energy(&a, &energy);
    (void)cff_state_at(&a, Frama_C_double_interval(-1e5, 1e5), &s);
    (void)cff_thrust_at(&a, Frama_C_double_interval(-1e5, 1e5), thrust);
#endif
#ifdef CONFLICTS
    cff_conflict_search_t search;
    cff_conflict_t conflicts[4];
    unsigned count = (unsigned)Frama_C_interval(0, 4);
    if (cff_conflicts_begin(&search, &a, &b, &zone) == CFF_OK) {
        (void)cff_conflicts_continue(&search, (unsigned)Frama_C_interval(0, 1000), conflicts, 4U, &count);
    }
#endif
#ifdef APPROACH
    cff_approach_t near;
    (void)cff_closest_approach(&a, &b, &zone, Frama_C_double_interval(-1e5, 1e5), Frama_C_double_interval(-1e5, 1e5),
                               (unsigned)Frama_C_interval(0, 1000), &near);
#endif
#ifdef AVOID
    const cff_path_t obstacles[2] = {a, b};
    const cff_zone_t zones[2] = {zone, zone};
    (void)cff_avoid(&one[0], obstacles, zones, (unsigned)Frama_C_interval(0, 2), (unsigned)Frama_C_interval(0, 100000), &work, &avoided);
#endif
#ifdef LOSS
    cff_drift_t drift;
    (void)cff_loss_of_thrust(&a, &b, &zone, 0.0, Frama_C_double_interval(0.0, 1e4), (unsigned)Frama_C_interval(0, 100000), &drift);
#endif
#ifdef WINDOW /* of the drifts after a loss of thrust: LOSS takes its contract */
    static drift_t drift;
    double failure;
    double time;
    drift.other = &b;
    drift.zone = &zone;
    any(&drift.y[0][0], 6 * CFF_TERMS, 1e6);
    any(drift.wrong, 6, 1.0);
    any(drift.its.columns, CFF_COLUMNS, 1e6);
    any(&drift.first, 2, 1.0);
    any(&drift.low, 2, 1.0);
    drift.at.window = (unsigned)Frama_C_interval(0, 1);
    drift.same = (Frama_C_interval(0, 1) != 0);
    drift.evaluations = (unsigned)Frama_C_interval(0, 100000);
    (void)judge_window(&drift, &failure, &time);
#endif
#ifdef IMPULSES
    static cff_impulses_t plan;
    cff_state_t begin;
    cff_state_t end;
    any_state(&begin);
    any_state(&end);
    if (cff_impulses_begin(&plan, chief, 1e-3, 0.0, Frama_C_double_interval(1.0, 1e4), &begin, &end) == CFF_OK) {
        (void)cff_impulses_continue(&plan, (unsigned)Frama_C_interval(0, 100000));
    }
#endif
#ifdef CIRCLE
    static cff_circle_t room;
    cff_table_t circle;
    (void)cff_circular_table(Frama_C_double_interval(-1.0, 1.0), Frama_C_double_interval(0.0, 1e5), &room, &circle);
#endif
#ifdef SEARCH
    static cff_leg_t legs[16];
    cff_schedule_t schedule;
    cff_attitude_t attitude;
    cff_lock_t lock;
    cff_state_t apart;
    cff_sensor_t sensor;
    unsigned legs_made = 0U;
    any(&schedule.half_angle_rad, 5, 10.0);
    schedule.passes = (unsigned)Frama_C_interval(0, 3);
    schedule.relaxed = (Frama_C_interval(0, 1) != 0);
    any(&sensor.half_angle_rad, 3, 1e3);
    any_state(&apart);
    (void)cff_basic_search(&schedule, legs, 16U, &legs_made);
    (void)cff_modified_search(&schedule, legs, 16U, &legs_made);
    (void)cff_attitude_at(legs, 16U, Frama_C_double_interval(0.0, 1e5), (cff_group_t)Frama_C_interval(0, 2), &attitude);
    (void)cff_first_lock(legs, 16U, &sensor, &apart, Frama_C_double_interval(0.0, 1e5), (unsigned)Frama_C_interval(0, 1000), &lock);
#endif
#ifdef JOINS
    static double velocities[CFF_MOST_CRAFT][3];
    cff_gathering_t gathering;
    cff_join_t join;
    any(&velocities[0][0], 3 * CFF_MOST_CRAFT, 1e2);
    if (cff_gathering_begin(&gathering, (unsigned)Frama_C_interval(0, 100), (cff_first_burn_t)Frama_C_interval(0, 3)) == CFF_OK) {
        for (int k = 0; k < Frama_C_interval(0, 1000); k++) {
            (void)cff_gathering_lock(&gathering, Frama_C_double_interval(0.0, 1e6), (unsigned)Frama_C_interval(0, 100),
                                     (unsigned)Frama_C_interval(0, 100), velocities, &join);
        }
    }
#endif
    return 0;
}
