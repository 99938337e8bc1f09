/*
 * A path of minimum energy around ellipsoids (theory 4; closeform/planning/energy/contact_solver.py).
 *
 * Where the path touches a zone a force along its normal bends it: thrust stays continuous and its rate jumps
 * by the force.  A round solves the quadratic program of the known contacts, deflects the path, slides each
 * contact to where the path comes closest, and adds contacts at new conflicts.  Once the path is nearly clear,
 * Newton's method solves the conditions of optimality.  Several sides are tried, the cheapest first.
 */
#include <math.h>
#include <stddef.h>

#include "cff_internal.h"

#define AIM (1.0 + 1.0e-9) /* norm at a contact */
#define FARTHER 2.0e-8    /* beside a table, whose errors would leave a nearer contact undecided within some km */
#define GRAZE 1.0e-9      /* shortfall of a conflict that only the errors of a table make possible */
#define ROUNDS 40U
#define HOPELESS 12U  /* rounds without progress towards a clear path */
#define SOFT 1.0e-2   /* initial softness of contacts, which fades by FADE a round while normals turn */
#define FADE 0.3
#define NEARLY 3.0e-2 /* shortfall in zones below which Newton's method is tried */
#define CLOSE 0.2     /* and change of normals in a round */
#define SLOWEST 0.2 /* share of the way that touches move at least */
#define SAME 1.0e-3   /* of the duration: contacts closer than this are one */
#define SWEEPS 300U
#define STEPS 15U
#define TOUCHING 1.0e-10 /* largest error of the conditions, in zones */
#define FAR 10.0
#define NUDGE 1.0e-6 /* relative change of an unknown in the derivatives by differences */
#define RAISES 4U
#define RAYS 10U /* sides on which to pass: eight across the motion of the first contact, and before and after */
#define SIDES 8U
#define DIAGONAL 0.7071067811865476
#define CONFLICTS 4U /* of the path and one obstacle that become contacts in a round */
#define FLIGHT_EVALUATIONS 1U /* cost of the state at a contact, and beside a table */
#define TABLE_EVALUATIONS 20U

/* What does not change. */
typedef struct {
    cff_path_t direct;
    const cff_path_t *obstacles;
    const cff_zone_t *zones;
    uint32_t obstacle_count;
    double start;
    double end;
    double aim; /* norm at a contact */
    cff_avoid_work_t *work;
} scene_t;

/* A vector in zone units as one in metres: the transpose of the zone's matrix. */
static void as_metres(const cff_zone_t *zone, const double v[3], double out[3])
{
    for (uint32_t i = 0U; i < 3U; i++) {
        out[i] = 0.0;
        for (uint32_t j = 0U; j < 3U; j++) {
            out[i] += zone->to_unit_per_m[j][i] * v[j];
        }
    }
}

/* The motion of a state relative to an obstacle at time t, in zone units. */
static void relative(const scene_t *scene, uint32_t which, double t, const cfi_motion_t *m, double r[3], double v[3])
{
    const cff_path_t *obstacle = &scene->obstacles[which];
    const cff_zone_t *zone = &scene->zones[which];
    cfi_motion_t o;
    cfi_motion_t unused;
    cfi_arc_motion(obstacle, cfi_locate(obstacle, t), t, &o, &unused);
    for (uint32_t i = 0U; i < 3U; i++) {
        o.r[i] = m->r[i] - o.r[i];
        o.v[i] = m->v[i] - o.v[i];
    }
    for (uint32_t i = 0U; i < 3U; i++) {
        r[i] = cfi_dot(zone->to_unit_per_m[i], o.r);
        v[i] = cfi_dot(zone->to_unit_per_m[i], o.v);
    }
}

/* Fly the arcs from the first arc's thrust on, with the forces as jumps; fills the touches and the end. */
static void fly(const scene_t *scene, cfi_motion_t *end)
{
    cff_avoid_work_t *work = scene->work;
    const cff_path_t path = {work->arcs, work->count + 1U, scene->direct.chief};
    for (uint32_t k = 0U; k <= work->count; k++) {
        cff_arc_t *arc = &work->arcs[k];
        cfi_motion_t u;
        arc->end_s = (k < work->count) ? work->touches[k].time_s : scene->end;
        cfi_arc_motion(&path, k, arc->end_s, end, &u);
        if (k < work->count) {
            cff_touch_t *touch = &work->touches[k];
            cff_arc_t *next = &work->arcs[k + 1U];
            double force[3];
            as_metres(&scene->zones[touch->obstacle], touch->force, force);
            relative(scene, touch->obstacle, touch->time_s, end, touch->position, touch->rate);
            *next = *arc;
            next->start_s = arc->end_s;
            for (uint32_t i = 0U; i < 3U; i++) {
                next->state.position_m[i] = end->r[i];
                next->state.velocity_m_s[i] = end->v[i];
                next->thrust_m_s2[i] = u.r[i];
                next->thrust_rate_m_s3[i] = u.v[i] + force[i];
                next->impulse_m_s[i] = 0.0;
            }
        }
    }
}

/* The path under the forces of the touches, in work->arcs: with the initial thrust that still meets the end. */
static void deflect(const scene_t *scene, uint32_t *evaluations)
{
    cff_avoid_work_t *work = scene->work;
    const cff_arc_t *direct = &scene->direct.arcs[0];
    cfi_motion_t end;
    cfi_motion_t wanted;
    cfi_motion_t u;
    double off[6];
    cfi_spend(evaluations, 2U * (work->count + 1U) * ((scene->direct.chief != NULL) ? TABLE_EVALUATIONS : FLIGHT_EVALUATIONS));
    work->arcs[0] = *direct;
    fly(scene, &end);
    cfi_arc_motion(&scene->direct, 0U, scene->end, &wanted, &u);
    for (uint32_t i = 0U; i < 3U; i++) {
        off[i] = wanted.r[i] - end.r[i];
        off[i + 3U] = wanted.v[i] - end.v[i];
    }
    work->arcs[0] = *direct;
    for (uint32_t i = 0U; i < 3U; i++) {
        for (uint32_t j = 0U; j < 6U; j++) {
            work->arcs[0].thrust_m_s2[i] += work->inverse[i][j] * off[j];
            work->arcs[0].thrust_rate_m_s3[i] += work->inverse[i + 3U][j] * off[j];
        }
    }
    fly(scene, &end);
    work->arc_count = work->count + 1U;
}

/* Order the touches by time. */
static void sort_touches(cff_avoid_work_t *work)
{
    for (uint32_t k = 1U; k < work->count; k++) {
        const cff_touch_t touch = work->touches[k];
        uint32_t m = k;
        while ((m > 0U) && (work->touches[m - 1U].time_s > touch.time_s)) { /* at most 7 turns */
            work->touches[m] = work->touches[m - 1U];
            m--;
        }
        work->touches[m] = touch;
    }
}

static void set_force(cff_touch_t *touch, double size)
{
    for (uint32_t i = 0U; i < 3U; i++) {
        touch->force[i] = size * touch->normal[i];
    }
}

/* The multipliers of minimum energy that keep `lift` away along each normal, by coordinate descent. */
static void solve_multipliers(const scene_t *scene, double lift, double soft, uint32_t *evaluations)
{
    cff_avoid_work_t *work = scene->work;
    const uint32_t count = work->count;
    double push[CFF_MOST_CONTACTS] = {0};
    double gap[CFF_MOST_CONTACTS];
    for (uint32_t k = 0U; k < count; k++) {
        set_force(&work->touches[k], 0.0);
    }
    deflect(scene, evaluations);
    for (uint32_t k = 0U; k < count; k++) {
        gap[k] = (lift * scene->aim) - cfi_dot(work->touches[k].normal, work->touches[k].position);
    }
    for (uint32_t m = 0U; m < count; m++) {
        double metres[3];
        as_metres(&scene->zones[work->touches[m].obstacle], work->touches[m].normal, metres);
        const double length = scene->end - scene->start;
        const double share = 192.0 / (cfi_max(cfi_dot(metres, metres), 1e-200) * length * length * length); /* moves about 1 */
        set_force(&work->touches[m], share);
        deflect(scene, evaluations);
        set_force(&work->touches[m], 0.0);
        for (uint32_t k = 0U; k < count; k++) {
            const cff_touch_t *touch = &work->touches[k];
            work->matrix[(k * CFF_MOST_CONTACTS) + m] = (cfi_dot(touch->normal, touch->position) - ((lift * scene->aim) - gap[k])) / share;
        }
    }
    bool on = true;
    for (uint32_t sweep = 0U; (sweep < SWEEPS) && on; sweep++) {
        on = false;
        for (uint32_t k = 0U; k < count; k++) {
            double missing = gap[k] + (work->matrix[(k * CFF_MOST_CONTACTS) + k] * push[k]);
            for (uint32_t m = 0U; m < count; m++) {
                missing -= work->matrix[(k * CFF_MOST_CONTACTS) + m] * push[m];
            }
            const double own = work->matrix[(k * CFF_MOST_CONTACTS) + k] * (1.0 + soft);
            const double next = (own > 0.0) ? cfi_max(missing / own, 0.0) : 0.0;
            on = on || (fabs(next - push[k]) > (1e-13 * next));
            push[k] = next;
        }
    }
    for (uint32_t k = 0U; k < count; k++) {
        set_force(&work->touches[k], push[k]);
    }
    deflect(scene, evaluations);
}

/* The path as it was last deflected. */
static cff_path_t bent(const scene_t *scene)
{
    const cff_path_t path = {scene->work->arcs, scene->work->arc_count, scene->direct.chief};
    return path;
}

/* The motion of the deflected path relative to an obstacle at time t, in zone units. */
static void relative_at(const scene_t *scene, uint32_t which, double t, double r[3], double v[3])
{
    const cff_path_t path = bent(scene);
    cfi_motion_t m;
    cfi_motion_t unused;
    cfi_arc_motion(&path, cfi_locate(&path, t), t, &m, &unused);
    relative(scene, which, t, &m, r, v);
}

/* The energy beyond that of the direct path: half the forces times the deflections. */
static double extra_energy(const scene_t *scene)
{
    double total = 0.0;
    for (uint32_t k = 0U; k < scene->work->count; k++) {
        const cff_touch_t *touch = &scene->work->touches[k];
        cfi_motion_t m;
        cfi_motion_t unused;
        double r[3];
        double v[3];
        cfi_arc_motion(&scene->direct, 0U, touch->time_s, &m, &unused);
        relative(scene, touch->obstacle, touch->time_s, &m, r, v);
        total += 0.5 * (cfi_dot(touch->force, touch->position) - cfi_dot(touch->force, r));
    }
    return total;
}

/*
 * Move a touch a share of the way to the local minimum of the norm in time, and to the normal there; returns the
 * relative change all the way.
 */
static double slide(const scene_t *scene, cff_touch_t *touch, double share, uint32_t *evaluations)
{
    const double length = scene->end - scene->start;
    const cff_path_t *obstacle = &scene->obstacles[touch->obstacle];
    const double first = cfi_max(scene->start, obstacle->arcs[0].start_s);
    const double last = cfi_min(scene->end, obstacle->arcs[obstacle->count - 1U].end_s);
    double t = touch->time_s;
    double r[3];
    double v[3];
    double moved = 0.0;
    bool on = true;
    for (uint32_t k = 0U; (k < STEPS) && on; k++) {
        const double ahead = cfi_min(t + (1e-5 * length), last);
        const double behind = ahead - (1e-5 * length);
        cfi_spend(evaluations, 2U * ((scene->direct.chief != NULL) ? TABLE_EVALUATIONS : FLIGHT_EVALUATIONS));
        relative_at(scene, touch->obstacle, ahead, r, v);
        const double after = cfi_dot(r, v);
        relative_at(scene, touch->obstacle, behind, r, v);
        const double before = cfi_dot(r, v);
        const double bend = (after - before) / (1e-5 * length);
        const double slope = before + (bend * (t - behind));
        double step = (slope > 0.0) ? (-0.02 * length) : (0.02 * length);
        if (bend > 0.0) {
            step = cfi_min(cfi_max(-slope / bend, -0.05 * length), 0.05 * length);
        }
        const double next = cfi_min(cfi_max(t + step, first), last);
        on = (fabs(next - t) > (1e-10 * length));
        t = next;
    }
    relative_at(scene, touch->obstacle, t, r, v);
    const double norm = sqrt(cfi_dot(r, r));
    moved = fabs(t - touch->time_s) / length;
    touch->time_s += share * (t - touch->time_s);
    const bool apart = (norm > 1e-9);
    for (uint32_t i = 0U; (i < 3U) && apart; i++) {
        const double turn = (r[i] / norm) - touch->normal[i];
        moved = cfi_max(moved, fabs(turn));
        touch->normal[i] += share * turn;
    }
    const double length_of_normal = sqrt(cfi_max(cfi_dot(touch->normal, touch->normal), 1e-300));
    for (uint32_t i = 0U; i < 3U; i++) {
        touch->normal[i] /= length_of_normal;
    }
    return moved;
}

/* Keep the touches that push; merge those of one obstacle that came together. */
static void keep_pushing(const scene_t *scene)
{
    cff_avoid_work_t *work = scene->work;
    const double near = SAME * (scene->end - scene->start);
    uint32_t count = 0U;
    for (uint32_t k = 0U; k < work->count; k++) {
        const cff_touch_t *touch = &work->touches[k];
        bool fresh = (cfi_dot(touch->force, touch->force) > 0.0);
        for (uint32_t m = 0U; m < count; m++) {
            const cff_touch_t *other = &work->touches[m];
            fresh = fresh && ((other->obstacle != touch->obstacle) || (fabs(other->time_s - touch->time_s) >= near));
        }
        if (fresh) {
            work->touches[count] = *touch;
            count++;
        }
    }
    work->count = count;
}

/* Add a touch where the deflected path comes closest to an obstacle, unless one is near. */
static bool add_touch(const scene_t *scene, uint32_t which, double t)
{
    cff_avoid_work_t *work = scene->work;
    const double near = 2.0 * SAME * (scene->end - scene->start);
    bool fresh = true;
    for (uint32_t k = 0U; k < work->count; k++) {
        const cff_touch_t *touch = &work->touches[k];
        fresh = fresh && ((touch->obstacle != which) || (fabs(touch->time_s - t) >= near));
    }
    if (fresh && (work->count < CFF_MOST_CONTACTS)) {
        cff_touch_t *touch = &work->touches[work->count];
        double v[3];
        touch->time_s = t;
        touch->obstacle = which;
        set_force(touch, 0.0);
        relative_at(scene, which, t, touch->normal, v);
        const double norm = sqrt(cfi_dot(touch->normal, touch->normal));
        for (uint32_t i = 0U; i < 3U; i++) {
            touch->normal[i] = (norm > 1e-9) ? (touch->normal[i] / norm) : ((i == 0U) ? 1.0 : 0.0);
        }
        work->count++;
    } else {
        fresh = false;
    }
    return fresh;
}

/*
 * Search the deflected path for conflicts: the largest shortfall, or CFF_FOREVER if the evaluations do not
 * suffice.  With `add`, new touches at the minima.
 */
static double look(const scene_t *scene, bool add, bool *fresh, uint32_t *evaluations)
{
    const cff_path_t path = bent(scene);
    double shortfall = 0.0;
    *fresh = false;
    for (uint32_t which = 0U; which < scene->obstacle_count; which++) {
        const cff_path_t *obstacle = &scene->obstacles[which];
        const cff_zone_t *zone = &scene->zones[which];
        cff_conflict_search_t search;
        cff_conflict_t conflicts[CONFLICTS] = {0};
        uint32_t count = 0U;
        const cff_status_t begun = cff_conflicts_begin(&search, &path, obstacle, zone);
        if (begun == CFF_BAD_INPUT) {
            shortfall = CFF_FOREVER; /* the arcs became too short to join */
        } else if (begun == CFF_NO_COMMON_TIME) {
            /* nothing to avoid */
        } else if (*evaluations < CFF_LEAST_EVALUATIONS) {
            shortfall = CFF_FOREVER;
        } else {
            const cff_status_t status = cff_conflicts_continue(&search, *evaluations, conflicts, CONFLICTS, &count);
            cfi_spend(evaluations, search.evaluations_used);
            shortfall = (status == CFF_MORE) ? CFF_FOREVER : shortfall;
        }
        for (uint32_t k = 0U; (k < count) && (k < CONFLICTS); k++) {
            cff_approach_t near = {0.0, 0.0, 0.0, 0U};
            (void)cff_closest_approach(&path, obstacle, zone, conflicts[k].start_s, conflicts[k].end_s,
                                       cfi_larger(*evaluations, CFF_LEAST_EVALUATIONS), &near);
            cfi_spend(evaluations, near.evaluations_used);
            shortfall = cfi_max(shortfall, cfi_max(1.0 - near.ratio, GRAZE));
            *fresh = (add && add_touch(scene, which, near.time_s)) || *fresh;
        }
    }
    return shortfall;
}

/* Two directions across a vector. */
static void across(const double v[3], double lines[2][3])
{
    uint32_t least = 0U;
    for (uint32_t i = 1U; i < 3U; i++) {
        least = (fabs(v[i]) < fabs(v[least])) ? i : least;
    }
    const double square = cfi_max(cfi_dot(v, v), 1e-300);
    for (uint32_t i = 0U; i < 3U; i++) {
        lines[0][i] = ((i == least) ? 1.0 : 0.0) - (v[least] * v[i] / square);
    }
    const double length = sqrt(cfi_max(cfi_dot(lines[0], lines[0]), 1e-300));
    for (uint32_t i = 0U; i < 3U; i++) {
        lines[0][i] /= length;
    }
    for (uint32_t i = 0U; i < 3U; i++) {
        const uint32_t j = (i + 1U) % 3U;
        const uint32_t k = (i + 2U) % 3U;
        lines[1][i] = ((v[j] * lines[0][k]) - (v[k] * lines[0][j])) / sqrt(square);
    }
}

/* The conditions of optimality: touching, a force along the normal, a minimum in time; returns the largest error. */
static double conditions(const scene_t *scene, double errors[], uint32_t *evaluations)
{
    cff_avoid_work_t *work = scene->work;
    double largest = 0.0;
    deflect(scene, evaluations);
    for (uint32_t k = 0U; k < work->count; k++) {
        const cff_touch_t *touch = &work->touches[k];
        const double *q = touch->position;
        const double square = cfi_max(cfi_dot(q, q), 1e-300);
        const double size = sqrt(cfi_max(cfi_dot(touch->normal, touch->normal), 1e-300)); /* of the force, see newton */
        double *error = &errors[4U * k];
        error[0] = sqrt(square) - scene->aim;
        for (uint32_t line = 0U; line < 2U; line++) {
            const double *w = work->lines[k][line];
            error[1U + line] = (cfi_dot(w, touch->force) - (cfi_dot(touch->force, q) * cfi_dot(w, q) / square)) / size;
        }
        error[3] = cfi_dot(q, touch->rate) * (scene->end - scene->start);
        largest = cfi_max(largest, fabs(error[0]));
        largest = cfi_max(largest, 0.01 * cfi_max(fabs(error[1]), cfi_max(fabs(error[2]), 0.1 * fabs(error[3]))));
    }
    return (largest <= FAR) ? largest : CFF_FOREVER; /* nan is far */
}

/* Unknown j: three forces and the time of each touch; and its scale. */
static double *unknown(const scene_t *scene, uint32_t j, double *size)
{
    cff_touch_t *touch = &scene->work->touches[j / 4U];
    *size = ((j % 4U) < 3U) ? sqrt(cfi_dot(touch->normal, touch->normal)) : (scene->end - scene->start);
    return ((j % 4U) < 3U) ? &touch->force[j % 4U] : &touch->time_s;
}

/* One step of Newton's method, with derivatives by differences. */
static bool newton_step(const scene_t *scene, uint32_t *evaluations)
{
    cff_avoid_work_t *work = scene->work;
    const uint32_t size = 4U * work->count;
    for (uint32_t j = 0U; j < size; j++) {
        double unit;
        double *x = unknown(scene, j, &unit);
        const double kept = *x;
        *x = kept + (NUDGE * unit);
        (void)conditions(scene, work->nudged, evaluations);
        *x = kept;
        for (uint32_t i = 0U; i < size; i++) {
            work->matrix[(i * size) + j] = (work->nudged[i] - work->errors[i]) / NUDGE;
        }
    }
    for (uint32_t i = 0U; i < size; i++) {
        work->right[i] = -work->errors[i];
    }
    bool good = cfi_solve(work->matrix, size, work->right, work->columns);
    for (uint32_t j = 0U; (j < size) && good; j++) {
        double unit;
        double *x = unknown(scene, j, &unit);
        *x += work->right[j] * unit;
    }
    for (uint32_t k = 0U; (k < work->count) && good; k++) { /* times stay in order and inside */
        const double before = (k > 0U) ? work->touches[k - 1U].time_s : scene->start;
        const double least = 1e-9 * (scene->end - scene->start);
        const cff_path_t *obstacle = &scene->obstacles[work->touches[k].obstacle];
        good = (work->touches[k].time_s > (before + least)) && (work->touches[k].time_s < (scene->end - least)) &&
               (work->touches[k].time_s >= obstacle->arcs[0].start_s) &&
               (work->touches[k].time_s <= obstacle->arcs[obstacle->count - 1U].end_s);
    }
    return good;
}

/* Solve the conditions of optimality from the touches; whether the method converges to forces that push. */
static bool newton(const scene_t *scene, uint32_t *evaluations)
{
    cff_avoid_work_t *work = scene->work;
    bool settled = false;
    bool on = (work->count > 0U);
    deflect(scene, evaluations);
    for (uint32_t turn = 0U; (turn < STEPS) && on && !settled; turn++) {
        for (uint32_t k = 0U; k < work->count; k++) {
            cff_touch_t *touch = &work->touches[k];
            across(touch->position, work->lines[k]);
            for (uint32_t i = 0U; i < 3U; i++) {
                touch->normal[i] = touch->force[i]; /* whose length scales the unknowns */
            }
        }
        const double error = conditions(scene, work->errors, evaluations);
        settled = (error < TOUCHING);
        on = (error < FAR) && (*evaluations > 0U) && (settled || newton_step(scene, evaluations));
    }
    for (uint32_t k = 0U; k < work->count; k++) {
        settled = settled && (cfi_dot(work->touches[k].force, work->touches[k].position) > 0.0);
    }
    return settled;
}

/* Keep the deflected path if it is clear and the cheapest so far. */
static bool accept(const scene_t *scene, cff_avoidance_t *found, cff_status_t *status, uint32_t *evaluations)
{
    const cff_avoid_work_t *work = scene->work;
    const double extra = extra_energy(scene);
    bool unused;
    bool clear = (*status != CFF_OK) || (extra < found->extra_energy_m2_s3);
    clear = clear && (extra >= 0.0) && (look(scene, false, &unused, evaluations) == 0.0);
    if (clear) {
        *status = CFF_OK;
        found->count = work->count + 1U;
        found->extra_energy_m2_s3 = extra;
        for (uint32_t k = 0U; k <= work->count; k++) {
            found->arcs[k] = work->arcs[k];
        }
        for (uint32_t k = 0U; k < work->count; k++) {
            const cff_touch_t *touch = &work->touches[k];
            found->contacts[k].time_s = touch->time_s;
            found->contacts[k].obstacle = touch->obstacle;
            as_metres(&scene->zones[touch->obstacle], touch->force, found->contacts[k].force_m_s3);
        }
    }
    return clear;
}

static void save_touches(cff_avoid_work_t *work, cff_touch_t to[], const cff_touch_t from[])
{
    for (uint32_t k = 0U; k < work->count; k++) {
        to[k] = from[k];
    }
}

/* Try to end a nearly clear round: by Newton's method, or by planes raised over the shortfall. */
static bool finish(const scene_t *scene, double shortfall, cff_avoidance_t *found, cff_status_t *status, uint32_t *evaluations)
{
    cff_avoid_work_t *work = scene->work;
    save_touches(work, work->kept, work->touches);
    bool done = newton(scene, evaluations);
    done = done && (accept(scene, found, status, evaluations) || ((*status == CFF_OK) && (extra_energy(scene) >= found->extra_energy_m2_s3)));
    double lift = 1.0;
    double missing = shortfall;
    bool on = !done;
    for (uint32_t turn = 0U; (turn < RAISES) && on && (*evaluations > 0U); turn++) {
        bool unused;
        save_touches(work, work->touches, work->kept);
        lift += (1.5 * missing) + 1e-11;
        solve_multipliers(scene, lift, 0.0, evaluations);
        missing = look(scene, false, &unused, evaluations);
        on = (missing > 0.0) && (missing < NEARLY);
        if (missing == 0.0) {
            (void)accept(scene, found, status, evaluations);
        }
    }
    if (!done) {
        save_touches(work, work->touches, work->kept);
    }
    return done;
}

/* Relax the touches until the path is clear at minimum energy on their sides. */
static void relax(const scene_t *scene, cff_avoidance_t *found, cff_status_t *status, uint32_t *evaluations)
{
    cff_avoid_work_t *work = scene->work;
    double soft = SOFT;
    double least = CFF_FOREVER;
    double last = CFF_FOREVER;
    double share = 1.0;
    uint32_t latest = 0U;
    bool on = true;
    for (uint32_t turn = 0U; (turn < ROUNDS) && on && (*evaluations > CFF_LEAST_EVALUATIONS); turn++) {
        double moved = 0.0;
        bool fresh;
        sort_touches(work);
        solve_multipliers(scene, 1.0, soft, evaluations);
        soft *= FADE;
        const double extra = extra_energy(scene);
        for (uint32_t k = 0U; k < work->count; k++) {
            if (cfi_dot(work->touches[k].force, work->touches[k].force) > 0.0) {
                moved = cfi_max(moved, slide(scene, &work->touches[k], share, evaluations));
            }
        }
        share = (moved > (0.8 * last)) ? cfi_max(0.5 * share, SLOWEST) : share; /* touches swing */
        last = moved;
        keep_pushing(scene);
        const double shortfall = look(scene, true, &fresh, evaluations);
        if (shortfall < cfi_max(least, NEARLY)) {
            least = shortfall;
            latest = turn;
        }
        on = (shortfall < CFF_FOREVER) && ((turn - latest) <= HOPELESS) && (work->count > 0U);
        if (on && (shortfall < NEARLY)) {
            on = (*status != CFF_OK) || (extra < (1.5 * found->extra_energy_m2_s3)); /* or another side is better */
            if (on && !fresh && (moved < CLOSE)) {
                sort_touches(work);
                on = !finish(scene, shortfall, found, status, evaluations);
            }
        }
        if ((work->count >= CFF_MOST_CONTACTS) && (*status != CFF_OK)) {
            *status = CFF_CROWDED;
        }
    }
}

/* Set the touches to the direct path's conflicts, on the side of a ray; ray RAYS: the nearer side. */
static void choose_side(const scene_t *scene, uint32_t ray, uint32_t *evaluations)
{
    static const double rays[RAYS][3] = {{1.0, 0.0, 0.0},  {DIAGONAL, DIAGONAL, 0.0},   {0.0, 1.0, 0.0},
                                         {-1.0, 0.0, 0.0}, {-DIAGONAL, DIAGONAL, 0.0},  {0.0, -1.0, 0.0},
                                         {0.0, 0.0, 1.0},  {-DIAGONAL, -DIAGONAL, 0.0}, {0.0, 0.0, -1.0},
                                         {DIAGONAL, -DIAGONAL, 0.0}};
    cff_avoid_work_t *work = scene->work;
    bool fresh;
    work->count = 0U;
    work->arc_count = 1U;
    work->arcs[0] = scene->direct.arcs[0];
    (void)look(scene, true, &fresh, evaluations);
    sort_touches(work);
    double lines[3][3] = {0};
    for (uint32_t k = 0U; (k < work->count) && (ray < RAYS); k++) {
        cff_touch_t *touch = &work->touches[k];
        double r[3];
        double v[3];
        double along = 0.0;
        double d[3];
        relative_at(scene, touch->obstacle, touch->time_s, r, v);
        if (k == 0U) {
            const double speed = sqrt(cfi_max(cfi_dot(v, v), 1e-300));
            across(v, lines);
            for (uint32_t i = 0U; i < 3U; i++) {
                lines[2][i] = v[i] / speed;
            }
        }
        for (uint32_t i = 0U; i < 3U; i++) {
            d[i] = (rays[ray][0] * lines[0][i]) + (rays[ray][1] * lines[1][i]) + (rays[ray][2] * lines[2][i]);
            along += d[i] * r[i];
        }
        const double ahead = sqrt(cfi_max((1.0 - cfi_dot(r, r)) + (along * along), 0.0)) - along;
        for (uint32_t i = 0U; i < 3U; i++) {
            touch->normal[i] = r[i] + (ahead * d[i]);
        }
        const double norm = sqrt(cfi_max(cfi_dot(touch->normal, touch->normal), 1e-300));
        for (uint32_t i = 0U; i < 3U; i++) {
            touch->normal[i] /= norm;
        }
    }
}

/* Try the sides, the cheapest first; the best clear path is left in `found`. */
static cff_status_t try_sides(const scene_t *scene, cff_avoidance_t *found, uint32_t *evaluations)
{
    double costs[RAYS + 1U] = {0};
    cff_status_t status = CFF_NO_PLAN;
    for (uint32_t ray = 0U; ray <= RAYS; ray++) {
        choose_side(scene, ray, evaluations);
        solve_multipliers(scene, 1.0, SOFT, evaluations);
        costs[ray] = extra_energy(scene);
    }
    for (uint32_t turn = 0U; turn < SIDES; turn++) {
        uint32_t best = 0U;
        for (uint32_t ray = 1U; ray <= RAYS; ray++) {
            best = (costs[ray] < costs[best]) ? ray : best;
        }
        if ((costs[best] < CFF_FOREVER) && (*evaluations > CFF_LEAST_EVALUATIONS)) {
            costs[best] = CFF_FOREVER;
            choose_side(scene, best, evaluations);
            relax(scene, found, &status, evaluations);
        }
    }
    if ((status != CFF_OK) && (*evaluations <= CFF_LEAST_EVALUATIONS)) {
        status = CFF_MORE;
    }
    return status;
}

/* The inverse of the response of the end to the initial thrust; false if there is none. */
static bool invert(const scene_t *scene)
{
    bool good = true;
    for (uint32_t j = 0U; (j < 6U) && good; j++) {
        double gap[6] = {0};
        double thrust[6];
        gap[j] = 1.0;
        good = cfi_steer(scene->direct.chief, scene->direct.arcs[0].mean_motion_rad_s, scene->start, scene->end, gap, thrust);
        for (uint32_t i = 0U; (i < 6U) && good; i++) {
            scene->work->inverse[i][j] = thrust[i];
        }
    }
    return good;
}

/* Whether the path starts or ends in a zone, while the obstacle is there. */
static bool ends_inside(const scene_t *scene)
{
    bool inside = false;
    for (uint32_t which = 0U; which < scene->obstacle_count; which++) {
        const cff_path_t *obstacle = &scene->obstacles[which];
        for (uint32_t end = 0U; end < 2U; end++) {
            const double t = (end == 0U) ? scene->start : scene->end;
            double r[3];
            double v[3];
            relative_at(scene, which, t, r, v);
            const bool there = (t >= obstacle->arcs[0].start_s) && (t <= obstacle->arcs[obstacle->count - 1U].end_s);
            inside = inside || (there && (cfi_norm(CFF_ELLIPSOID, r) <= AIM));
        }
    }
    return inside;
}

cff_status_t cff_avoid(const cff_arc_t *direct, const cff_path_t obstacles[], const cff_zone_t zones[],
                       uint32_t obstacle_count, uint32_t evaluations, cff_avoid_work_t *work, cff_avoidance_t *found)
{
    double energy = 0.0;
    cff_status_t status = ((obstacle_count > 0U) && (obstacle_count <= CFF_MOST_OBSTACLES) &&
                           (evaluations >= CFF_LEAST_EVALUATIONS)) ? CFF_OK : CFF_BAD_INPUT;
    const cff_path_t path = {direct, 1U, (status == CFF_OK) ? obstacles[0].chief : NULL};
    for (uint32_t k = 0U; (k < obstacle_count) && (status == CFF_OK); k++) {
        const cff_status_t pair = cfi_check_pair(&path, &obstacles[k], &zones[k]);
        status = ((pair == CFF_BAD_INPUT) || (zones[k].shape != CFF_ELLIPSOID)) ? CFF_BAD_INPUT : CFF_OK;
    }
    status = (status == CFF_OK) ? cff_energy(&path, &energy) : status;
    if (status == CFF_OK) {
        scene_t scene;
        uint32_t left = evaluations;
        bool unused;
        scene.direct = path;
        scene.obstacles = obstacles;
        scene.zones = zones;
        scene.obstacle_count = obstacle_count;
        scene.start = direct->start_s;
        scene.end = direct->end_s;
        scene.aim = (obstacles[0].chief == NULL) ? AIM : (AIM + FARTHER);
        scene.work = work;
        work->count = 0U;
        work->arc_count = 1U;
        work->arcs[0] = *direct;
        found->arcs[0] = *direct;
        found->count = 1U;
        found->extra_energy_m2_s3 = 0.0;
        const double shortfall = look(&scene, false, &unused, &left);
        if (shortfall >= CFF_FOREVER) {
            status = CFF_MORE;
        } else if (ends_inside(&scene)) {
            status = CFF_END_INSIDE;
        } else if (shortfall > 0.0) {
            status = invert(&scene) ? try_sides(&scene, found, &left) : CFF_SINGULAR;
        } else {
            /* the direct path is clear */
        }
        found->energy_m2_s3 = energy + found->extra_energy_m2_s3;
        found->evaluations_used = evaluations - left;
    }
    return status;
}
