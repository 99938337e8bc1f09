// Tracks: paths as cubic Hermite pieces between the nodes of the scene.

import { rowAt } from "./scene.js";

const MOST_PIECES = 32; // of one Hermite piece as chords

export class Track {
  constructor(entry, scene) {
    Object.assign(this, { craft: entry.craft, stage: entry.stage, kind: entry.kind, start: entry.start, end: entry.end });
    this.times = scene.numbers(entry.times);
    this.states = scene.numbers(entry.states);
  }

  /** Position at a time into `out` from `o` on; held at both ends. */
  position(time, out = [0, 0, 0], o = 0) {
    const { times, states } = this;
    const last = times.length - 1;
    const k = rowAt(times, time);
    const h = k < last ? times[k + 1] - times[k] : 0;
    const u = Math.min(1, Math.max(0, h > 0 ? (time - times[k]) / h : 0));
    const a = 6 * k;
    const b = h > 0 ? a + 6 : a;
    const [p, q] = [u * u * (3 - 2 * u), u * (1 - u)];
    for (let i = 0; i < 3; i++) {
      out[o + i] =
        (1 - p) * states[a + i] + p * states[b + i] + h * q * ((1 - u) * states[a + 3 + i] - u * states[b + 3 + i]);
    }
    return out;
  }

  /** Points (x, y, z, t), one after another, whose chords are within a tolerance [m] of the track, from a time on. */
  chords(tolerance, from = this.start, until = this.end) {
    const { times, states } = this;
    const points = [];
    const put = (time) => {
      const at = points.length;
      points.push(0, 0, 0, time);
      this.position(time, points, at);
    };
    put(Math.max(from, this.start));
    for (let k = 0; k + 1 < times.length; k++) {
      const h = times[k + 1] - times[k];
      if (h <= 0 || times[k + 1] <= from || times[k] >= until) continue;
      let bend = 0;
      for (let i = 6 * k; i < 6 * k + 3; i++) {
        const [way, v, w] = [6 * (states[i + 6] - states[i]), h * states[i + 3], h * states[i + 9]];
        bend += Math.max((way - 4 * v - 2 * w) ** 2, (way - 2 * v - 4 * w) ** 2);
      }
      const pieces = Math.min(MOST_PIECES, Math.max(1, Math.ceil(Math.sqrt(Math.sqrt(bend) / (8 * tolerance)))));
      for (let j = 1; j <= pieces; j++) {
        const time = times[k] + (j / pieces) * h;
        if (time > from && time < until) put(time);
      }
    }
    put(Math.min(until, this.end));
    return points;
  }
}

/** The whole path of one spacecraft, stage by stage. */
export class Way {
  constructor(tracks) {
    this.tracks = tracks;
    this.starts = tracks.map((track) => track.start);
  }

  position(time, out, o) {
    return this.tracks[rowAt(this.starts, time)].position(time, out, o);
  }
}
