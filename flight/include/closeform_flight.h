/*
 * closeform_flight: what an on-board computer needs of closeform, in C99.
 *
 * Hill / Clohessy-Wiltshire motion in closed form for any mean motion n >= 0 (n = 0 is deep space),
 * energy-optimal transfer, all conflicts of two paths without a time step, closest approach,
 * and the search, first lock and gathering of lost craft.
 *
 * Frame: x radial outward, y along the velocity, z along the orbit normal.  Units are in the names.
 *
 * No heap, no recursion, no function pointer, no global or static variable that is written, no
 * dependency but sqrt and fabs (sine and cosine are its own).  Every loop has a bound that is known at compile time or is
 * paid for by `evaluations`: one evaluation is one evaluation of a relative motion, the unit of execution time.
 * A function that runs out of evaluations says until when its answer is certified, and can be called again.
 *
 * Reentrant.  Pointers must not be null and are not kept, but for those of cff_conflicts_begin.
 */
#ifndef CLOSEFORM_FLIGHT_H
#define CLOSEFORM_FLIGHT_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define CFF_VERSION "0.1"
#define CFF_LARGEST 1.0e60          /* of a number: beyond, squares and cubes overflow */
#define CFF_LARGEST_ANGLE_RAD 6.0e5 /* of an arc: beyond, the phase of an orbit loses digits */
#define CFF_SHORTEST_S 1.0e-12      /* of an arc */
#define CFF_LEAST_EVALUATIONS 64U         /* of a call: fewer may come to nothing */
#define CFF_MOST_ARCS 256U          /* of a path */
#define CFF_MOST_CRAFT 64U          /* of a gathering */
#define CFF_MOST_LEGS 64U           /* of any search */

typedef enum {
    CFF_OK = 0,             /* done: the answer is complete and certified */
    CFF_MORE = 1,           /* evaluations are spent: certified up to the time that is told; call again */
    CFF_FULL = 2,           /* no room for another conflict: certified up to the time that is told; call again */
    CFF_NO_COMMON_TIME = 3, /* the two paths are never there together: nothing to be found */
    CFF_NO_WAY = 4,         /* no clear path was found with one contact: ask the ground, or another duration */
    CFF_END_INSIDE = 5,     /* the start or the end is inside the zone: no path between them is clear */
    CFF_BAD_INPUT = -1,     /* a number is not finite, too large, or an argument is out of its bounds */
    CFF_SINGULAR = -2,      /* no unique thrust leads there: the duration is too short for the numbers */
    CFF_TOO_NARROW = -3     /* the sensor is too narrow for the tips that the sun limit allows */
} cff_status_t;

typedef struct {
    double position_m[3];
    double velocity_m_s[3];
} cff_state_t;

/*
 * Motion under one law of thrust: a row of `Path.arcs` of the Python package, 30 doubles in its order.
 * Both thrusts are told by their derivatives at the start: the optimal one is a natural motion itself,
 * the push lies in the span of 1, t, cos nt, sin nt (its first derivative alone: constant thrust).
 */
typedef struct {
    double start_s;
    double end_s;
    double mean_motion_rad_s;
    double impulse_m_s[3]; /* just before the start; for information */
    cff_state_t state;     /* at the start, after the impulse */
    double thrust_m_s2[3];
    double thrust_rate_m_s3[3];
    double push_m_s2[3];
    double push_rate_m_s3[3];
    double push_bend_m_s4[3];
    double push_twist_m_s5[3];
} cff_arc_t;

/* One craft's motion: arcs in order of time, each of which begins where the one before it ends. */
typedef struct {
    const cff_arc_t *arcs;
    uint32_t count;
} cff_path_t;

typedef enum { CFF_ELLIPSOID = 0, CFF_BOX = 1 } cff_shape_t;

/* A keep-out zone around one of two craft: where the norm of `to_unit_per_m` times r is at most 1. */
typedef struct {
    cff_shape_t shape;          /* norm: Euclidean, or the greatest component */
    double to_unit_per_m[3][3]; /* rows: axes of the zone, each divided by its half-width */
} cff_zone_t;

/* One conflict inside a zone. */
typedef struct {
    double start_s;
    double end_s;
} cff_conflict_t;

typedef struct {
    double time_s;            /* of the least norm */
    double ratio;             /* the least norm: 1 on the zone's surface, 0 where the centres meet */
    double certified_until_s; /* it is the least from the start up to here */
    uint32_t evaluations_used;
} cff_approach_t;

/* A search for conflicts under way.  Its fields are told for telemetry; only the library writes them. */
typedef struct {
    cff_path_t one;
    cff_path_t other;
    const cff_zone_t *zone;
    double end_s;
    double certified_until_s; /* all conflicts up to here are known */
    double view_end_s;
    double entry_s; /* of the conflict that is on, if `inside` */
    uint32_t arc_of_one;
    uint32_t arc_of_other;
    uint32_t patience;
    uint32_t evaluations_used;
    bool inside;
    bool finished;
} cff_conflict_search_t;

/* A path shaped around one zone, as two arcs. */
typedef struct {
    cff_arc_t arcs[2];
    uint32_t count; /* 1: the direct path is clear as it is */
    double energy_m2_s3;
    double extra_energy_m2_s3; /* beyond the direct path's */
    double contact_s;          /* when it touches the zone */
    uint32_t evaluations_used;
} cff_avoidance_t;

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

/* What a schedule is made of; the sun is along -z of the inertial frame. */
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

/* Natural motion: the state `duration_s` later (or earlier). */
cff_status_t cff_coast(double mean_motion_rad_s, double duration_s, const cff_state_t *state, cff_state_t *later);

/* The arc of least energy, half the integral of |thrust|^2, between two states. */
cff_status_t cff_transfer(double mean_motion_rad_s, double start_s, double duration_s, const cff_state_t *initial,
                          const cff_state_t *final, cff_arc_t *arc);

/* An arc of natural motion. */
cff_status_t cff_drift(double mean_motion_rad_s, double start_s, double duration_s, const cff_state_t *initial,
                       cff_arc_t *arc);

/* Half the integral of |thrust|^2 along an arc without push, per unit mass. */
cff_status_t cff_energy(const cff_arc_t *arc, double *energy_m2_s3);

/* State and thrust acceleration along a path; before its start and after its end, those there. */
cff_status_t cff_state_at(const cff_path_t *path, double time_s, cff_state_t *state);
cff_status_t cff_thrust_at(const cff_path_t *path, double time_s, double thrust_m_s2[3]);

/* Whether a path can be used: numbers, times in order, joints (to 1e-9), mean motion. */
cff_status_t cff_check_path(const cff_path_t *path);

/*
 * All conflicts of one craft in the zone around another, over the time that both paths have.
 *
 * Begin once; then continue with some evaluations at a time until the status is CFF_OK.  Each call appends
 * to `conflicts` from `*count` on.  Between conflicts, and up to `certified_until_s`, the norm of the relative
 * position is above 1, however short a conflict is, up to rounding.  The paths and the zone that
 * cff_conflicts_begin was given must outlive the search.
 */
cff_status_t cff_conflicts_begin(cff_conflict_search_t *search, const cff_path_t *one, const cff_path_t *other,
                                 const cff_zone_t *zone);
cff_status_t cff_conflicts_continue(cff_conflict_search_t *search, uint32_t evaluations, cff_conflict_t conflicts[], uint32_t capacity,
                                    uint32_t *count);

/* The least norm from start to end, both within the time that both paths have. */
cff_status_t cff_closest_approach(const cff_path_t *one, const cff_path_t *other, const cff_zone_t *zone,
                                  double start_s, double end_s, uint32_t evaluations, cff_approach_t *approach);

/*
 * The path of least energy between the same states and times that touches an ellipsoid once and is clear
 * of it: what CFF_OK tells is certified by the same march.  `direct` is that of cff_transfer or
 * cff_drift; the obstacle must be there all the while.
 */
cff_status_t cff_avoid(const cff_arc_t *direct, const cff_path_t *obstacle, const cff_zone_t *zone, uint32_t evaluations,
                       cff_avoidance_t *found);

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

/* Which craft of the first pair burns. */
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
