// Reach: the extent of paths along a direction, used to fit views.

import { dot } from "./view.js";

const CLOSE = 1.15; // of a zone's size, seen to either side of the craft that is followed
const SHADES = 3.4; // half of the close view, in shades, of craft that look for each other
const CONED = 0.9; // of a sensor's cone, for which there is room beside the ways
const ALONE = 0.04; // of the scene, where a craft has neither

/** A function of (view, craft) that gives the function from a direction to [least, most] for `View.fit`. */
export function reaches(scene, moment, { tubes, cone, least }) {
  const ways = moment.tracks.filter(({ kind }) => kind !== "drift").map((track) => ({ track, points: track.chords(Infinity) }));
  const ellipsoids = tubes.flatMap((tube) => Array.from({ length: 13 }, (_, k) => {
    const time = tube.start + (k / 12) * (tube.end - tube.start);
    return { middle: tube.way.position(time), spread: tube.spread(time) };
  }));
  const resting = scene.craft.some(({ moves, zone }) => !moves && zone >= 0);
  const searched = moment.searches.length ? CONED * cone + moment.searches[0].sensor.offset : 0;
  const spans = (direction) => {
    let [low, high] = [Infinity, -Infinity];
    for (const { track, points } of ways) {
      const { zone, moves } = scene.craft[track.craft];
      const guarded = zone >= 0 && !(moves && resting) ? support(scene.zones[zone], direction) : 0;
      const room = Math.max(guarded, searched);
      for (let k = 0; k < points.length; k += 4) {
        const at = points[k] * direction[0] + points[k + 1] * direction[1] + points[k + 2] * direction[2];
        [low, high] = [Math.min(low, at - room), Math.max(high, at + room)];
      }
    }
    for (const { middle, spread } of ellipsoids) {
      const [at, [xx, xy, xz, yy, yz, zz], [x, y, z]] = [dot(middle, direction), spread, direction];
      const room = Math.sqrt(Math.max(0, xx * x * x + yy * y * y + zz * z * z + 2 * (xy * x * y + xz * x * z + yz * y * z)));
      [low, high] = [Math.min(low, at - room), Math.max(high, at + room)];
    }
    for (const { middle, zone } of scene.regions) {
      const at = dot(middle, direction);
      const back = direction.map((one) => -one);
      [low, high] = [Math.min(low, at - support(scene.zones[zone], back)), Math.max(high, at + support(scene.zones[zone], direction))];
    }
    return low <= high ? [low, high] : [-1, 1];
  };
  const size = Math.max(...scene.low.map((low, i) => scene.high[i] - low), 1);
  const near = (craft) => {
    const { zone } = scene.craft[craft];
    if (moment.searches.length) return SHADES * Math.max(moment.searches[0].sensor.offset, least);
    return zone >= 0 ? CLOSE * scene.zones[zone].radius : ALONE * size;
  };
  return (view, craft) => {
    if (!view.follows) return spans;
    const [half, place] = [near(craft), moment.positions[craft]];
    return (direction) => [dot(place, direction) - half, dot(place, direction) + half];
  };
}

/** How far a zone goes from its middle. */
function support({ shape, axes, corners, radius }, direction) {
  if (shape === "faces") return Math.min(radius, Math.max(...corners.map((corner) => dot(corner, direction))));
  const parts = [0, 1, 2].map((j) => axes[j] * direction[0] + axes[3 + j] * direction[1] + axes[6 + j] * direction[2]);
  if (shape === "ball") return Math.hypot(...parts);
  if (shape === "cylinder") return Math.hypot(parts[0], parts[1]) + Math.abs(parts[2]);
  return parts.reduce((sum, one) => sum + Math.abs(one), 0);
}
