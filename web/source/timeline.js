// Time line: stages, phases, conflicts and burns over time; a click on a mark goes to its moment.

import { element } from "./element.js";
import { Pen } from "./pen.js";
import { TimeScale } from "./timescale.js";
import { clock, timeStep } from "./units.js";

const SIDE = 14; // pixels left and right of it
const [BANDS, MARKS, TICKS] = [17, 19, 15]; // heights of its rows
const HEIGHT = 2 + BANDS + MARKS + TICKS;
const FEW = 40; // marks up to which locks go through the bands above
const NEAR = 7; // pixels by which a click may miss a mark
const RANK = ["conflict", "failure", "lock", "approach", "burn", "end", "phase", "stage"];

export class Timeline extends TimeScale {
  /** In a box of the page; the cursor is an element, so that all else is drawn once. */
  constructor(box, scene, player) {
    super(scene, SIDE, SIDE);
    Object.assign(this, { player, box });
    const canvas = element("canvas", { "aria-hidden": "true" });
    this.pen = new Pen(canvas);
    this.now = element("i", { class: "cursor" });
    box.append(canvas, this.now);
    this.marks = scene.events.filter(({ kind }) => kind !== "stage" && kind !== "phase");
    this.crowded = this.marks.length > FEW;
  }

  /** The event whose mark is at a place of the canvas, the most important of those near; else null. */
  at(x, y) {
    if (y > 2 + BANDS + MARKS || y < BANDS - 2) return null;
    const near = this.marks.filter((event) => this.x(event.time) - NEAR <= x && x <= Math.max(this.x(event.time), this.x(event.until)) + NEAR);
    const off = (event) => Math.max(0, Math.abs(x - this.x(event.time)) - 3);
    return near.sort((a, b) => off(a) - off(b) || RANK.indexOf(a.kind) - RANK.indexOf(b.kind))[0] ?? null;
  }

  /** What is said of a place: of the mark there, or of the stage or phase. */
  story(x, y) {
    const mark = this.at(x, y);
    if (mark) return `${clock(mark.time, 1)}  ${mark.text}`;
    const time = this.time(x);
    return (y < BANDS && this.bands.find(({ start, end }) => start <= time && time <= end)?.text) || "";
  }

  /** Draws what does not move. */
  lay(width, palette) {
    Object.assign(this, { width, palette });
    const { pen, scene } = this;
    pen.begin(width, HEIGHT);
    pen.font(11, 550);
    const bands = scene.stages.map((stage) => ({ ...stage, text: stage.title }));
    for (const { phases, stage } of scene.searches) {
      const at = bands.findIndex(({ number }) => number === stage);
      bands.splice(at, 1, ...phases.filter(({ start }) => start < scene.end).map((phase) => ({ ...phase, text: `${phase.name} ${phase.round}`, failure: null })));
    }
    this.bands = bands;
    bands.forEach(({ start, end, text, failure }, k) => {
      const [left, right] = [this.x(start), this.x(Math.min(end, scene.end))];
      pen.page.fillStyle = k % 2 ? palette.grid : palette.line;
      pen.page.fillRect(left, 1, Math.max(1, right - left), BANDS - 2);
      pen.text(pen.fitted(text, right - left - 10), left + 5, 1 + BANDS / 2, failure ? palette.conflict : palette.ink);
    });
    for (const event of [...this.marks].sort((a, b) => RANK.indexOf(b.kind) - RANK.indexOf(a.kind))) this.mark(pen, event, palette);
    this.ticks(pen, palette);
  }

  mark(pen, { kind, time, until, level }, palette) {
    const [x, y] = [this.x(time), 1 + BANDS + MARKS / 2];
    const bad = level === "bad" ? palette.conflict : null;
    if (kind === "conflict") {
      pen.page.fillStyle = bad ?? palette.before;
      pen.page.fillRect(x, y - 4, Math.max(3, this.x(until) - x), 8);
    } else if (kind === "lock") {
      pen.line([[x, this.crowded ? y - 8 : 1], [x, y + 8]], palette.lock, { width: this.crowded ? 1 : 1.6 });
      pen.ring(x, y, 3.5, palette.lock, { fill: palette.lock });
    } else if (kind === "burn") {
      if (until > time) pen.line([[x, y], [Math.max(x + 1, this.x(until)), y]], palette.thrust, { width: 2.5 });
      else pen.diamond(x, y, 4, palette.thrust);
    } else if (kind === "approach") pen.ring(x, y, 3, bad ?? palette.ink, { width: 1.4, fill: palette.panel });
    else if (kind === "failure") pen.cross(x, y, 3.5, bad ?? palette.drift);
    else pen.line([[x, y - 7], [x, y + 7]], palette.quiet, { width: 2 });
  }

  ticks(pen, palette) {
    const { start, end } = this.scene;
    pen.font(10.5);
    const step = timeStep((76 * (end - start)) / this.width || 1);
    for (let k = Math.ceil(start / step); k * step <= end; k++) {
      const x = this.x(k * step);
      pen.line([[x, HEIGHT - TICKS - 1], [x, HEIGHT - TICKS + 3]], palette.quiet);
      const align = x < 30 ? "left" : x > this.width - 30 ? "right" : "center";
      pen.text(clock(k * step, step < 1 ? 2 : 0), align === "left" ? SIDE - 8 : align === "right" ? this.width - SIDE + 8 : x, HEIGHT - 6, palette.quiet, { align });
    }
  }

  draw() {
    this.now.style.transform = `translateX(${this.x(this.player.time)}px)`;
  }

  /** Dragging goes through time, a click on a mark to its event. */
  listen(chosen, hint) {
    const { box, player } = this;
    let pressed = null;
    box.addEventListener("pointerdown", (event) => {
      box.setPointerCapture(event.pointerId);
      pressed = { x: event.offsetX, mark: this.at(event.offsetX, event.offsetY) };
      player.play(false);
      if (!pressed.mark) player.go(this.time(event.offsetX));
    });
    box.addEventListener("pointermove", (event) => {
      if (pressed && Math.abs(event.offsetX - pressed.x) > 4) pressed.mark = null;
      if (pressed && !pressed.mark) player.go(this.time(event.offsetX));
      box.style.cursor = this.at(event.offsetX, event.offsetY) ? "pointer" : "ew-resize";
      hint(this.story(event.offsetX, event.offsetY), event.clientX, event.clientY);
    });
    box.addEventListener("pointerup", () => {
      if (pressed?.mark) chosen(pressed.mark);
      pressed = null;
    });
    box.addEventListener("pointercancel", () => (pressed = null));
    box.addEventListener("pointerleave", () => hint(""));
  }
}
