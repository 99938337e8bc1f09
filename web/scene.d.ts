/**
 * The scene: all that the page of a result folder, `viewer.html`, shows. Python writes it (`closeform.viewer`),
 * the page in `web/` reads it. This file is the contract between the two.
 *
 * The page is one file:
 *
 *     <!doctype html>
 *     <html lang="en"> ... <style> viewer.css </style>
 *     <body>
 *       <main id="still"> title, verdict, three views as inline SVG, why there is no motion </main>
 *       <div id="viewer"></div>                                 the page builds itself in here
 *       <script type="application/json" id="scene"> a Scene, as JSON </script>
 *       <script type="text/plain" id="numbers"> one block of bytes, little-endian, in base64 </script>
 *       <script> viewer.js: one classic script (esbuild, format iife, minified) </script>
 *
 * `viewer.js` and `viewer.css` are package data in `src/closeform/viewer/`. The script hides `#still` when it has
 * WebGL; when it has none it leaves it, and puts the reason into `#still-reason`.
 *
 * Positions are in the chief's rotating frame [m]: x radial, y along-track, z cross-track; in deep space an
 * inertial frame. Times are in seconds; the scene begins at `start`. All text is plain text of the user's: put it
 * on the page as text, never as HTML.
 */

/** Rows of numbers in `#numbers`: `rows` times `columns` of them from byte `at` on (a multiple of 8). */
export interface Block {
  at: number;
  rows: number;
  columns: number;
  /** "f4": Float32, "f8": Float64. */
  type: "f4" | "f8";
}

/** Index of a craft in `Scene.craft`, of a zone in `Scene.zones`; -1 stands for none. */
export type Index = number;
export type Vector = [number, number, number];

export interface Scene {
  /** Of this contract; the page refuses another one by a line on the page. */
  format: 1;
  /** Title of the scenario. */
  title: string;
  /** Summary line, such as "8 craft in an orbit of 94.62 min, 4257.8 s". */
  opening: string;
  /** The last line of the run; `ok` says whether it is good news. */
  verdict: string;
  ok: boolean;
  /** Important notes. */
  warnings: string[];
  /** [s]; all tracks lie in between, but drifts after a failure may go on beyond `end`. */
  start: number;
  end: number;
  /** UTC at time 0 as ISO 8601, such as "2026-03-01T12:00:00.000Z"; null where the scenario has no epoch. */
  epoch: string | null;
  /** [rad/s] and [s]; 0 and null in deep space. */
  mean_motion: number;
  period: number | null;
  /** Names of the axes x, y, z: "radial", "along-track", "cross-track"; "x", "y", "z" in deep space. */
  axes: [string, string, string];
  /** Unit vector to the sun where a search knows it, else null. It is fixed (deep space only). */
  sun: Vector | null;
  /** How far a track joined by cubic Hermite pieces is from the closed form at most [m]. */
  error: number;
  /** A box that holds all executed tracks and their zones [m]: where cameras begin. */
  low: Vector;
  high: Vector;

  craft: Craft[];
  zones: Zone[];
  /** The `zones` of each pair. */
  pairs: Pairs;
  regions: Region[];
  stages: Stage[];
  /** Flown first; each kind in order of stage, then craft. */
  tracks: Track[];
  searches: SearchScene[];
  /** Continuous thrust. */
  thrusts: Thrust[];
  /** Impulses and pulses, in order of time. */
  burns: Burn[];
  /** Locks in order of time. */
  locks: Lock[];
  conflicts: Conflict[];
  approaches: Approach[];
  failures: Failure[];
  tubes: Tube[];
  /** Marks on the time line and rows of the event list, in order of time. */
  events: Event[];
  series: Series[];
  /** Pictures beside the page, by relative name, for links in `#still` and in a menu. May be empty. */
  pictures: { name: string; title: string }[];
  /** Relative names of other pages: "report.html". */
  report: string | null;
}

export interface Craft {
  name: string;
  /** "#rrggbb" as in the other pictures, which have a white background; lighten it for the dark theme. */
  colour: string;
  /**
   * What is drawn around it: the centres of those that it keeps it with are to stay outside. -1: none.
   * Where craft keep unlike zones with others `pairs` says which.
   */
  zone: Index;
  /** Its hard body, drawn solid; -1 where none is given (then draw a mark of constant size). */
  body: Index;
  /** Whether it moves under its own thrust in some stage; others only coast. */
  moves: boolean;
  /** A size [m] for the model of the craft: of its body or a part of its zone. */
  size: number;
}

/**
 * A convex body about the origin, in the frame of positions.
 *
 * A ball, a box or a cylinder is the unit shape (a cylinder along its third axis) times `axes`; "faces" is the
 * convex hull of its `corners`.
 */
export interface Zone {
  shape: "ball" | "box" | "cylinder" | "faces";
  /** Rows of a matrix one after another [m]: point = axes * point of the unit shape. */
  axes: number[];
  /** For "faces" [m], else []. One without end is cut off. */
  corners: Vector[];
  /** Of a ball that holds it, as drawn [m]. */
  radius: number;
}

/**
 * The zone of craft i < j is about r_i - r_j: `zones[table[kind[i]][kind[j]]]`, -1 for none; none either where
 * neither `moves`. `null` where craft are so many and so unlike that no table is written.
 */
export type Pairs = { kind: number[]; table: number[][]; moves: boolean[] } | null;

/**
 * A region that a craft must not leave: an approach corridor, as far as the path reaches, or the tolerance of a
 * waypoint, which has equal `start` and `end`.
 */
export interface Region {
  name: string;
  craft: Index;
  stage: number;
  /** [s] between which it holds, during the stage. */
  start: number;
  end: number;
  zone: Index;
  /** Where the middle of the zone is [m]. */
  middle: Vector;
}

export interface Stage {
  /** From 1. */
  number: number;
  /** Of the scenario: "coast", "transfer", "avoid", "reconfigure", "scatter", "regather", "gather", "lock". */
  kind: string;
  /** Such as "stage 2, array: reconfigure". */
  title: string;
  start: number;
  end: number;
  /** Null if all is well; else why the mission cannot go on after it. */
  failure: string | null;
  /** False for a plan that failed: its paths are shown, but are not executed. */
  executed: boolean;
}

/**
 * One craft's way during one stage. Rows (x, y, z, vx, vy, vz) of `states` at the rows of `times`, to be joined
 * by cubic Hermite pieces; two rows at one time are the velocities before and after an impulse.
 *
 * executed: as executed. before: without avoidance. planned: the plan that pulses follow. drift: after a failure.
 * The executed tracks of one craft follow each other without gaps, with a row of its own at each joint. Kinds other
 * than "executed" stand only for craft of which they differ from what is executed.
 */
export interface Track {
  craft: Index;
  stage: number;
  kind: "executed" | "before" | "planned" | "drift";
  start: number;
  end: number;
  /** f8, one column [s]. */
  times: Block;
  /** f4, six columns [m, m/s]. */
  states: Block;
}

/** One search stage. */
export interface SearchScene {
  stage: number;
  start: number;
  end: number;
  sensor: {
    /** Of the cone about the boresight [rad], below pi. */
    half_angle: number;
    /** From the centre of mass along the boresight [m]. */
    offset: number;
    /** [m]; null: unlimited. */
    range: number | null;
  };
  /** The most that body x, the shade's normal, may be off the sun [rad]. */
  sun_limit: number;
  /** "A" or "B" for each craft, "" for one that takes no part. */
  groups: ("A" | "B" | "")[];
  /**
   * Attitudes of both groups: rows (t, x, y, z, w), quaternions that take body axes to the frame; f8. Joined by
   * slerp, which is exact. Body x points out of the shade at the sun, body z is the boresight. The last holds on.
   */
  attitudes: { A: Block; B: Block };
  phases: { name: string; round: number; start: number; end: number }[];
  /**
   * Sets over time: f8 rows (t, label of each craft), valid from t on: -1 lost, 0 the formation set, k >= 1
   * knowledge set k. Null where only first locks were looked for.
   */
  sets: Block | null;
}

/** Thrust acceleration of one craft as executed in one stage: f4 rows (t - start, ux, uy, uz) [s, m/s^2], linear between. */
export interface Thrust {
  craft: Index;
  stage: number;
  start: number;
  /** Greatest magnitude [m/s^2]. */
  peak: number;
  rows: Block;
}

/** Impulses (`duration` 0) and pulses of thrusters of one craft in one stage: f8 rows (t, duration, dvx, dvy, dvz). */
export interface Burn {
  craft: Index;
  stage: number;
  kind: "impulse" | "pulse";
  /** Greatest magnitude [m/s]. */
  peak: number;
  rows: Block;
}

export interface Lock {
  first: Index;
  second: Index;
  time: number;
  stage: number;
}

/** A pair within its zone. `when`: before or after avoidance; those "after" remain. */
export interface Conflict {
  first: Index;
  second: Index;
  stage: number;
  when: "before" | "after";
  start: number;
  end: number;
  /** When it is deepest, and its least norm then (below 1). */
  time: number;
  ratio: number;
}

/** The closest approach of a pair as executed, the closest first; of very many only the closest. */
export interface Approach {
  first: Index;
  second: Index;
  stage: number;
  time: number;
  ratio: number;
  /** [m] */
  distance: number;
}

/** The worst of all failures of one craft near another; its drift is `tracks[track]`, -1 where it is not drawn. */
export interface Failure {
  /** The failing spacecraft and the other one, which continues its path or drifts after the stage. */
  fails: Index;
  meets: Index;
  stage: number;
  /** Times of loss of thrust and of closest approach; null in a drift too slow to determine it. */
  failed_at: number | null;
  time: number | null;
  /** Minimum clearance ratio; below 1 is inside the zone. */
  ratio: number;
  /** Between the centres then [m]; null where `time` is. */
  distance: number | null;
  safe: boolean;
  /** Drifts of the failing spacecraft, and of the other one after its stage. */
  track: Index;
  met_track: Index;
}

/** Position uncertainty: an ellipsoid of `sigmas` about a track. */
export interface Tube {
  craft: Index;
  stage: number;
  sigmas: number;
  /**
   * f4 rows (t - stage's start, then the upper triangle xx, xy, xz, yy, yz, zz of the covariance [m^2] times
   * sigmas^2): semi-axes are the square roots of its eigenvalues. Interpolate linearly.
   */
  rows: Block;
}

export interface Event {
  time: number;
  /** Of an interval, such as a phase or a conflict; else equal to `time`. */
  until: number;
  kind: "stage" | "phase" | "lock" | "burn" | "conflict" | "approach" | "failure" | "end";
  /** Spacecraft of the event, with the one to follow first. May be empty. */
  craft: Index[];
  stage: number;
  /** One line, such as "TPF1 - TPF2: lock, the formation set begins". */
  text: string;
  level: "plain" | "good" | "bad";
}

/** A curve of the strip chart. Curves of one `times` share its block. NaN: a gap. */
export interface Series {
  kind: "ratio" | "range" | "speed" | "thrust" | "delta-v";
  /** What it is, such as "F6 - F8". */
  name: string;
  /** "× zone", "m", "m/s²", "m/s". */
  unit: string;
  /** One craft, or the two of a pair. */
  craft: Index[];
  /** f8, one column [s]. */
  times: Block;
  /** f4, one column. Linear between; "delta-v" of impulses jumps by two rows at one time. */
  values: Block;
  /** The same for the limit of a speed; else null. */
  limit: Block | null;
}
