// Marks: drawings over the views: names, thrust, burns, ghosts, distances. Names never overlap.

import { Labels } from "./labels.js";
import { clock, length, measured } from "./units.js";
import { dot } from "./view.js";
import { VIEWS } from "./viewpoints.js";

const NAMED = 40; // maximum number of spacecraft with names
const ARROW = 46; // pixels of the greatest thrust
const MARKED = 600; // maximum number of impulses marked on paths
const MOMENT = 1 / 160; // of the scene: how long an impulse or a closest approach is shown

export class Marks {
  constructor(scene, moment) {
    Object.assign(this, { scene, moment });
    this.window = MOMENT * (scene.end - scene.start);
    this.labels = new Map(VIEWS.map((key) => [key, new Labels()]));
    this.burns = moment.burns.filter(({ kind }) => kind === "impulse").flatMap(({ craft, rows, table }) =>
      Array.from({ length: rows.rows }, (_, k) => ({ craft, time: table[5 * k], place: moment.ways[craft].position(table[5 * k]) })),
    ).slice(0, MARKED);
    this.slips = scene.failures.filter(({ track, failed_at: at }) => track >= 0 && at !== null).map((failure) => {
      const way = moment.tracks[failure.track];
      return { failure, from: way.position(failure.failed_at), near: way.position(failure.time ?? failure.failed_at) };
    });
  }

  /** Draws the visible `layers` over a view; `taken` are boxes without names. */
  draw(pen, view, palette, chosen, layers, taken) {
    const { moment, scene } = this;
    const spots = moment.positions.map((place, k) => (moment.ways[k] ? view.project(...place) : null))
      .map((spot) => (spot && spot[2] <= view.cut ? spot : null));
    const labels = this.labels.get(view.key);
    const seen = spots.map((spot) => spot && view.holds(spot[0], spot[1], -2));
    labels.begin([...taken, ...spots.flatMap((spot, k) => (seen[k] ? [[spot[0] - 6, spot[1] - 6, spot[0] + 6, spot[1] + 6]] : []))]);
    if (layers.grid) this.stems(pen, view, palette, spots);
    if (layers.thrust) this.impulses(pen, view, palette, chosen);
    if (layers.before) this.ghosts(pen, view, palette, "before");
    if (layers.drifts) this.failed(pen, view, palette, chosen, labels);
    if (layers.thrust) this.thrust(pen, view, palette, spots);
    this.approaches(pen, view, palette, chosen, spots, labels);
    if (view.follows && layers.cones) this.attitude(pen, view, palette, chosen, labels);
    const spot = spots[chosen];
    if (spot) pen.ring(spot[0], spot[1], Math.max(view.follows ? 14 : 9, 4 + this.hull(chosen) / view.scale), palette.ink, { width: 1.4, dash: [3, 2] });
    if (layers.names) this.names(pen, view, palette, chosen, spots, seen, labels);
  }

  /** Radius of the hard body of a spacecraft [m]. */
  hull(craft) {
    const { body } = this.scene.craft[craft];
    return body >= 0 ? this.scene.zones[body].radius : 0;
  }

  names(pen, view, palette, chosen, spots, seen, labels) {
    const { craft } = this.scene;
    const urgent = new Set(this.moment.conflicts.filter(({ when }) => when === "after").flatMap(({ first, second }) => [first, second]));
    const rank = (k) => (k === chosen ? 0 : urgent.has(k) ? 1 : 2);
    const shown = craft.map((_, k) => k).filter((k) => seen[k] || (k === chosen && spots[k])).sort((a, b) => rank(a) - rank(b) || a - b).slice(0, NAMED);
    for (const k of shown) {
      pen.font(12, k === chosen ? 700 : 500);
      word(pen, view, palette, labels, k, spots[k], pen.fitted(craft[k].name, 130), palette.name(craft[k].colour), true);
    }
  }

  /** Plumb lines from craft to the floor. */
  stems(pen, view, palette, spots) {
    if (!view.floor || this.scene.craft.length > NAMED) return;
    const { up, level } = view.floor;
    this.moment.positions.forEach((place, k) => {
      if (!spots[k]) return;
      const foot = [...place];
      foot[up] = level;
      const [x, y] = view.project(...foot);
      pen.line([spots[k], [x, y]], palette.quiet, { alpha: 0.55 });
      pen.ring(x, y, 1.5, palette.quiet, { fill: palette.quiet, width: 0.5 });
    });
  }

  impulses(pen, view, palette, chosen) {
    const crowded = this.scene.craft.length > NAMED / 2;
    for (const { craft, time, place } of this.burns) {
      if (crowded && craft !== chosen) continue;
      const [x, y] = view.project(...place);
      if (view.holds(x, y)) pen.diamond(x, y, 3.6, palette.thrust, time <= this.moment.time);
    }
  }

  thrust(pen, view, palette, spots) {
    for (const { craft, vector, share, size } of this.moment.pushes(this.window)) {
      if (!spots[craft]) continue;
      const [u, v] = [dot(vector, view.right) / size, -dot(vector, view.up) / size];
      const long = (view.follows ? 1.4 : 1) * ARROW * (0.25 + 0.75 * share);
      const [x, y] = spots[craft];
      if (Math.hypot(u, v) * long > 3) pen.arrow([x + 5 * u, y + 5 * v], [x + (5 + long) * u, y + (5 + long) * v], palette.thrust, { width: 2.4, head: 8 });
    }
  }

  ghosts(pen, view, palette, kind) {
    for (const track of this.moment.ghosts(kind)) {
      const [x, y] = view.project(...track.position(this.moment.time));
      pen.ring(x, y, 4.5, palette[kind === "before" ? "before" : "drift"], { width: 1.6, fill: palette.panel });
    }
  }

  /** Marks loss of thrust and the closest approach of the drift, with text for the followed spacecraft. */
  failed(pen, view, palette, chosen, labels) {
    this.ghosts(pen, view, palette, "drift");
    for (const { failure, from, near } of this.slips) {
      const [[x, y], [u, v]] = [view.project(...from), view.project(...near)];
      if (view.holds(x, y)) pen.cross(x, y, 4, palette.drift);
      if (view.holds(u, v)) pen.diamond(u, v, 4.5, failure.safe ? palette.drift : palette.conflict);
      if (failure.fails !== chosen || view.key !== "oblique" || !view.holds(u, v)) continue;
      pen.font(11.5);
      const text = `closest after loss of thrust at ${clock(failure.failed_at)}: ${measured(failure.ratio, "x zone")}`;
      word(pen, view, palette, labels, `drift ${failure.meets}`, [u, v], text, palette.ink);
    }
  }

  /** Draws the directions of shade and sensor of the followed spacecraft, and the sun angle. */
  attitude(pen, view, palette, chosen, labels) {
    const axes = this.moment.axes(chosen);
    const { sun } = this.scene;
    if (!axes || !sun) return;
    const long = Math.min(view.place.width, view.place.height) / 4;
    const { left, top } = view.place;
    const group = this.moment.search.groups[chosen] === "A" ? palette.cone_a : palette.cone_b;
    pen.font(11.5);
    for (const [axis, name, colour] of [[axes[0], "body x", palette.ink], [axes[2], "boresight", group]]) {
      const [x, y] = view.project(...this.moment.positions[chosen]);
      const [u, v] = [x + long * dot(axis, view.right), y - long * dot(axis, view.up)];
      pen.arrow([x, y], [u, v], colour, { width: 1.8 });
      word(pen, view, palette, labels, name, [u, v], name, colour);
    }
    const angle = (Math.acos(Math.max(-1, Math.min(1, dot(axes[0], sun)))) * 180) / Math.PI;
    pen.text(`shade ${angle.toFixed(1)}° off the sun`, left + 10, top + 34, palette.quiet, { halo: palette.panel });
  }

  /** Draws the distance of a pair at its closest approach: the followed pair first, then the closest. */
  approaches(pen, view, palette, chosen, spots, labels) {
    const near = this.scene.approaches.filter(({ time }) => Math.abs(time - this.moment.time) <= this.window)
      .sort((a, b) => Number(b.first === chosen || b.second === chosen) - Number(a.first === chosen || a.second === chosen)).slice(0, 1);
    for (const { first, second, distance, ratio } of near) {
      if (!spots[first] || !spots[second]) continue;
      const colour = ratio < 1 - 1e-6 ? palette.conflict : palette.ink;
      pen.line([spots[first], spots[second]], colour, { width: 1.2, dash: [2, 2] });
      const [x, y] = [0, 1].map((i) => (spots[first][i] + spots[second][i]) / 2);
      if (!view.holds(x, y)) continue;
      pen.font(11.5);
      const text = `${length(distance)}, ${measured(ratio, "x zone")}`;
      word(pen, view, palette, labels, `approach ${first} ${second}`, [x, y], text, colour);
    }
  }
}

/** Writes text in the pen's font beside a point, where there is room; `led`: by a line if it stands far off. */
function word(pen, view, palette, labels, key, [x, y], text, colour, led = false) {
  const { left, top, width, height } = view.place;
  const wide = pen.width(text);
  const spot = labels.place(key, x, y, wide, 14, [left + 3, top + 3, left + width - 3, top + height - 3]);
  if (!spot) return;
  if (led && spot.led) pen.line([[x, y], [Math.max(spot.left, Math.min(x, spot.left + wide)), spot.top + 7]], palette.quiet, { alpha: 0.8 });
  pen.text(text, spot.left, spot.top + 7.5, colour, { halo: palette.panel });
}
