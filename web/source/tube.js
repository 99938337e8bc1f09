// Tubes: uncertainty ellipsoids swept along a track, and the current one.

import { BufferAttribute, BufferGeometry } from "three";
import { between } from "./scene.js";
import { cross, dot } from "./view.js";

const AROUND = 20; // corners of a ring
const MOST_RINGS = 240;

export class Tube {
  constructor(entry, stage, way, scene) {
    Object.assign(this, { craft: entry.craft, start: stage.start, end: stage.end, way });
    this.rows = scene.numbers(entry.rows);
  }

  /** Sigmas squared times the covariance at a time: xx, xy, xz, yy, yz, zz. */
  spread(time) {
    return between(this.rows, time - this.start, 6);
  }

  /** Whether the craft goes farther than its errors reach: else the ellipsoid of now says all. */
  get moves() {
    const middle = (this.start + this.end) / 2;
    const [first, half, last] = [this.start, middle, this.end].map((time) => this.way.position(time));
    const [xx, , , yy, , zz] = this.spread(middle);
    return Math.hypot(...difference(half, first)) + Math.hypot(...difference(last, half)) > Math.sqrt(Math.max(xx, yy, zz));
  }

  /** The outline of all ellipsoids, as faces. */
  outline() {
    const rings = Math.min(MOST_RINGS, Math.max(2, 3 * (this.rows.length / 7)));
    const [points, normals, corners] = [[], [], []];
    let aside = null;
    const step = (this.end - this.start) / (rings - 1);
    for (let k = 0; k < rings; k++) {
      const time = this.start + k * step;
      const middle = this.way.position(time);
      const way = difference(this.way.position(time + 0.01 * step), this.way.position(time - 0.01 * step));
      aside = across(way, aside);
      const ahead = unit(way);
      const up = cross(ahead ?? cross(aside, [1, 0, 0]), aside);
      const spread = this.spread(time);
      for (let j = 0; j < AROUND; j++) {
        const angle = (2 * Math.PI * j) / AROUND;
        const out = aside.map((one, i) => Math.cos(angle) * one + Math.sin(angle) * up[i]);
        const pulled = times(spread, out); // the ellipsoid's point farthest that way
        const size = Math.sqrt(Math.max(dot(out, pulled), 1e-18));
        const along = ahead ? dot(pulled, ahead) : 0;
        const flat = pulled.map((one, i) => (one - (ahead ? along * ahead[i] : 0)) / size);
        points.push(...middle.map((one, i) => one + flat[i]));
        normals.push(...out);
        if (k) {
          const [a, b] = [AROUND * (k - 1) + j, AROUND * (k - 1) + ((j + 1) % AROUND)];
          corners.push(a, b, a + AROUND, b, b + AROUND, a + AROUND);
        }
      }
    }
    const faces = new BufferGeometry().setAttribute("position", new BufferAttribute(new Float32Array(points), 3));
    faces.setAttribute("normal", new BufferAttribute(new Float32Array(normals), 3));
    faces.setIndex(corners);
    return [faces, null];
  }
}

/** A root (rows of 3 x 3) of a covariance, which makes its ellipsoid of the unit ball. */
export function root([xx, xy, xz, yy, yz, zz]) {
  const a = Math.sqrt(Math.max(xx, 0));
  const [d, g] = a > 0 ? [xy / a, xz / a] : [0, 0];
  const e = Math.sqrt(Math.max(yy - d * d, 0));
  const h = e > 0 ? (yz - g * d) / e : 0;
  return [a, 0, 0, d, e, 0, g, h, Math.sqrt(Math.max(zz - g * g - h * h, 0))];
}

function times([xx, xy, xz, yy, yz, zz], [x, y, z]) {
  return [xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z];
}

function difference(a, b) {
  return a.map((one, i) => one - b[i]);
}

function unit(vector) {
  const size = Math.hypot(...vector);
  return size > 1e-9 ? vector.map((one) => one / size) : null;
}

/** A unit vector across a way, as near the one before as can be. */
function across(way, before) {
  const ahead = unit(way);
  const guess = before ?? (ahead && Math.abs(ahead[0]) > 0.8 ? [0, 0, 1] : [1, 0, 0]);
  if (!ahead) return guess;
  const off = dot(guess, ahead);
  return unit(guess.map((one, i) => one - off * ahead[i])) ?? across(way, ahead[0] > 0.5 ? [0, 1, 0] : [1, 0, 0]);
}
