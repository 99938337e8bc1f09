/*
 * closeform_flight: closeform's algorithms for an on-board computer, in C99.
 *
 * Relative motion beside a chief: by Hill's (Clohessy-Wiltshire) equations in closed form for any mean
 * motion n >= 0 (n = 0 is deep space), or by an uploaded table for an eccentric or J2-perturbed chief.
 * Transfers of minimum energy, all conflicts of two paths without a time step, closest approach,
 * avoidance, passive safety, and the search, first lock and gathering of lost spacecraft.
 *
 * Frame: x radial outward, y along the velocity, z along the orbit normal.  Units are in the names.
 *
 * No heap, no recursion, no function pointer, no writable static data; of libm only sqrt and fabs.
 * Every loop has a bound that is known at compile time or is paid for by `evaluations`, the unit of
 * execution time.  A function that runs out of evaluations returns CFF_MORE and the time up to which its
 * answer is certified; call it again to continue.  cff_closest_approach and cff_avoid do not continue: call
 * them again with more evaluations.
 *
 * A call that returns CFF_BAD_INPUT leaves its outputs unchanged.  Reentrant.  Pointers must not be null
 * and are not kept, except those of cff_conflicts_begin and the table of cff_impulses_begin.
 */
#ifndef CLOSEFORM_FLIGHT_H
#define CLOSEFORM_FLIGHT_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define CFF_VERSION "0.1"
#define CFF_LARGEST 1.0e60          /* largest magnitude of an input: squares and cubes do not overflow */
#define CFF_LARGEST_ANGLE_RAD 6.0e5 /* longest arc, times the mean motion: beyond, the phase loses digits */
#define CFF_SHORTEST_S 1.0e-12      /* shortest arc */
#define CFF_LEAST_EVALUATIONS 64U   /* least budget of a call: with less it might make no progress */
#define CFF_MOST_ARCS 256U          /* arcs of a path */
#define CFF_MOST_WINDOWS 4096U      /* windows of a table, and windows that one arc may last */
#define CFF_MOST_OBSTACLES 8U       /* obstacles of an avoidance */
#define CFF_MOST_CONTACTS 8U        /* contacts of an avoidance */
#define CFF_MOST_IMPULSES 6U        /* of a plan of minimum delta-v */
#define CFF_MOST_PEAKS 8U           /* maxima of the primer that such a plan takes up at once */
#define CFF_MOST_LEGS 64U           /* turns of a search */
#define CFF_MOST_CRAFT 64U          /* spacecraft of a gathering */
#define CFF_TERMS 12U               /* coefficients of a polynomial of a table */
#define CFF_COLUMNS 15U             /* state, costate and constant push */

typedef enum {
    CFF_OK = 0,             /* the answer is complete and certified */
    CFF_MORE = 1,           /* the evaluations are spent: certified up to `certified_until_s`; call again */
    CFF_FULL = 2,           /* no space for another conflict: certified up to `certified_until_s`; call again */
    CFF_NO_COMMON_TIME = 3, /* the two paths share no time */
    CFF_NO_PLAN = 4,        /* no clear path was found: ask the ground, or take another duration */
    CFF_END_INSIDE = 5,     /* the start or the end is inside a zone: no path between them is clear */
    CFF_CROWDED = 6,        /* the path needs more than CFF_MOST_CONTACTS contacts */
    CFF_BAD_INPUT = -1,     /* a number is not finite or too large, or an argument is out of its bounds */
    CFF_SINGULAR = -2,      /* no unique thrust leads there: the duration is too short for the numbers */
    CFF_TOO_NARROW = -3     /* the sensor is too narrow for the tips that the sun limit allows */
} cff_status_t;

typedef struct {
    double position_m[3];
    double velocity_m_s[3];
} cff_state_t;

/*
 * Motion under one law of thrust: a row of `Path.arcs` of the Python package, 30 doubles in its order.
 * The optimal thrust follows natural motion, from its value and its rate at the start.  The push is a
 * prescribed thrust in the span of 1, t, cos nt and sin nt, given by its derivatives at the start; a
 * constant push has the first alone, and beside a table only a constant push is allowed.
 */
typedef struct {
    double start_s;
    double end_s;
    double mean_motion_rad_s; /* not used beside a table */
    double impulse_m_s[3];    /* just before the start; for information */
    cff_state_t state;        /* at the start, after the impulse */
    double thrust_m_s2[3];
    double thrust_rate_m_s3[3];
    double push_m_s2[3];
    double push_rate_m_s3[3];
    double push_bend_m_s4[3];
    double push_twist_m_s5[3];
} cff_arc_t;

/*
 * Table of a chief: its transition matrix and the response to thrust, as polynomials in windows of an
 * angle s.  The Python package makes it, see cff_uploaded_table; the arrays stay in the caller's memory.
 * Clock: rate t + phase = s - eccentricity sin s.  Theory (97).
 */
typedef struct {
    double rate_rad_s;
    double eccentricity;
    double phase_rad;
    double turn_rad;         /* angle after which the table repeats; 0 if it does not */
    uint32_t windows;
    const double *joints_rad; /* windows + 1: angles at which windows begin and end */
    const double *rows;       /* windows x 15 x 6 x 12: Bernstein coefficients of (r, v/n) for each column */
    const double *steps;      /* windows x 6 x 15: (r, v/n) at the end of a window for each column */
    const double *errors;     /* windows x 15: bounds of the errors of the positions of `rows` */
    const double *returns;    /* windows x 9 x 6 x 12: the change of a window's first state by costate and push */
    const double *return_errors; /* windows x 9: bounds of their errors; NULL for both: no passive safety */
} cff_table_t;

/* Room for the table of a circular orbit or of deep space, which cff_circular_table makes. */
typedef struct {
    double joints_rad[2];
    double rows[1080];
    double steps[90];
    double errors[15];
    double returns[648];
    double return_errors[9];
} cff_circle_t;

/* Motion of one spacecraft: arcs in order of time, each of which begins where the one before it ends. */
typedef struct {
    const cff_arc_t *arcs;
    uint32_t count;
    const cff_table_t *chief; /* NULL: Hill's equations, with the mean motion of each arc */
} cff_path_t;

typedef enum {
    CFF_ELLIPSOID = 0, /* |q| <= 1; a sphere is one */
    CFF_BOX = 1,       /* |q_0|, |q_1|, |q_2| <= 1 */
    CFF_CYLINDER = 2   /* hypot(q_0, q_1) <= 1, |q_2| <= 1 */
} cff_shape_t;

/* Keep-out zone of a pair: the set of relative positions r whose norm is at most 1, with q = to_unit_per_m r. */
typedef struct {
    cff_shape_t shape;
    double to_unit_per_m[3][3]; /* rows: axes of the zone, each divided by its half-width */
} cff_zone_t;

/* Time interval inside a zone. */
typedef struct {
    double start_s;
    double end_s;
} cff_conflict_t;

typedef struct {
    double time_s;            /* time of the minimum norm */
    double ratio;             /* minimum norm: 1 on the surface of the zone, 0 where the centres meet */
    double certified_until_s; /* it is the minimum from the start up to this time */
    uint32_t evaluations_used;
} cff_approach_t;

/* Place on a path, for the library: an arc, its window of the table, and the columns where that begins. */
typedef struct {
    uint32_t arc;
    uint32_t window;
    double origin_rad;
    double columns[CFF_COLUMNS];
} cff_cursor_t;

/* A search for conflicts in progress.  Read its fields for telemetry; only the library writes them. */
typedef struct {
    cff_path_t one;
    cff_path_t other;
    const cff_zone_t *zone;
    double end_s;
    double certified_until_s; /* all conflicts that begin before this time are known */
    double entry_s;           /* of the open conflict, if `inside` */
    double exit_s;
    double step; /* of the view in progress, in its variable */
    cff_cursor_t place_of_one;
    cff_cursor_t place_of_other;
    uint32_t evaluations_used;
    bool begun;
    bool inside;
    bool finished;
} cff_conflict_search_t;

/* A conflict with one of several others. */
typedef struct {
    uint32_t other;
    cff_conflict_t conflict;
} cff_fleet_conflict_t;

typedef struct {
    double time_s;
    uint32_t obstacle;
    double force_m_s3[3]; /* jump of the thrust rate */
} cff_contact_t;

/* A path around obstacles: one arc more than contacts. */
typedef struct {
    cff_arc_t arcs[CFF_MOST_CONTACTS + 1U];
    uint32_t count; /* of arcs; 1: the direct path is clear */
    cff_contact_t contacts[CFF_MOST_CONTACTS];
    double energy_m2_s3;
    double extra_energy_m2_s3; /* beyond that of the direct path */
    uint32_t evaluations_used;
} cff_avoidance_t;

/* A contact in progress; forces and normals are in zone units. */
typedef struct {
    double time_s;
    uint32_t obstacle;
    double normal[3];
    double force[3];
    double size; /* that scales the force in Newton's method */
    double position[3]; /* of the path in the zone, and its rate */
    double rate[3];
} cff_touch_t;

/* Space that cff_avoid works in; its contents mean nothing between calls. */
typedef struct {
    cff_touch_t touches[CFF_MOST_CONTACTS];
    cff_touch_t kept[CFF_MOST_CONTACTS];
    cff_touch_t first[CFF_MOST_CONTACTS];
    uint32_t first_count;
    uint32_t count;
    uint32_t arc_count;
    cff_arc_t arcs[CFF_MOST_CONTACTS + 1U];
    double inverse[6][6];
    double matrix[16U * CFF_MOST_CONTACTS * CFF_MOST_CONTACTS];
    double right[4U * CFF_MOST_CONTACTS];
    cff_conflict_search_t search;
    double columns[4U * CFF_MOST_CONTACTS];
    double errors[4U * CFF_MOST_CONTACTS];
    double nudged[4U * CFF_MOST_CONTACTS];
} cff_avoid_work_t;

typedef struct {
    double time_s;
    double delta_v_m_s[3];
} cff_impulse_t;

/* A unit impulse, for the library: its effect on the final state, and that of a primer's initial value and rate along it. */
typedef struct {
    double time_s;
    double direction[3];
    double size_m_s;
    double change[6];
    double along[6];
} cff_push_t;

/* Impulses between two states in a given time.  Read the plan; only the library writes it. */
typedef struct {
    cff_arc_t arcs[CFF_MOST_IMPULSES + 1U]; /* the plan: coasts, each after its impulse */
    uint32_t count;                         /* of arcs */
    double delta_v_m_s;                     /* of the plan */
    double lower_bound_m_s;                 /* no thrust of any kind makes the transfer with less, up to rounding */
    uint32_t evaluations_used;
    bool finished;
    const cff_table_t *chief; /* the rest is for the library */
    cff_arc_t coast;          /* without impulses */
    double change[6];         /* of the final state, that impulses make */
    cff_push_t basis[CFF_MOST_IMPULSES];
    double cost_m_s; /* of the basis */
    cff_arc_t primer; /* as a coast from its first value and rate on */
    cff_push_t peaks[CFF_MOST_PEAKS];
    uint32_t peak_count;
    double scanned_s; /* of the primer, and the piece of the next view */
    double low;
    double width;
} cff_impulses_t;

typedef enum { CFF_SAFE = 0, CFF_UNSAFE = 1, CFF_UNDECIDED = 2 } cff_verdict_t;

/* The verdict on a loss of thrust. */
typedef struct {
    cff_verdict_t verdict;    /* CFF_UNDECIDED: a failure leads so close to the surface that rounding decides */
    double failure_s;         /* not safe: time of such a failure */
    double time_s;            /* and the time at which the drift after it is inside the zone, or nearly */
    double certified_until_s; /* no failure before this time leads into the zone */
    uint32_t evaluations_used;
} cff_drift_t;

/* Body axes in the inertial frame; the boresight is body z. */
typedef struct {
    double body_x[3];
    double body_y[3];
    double boresight[3];
} cff_attitude_t;

/* One turn of a search, the same for all craft: `Search.legs` of the Python package. */
typedef struct {
    double start_s;
    double end_s;
    double angle_rad;        /* right-handed about the axis, at a constant rate */
    double axis[3];          /* unit vector, inertial */
    cff_attitude_t attitude; /* of group A at the start of the leg */
} cff_leg_t;

/* Group B looks in the direction opposite to group A. */
typedef enum { CFF_GROUP_A = 0, CFF_GROUP_B = 1 } cff_group_t;

/* Numbers of a search; the sun is along -z of the inertial frame. */
typedef struct {
    double half_angle_rad;    /* of the sensor's cone */
    double slew_rate_rad_s;   /* of all turns */
    double sun_limit_rad;     /* greatest angle of body x from the sun, below pi / 2 */
    double in_plane_turn_rad; /* basic search: angle of each in-plane turn, such as 3 pi */
    double tip_angle_rad;     /* basic search: angle of the out-of-plane turns; 0 for that of the paper */
    uint32_t passes;          /* basic search: how often in-plane and out-of-plane turns are made */
    bool relaxed;             /* basic search: single tips, which may exceed the sun limit */
} cff_schedule_t;

/* The sensor of each craft: a cone along its boresight. */
typedef struct {
    double half_angle_rad; /* above 0 and below pi */
    double offset_m;       /* from the centre of mass along the boresight, >= 0 */
    double range_m;        /* CFF_LARGEST: none */
} cff_sensor_t;

typedef struct {
    double time_s;            /* of the lock, if `leg` >= 0 */
    int32_t leg;              /* of the lock; -1: none */
    double certified_until_s; /* no lock before here */
    uint32_t evaluations_used;
} cff_lock_t;

/*
 * Contracts of the functions are in ACSL (comments that begin with an at sign), for Frama-C; see flight/analysis.
 * All of them require that pointers are valid, also those in a path or a table.
 */
/*@ predicate cff_is_table(cff_table_t *chief) = \valid_read(chief) &&
      \valid_read(chief->joints_rad + (0 .. chief->windows)) &&
      \valid_read(chief->rows + (0 .. chief->windows * 1080 - 1)) &&
      \valid_read(chief->steps + (0 .. chief->windows * 90 - 1)) &&
      \valid_read(chief->errors + (0 .. chief->windows * 15 - 1)); */
/*@ predicate cff_is_path(cff_path_t *path) = \valid_read(path) &&
      (path->count > 0 ==> \valid_read(path->arcs + (0 .. path->count - 1))) &&
      (path->chief == \null || cff_is_table(path->chief)); */

/* Natural motion: the state `duration_s` later (or earlier, by Hill's equations). */
/*@ requires \valid_read(state) && \valid(later); assigns *later; */
cff_status_t cff_coast(double mean_motion_rad_s, double duration_s, const cff_state_t *state, cff_state_t *later);

/* The arc of minimum energy, half the integral of |thrust|^2, between two states. */
/*@ requires \valid_read(initial) && \valid_read(final) && \valid(arc); assigns *arc; */
cff_status_t cff_transfer(double mean_motion_rad_s, double start_s, double duration_s, const cff_state_t *initial,
                          const cff_state_t *final, cff_arc_t *arc);

/* An arc of natural motion. */
/*@ requires \valid_read(initial) && \valid(arc); assigns *arc; */
cff_status_t cff_drift(double mean_motion_rad_s, double start_s, double duration_s, const cff_state_t *initial,
                       cff_arc_t *arc);

/* The same beside the chief of a table. */
/*@ requires cff_is_table(chief) && \valid_read(initial) && \valid_read(final) && \valid(arc); assigns *arc; */
cff_status_t cff_transfer_beside(const cff_table_t *chief, double start_s, double duration_s, const cff_state_t *initial,
                                 const cff_state_t *final, cff_arc_t *arc);
/*@ requires cff_is_table(chief) && \valid_read(initial) && \valid(arc); assigns *arc; */
cff_status_t cff_drift_beside(const cff_table_t *chief, double start_s, double duration_s, const cff_state_t *initial,
                              cff_arc_t *arc);

/* Half the integral of |thrust|^2 along a path without push, per unit mass. */
/*@ requires cff_is_path(path) && \valid(energy_m2_s3); assigns *energy_m2_s3; */
cff_status_t cff_energy(const cff_path_t *path, double *energy_m2_s3);

/* State and thrust acceleration along a path; before its start and after its end, those there. */
/*@ requires cff_is_path(path) && \valid(state); assigns *state; */
cff_status_t cff_state_at(const cff_path_t *path, double time_s, cff_state_t *state);
/*@ requires cff_is_path(path) && \valid(thrust_m_s2 + (0 .. 2)); assigns thrust_m_s2[0 .. 2]; */
cff_status_t cff_thrust_at(const cff_path_t *path, double time_s, double thrust_m_s2[3]);

/* Check a path: numbers, times in order, joints (to 1e-9), mean motion or table. */
/*@ requires cff_is_path(path); assigns \nothing; */
cff_status_t cff_check_path(const cff_path_t *path);

/* Check a table once, when it is uploaded: numbers, and angles in order.  Other functions check its clock only. */
/*@ requires cff_is_table(chief); assigns \nothing; */
cff_status_t cff_check_table(const cff_table_t *chief);

/*
 * The table in a block of doubles, as `closeform.flight.table_bytes` writes it: the first five numbers of cff_table_t,
 * then its arrays.  It is checked, and points into the block.
 */
/*@ requires \valid_read(block + (0 .. count - 1)) && \valid(table); assigns *table; */
cff_status_t cff_uploaded_table(const double block[], uint32_t count, cff_table_t *table);

/*
 * The table of a circular orbit, or of deep space with mean motion 0; it points into `room`.  A window is at most an
 * eighth of an orbit; in deep space take about the duration of the motion.  Angles of the table are times in windows,
 * and times are at most 50 000 windows from 0.
 */
/*@ requires \valid(room) && \valid(table); assigns *room, *table; */
cff_status_t cff_circular_table(double mean_motion_rad_s, double window_s, cff_circle_t *room, cff_table_t *table);

/*
 * All conflicts of one spacecraft in the zone around another, over the common time of the paths.
 *
 * Begin once; then continue with some evaluations at a time until the status is CFF_OK.  Each call appends
 * to `conflicts` from `*count` on.  Between conflicts, and up to `certified_until_s`, the norm of the
 * relative position is above 1, up to rounding, however short a conflict is.  The paths, tables and zone
 * given to cff_conflicts_begin must outlive the search.
 */
/*@ requires \valid(search) && cff_is_path(one) && cff_is_path(other) && \valid_read(zone); assigns *search; */
cff_status_t cff_conflicts_begin(cff_conflict_search_t *search, const cff_path_t *one, const cff_path_t *other,
                                 const cff_zone_t *zone);
/*@ requires \valid(search) && \valid(count) && (capacity > 0 ==> \valid(conflicts + (0 .. capacity - 1)));
    assigns *search, *count, conflicts[0 .. capacity - 1]; */
cff_status_t cff_conflicts_continue(cff_conflict_search_t *search, uint32_t evaluations, cff_conflict_t conflicts[],
                                    uint32_t capacity, uint32_t *count);

/*
 * The conflicts of one spacecraft with several others: begin a search for each, then continue all of them.
 * The search that is certified for the shortest time goes first, so that `*certified_until_s`, up to which
 * all are certified, grows.
 */
/*@ requires \valid(searches + (0 .. search_count - 1)) && \valid(count) && \valid(certified_until_s) &&
      (capacity > 0 ==> \valid(conflicts + (0 .. capacity - 1)));
    assigns searches[0 .. search_count - 1], conflicts[0 .. capacity - 1], *count, *certified_until_s; */
cff_status_t cff_fleet_continue(cff_conflict_search_t searches[], uint32_t search_count, uint32_t evaluations,
                                cff_fleet_conflict_t conflicts[], uint32_t capacity, uint32_t *count,
                                double *certified_until_s);

/* The minimum norm from start to end, both within the common time of the paths. */
/*@ requires cff_is_path(one) && cff_is_path(other) && \valid_read(zone) && \valid(approach); assigns *approach; */
cff_status_t cff_closest_approach(const cff_path_t *one, const cff_path_t *other, const cff_zone_t *zone,
                                  double start_s, double end_s, uint32_t evaluations, cff_approach_t *approach);

/*
 * The path of minimum energy around obstacles, between the states and times of `direct`, which is an arc of
 * cff_transfer or cff_drift, or the like beside the chief of the obstacles.  Zones are ellipsoids.  CFF_OK:
 * the path is certified clear by the search for conflicts.  It is a local minimum, the best of several sides.
 */
/*@ requires \valid_read(direct) && (\forall integer k; 0 <= k < obstacle_count ==> cff_is_path(obstacles + k)) &&
      \valid_read(zones + (0 .. obstacle_count - 1)) && \valid(work) && \valid(found);
    assigns *work, *found; */
cff_status_t cff_avoid(const cff_arc_t *direct, const cff_path_t obstacles[], const cff_zone_t zones[],
                       uint32_t obstacle_count, uint32_t evaluations, cff_avoid_work_t *work, cff_avoidance_t *found);

/*
 * The minimum delta-v between two states in a given time, by at most six impulses, with or without a table.
 *
 * Begin once: the plan is a valid transfer from then on.  Each call of cff_impulses_continue makes it cheaper and
 * raises the lower bound, until the status is CFF_OK: the two agree to 1e-6.  CFF_SINGULAR: by cff_impulses_begin
 * that no impulses make this transfer, by the other that rounding prevents that precision; the plan and its bound
 * hold.  The table must outlive the plan.
 */
/*@ requires \valid(plan) && (chief == \null || cff_is_table(chief)) && \valid_read(initial) && \valid_read(final);
    assigns *plan; */
cff_status_t cff_impulses_begin(cff_impulses_t *plan, const cff_table_t *chief, double mean_motion_rad_s, double start_s,
                                double duration_s, const cff_state_t *initial, const cff_state_t *final);
/*@ requires \valid(plan); assigns *plan; */
cff_status_t cff_impulses_continue(cff_impulses_t *plan, uint32_t evaluations);

/*
 * Passive safety: the verdict on a loss of thrust at any instant of a path from `from_s` on, with natural
 * motion after it until `until_s`.  An impulse may be fired in part.  The other path must last until then.
 * Both paths are beside a table, which cff_circular_table makes for a circular orbit or deep space.  CFF_SAFE is
 * certified.  After CFF_MORE call again with `from_s` = `certified_until_s`, and with more evaluations if that is
 * `from_s` still.
 */
/*@ requires cff_is_path(path) && cff_is_path(other) && \valid_read(zone) && \valid(found); assigns *found; */
cff_status_t cff_loss_of_thrust(const cff_path_t *path, const cff_path_t *other, const cff_zone_t *zone, double from_s,
                                double until_s, uint32_t evaluations, cff_drift_t *found);

/*
 * The turns of the modified search (Scharf et al. 2004), which locks every pair, and of the basic search
 * (Hadaegh et al. 2003).  CFF_TOO_NARROW: the tips would exceed the sun limit.  CFF_FULL: more than `capacity`.
 */
cff_status_t cff_modified_search(const cff_schedule_t *schedule, cff_leg_t legs[], uint32_t capacity, uint32_t *count);
cff_status_t cff_basic_search(const cff_schedule_t *schedule, cff_leg_t legs[], uint32_t capacity, uint32_t *count);

/* The attitude of the craft of one group at a time within the search. */
cff_status_t cff_attitude_at(const cff_leg_t legs[], uint32_t leg_count, double time_s, cff_group_t group,
                             cff_attitude_t *attitude);

/* The first lock of a pair from `from_s` on; B minus A at time 0 of the search, inertial. */
cff_status_t cff_first_lock(const cff_leg_t legs[], uint32_t leg_count, const cff_sensor_t *sensor,
                            const cff_state_t *relative, double from_s, uint32_t evaluations, cff_lock_t *lock);

/*
 * Gathering of lost craft (Hadaegh et al. 2003, section IV): every craft runs the same state machine on the locks
 * that are broadcast.  A craft is lost, or in the formation set, whose craft move with one velocity, or in a
 * knowledge set, whose craft know each other's motion and coast.  The first pair to lock begins the formation set.
 */
#define CFF_LOST (-1)
#define CFF_FORMATION 0

/* The craft of the first pair that burn. */
typedef enum { CFF_LOWER_BURNS = 0, CFF_HIGHER_BURNS = 1, CFF_BOTH_BURN = 2 } cff_first_burn_t;

typedef enum {
    CFF_NOTHING_NEW = 0, /* both were in one set already */
    CFF_COAST = 1,       /* the craft of this knowledge set exchange their states, and coast */
    CFF_BURN = 2         /* each craft with a delta-v burns it now, to match the formation set's velocity */
} cff_action_t;

typedef struct {
    uint32_t count;
    cff_first_burn_t first_burn;
    int32_t labels[CFF_MOST_CRAFT]; /* CFF_LOST, CFF_FORMATION, or the number of a knowledge set, from 1 */
    int32_t unused;                 /* number of the next knowledge set */
    uint32_t formed;                /* craft in the formation set: gathered when it is `count` */
    double velocity_m_s[3];         /* of the formation set */
    double time_s;                  /* of the last lock */
} cff_gathering_t;

typedef struct {
    cff_action_t action;
    int32_t label;                          /* of the set that both are in now */
    uint32_t table_case;                    /* of figure 8 of the paper, 1 to 9: sets of the lower and the higher index before */
    bool joins[CFF_MOST_CRAFT];             /* whether a craft is new to this set */
    double delta_v_m_s[CFF_MOST_CRAFT][3];  /* inertial; 0 for a craft that does not burn */
} cff_join_t;

/* All craft lost. */
cff_status_t cff_gathering_begin(cff_gathering_t *gathering, uint32_t count, cff_first_burn_t first_burn);

/*
 * A lock between craft i and j, no earlier than the last.  `velocities_m_s` has a row for each craft, inertial, just
 * before: only those of craft that burn or agree on a velocity are read, and they are known by then.
 */
cff_status_t cff_gathering_lock(cff_gathering_t *gathering, double time_s, uint32_t i, uint32_t j,
                                const double velocities_m_s[][3], cff_join_t *join);

#ifdef __cplusplus
}
#endif

#endif
