// Frame: orientation, grid and scale of a view.

import { length, niceStep } from "./units.js";
import { dot } from "./view.js";

const SQUARE = 64; // least pixels between two lines of a grid
const MOST_LINES = 60;
const KILO = 1000; // metres from which on a step is told in kilometres
const ARM = 30; // pixels of an axis of the triad
const ACROSS = 0.08; // of its length: an axis that is seen from its end
const FLAT = 0.999; // cosine from which on a view looks along an axis

export class Frame {
  constructor(scene) {
    this.scene = scene;
    this.short = scene.axes.map((name) => name.replace("-track", ""));
    this.middle = scene.low.map((low, i) => (low + scene.high[i]) / 2);
  }

  /** The axis along which a view looks, -1 for none. */
  facing(view) {
    return view.back.findIndex((one) => Math.abs(one) > FLAT);
  }

  /** A grid for a view: its step [m], lines as pairs of points, and numbers to write [text, x, y, align]. */
  grid(view, shown) {
    const facing = this.facing(view);
    view.floor = null;
    const grid = { step: niceStep(Math.min(SQUARE, view.place.width / 6) * view.scale), lines: [], numbers: [] };
    if (shown && facing >= 0) this.numbered(view, grid, facing);
    else if (shown) this.floor(view, grid);
    return grid;
  }

  /** Lines behind everything, with numbers, where a view looks along an axis. */
  numbered(view, { step, lines, numbers }, facing) {
    const { left, top, width, height } = view.place;
    const unit = step >= KILO ? 1000 : 1;
    const axes = [0, 1, 2].filter((axis) => axis !== facing);
    for (const axis of axes) {
      const upright = Math.abs(view.right[axis]) > 0.7; // lines go up and down
      const sign = upright ? view.right[axis] : -view.up[axis];
      const size = upright ? width : height;
      const half = (view.scale * size) / 2;
      for (let at = Math.ceil((view.target[axis] - half) / step); at * step <= view.target[axis] + half; at++) {
        const line = [-1, 1].map((end) => {
          const point = view.target.map((one, i) => one + end * view.scale * (upright ? height * view.up[i] : width * view.right[i]));
          point[axis] = at * step;
          return point;
        });
        lines.push([...line, at === 0]);
        const pixel = size / 2 + (sign * (at * step - view.target[axis])) / view.scale;
        const number = `${at < 0 ? "−" : ""}${Number(Math.abs((at * step) / unit).toPrecision(6))}`;
        if (upright && pixel > 60 && pixel < size - 14) numbers.push([number, left + pixel, top + height - 9, "center"]);
        if (!upright && pixel > 34 && pixel < size - 24) numbers.push([number, left + 5, top + pixel, "left"]);
      }
    }
    numbers.push([unit === 1 ? "[m]" : "[km]", left + 5, top + height - 9, "left"]);
  }

  /** The plane across the view's upright direction, through the chief in an orbit, else below all craft. */
  floor(view, { step, lines }) {
    const { low, high, mean_motion } = this.scene;
    const up = view.pole.findIndex((one) => Math.abs(one) > 0.5);
    const level = mean_motion ? Math.min(high[up], Math.max(low[up], 0)) : view.pole[up] > 0 ? low[up] : high[up];
    view.floor = { up, level };
    const [a, b] = [0, 1, 2].filter((axis) => axis !== up);
    const range = (axis) => [Math.floor(low[axis] / step) - 1, Math.ceil(high[axis] / step) + 1];
    const [[a0, a1], [b0, b1]] = [range(a), range(b)];
    if (a1 - a0 > MOST_LINES || b1 - b0 > MOST_LINES) return;
    const point = (i, j) => {
      const place = [0, 0, 0];
      [place[a], place[b], place[up]] = [i * step, j * step, level];
      return place;
    };
    for (let i = a0; i <= a1; i++) lines.push([point(i, b0), point(i, b1), i === 0]);
    for (let j = b0; j <= b1; j++) lines.push([point(a0, j), point(a1, j), j === 0]);
  }

  /** Title, scale and directions; gives the boxes that they take. */
  words(pen, view, palette, { step, numbers }) {
    const { left, top, width, height } = view.place;
    const taken = [];
    pen.font(10.5);
    for (const [text, x, y, align] of numbers) pen.text(text, x, y, palette.quiet, { align, halo: palette.panel });
    pen.font(13, 650);
    const said = pen.fitted(view.title, width - view.tools - 16);
    pen.text(said, left + 10, top + 15, palette.ink, { halo: palette.panel });
    taken.push([left, top, left + 14 + pen.width(said), top + 26]);
    taken.push(this.scale(pen, view, palette, step));
    taken.push(this.triad(pen, view, palette));
    taken.push([left, top + height - 18, left + width, top + height]);
    return taken;
  }

  scale(pen, view, palette, step) {
    const { left, top, width, height } = view.place;
    const size = step / view.scale;
    const [right, low] = [left + width - 14, top + height - (this.facing(view) >= 0 ? 24 : 14)];
    pen.line([[right - size, low], [right, low]], palette.panel, { width: 6 });
    pen.line([[right - size, low - 4], [right - size, low + 1], [right, low + 1], [right, low - 4]], palette.ink, { width: 2 });
    pen.font(12);
    pen.text(length(step), right - size / 2, low - 9, palette.ink, { align: "center", halo: palette.panel });
    return [right - size - 4, low - 20, right + 6, low + 6];
  }

  triad(pen, view, palette) {
    const { left, top, width, height } = view.place;
    const small = width < 300 || height < 300;
    const arm = small ? 0.75 * ARM : ARM;
    const names = small ? this.short : this.scene.axes;
    const colours = this.scene.mean_motion ? [palette.radial, palette.along, palette.cross] : [palette.ink, palette.ink, palette.ink];
    pen.font(11.5, 600);
    const tips = names.map((name, i) => tip(name, view.right[i], -view.up[i], arm, pen.width(name)));
    if (this.scene.sun) tips.push(this.sunward(view, arm, pen.width("Sun") + 14));
    const box = [0, 1, 2, 3].map((k) => Math[k < 2 ? "min" : "max"](k < 2 ? -10 : 10, ...tips.map((one) => one.box[k])));
    const x = left + 8 - box[0] + (this.facing(view) >= 0 ? 26 : 0);
    const y = top + height - 8 - box[3] - (this.facing(view) >= 0 ? 14 : 0);
    names.forEach((name, i) => {
      const { u, v, at, align, size } = tips[i];
      if (size < ACROSS) {
        pen.ring(x, y, 5, colours[i], { fill: palette.panel });
        if (view.back[i] > 0) pen.ring(x, y, 1.2, colours[i], { fill: colours[i] });
        else pen.cross(x, y, 2.6, colours[i]);
      } else pen.arrow([x, y], [x + arm * u, y + arm * v], colours[i], { width: 1.8, head: 6 });
      pen.text(name, x + at[0], y + at[1], colours[i], { align, halo: palette.panel });
    });
    if (this.scene.sun) this.sun(pen, palette, x, y, tips[3]);
    return [box[0] + x, box[1] + y, box[2] + x, box[3] + y];
  }

  /** Where the sun is drawn beside the axes. */
  sunward(view, arm, wide) {
    const u = dot(this.scene.sun, view.right);
    const v = -dot(this.scene.sun, view.up);
    const at = [1.25 * arm * u, 1.25 * arm * v];
    return { at, size: Math.hypot(u, v), box: [at[0] - 6, at[1] - 8, at[0] + wide, at[1] + 8] };
  }

  sun(pen, palette, x, y, { at, size }) {
    if (size < ACROSS) return;
    pen.line([[x, y], [x + at[0], y + at[1]]], palette.sun, { width: 1.5, dash: [3, 3] });
    pen.ring(x + at[0], y + at[1], 5, palette.ink, { width: 1, fill: palette.sun });
    pen.text("Sun", x + at[0] + 9, y + at[1], palette.ink, { halo: palette.panel });
  }
}

/** An axis of the triad: where its name stands, and the box that it takes, from the triad's middle. */
function tip(name, u, v, arm, wide) {
  const size = Math.hypot(u, v);
  const hidden = size < ACROSS;
  const [a, b] = hidden ? [-0.8, 0.8] : [u / size, v / size];
  const at = hidden ? [-7, 12] : [arm * u + 5 * a, arm * v + 8 * b];
  const align = Math.abs(a) < 0.35 ? "center" : a > 0 ? "left" : "right";
  const from = at[0] - (align === "left" ? 0 : align === "right" ? wide : wide / 2);
  return { u, v, size, at, align, box: [from, at[1] - 8, from + wide, at[1] + 8] };
}
