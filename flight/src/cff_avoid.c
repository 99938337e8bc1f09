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
#define NEAR 0.05     /* of the duration: how far a contact slides in a round */
#define SAME 1.0e-3   /* of the duration: contacts closer than this are one */
#define SWEEPS 300U
#define STEPS 15U /* of Newton's method */
#define TOUCHING 1.0e-10 /* largest error of the conditions, in zones */
#define FAR 10.0
#define NUDGE 1.0e-6 /* relative change of an unknown in the derivatives by differences */
#define RAYS 14U /* sides on which to pass: along both ways of the axes of a zone, and of its diagonals */
#define SIDES 8U
#define DIAGONAL 0.5773502691896258

/* The task: it does not change during a call. */
typedef struct {
    cff_path_t direct;
    const cff_path_t *obstacles;
    const cff_zone_t *zones;
    uint32_t obstacle_count;
    double start;
    double end;
    double aim;   /* norm at a contact */
    double clear; /* and from which the path is clear */
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
static void relative(const scene_t *scene, uint32_t which, double t, const cff_state_t *m, double r[3], double v[3])
{
    const cff_path_t *obstacle = &scene->obstacles[which];
    const cff_zone_t *zone = &scene->zones[which];
    cff_state_t o;
    cff_state_t unused;
    cfi_arc_motion(obstacle, cfi_locate(obstacle, t), t, &o, &unused);
    for (uint32_t i = 0U; i < 3U; i++) {
        o.position_m[i] = m->position_m[i] - o.position_m[i];
        o.velocity_m_s[i] = m->velocity_m_s[i] - o.velocity_m_s[i];
    }
    for (uint32_t i = 0U; i < 3U; i++) {
        r[i] = cfi_dot(zone->to_unit_per_m[i], o.position_m);
        v[i] = cfi_dot(zone->to_unit_per_m[i], o.velocity_m_s);
    }
}

/* Fly the arcs from the first arc's thrust on, with the forces as jumps; fills the touches and the end. */
static void fly(const scene_t *scene, cff_state_t *end)
{
    cff_avoid_work_t *work = scene->work;
    const cff_path_t path = {work->arcs, work->count + 1U, scene->direct.chief};
    for (uint32_t k = 0U; k <= work->count; k++) {
        cff_arc_t *arc = &work->arcs[k];
        cff_state_t u;
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
            next->state = *end;
            for (uint32_t i = 0U; i < 3U; i++) {
                next->thrust_m_s2[i] = u.position_m[i];
                next->thrust_rate_m_s3[i] = u.velocity_m_s[i] + force[i];
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
    cff_state_t end;
    cff_state_t wanted;
    cff_state_t u;
    double off[6];
    cfi_spend(evaluations, 2U * (work->count + 1U) * cfi_motion_cost(scene->direct.chief));
    work->arcs[0] = *direct;
    fly(scene, &end);
    cfi_arc_motion(&scene->direct, 0U, scene->end, &wanted, &u);
    cfi_miss(&wanted, &end, off);
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

/* Scale a vector to length 1; one without length becomes the first axis. */
static void make_unit(double v[3])
{
    const double size = sqrt(cfi_dot(v, v));
    for (uint32_t i = 0U; i < 3U; i++) {
        v[i] = (size > 1e-9) ? (v[i] / size) : ((i == 0U) ? 1.0 : 0.0);
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
    double gap[CFF_MOST_CONTACTS] = {0};
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
            const double moved = cfi_dot(touch->normal, touch->position) - ((lift * scene->aim) - gap[k]);
            work->matrix[(k * CFF_MOST_CONTACTS) + m] = moved / share;
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

/* The motion of a path relative to an obstacle at time t, in zone units. */
static void relative_at(const scene_t *scene, const cff_path_t *path, uint32_t which, double t, double r[3], double v[3])
{
    cff_state_t m;
    cff_state_t unused;
    cfi_arc_motion(path, cfi_locate(path, t), t, &m, &unused);
    relative(scene, which, t, &m, r, v);
}

/* The energy beyond that of the direct path: half the forces times the deflections. */
static double extra_energy(const scene_t *scene)
{
    double total = 0.0;
    for (uint32_t k = 0U; k < scene->work->count; k++) {
        const cff_touch_t *touch = &scene->work->touches[k];
        double r[3];
        double v[3];
        relative_at(scene, &scene->direct, touch->obstacle, touch->time_s, r, v);
        total += 0.5 * (cfi_dot(touch->force, touch->position) - cfi_dot(touch->force, r));
    }
    return total;
}

/*
 * Move a touch a share of the way to the minimum of the norm near it, and to the normal there; returns the relative
 * change all the way.
 */
static double slide(const scene_t *scene, cff_touch_t *touch, double share, uint32_t *evaluations)
{
    const double length = scene->end - scene->start;
    const cff_path_t path = bent(scene);
    const cff_path_t *obstacle = &scene->obstacles[touch->obstacle];
    const double first = cfi_max(cfi_max(scene->start, obstacle->arcs[0].start_s), touch->time_s - (NEAR * length));
    const double last = cfi_min(cfi_min(scene->end, obstacle->arcs[obstacle->count - 1U].end_s), touch->time_s + (NEAR * length));
    cff_approach_t near = {touch->time_s, 0.0, 0.0, 0U};
    double r[3];
    double v[3];
    (void)cff_closest_approach(&path, obstacle, &scene->zones[touch->obstacle], first, last,
                               cfi_larger(*evaluations, CFF_LEAST_EVALUATIONS), &near);
    cfi_spend(evaluations, near.evaluations_used);
    relative_at(scene, &path, touch->obstacle, near.time_s, r, v);
    double moved = fabs(near.time_s - touch->time_s) / length;
    touch->time_s += share * (near.time_s - touch->time_s);
    const double norm = sqrt(cfi_dot(r, r));
    const bool apart = (norm > 1e-9);
    for (uint32_t i = 0U; (i < 3U) && apart; i++) {
        const double turn = (r[i] / norm) - touch->normal[i];
        moved = cfi_max(moved, fabs(turn));
        touch->normal[i] += share * turn;
    }
    make_unit(touch->normal);
    return moved;
}

/* Keep the touches that push, and those from `old` on, which are new; merge those of one obstacle that came together. */
static void keep_pushing(const scene_t *scene, uint32_t old)
{
    cff_avoid_work_t *work = scene->work;
    const double near = SAME * (scene->end - scene->start);
    uint32_t count = 0U;
    for (uint32_t k = 0U; k < work->count; k++) {
        const cff_touch_t *touch = &work->touches[k];
        bool fresh = (k >= old) || (cfi_dot(touch->force, touch->force) > 0.0);
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
        const cff_path_t path = bent(scene);
        double v[3];
        touch->time_s = t;
        touch->obstacle = which;
        set_force(touch, 0.0);
        relative_at(scene, &path, which, t, touch->normal, v);
        make_unit(touch->normal);
        work->count++;
    } else {
        fresh = false;
    }
    return fresh;
}

/*
 * The largest shortfall of the deflected path at its closest approaches, or CFF_FOREVER if the evaluations do not
 * suffice.  With `add`, new touches there.
 */
static double look(const scene_t *scene, bool add, bool *fresh, uint32_t *evaluations)
{
    const cff_path_t path = bent(scene);
    double shortfall = 0.0;
    *fresh = false;
    for (uint32_t which = 0U; which < scene->obstacle_count; which++) {
        const cff_path_t *obstacle = &scene->obstacles[which];
        const double first = cfi_max(scene->start, obstacle->arcs[0].start_s);
        const double last = cfi_min(scene->end, obstacle->arcs[obstacle->count - 1U].end_s);
        cff_approach_t near = {0.0, 1.0, 0.0, 0U};
        cff_status_t status = CFF_OK;
        if (first <= last) {
            status = cff_closest_approach(&path, obstacle, &scene->zones[which], first, last, *evaluations, &near);
            cfi_spend(evaluations, near.evaluations_used);
        }
        if (status != CFF_OK) {
            shortfall = CFF_FOREVER; /* the evaluations are spent, or arcs became too short to join */
        } else if (near.ratio < scene->clear) {
            shortfall = cfi_max(shortfall, cfi_max(1.0 - near.ratio, GRAZE));
            *fresh = (add && add_touch(scene, which, near.time_s)) || *fresh;
        } else {
            /* clear */
        }
    }
    return shortfall;
}

/* The conditions of optimality: each contact is where its force points to, and closest then; returns the largest error. */
static double conditions(const scene_t *scene, double errors[], uint32_t *evaluations)
{
    cff_avoid_work_t *work = scene->work;
    double largest = 0.0;
    deflect(scene, evaluations);
    for (uint32_t k = 0U; k < work->count; k++) {
        const cff_touch_t *touch = &work->touches[k];
        double *error = &errors[4U * k];
        double way[3] = {touch->force[0], touch->force[1], touch->force[2]};
        make_unit(way);
        for (uint32_t i = 0U; i < 3U; i++) {
            error[i] = touch->position[i] - (scene->aim * way[i]);
            largest = cfi_max(largest, fabs(error[i]));
        }
        error[3] = cfi_dot(touch->position, touch->rate) * (scene->end - scene->start);
        largest = cfi_max(largest, 1e-3 * fabs(error[3]));
    }
    return (largest <= FAR) ? largest : CFF_FOREVER; /* nan is far */
}

/* Unknown j: three forces and the time of each touch; and its scale. */
static double *unknown(const scene_t *scene, uint32_t j, double *size)
{
    cff_touch_t *touch = &scene->work->touches[j / 4U];
    *size = ((j % 4U) < 3U) ? touch->size : (scene->end - scene->start);
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
            work->touches[k].size = cfi_max(sqrt(cfi_dot(work->touches[k].force, work->touches[k].force)), 1e-300);
        }
        const double error = conditions(scene, work->errors, evaluations);
        settled = (error < TOUCHING);
        on = (error < FAR) && (*evaluations > 0U) && (settled || newton_step(scene, evaluations));
    }
    return settled;
}

/* Whether the search for conflicts certifies that the deflected path is clear. */
static bool certify(const scene_t *scene, uint32_t *evaluations)
{
    const cff_path_t path = bent(scene);
    cff_conflict_search_t *search = &scene->work->search;
    bool clear = true;
    for (uint32_t which = 0U; (which < scene->obstacle_count) && clear; which++) {
        const cff_status_t begun = cff_conflicts_begin(search, &path, &scene->obstacles[which], &scene->zones[which]);
        clear = (begun == CFF_NO_COMMON_TIME);
        if (begun == CFF_OK) {
            cff_conflict_t conflict[1];
            uint32_t count = 0U;
            clear = (cff_conflicts_continue(search, *evaluations, conflict, 1U, &count) == CFF_OK) && (count == 0U);
            cfi_spend(evaluations, search->evaluations_used);
        }
    }
    return clear;
}

/* Keep the deflected path, which looks clear, if it is the cheapest so far and certified. */
static void accept(const scene_t *scene, double extra, cff_avoidance_t *found, cff_status_t *status, uint32_t *evaluations)
{
    const cff_avoid_work_t *work = scene->work;
    const bool cheaper = (extra >= 0.0) && ((*status != CFF_OK) || (extra < found->extra_energy_m2_s3));
    if (cheaper && certify(scene, evaluations)) {
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
}

static void copy_touches(cff_touch_t to[], const cff_touch_t from[], uint32_t count)
{
    for (uint32_t k = 0U; k < count; k++) {
        to[k] = from[k];
    }
}

/* Try to end a nearly clear round by Newton's method; else the touches are left as they were. */
static bool finish(const scene_t *scene, cff_avoidance_t *found, cff_status_t *status, uint32_t *evaluations)
{
    cff_avoid_work_t *work = scene->work;
    bool unused;
    copy_touches(work->kept, work->touches, work->count);
    bool done = newton(scene, evaluations);
    const double extra = extra_energy(scene);
    const bool dear = (*status == CFF_OK) && (extra >= found->extra_energy_m2_s3);
    if (done && !dear && (look(scene, false, &unused, evaluations) == 0.0)) {
        accept(scene, extra, found, status, evaluations);
    } else if (!done || !dear) {
        copy_touches(work->touches, work->kept, work->count);
        done = false;
    } else {
        /* it ends dearer than another side */
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
    double lift = 1.0;
    uint32_t latest = 0U;
    bool on = true;
    for (uint32_t turn = 0U; (turn < ROUNDS) && on && (*evaluations > CFF_LEAST_EVALUATIONS); turn++) {
        double moved = 0.0;
        bool fresh;
        sort_touches(work);
        solve_multipliers(scene, lift, soft, evaluations);
        soft *= FADE;
        const double extra = extra_energy(scene);
        const uint32_t count = work->count;
        const double shortfall = look(scene, true, &fresh, evaluations);
        if (shortfall == 0.0) {
            accept(scene, extra, found, status, evaluations);
        }
        for (uint32_t k = 0U; k < count; k++) {
            if (cfi_dot(work->touches[k].force, work->touches[k].force) > 0.0) {
                moved = cfi_max(moved, slide(scene, &work->touches[k], share, evaluations));
            }
        }
        share = (moved > (0.8 * last)) ? cfi_max(0.5 * share, SLOWEST) : share; /* touches swing */
        last = moved;
        keep_pushing(scene, count);
        if (shortfall < cfi_max(least, NEARLY)) {
            least = shortfall;
            latest = turn;
        }
        on = (shortfall < CFF_FOREVER) && ((turn - latest) <= HOPELESS) && (work->count > 0U);
        if (on && (shortfall < NEARLY)) {
            on = (*status != CFF_OK) || (extra < (1.5 * found->extra_energy_m2_s3)); /* or another side is better */
            if (on && !fresh && (moved < CLOSE)) {
                sort_touches(work);
                on = !finish(scene, found, status, evaluations);
                lift += (1.5 * shortfall) + 1e-11;
            }
        }
        if ((work->count >= CFF_MOST_CONTACTS) && (*status != CFF_OK)) {
            *status = CFF_CROWDED;
        }
    }
}

/* Set the touches to the direct path's conflicts, on the side of a ray; ray RAYS: the nearer side. */
static void choose_side(const scene_t *scene, uint32_t ray)
{
    cff_avoid_work_t *work = scene->work;
    work->count = work->first_count;
    copy_touches(work->touches, work->first, work->count);
    for (uint32_t k = 0U; (k < work->count) && (ray < RAYS); k++) {
        cff_touch_t *touch = &work->touches[k];
        for (uint32_t i = 0U; i < 3U; i++) {
            const double sign = (((ray >> i) % 2U) == 0U) ? 1.0 : -1.0;
            double way = sign * DIAGONAL;
            if (ray >= 8U) {
                way = ((ray - 8U) == i) ? 1.0 : 0.0;
                way = ((ray - 11U) == i) ? -1.0 : way;
            }
            touch->normal[i] = touch->position[i] + way;
        }
        make_unit(touch->normal);
    }
}

/* Try the sides, the cheapest first; the best clear path is left in `found`. */
static cff_status_t try_sides(const scene_t *scene, cff_avoidance_t *found, uint32_t *evaluations)
{
    double costs[RAYS + 1U] = {0};
    cff_avoid_work_t *work = scene->work;
    cff_status_t status = CFF_NO_PLAN;
    bool unused;
    (void)look(scene, true, &unused, evaluations);
    sort_touches(work);
    deflect(scene, evaluations); /* without a force: the positions of the direct path */
    work->first_count = work->count;
    copy_touches(work->first, work->touches, work->count);
    for (uint32_t ray = 0U; ray <= RAYS; ray++) {
        choose_side(scene, ray);
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
            choose_side(scene, best);
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
            relative_at(scene, &scene->direct, which, t, r, v);
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
        scene.clear = (obstacles[0].chief == NULL) ? 1.0 : (1.0 + (0.5 * FARTHER));
        scene.aim = (obstacles[0].chief == NULL) ? AIM : (AIM + FARTHER);
        scene.work = work;
        work->count = 0U;
        work->arc_count = 1U;
        work->arcs[0] = *direct;
        found->arcs[0] = *direct;
        found->count = 1U;
        found->extra_energy_m2_s3 = 0.0;
        const double shortfall = certify(&scene, &left) ? 0.0 : look(&scene, false, &unused, &left);
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
