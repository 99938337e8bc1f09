/*
 * A transfer shaped around one ellipsoid (theory 4; closeform/planning/local.py with one contact).
 *
 * Where the path touches, a force along the zone's normal bends it: thrust conflicts continuous and its rate
 * jumps by that force.  For a given time and normal the size of the force is linear.  The time slides to
 * where the path comes closest and the normal to the one there, until neither moves: then the path is the
 * cheapest on that side.  Several sides are tried, the cheapest ones first; what is returned is certified
 * clear by the march that finds conflicts.
 */
#include <math.h>
#include <stddef.h>

#include "cff_internal.h"

#define AIM (1.0 + 1.0e-9) /* the norm at the contact */
#define SETTLED 1.0e-10    /* relative change of energy and of the least norm at which rounds end */
#define ROUNDS 60U
#define SLOWEST 0.05 /* share of the way that a contact moves at least */
#define RAYS 8U  /* directions across the motion that are looked at */
#define SIDES 4U /* of which so many are tried */
#define STEER_EVALUATIONS 16U

/* One contact: its time and the zone's normal, in zone units. */
typedef struct {
    double time;
    double normal[3];
} contact_t;

/* What does not change. */
typedef struct {
    const cff_arc_t *direct;
    const cff_path_t *obstacle;
    const cff_zone_t *zone;
    double start;
    double end;
} scene_t;

/* The relative motion of an arc and the obstacle at time t, in zone units. */
static void relative(const scene_t *scene, const cff_arc_t *arc, double t, cfi_motion_t *out)
{
    cfi_motion_t m;
    cfi_motion_t o;
    cfi_state(arc, t, &m);
    cfi_state(&scene->obstacle->arcs[cfi_locate(scene->obstacle, t)], t, &o);
    for (uint32_t i = 0U; i < 3U; i++) {
        m.r[i] -= o.r[i];
        m.v[i] -= o.v[i];
    }
    for (uint32_t i = 0U; i < 3U; i++) {
        out->r[i] = cfi_dot(scene->zone->to_unit_per_m[i], m.r);
        out->v[i] = cfi_dot(scene->zone->to_unit_per_m[i], m.v);
    }
}

/* The start thrust with which a force at time t, along a direction in metres, leaves both ends where they are. */
static bool bend(const scene_t *scene, double t, const double force[3], double thrust[6])
{
    static const double nothing[3] = {0.0, 0.0, 0.0};
    const double n = scene->direct->mean_motion_rad_s;
    cfi_transforms_t k;
    cfi_motion_t m = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    double gap[6];
    cfi_transforms(n, scene->end - t, &k);
    cfi_add_driven(n, scene->end - t, &k, nothing, force, &m);
    for (uint32_t i = 0U; i < 3U; i++) {
        gap[i] = -m.r[i];
        gap[i + 3U] = -m.v[i];
    }
    return cfi_steer(n, scene->end - scene->start, gap, thrust);
}

/* How far a start thrust moves a craft by time t, in zone units. */
static void moved(const scene_t *scene, double t, const double thrust[6], double out[3])
{
    const double n = scene->direct->mean_motion_rad_s;
    cfi_transforms_t k;
    cfi_motion_t m = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    cfi_transforms(n, t - scene->start, &k);
    cfi_add_driven(n, t - scene->start, &k, &thrust[0], &thrust[3], &m);
    for (uint32_t i = 0U; i < 3U; i++) {
        out[i] = cfi_dot(scene->zone->to_unit_per_m[i], m.r);
    }
}

/* A normal of the zone, in zone units, as a direction of force in metres. */
static void as_force(const scene_t *scene, const double normal[3], double force[3])
{
    for (uint32_t i = 0U; i < 3U; i++) {
        force[i] = 0.0;
        for (uint32_t j = 0U; j < 3U; j++) {
            force[i] += scene->zone->to_unit_per_m[j][i] * normal[j];
        }
    }
}

/* The two arcs that keep AIM away along the contact's normal at its time. */
static bool shape_path(const scene_t *scene, const contact_t *contact, cff_avoidance_t *out)
{
    const cff_arc_t *direct = scene->direct;
    double force[3];
    double thrust[6];
    double give[3];
    cfi_motion_t now;
    as_force(scene, contact->normal, force);
    bool good = bend(scene, contact->time, force, thrust);
    if (good) {
        moved(scene, contact->time, thrust, give);
        relative(scene, direct, contact->time, &now);
        const double compliance = cfi_dot(contact->normal, give);
        const double push = (AIM - cfi_dot(contact->normal, now.r)) / compliance;
        good = (compliance > 0.0) && cfi_finite(&push, 1U);
        if (good) {
            cff_arc_t *one = &out->arcs[0];
            cff_arc_t *two = &out->arcs[1];
            cfi_motion_t m;
            double p[3];
            *one = *direct;
            one->end_s = contact->time;
            for (uint32_t i = 0U; i < 3U; i++) {
                one->thrust_m_s2[i] += push * thrust[i];
                one->thrust_rate_m_s3[i] += push * thrust[i + 3U];
            }
            *two = *one;
            two->start_s = contact->time;
            two->end_s = scene->end;
            cfi_state(one, contact->time, &m);
            for (uint32_t i = 0U; i < 3U; i++) {
                two->state.position_m[i] = m.r[i];
                two->state.velocity_m_s[i] = m.v[i];
                two->impulse_m_s[i] = 0.0;
            }
            const double dt = contact->time - scene->start;
            cfi_oscillation(direct->mean_motion_rad_s, dt, p);
            cfi_coast(direct->mean_motion_rad_s, dt, p, one->thrust_m_s2, one->thrust_rate_m_s3, &m);
            for (uint32_t i = 0U; i < 3U; i++) {
                two->thrust_m_s2[i] = m.r[i];
                two->thrust_rate_m_s3[i] = m.v[i] + (push * force[i]);
            }
            /* the deflection of the cheapest path that is c off at the contact costs half c times the push */
            out->count = 2U;
            out->contact_s = contact->time;
            out->extra_energy_m2_s3 = 0.5 * push * push * compliance;
        }
    }
    return good;
}

/* Move a contact a share of the way to where the path comes closest, and to the normal there. */
static void slide(contact_t *contact, double time, const cfi_motion_t *there, double share)
{
    const double norm = sqrt(cfi_dot(there->r, there->r));
    contact->time += share * (time - contact->time);
    for (uint32_t i = 0U; i < 3U; i++) {
        contact->normal[i] += share * ((there->r[i] / norm) - contact->normal[i]);
    }
    const double length = sqrt(cfi_max(cfi_dot(contact->normal, contact->normal), 1e-300));
    for (uint32_t i = 0U; i < 3U; i++) {
        contact->normal[i] /= length;
    }
}

/*
 * Slide a contact until it is where the path comes closest; whether it settles, and clear.  Its moves are
 * damped as the last two tell (Aitken): undamped they would overshoot, or swing for ever.
 */
static bool settle(const scene_t *scene, contact_t *contact, cff_avoidance_t *out, uint32_t *evaluations)
{
    double energy = 0.0;
    double last = 0.0;
    double share = 1.0;
    bool clear = false;
    bool on = true;
    for (uint32_t k = 0U; (k < ROUNDS) && on; k++) {
        cff_approach_t near;
        cfi_spend(evaluations, STEER_EVALUATIONS);
        on = (*evaluations >= CFF_LEAST_EVALUATIONS) && shape_path(scene, contact, out);
        if (on) {
            const cff_path_t path = {out->arcs, 2U};
            on = (cff_closest_approach(&path, scene->obstacle, scene->zone, scene->start, scene->end, *evaluations, &near) ==
                  CFF_OK);
            cfi_spend(evaluations, near.evaluations_used);
            on = on && (near.ratio > 1e-6) && (near.time_s > scene->start) && (near.time_s < scene->end);
        }
        if (on) {
            const double change = fabs(out->extra_energy_m2_s3 - energy);
            energy = out->extra_energy_m2_s3;
            clear = (near.ratio > (1.0 + (0.5 * (AIM - 1.0)))) && (change <= (SETTLED * energy));
            on = !clear;
        }
        if (on) {
            const double way = near.time_s - contact->time;
            cfi_motion_t there;
            if ((k > 0U) && (way != last)) {
                share = cfi_min(cfi_max(-share * last / (way - last), SLOWEST), 1.0);
            }
            last = way;
            relative(scene, &out->arcs[(near.time_s < contact->time) ? 0U : 1U], near.time_s, &there);
            slide(contact, near.time_s, &there, share);
        }
    }
    return clear;
}

/* Whether a path has no conflict in the zone, certified. */
static bool is_clear(const scene_t *scene, const cff_path_t *path, uint32_t *evaluations)
{
    cff_conflict_search_t search;
    cff_conflict_t conflict[1];
    uint32_t count = 0U;
    bool clear = (cff_conflicts_begin(&search, path, scene->obstacle, scene->zone) == CFF_OK);
    if (clear) {
        clear = (cff_conflicts_continue(&search, *evaluations, conflict, 1U, &count) == CFF_OK) && (count == 0U);
        cfi_spend(evaluations, search.evaluations_used);
    }
    return clear;
}

/* Two unit vectors across v. */
static void across(const double v[3], double one[3], double two[3])
{
    uint32_t least = 0U;
    for (uint32_t i = 1U; i < 3U; i++) {
        if (fabs(v[i]) < fabs(v[least])) {
            least = i;
        }
    }
    double e[3] = {0.0, 0.0, 0.0};
    e[least] = 1.0;
    const double square = cfi_max(cfi_dot(v, v), 1e-300);
    const double along = cfi_dot(v, e) / square;
    for (uint32_t i = 0U; i < 3U; i++) {
        one[i] = e[i] - (along * v[i]);
    }
    const double length = sqrt(cfi_max(cfi_dot(one, one), 1e-300));
    const double speed = sqrt(square);
    for (uint32_t i = 0U; i < 3U; i++) {
        one[i] /= length;
    }
    two[0] = ((v[1] * one[2]) - (v[2] * one[1])) / speed;
    two[1] = ((v[2] * one[0]) - (v[0] * one[2])) / speed;
    two[2] = ((v[0] * one[1]) - (v[1] * one[0])) / speed;
}

/* Where rays across the motion leave the ball, and what it roughly costs to be there. */
static bool ways_out(const scene_t *scene, double t, double normals[RAYS][3], double costs[RAYS])
{
    static const double cosines[RAYS] = {1.0, 0.7071067811865476, 0.0, -0.7071067811865476,
                                         -1.0, -0.7071067811865476, 0.0, 0.7071067811865476};
    cfi_motion_t m;
    double one[3];
    double two[3];
    double compliance[3][3]; /* row i: how the unit normal i moves the craft */
    bool good = true;
    relative(scene, scene->direct, t, &m);
    across(m.v, one, two);
    for (uint32_t i = 0U; (i < 3U) && good; i++) {
        double normal[3] = {0.0, 0.0, 0.0};
        double force[3];
        double thrust[6];
        normal[i] = 1.0;
        as_force(scene, normal, force);
        good = bend(scene, t, force, thrust);
        moved(scene, t, thrust, compliance[i]);
    }
    for (uint32_t k = 0U; (k < RAYS) && good; k++) {
        double ray[3];
        double give = 0.0;
        for (uint32_t i = 0U; i < 3U; i++) {
            ray[i] = (cosines[k] * one[i]) + (cosines[(k + 6U) % RAYS] * two[i]);
        }
        const double along = cfi_dot(ray, m.r);
        const double ahead = sqrt(cfi_max((1.0 - cfi_dot(m.r, m.r)) + (along * along), 0.0)) - along;
        for (uint32_t i = 0U; i < 3U; i++) {
            normals[k][i] = m.r[i] + (ahead * ray[i]);
        }
        for (uint32_t i = 0U; i < 3U; i++) {
            give += normals[k][i] * cfi_dot(compliance[i], normals[k]);
        }
        const double missing = cfi_max(1.0 - cfi_dot(normals[k], m.r), 0.0);
        costs[k] = (give > 0.0) ? (missing * missing / give) : CFF_FOREVER;
    }
    return good;
}

/* Try the cheapest ways out; the best clear path is left in `found`. */
static cff_status_t try_sides(const scene_t *scene, double deepest, uint32_t *evaluations, cff_avoidance_t *found)
{
    double normals[RAYS][3];
    double costs[RAYS];
    cff_status_t status = ways_out(scene, deepest, normals, costs) ? CFF_NO_WAY : CFF_SINGULAR;
    cfi_spend(evaluations, 3U * STEER_EVALUATIONS);
    for (uint32_t turn = 0U; (turn < SIDES) && (status != CFF_SINGULAR); turn++) {
        uint32_t k = 0U;
        for (uint32_t j = 1U; j < RAYS; j++) {
            if (costs[j] < costs[k]) {
                k = j;
            }
        }
        if (costs[k] < CFF_FOREVER) {
            cff_avoidance_t trial = *found;
            contact_t contact = {deepest, {normals[k][0], normals[k][1], normals[k][2]}};
            costs[k] = CFF_FOREVER;
            if (settle(scene, &contact, &trial, evaluations)) {
                const cff_path_t path = {trial.arcs, 2U};
                const bool better = (status != CFF_OK) || (trial.extra_energy_m2_s3 < found->extra_energy_m2_s3);
                if (better && is_clear(scene, &path, evaluations)) {
                    *found = trial;
                    status = CFF_OK;
                }
            }
        }
    }
    return status;
}

cff_status_t cff_avoid(const cff_arc_t *direct, const cff_path_t *obstacle, const cff_zone_t *zone, uint32_t evaluations,
                       cff_avoidance_t *found)
{
    const scene_t scene = {direct, obstacle, zone, direct->start_s, direct->end_s};
    const cff_path_t path = {direct, 1U};
    uint32_t left = evaluations;
    cff_approach_t near = {0.0, 0.0, 0.0, 0U};
    double energy = 0.0;
    cff_status_t status = cff_energy(direct, &energy);
    found->arcs[0] = *direct;
    found->arcs[1] = *direct;
    found->count = 1U;
    found->energy_m2_s3 = energy;
    found->extra_energy_m2_s3 = 0.0;
    found->contact_s = direct->start_s;
    found->evaluations_used = 0U;
    if ((status == CFF_OK) && (zone->shape != CFF_ELLIPSOID)) {
        status = CFF_BAD_INPUT;
    }
    if (status == CFF_OK) {
        status = cff_closest_approach(&path, obstacle, zone, scene.start, scene.end, left, &near);
        cfi_spend(&left, near.evaluations_used);
    }
    if ((status == CFF_OK) && (near.ratio <= 1.0)) {
        cfi_motion_t begin;
        cfi_motion_t end;
        relative(&scene, direct, scene.start, &begin);
        relative(&scene, direct, scene.end, &end);
        if ((cfi_norm(CFF_ELLIPSOID, begin.r) <= AIM) || (cfi_norm(CFF_ELLIPSOID, end.r) <= AIM)) {
            status = CFF_END_INSIDE;
        } else {
            status = try_sides(&scene, near.time_s, &left, found);
            found->energy_m2_s3 = energy + found->extra_energy_m2_s3;
        }
    }
    found->evaluations_used = evaluations - left;
    return status;
}
