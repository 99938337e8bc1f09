// The scene at one time: positions, attitudes, sets and conflicts.

import { between, rowAt } from "./scene.js";
import { Track, Way } from "./track.js";
import { dot } from "./view.js";

const FEW = 12; // craft up to which each has its cone, and every pair its lock
const SEEN = 1e-6; // of the distance: a pair counts as in lock at the very time of its lock

export class Moment {
  constructor(scene) {
    this.scene = scene;
    this.tracks = scene.tracks.map((entry) => new Track(entry, scene));
    const executed = scene.craft.map((_, k) => this.tracks.filter((track) => track.kind === "executed" && track.craft === k));
    this.ways = executed.map((tracks) => (tracks.length ? new Way(tracks) : null));
    this.positions = scene.craft.map(() => [0, 0, 0]);
    this.searches = scene.searches.map((search) => ({
      ...search,
      A: scene.numbers(search.attitudes.A),
      B: scene.numbers(search.attitudes.B),
      rows: search.sets && scene.numbers(search.sets),
    }));
    this.thrusts = scene.thrusts.map((one) => ({ ...one, table: scene.numbers(one.rows) }));
    this.burns = scene.burns.map((one) => ({ ...one, table: scene.numbers(one.rows) }));
    this.few = scene.craft.length <= FEW;
    this.go(scene.start);
  }

  go(time) {
    this.time = time;
    this.ways.forEach((way, k) => way?.position(time, this.positions[k]));
    const { stages } = this.scene;
    this.stage = stages[rowAt(stages.map((stage) => stage.start), time)] ?? null;
    this.search = this.searches.find((search) => search.start <= time && time <= search.end) ?? null;
    this.attitudes = this.search && { A: attitude(this.search.A, time), B: attitude(this.search.B, time) };
    this.conflicts = this.scene.conflicts.filter((one) => one.start <= time && time <= one.end);
  }

  /** The phase of a search that is under way. */
  get phase() {
    return this.search?.phases.find((phase) => phase.start <= this.time && this.time <= phase.end) ?? null;
  }

  /** The label of a spacecraft's set (-1 lost), null without a search. */
  label(craft) {
    const rows = this.search?.rows;
    if (!rows || !this.search.groups[craft]) return null;
    const stride = this.scene.craft.length + 1;
    return rows[stride * rowAt(rows, this.time, stride) + 1 + craft];
  }

  /** Body axes x, y, z of a craft that takes part in a search, else null. */
  axes(craft) {
    return this.attitudes?.[this.search.groups[craft]] ?? null;
  }

  /** Pairs that see each other now, and those that did before, of few craft all, else those that joined sets. */
  get locks() {
    if (!this.search) return { now: [], past: [] };
    const met = this.scene.locks.filter((lock) => lock.time <= this.time && lock.stage === this.search.stage);
    const known = new Map(met.map((lock) => [`${lock.first} ${lock.second}`, [lock.first, lock.second]]));
    const { groups } = this.search;
    const pairs = this.few
      ? groups.flatMap((a, i) => groups.flatMap((b, j) => (i < j && a && b && a !== b ? [[i, j]] : [])))
      : [...known.values()];
    const now = pairs.filter(([i, j]) => this.sees(i, j) && this.sees(j, i));
    const held = new Set(now.map(([i, j]) => `${i} ${j}`));
    const past = [...known].filter(([key]) => !held.has(key)).map(([, pair]) => pair);
    return { now, past };
  }

  sees(one, other) {
    const { half_angle: half, offset, range } = this.search.sensor;
    const [mine, its] = [this.axes(one)[2], this.axes(other)[2]];
    const way = [0, 1, 2].map((i) => this.positions[other][i] + offset * its[i] - this.positions[one][i] - offset * mine[i]);
    const far = Math.hypot(...way);
    return dot(way, mine) >= far * (Math.cos(half) - SEEN) && far <= (range ?? Infinity) * (1 + SEEN);
  }

  /** Thrust of each craft that burns now: its share of the greatest, and acceleration [m/s^2] or delta-v [m/s] with its size. */
  pushes(window) {
    const found = [];
    for (const { craft, start, peak, table } of this.thrusts) {
      if (this.time < start || this.time > start + table[table.length - 4] || !peak) continue;
      const vector = between(table, this.time - start, 3);
      const size = Math.hypot(...vector);
      if (size > 1e-3 * peak) found.push({ craft, vector, share: size / peak, size });
    }
    for (const { craft, peak, table } of this.burns) {
      const last = rowAt(table, this.time + window, 5);
      for (let k = last; k >= 0 && k > last - 3; k--) {
        const [at, lasts] = [table[5 * k], table[5 * k + 1]];
        if (at - window > this.time || at + lasts + window < this.time) continue;
        const vector = [...table.subarray(5 * k + 2, 5 * k + 5)];
        const size = Math.hypot(...vector);
        found.push({ craft, vector, share: size / (peak || 1), size });
        break;
      }
    }
    return found;
  }

  /** Positions on alternative paths: before avoidance, and drifts after failures. */
  ghosts(kind) {
    return this.tracks.filter((track) => track.kind === kind && track.start <= this.time && this.time <= track.end);
  }
}

/** Body axes (three unit vectors) of quaternions (t, x, y, z, w) joined by slerp. */
function attitude(rows, time) {
  const last = rows.length / 5 - 1;
  const k = rowAt(rows, time, 5);
  const p = [...rows.subarray(5 * k + 1, 5 * k + 5)];
  if (k === last || time <= rows[5 * k]) return turned(p);
  let q = [...rows.subarray(5 * k + 6, 5 * k + 10)];
  let cosine = p.reduce((sum, one, i) => sum + one * q[i], 0);
  if (cosine < 0) [q, cosine] = [q.map((one) => -one), -cosine];
  const share = (time - rows[5 * k]) / (rows[5 * k + 5] - rows[5 * k]);
  const angle = Math.acos(Math.min(1, cosine));
  const [a, b] = angle < 1e-9 ? [1 - share, share] : [Math.sin((1 - share) * angle), Math.sin(share * angle)].map((one) => one / Math.sin(angle));
  return turned(p.map((one, i) => a * one + b * q[i]));
}

function turned([x, y, z, w]) {
  return [
    [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
    [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
    [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)],
  ];
}
