// Strip chart: one kind of curve over time, and its value at one time.

import { element, say } from "./element.js";
import { Pen } from "./pen.js";
import { rowAt } from "./scene.js";
import { TimeScale } from "./timescale.js";
import { clock, measured, niceStep, plain, timeStep } from "./units.js";

export const TITLES = { ratio: "Clearance ratio", range: "Range", speed: "Speed", thrust: "Thrust", "delta-v": "Delta-v so far" };
const [LEFT, RIGHT, ABOVE, BELOW] = [44, 10, 22, 15];
const LIMIT = { width: 1.4, dash: [5, 3] }; // look of a limit
const VALUE = 100; // pixels of the longest value with its unit, and of the gaps around it
const NEARBY = 6; // zones up to which ratios are of interest
const DECADES = 30; // greatest over least from which on the scale is logarithmic

export class Strip extends TimeScale {
  /** In a box of the page; what moves over the curves are elements, so that the curves are drawn once. */
  constructor(box, kind, scene, player) {
    super(scene, LEFT, RIGHT);
    Object.assign(this, { box, kind, player });
    const canvas = element("canvas", { "aria-hidden": "true" });
    this.pen = new Pen(canvas);
    this.now = element("i", { class: "cursor" });
    this.then = element("i", { class: "cursor then", hidden: true });
    this.dot = element("i", { class: "spot" });
    this.name = element("span", { class: "name" });
    this.value = element("span");
    this.said = element("span", { class: "said" }, this.name, this.value);
    box.append(canvas, this.now, this.then, this.dot, this.said);
    this.curves = scene.series.filter((one) => one.kind === kind)
      .map((one) => ({ ...one, t: scene.numbers(one.times), v: scene.numbers(one.values), limit: one.limit && scene.numbers(one.limit) }));
    this.unit = this.curves[0]?.unit ?? "";
    let [least, most] = [Infinity, -Infinity];
    for (const { v, limit } of this.curves) {
      for (const one of [...v, ...(limit ?? [])]) if (Number.isFinite(one)) [least, most] = [Math.min(least, one), Math.max(most, one)];
    }
    if (kind === "ratio") [least, most] = [Math.min(least, 1), Math.max(1.5, most)];
    this.log = least > 0 && most / least > DECADES && (kind === "range" || kind === "ratio");
    this.low = this.log ? least : kind === "ratio" ? 0 : Math.min(0, least);
    this.high = most > this.low ? most : this.low + 1;
    if (kind === "ratio" && !this.log) this.high = Math.min(this.high, Math.max(NEARBY, 2 * least));
    if (this.log) [this.low, this.high] = [this.low / 1.2, this.high * 1.2];
    else this.high += 0.06 * (this.high - this.low);
  }

  y(value) {
    const share = this.log
      ? Math.log(value / this.low) / Math.log(this.high / this.low)
      : (value - this.low) / (this.high - this.low);
    return this.height - BELOW - share * (this.height - ABOVE - BELOW);
  }

  /** Draws what does not move: scales and curves, those of the craft that is followed stronger. */
  lay(width, height, palette, chosen) {
    Object.assign(this, { width, height, palette, chosen });
    const { pen } = this;
    pen.begin(width, height);
    pen.font(12, 650);
    const full = `${TITLES[this.kind]}${this.units ? ` [${this.units}]` : ""}`;
    const room = width - VALUE; // where it is short, the value alone has the unit
    const words = TITLES[this.kind];
    const title = [full, words, words.split(" ")[0]].find((one) => pen.width(one) <= room) ?? pen.fitted(words, room);
    pen.text(title, 8, 11, palette.ink);
    this.said.style.maxWidth = `${width - pen.width(title) - 22}px`;
    for (const line of [this.now, this.then]) Object.assign(line.style, { top: `${ABOVE - 4}px`, bottom: `${BELOW}px` });
    this.scales(pen, palette);
    const frame = { left: LEFT, top: ABOVE - 2, width: width - LEFT - RIGHT, height: height - ABOVE - BELOW + 4 };
    pen.within(frame, () => {
      const ranked = [...this.curves].sort((a, b) => this.own(a) - this.own(b));
      for (const curve of ranked) {
        const own = this.own(curve) || this.curves.length <= 3;
        pen.line(this.points(curve, curve.v), this.colour(curve), { width: own ? 1.7 : 1, alpha: own ? 1 : 0.35 });
        if (curve.limit) pen.line(this.points(curve, curve.limit), palette.conflict, LIMIT);
      }
    });
  }

  own({ craft }) {
    return craft.includes(this.chosen);
  }

  /** A pair's curve has the colour of the one that is not followed. */
  colour({ craft }) {
    const other = craft.find((k) => k !== this.chosen) ?? craft[0];
    return this.palette.craft(this.scene.craft[craft.length > 1 ? other : craft[0]].colour);
  }

  /** Points of the values of a curve, a few for each pixel. */
  points({ t }, v) {
    const points = [];
    const every = Math.max(1, Math.floor(t.length / (4 * this.width)));
    for (let k = 0; k < t.length; k += every) if (Number.isFinite(v[k])) points.push([this.x(t[k]), this.y(v[k])]);
    return points;
  }

  scales(pen, palette) {
    const { width, height, scene } = this;
    pen.font(10.5);
    const step = niceStep((26 * (this.high - this.low)) / Math.max(30, height - ABOVE - BELOW));
    const values = [];
    if (this.log) for (let at = Math.ceil(Math.log10(this.low)); 10 ** at <= this.high; at++) values.push(10 ** at);
    else for (let k = Math.ceil(this.low / step); k * step <= this.high; k++) values.push(k * step);
    const few = Math.ceil(values.length / Math.max(1, Math.floor((height - ABOVE - BELOW) / 18)));
    values.forEach((value, k) => {
      const y = this.y(value);
      pen.line([[LEFT, y], [width - RIGHT, y]], palette.line);
      if (k % few === 0) pen.text(this.number(value), LEFT - 5, y, palette.quiet, { align: "right" });
    });
    if (this.kind === "ratio") {
      const y = this.y(1);
      pen.line([[LEFT, y], [width - RIGHT, y]], palette.conflict, LIMIT);
    }
    const long = timeStep((70 * (scene.end - scene.start)) / (width - LEFT) || 1);
    for (let k = Math.ceil(scene.start / long); k * long <= scene.end; k++) {
      const x = this.x(k * long);
      pen.line([[x, ABOVE], [x, height - BELOW]], palette.line);
      if (x > LEFT + 14 && x < width - 24) pen.text(clock(k * long), x, height - 6, palette.quiet, { align: "center" });
    }
  }

  number(value) {
    const kilo = this.unit === "m" && this.high >= 1e4;
    const milli = this.unit.startsWith("m/s") && this.high < 0.1 ? (this.high < 1e-4 ? 1e6 : 1e3) : 1;
    return plain(kilo ? value / 1e3 : value * milli);
  }

  get units() {
    if (this.unit === "m") return this.high >= 1e4 ? "km" : "m";
    if (this.kind === "ratio") return "× zone";
    return `${this.high >= 0.1 ? "" : this.high < 1e-4 ? "µ" : "m"}${this.unit}`;
  }

  /** The curve that matters most at a time, and its value: the least ratio or range, the greatest thrust or delta-v. */
  telling(time) {
    const lowest = this.kind === "ratio" || this.kind === "range";
    const mine = this.curves.filter((curve) => this.own(curve));
    let best = null;
    for (const curve of mine.length ? mine : this.curves) {
      const value = valueAt(curve, time);
      if (Number.isFinite(value) && (!best || (lowest ? value < best.value : value > best.value))) best = { curve, value };
    }
    return best;
  }

  draw(hovered) {
    const { player, now, then, dot, said } = this;
    const time = hovered ?? player.time;
    now.style.transform = `translateX(${this.x(player.time)}px)`;
    then.hidden = hovered === null;
    then.style.transform = `translateX(${this.x(time)}px)`;
    const best = this.telling(time);
    dot.hidden = !best;
    said.hidden = !best;
    if (!best) return;
    const y = Math.min(this.height - BELOW, Math.max(ABOVE, this.y(best.value))); // at the edge where it is beyond
    dot.style.transform = `translate(${this.x(time)}px, ${y}px)`;
    dot.style.background = this.colour(best.curve);
    const value = this.kind === "ratio" ? best.value.toFixed(best.value < 100 ? 3 : 0) : measured(best.value, this.unit);
    say(this.name, best.curve.name);
    say(this.value, value);
  }

  listen(hovered) {
    const { box, player } = this;
    box.addEventListener("pointermove", (event) => hovered(this.time(event.offsetX)));
    box.addEventListener("pointerleave", () => hovered(null));
    box.addEventListener("click", (event) => {
      player.play(false);
      player.go(this.time(event.offsetX));
    });
  }
}

function valueAt({ t, v }, time) {
  if (!t.length || time < t[0] || time > t[t.length - 1]) return NaN;
  const k = Math.min(rowAt(t, time), t.length - 1);
  const next = Math.min(k + 1, t.length - 1);
  const share = t[next] > t[k] ? (time - t[k]) / (t[next] - t[k]) : 0;
  return share ? v[k] * (1 - share) + v[next] * share : v[k];
}
