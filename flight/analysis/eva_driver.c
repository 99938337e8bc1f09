/* Frama-C/EVA: every public function, with all inputs within ranges: no invalid access, no use of what is not set. */
#include "__fc_builtin.h"
#include "closeform_flight.h"

static void state(cff_state_t *s)
{
    for (int i = 0; i < 3; i++) {
        s->position_m[i] = Frama_C_double_interval(-1e5, 1e5);
        s->velocity_m_s[i] = Frama_C_double_interval(-1e2, 1e2);
    }
}

static void arc(cff_arc_t *a, double start)
{
    a->start_s = start;
    a->end_s = start + Frama_C_double_interval(1.0, 1e5);
    a->mean_motion_rad_s = Frama_C_double_interval(0.0, 2e-3);
    state(&a->state);
    for (int i = 0; i < 3; i++) {
        a->impulse_m_s[i] = Frama_C_double_interval(-1e2, 1e2);
        a->thrust_m_s2[i] = Frama_C_double_interval(-1.0, 1.0);
        a->thrust_rate_m_s3[i] = Frama_C_double_interval(-1e-2, 1e-2);
        a->push_m_s2[i] = Frama_C_double_interval(-1.0, 1.0);
        a->push_rate_m_s3[i] = Frama_C_double_interval(-1e-2, 1e-2);
        a->push_bend_m_s4[i] = Frama_C_double_interval(-1e-4, 1e-4);
        a->push_twist_m_s5[i] = Frama_C_double_interval(-1e-6, 1e-6);
    }
}

int main(void)
{
    cff_arc_t one[2];
    cff_arc_t other[2];
    arc(&one[0], 0.0);
    arc(&one[1], one[0].end_s);
    arc(&other[0], 0.0);
    arc(&other[1], other[0].end_s);
    const cff_path_t a = {one, (unsigned)Frama_C_interval(1, 2)};
    const cff_path_t b = {other, (unsigned)Frama_C_interval(1, 2)};
    cff_zone_t zone;
    zone.shape = Frama_C_interval(0, 1) ? CFF_BOX : CFF_ELLIPSOID;
    for (int i = 0; i < 9; i++) {
        zone.to_unit_per_m[i / 3][i % 3] = Frama_C_double_interval(-1.0, 1.0);
    }
    cff_state_t s;
    cff_state_t t;
    cff_arc_t made;
    double energy;
    double thrust[3];
    state(&s);
    state(&t);
    const double n = Frama_C_double_interval(0.0, 2e-3);
    const double duration = Frama_C_double_interval(1.0, 1e5);
    (void)cff_coast(n, duration, &s, &t);
    if (cff_transfer(n, 0.0, duration, &s, &t, &made) == CFF_OK) {
        (void)cff_energy(&made, &energy);
    }
    (void)cff_state_at(&a, Frama_C_double_interval(-1e5, 1e5), &s);
    (void)cff_thrust_at(&a, Frama_C_double_interval(-1e5, 1e5), thrust);
    cff_conflict_search_t search;
    cff_conflict_t conflicts[4];
    unsigned count = (unsigned)Frama_C_interval(0, 4);
    if (cff_conflicts_begin(&search, &a, &b, &zone) == CFF_OK) {
        (void)cff_conflicts_continue(&search, (unsigned)Frama_C_interval(0, 1000), conflicts, 4U, &count);
        cff_approach_t near;
        (void)cff_closest_approach(&a, &b, &zone, search.certified_until_s, search.end_s, (unsigned)Frama_C_interval(0, 1000), &near);
    }
    cff_leg_t legs[CFF_SEARCH_LEGS];
    cff_lock_t lock;
    const cff_sensor_t sensor = {Frama_C_double_interval(0.0, 20.0), Frama_C_double_interval(-0.99, 0.99), Frama_C_double_interval(1.0, 1e60)};
    state(&s);
    if (cff_modified_search(Frama_C_double_interval(1e-4, 1.0), Frama_C_double_interval(0.01, 1.5), legs) == CFF_OK) {
        (void)cff_first_lock(legs, CFF_SEARCH_LEGS, &sensor, &s, Frama_C_double_interval(0.0, 1e5), (unsigned)Frama_C_interval(0, 1000), &lock);
    }
    return 0;
}
