// World: everything in space, drawn once for each view by one renderer.

import { Color, Scene, WebGLRenderer } from "three";
import { Bodies } from "./bodies.js";
import { Guards } from "./guards.js";
import { Paths } from "./paths.js";
import { Ribbons } from "./ribbons.js";

const SHARPEST = 2; // device pixels to a pixel that are worth their time
const GRID = 400; // lines of a grid
const DEEP = 20; // radii of the scene that are seen before and behind

export class World {
  /** Throws where there is no WebGL. */
  constructor(canvas, scene, moment) {
    this.renderer = new WebGLRenderer({ canvas, antialias: false, powerPreference: "high-performance" });
    this.renderer.autoClear = false;
    this.renderer.setScissorTest(true);
    Object.assign(this, { scene, moment, stage: new Scene(), layers: {}, parts: [] });
    this.stage.matrixWorldAutoUpdate = false;
    const sides = scene.low.map((low, i) => scene.high[i] - low);
    this.radius = Math.hypot(...sides, ...scene.low.map(Math.abs), ...scene.high) || 1;
    const span = Math.max(...sides, 1e-3);
    this.paths = new Paths(scene, moment, span / 2);
    this.guards = new Guards(scene, moment);
    this.bodies = new Bodies(scene, moment, span);
    this.grid = new Ribbons(GRID, { order: 0.2 });
    this.put("grid", [this.grid]);
    this.put("zones", [...this.guards.zones.values()]);
    this.put("regions", this.guards.regions.map(({ solids }) => solids));
    this.put("errors", [this.guards.spreads, ...this.guards.outlines]);
    this.put("cones", [this.bodies.cones, this.bodies.shades]);
    this.put("locks", [this.bodies.locks]);
    this.put("craft", [this.bodies.dots, ...this.bodies.hulls.values()]);
    for (const [name, ribbons] of this.paths.groups) this.put(name, [ribbons]);
  }

  put(name, parts) {
    this.layers[name] = parts.flatMap((part) => part.meshes);
    this.parts.push(...parts);
    if (parts.length) this.stage.add(...this.layers[name]);
  }

  show(name, whether) {
    for (const mesh of this.layers[name] ?? []) mesh.visible = whether;
  }

  paint(palette) {
    this.palette = palette;
    this.ground = new Color(palette.panel);
    this.paths.paint(palette);
  }

  resize(width, height) {
    this.renderer.setPixelRatio(Math.min(SHARPEST, window.devicePixelRatio || 1));
    this.renderer.setSize(width, height, false);
    this.height = height;
  }

  update(chosen, ghosts) {
    this.paths.update(chosen);
    this.guards.update(this.palette, chosen, ghosts);
    this.bodies.update(this.palette, chosen);
  }

  /** Draws a view; in one that follows a craft, whatever stands before that craft is cut away. */
  draw(view, chosen, lines) {
    const { renderer, bodies, grid } = this;
    grid.clear();
    for (const [from, to, strong] of lines.slice(0, GRID)) {
      grid.line([...from, 0, ...to, 0], this.palette.grid, { width: strong ? 1.8 : 1 });
    }
    grid.finish();
    const { left, top, width, height } = view.place;
    for (const { uniforms } of this.parts) {
      if (uniforms.units) uniforms.units.value = view.scale;
      uniforms.halfSize?.value.set(width / 2, height / 2);
    }
    bodies.cones.uniforms.stretch.value = view.follows ? bodies.near / bodies.reach : 1;
    bodies.dots.uniforms.least.value = view.follows ? 7 : 4.5;
    const frame = [left, this.height - top - height, width, height];
    renderer.setViewport(...frame);
    renderer.setScissor(...frame);
    renderer.setClearColor(this.ground, 1);
    renderer.clear();
    const far = DEEP * this.radius;
    view.cut = view.follows ? Math.max(12 * view.scale, bodies.size(chosen)) : far;
    renderer.render(this.stage, view.aim(far));
  }
}
