// App: the scene, the time, the choices of the user, and their display.

import { Address, readAddress } from "./address.js";
import { EventList } from "./eventlist.js";
import { say } from "./element.js";
import { Frame } from "./frame.js";
import { listen } from "./gestures.js";
import { Legend, layerKeys } from "./legend.js";
import { Marks } from "./marks.js";
import { Moment } from "./moment.js";
import { Page } from "./page.js";
import { Palette } from "./palette.js";
import { Pen } from "./pen.js";
import { Player } from "./player.js";
import { reaches } from "./reach.js";
import { Strip } from "./strip.js";
import { Timeline } from "./timeline.js";
import { clock, utc } from "./units.js";
import { views } from "./viewpoints.js";
import { World } from "./world.js";

const PICKED = 18; // pixels from a craft within which a click follows it
const KEYS = {
  " ": (app) => app.player.play(), n: (app) => app.toEvent(1), p: (app) => app.toEvent(-1),
  ArrowLeft: (app, shift) => app.byStep(shift ? -10 : -1), ArrowRight: (app, shift) => app.byStep(shift ? 10 : 1),
  ArrowUp: (app) => app.player.faster(1), ArrowDown: (app) => app.player.faster(-1),
  0: (app) => app.home(), v: (app) => app.nextAlone(), t: (app) => app.nextTheme(), "?": (app) => app.toggleHelp(), h: (app) => app.toggleHelp(),
  Home: (app) => app.player.go(app.scene.start), End: (app) => app.player.go(app.scene.end),
};

export class App {
  constructor(root, scene) {
    Object.assign(this, { root, scene, frames: 0, queued: false, hovered: null, one: null });
    this.moment = new Moment(scene);
    this.layers = Object.fromEntries(layerKeys(scene).map((key) => [key, true]));
    this.views = views(scene, this.moment);
    this.player = new Player(scene.start, scene.end, () => this.changed());
    this.page = new Page(root, scene, this.deeds());
    this.world = new World(this.page.space, scene, this.moment);
    this.pen = new Pen(this.page.over);
    [this.frame, this.marks] = [new Frame(scene), new Marks(scene, this.moment)];
    this.chosen = firstChosen(scene, this.moment);
    this.events = new EventList(scene, (event) => this.toMoment(event));
    this.legend = new Legend(scene, this.layers, () => this.changed());
    this.page.fill(this.events.element, this.legend.element);
    this.timeline = new Timeline(this.page.line, scene, this.player);
    this.strips = Object.entries(this.page.strips).map(([kind, box]) => new Strip(box, kind, scene, this.player));
    const { guards: { tubes }, bodies: { cone, least } } = this.world;
    this.reach = reaches(scene, this.moment, { tubes, cone, least });
    this.address = new Address(() => this.said());
    this.choose(readAddress(location.hash));
    this.connect();
    this.paint();
    this.resize();
    this.recall(readAddress(location.hash));
    this.draw();
  }

  deeds() {
    return {
      follow: (craft) => this.follow(craft), theme: () => this.nextTheme(), help: () => this.toggleHelp(),
      alone: (key) => this.alone(this.one === key ? null : key), home: (key) => this.home([this.views.find((view) => view.key === key)]),
      play: () => this.player.play(), event: (way) => this.toEvent(way), step: (steps) => this.byStep(steps),
      faster: (doublings) => this.player.faster(doublings),
    };
  }

  connect() {
    for (const view of this.views) {
      this.page.panes[view.key].setAttribute("aria-label", view.title);
      listen(this.page.panes[view.key], view, () => this.changed(), (x, y) => this.pick(view, view.place.left + x, view.place.top + y));
    }
    const hint = (...words) => this.page.tell(...words);
    this.timeline.listen((event) => this.toMoment(event), hint);
    for (const strip of this.strips) {
      strip.listen((time) => {
        this.hovered = time;
        this.changed();
      });
    }
    new ResizeObserver(() => this.resize()).observe(this.root);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.paint());
    window.addEventListener("hashchange", () => location.hash !== this.address.written && this.recall(readAddress(location.hash)));
    window.addEventListener("keydown", (event) => this.key(event));
  }

  key(event) {
    if (event.key === "Escape") this.toggleHelp(false);
    const inside = event.target instanceof HTMLElement ? event.target : document.body;
    if (event.ctrlKey || event.metaKey || event.altKey || inside.matches("select, input")) return;
    if (event.key === " " && inside.matches("button, summary, a")) return;
    const digit = Number(event.key);
    if (digit >= 1 && digit <= this.scene.craft.length) this.follow(digit - 1);
    else if (event.key in KEYS) KEYS[event.key](this, event.shiftKey);
    else return;
    event.preventDefault();
  }

  // user actions

  follow(craft) {
    this.chosen = craft;
    this.lay();
    this.changed();
  }

  pick(view, x, y) {
    const spots = this.moment.positions.map((place, k) => (this.moment.ways[k] ? view.project(...place) : [Infinity, Infinity]));
    const far = spots.map(([u, v]) => Math.hypot(u - x, v - y));
    const nearest = far.indexOf(Math.min(...far));
    if (far[nearest] <= PICKED) this.follow(nearest);
  }

  byStep(steps) {
    this.player.play(false);
    this.player.go(this.player.time + steps * this.player.step);
  }

  toEvent(way) {
    const times = this.scene.events.map(({ time }) => time);
    const now = this.player.time;
    const next = way > 0 ? times.find((time) => time > now + 1e-6) : times.findLast((time) => time < now - 1e-6);
    this.player.play(false);
    this.player.go(next ?? (way > 0 ? this.scene.end : this.scene.start));
  }

  toMoment(event) {
    if (event.craft.length) this.follow(event.craft[0]);
    this.player.play(false);
    this.player.go(event.kind === "conflict" ? this.deepest(event) : event.time);
  }

  deepest({ craft, time, until }) {
    const found = this.scene.conflicts.find((one) => one.first === Math.min(...craft) && one.second === Math.max(...craft) && one.start >= time - 1e-6 && one.end <= until + 1e-6);
    return found?.time ?? time;
  }

  home(which = this.views) {
    for (const view of which) view.fit(this.reach(view, this.chosen));
    this.changed();
  }

  alone(key) {
    this.one = key;
    this.resize();
  }

  nextAlone() {
    const keys = [null, ...this.views.map(({ key }) => key)];
    this.alone(keys[(keys.indexOf(this.one) + 1) % keys.length]);
  }

  nextTheme() {
    document.documentElement.dataset.theme = this.palette.dark ? "light" : "dark";
    this.paint();
  }

  toggleHelp(shown = this.page.keys.hidden) {
    const { keys, help } = this.page;
    keys.hidden = !shown;
    help.setAttribute("aria-expanded", String(shown));
  }

  // address

  said() {
    const pairs = [["t", String(Number(this.player.time.toFixed(2)))], ["craft", this.scene.craft[this.chosen].name]];
    const hidden = Object.keys(this.layers).filter((key) => !this.layers[key]);
    if (hidden.length) pairs.push(["hide", hidden.join(",")]);
    if (this.one) pairs.push(["one", this.one]);
    for (const view of this.views) if (view.touched) pairs.push([view.key, view.numbers.join(",")]);
    return pairs;
  }

  choose({ craft, hide, one }) {
    const named = this.scene.craft.findIndex(({ name }) => name === craft);
    if (named >= 0) this.chosen = named;
    for (const key of hide?.split(",") ?? []) if (key in this.layers) this.layers[key] = false;
    if (this.views.some(({ key }) => key === one)) this.one = one;
  }

  recall(said) {
    this.choose(said);
    this.legend.show();
    this.lay();
    for (const view of this.views) if (said[view.key] && view.shown) view.numbers = said[view.key];
    this.player.go(said.t ?? this.player.time);
  }

  // display

  paint() {
    this.palette = new Palette(document.documentElement);
    this.world.paint(this.palette);
    this.lay();
    this.changed();
  }

  /** Sizes of all canvases; views that nobody touched are fitted anew. */
  resize() {
    const { page, world } = this;
    this.root.dataset.one = this.one ?? "";
    const frame = page.views.getBoundingClientRect();
    world.resize(frame.width, frame.height);
    this.size = [frame.width, frame.height];
    for (const view of this.views) {
      const pane = page.panes[view.key].getBoundingClientRect();
      const before = Math.min(view.place.width, view.place.height);
      view.place = { left: pane.left - frame.left, top: pane.top - frame.top, width: pane.width, height: pane.height };
      if (!view.shown) continue;
      view.tools = page.tools[view.key].offsetWidth;
      if (view.touched) view.scale *= before / Math.min(pane.width, pane.height);
      else view.fit(this.reach(view, this.chosen));
    }
    this.lay();
    this.draw();
  }

  /** Lays the parts of time line and curves that do not move. */
  lay() {
    const line = this.page.line.clientWidth;
    if (!line || !this.palette) return;
    this.timeline.lay(line, this.palette);
    for (const strip of this.strips) {
      const { clientWidth: width, clientHeight: height } = strip.box;
      strip.shown = width > 0;
      if (strip.shown) strip.lay(width, height, this.palette, this.chosen);
    }
  }

  changed() {
    this.address?.write();
    if (this.queued) return;
    this.queued = true;
    requestAnimationFrame((now) => {
      this.queued = false;
      this.player.tick(now);
      this.draw();
      if (this.player.playing) this.changed();
    });
  }

  draw() {
    const { moment, player, world, pen, layers } = this;
    if (!this.size) return;
    moment.go(player.time);
    for (const name of Object.keys(world.layers)) world.show(name, layers[name] ?? true);
    world.update(this.chosen, layers.before);
    pen.begin(...this.size);
    for (const view of this.views.filter((one) => one.shown)) this.drawView(view);
    this.timeline.draw();
    for (const strip of this.strips) if (strip.shown) strip.draw(this.hovered);
    this.tell();
    this.frames += 1;
  }

  drawView(view) {
    const { pen, palette, layers, moment, chosen } = this;
    if (view.follows) view.target = [...moment.positions[chosen]];
    const grid = this.frame.grid(view, layers.grid);
    this.world.draw(view, chosen, grid.lines);
    pen.within(view.place, () => {
      const taken = this.frame.words(pen, view, palette, grid);
      this.marks.draw(pen, view, palette, chosen, layers, taken);
    });
  }

  /** Updates all text. */
  tell() {
    const { page, player, moment, scene } = this;
    say(page.clock, clock(player.time, 1));
    say(page.fine, scene.epoch ? utc(scene.epoch, player.time) : `${player.time.toFixed(1)} s`);
    const phase = moment.phase;
    say(page.phase, phase ? `${phase.name} ${phase.round}` : (moment.stage?.title ?? ""));
    page.playing(player.playing);
    const speed = player.speed;
    say(page.speed, `× ${speed >= 1 ? Math.round(speed * 10) / 10 : Number(speed.toPrecision(2))}`);
    page.line.setAttribute("aria-valuenow", player.time.toFixed(1));
    page.line.setAttribute("aria-valuetext", clock(player.time, 1));
    if (page.follow.value !== String(this.chosen)) page.follow.value = String(this.chosen);
    this.events.mark(player.time, player.playing || !this.root.matches(":has(.events :focus)"));
    this.legend.paint(this.palette, Boolean(moment.search?.rows));
  }
}

/** Initially followed spacecraft: the only one that manoeuvres, otherwise the first. */
function firstChosen(scene, moment) {
  const moving = scene.craft.flatMap(({ moves }, k) => (moves && moment.ways[k] ? [k] : []));
  return moving[0] ?? 0;
}
