// Bodies: spacecraft, with the sun shades and sensor cones during a search.

import { Dots } from "./dots.js";
import { Ribbons } from "./ribbons.js";
import { axesOf, shapeOf, SHAPES, Solids } from "./solids.js";

export class Bodies {
  constructor(scene, moment, span) {
    Object.assign(this, { scene, moment });
    const many = scene.craft.length;
    this.dots = new Dots(many);
    this.hulls = new Map(); // hard bodies by shape, where they are known
    for (const { body } of scene.craft) {
      if (body < 0 || this.hulls.has(body)) continue;
      const [faces] = shapeOf(scene.zones[body]);
      this.hulls.set(body, new Solids([faces, null], many, { matte: true, side: "front", order: 0 }));
    }
    this.shades = new Solids(SHAPES.disc(), many, { matte: true, side: "both", order: 0 });
    this.cones = new Solids(SHAPES.cone(), many, { side: "both", order: 1.2, edge: 1.6 });
    this.locks = new Ribbons(moment.few ? many * many : scene.locks.length, { order: 2.5 });
    this.cone = (moment.few ? 0.17 : 0.12) * span;
    this.least = 0.017 * span;
  }

  /** How far a cone is drawn [m]. */
  get reach() {
    const range = this.moment.search?.sensor.range ?? Infinity;
    return Math.min(this.cone, range);
  }

  /** Half of the shade's width [m]: the sensor stands at its rim. */
  get shade() {
    return Math.max(this.least, this.moment.search?.sensor.offset ?? 0);
  }

  /** How far a craft reaches from its centre [m]. */
  size(craft) {
    const { body } = this.scene.craft[craft];
    return Math.max(this.moment.axes(craft) ? this.shade : 0, body >= 0 ? this.scene.zones[body].radius : 0);
  }

  /** How far the cone of the one that is seen from near by is drawn [m]. */
  get near() {
    return Math.min(this.reach, 2 * this.shade);
  }

  update(palette, chosen) {
    const { scene, moment, dots, hulls, shades, cones, locks } = this;
    const parts = [dots, ...hulls.values(), shades, cones, locks];
    for (const part of parts) part.clear();
    scene.craft.forEach((craft, k) => {
      if (!moment.ways[k]) return;
      const label = moment.label(k);
      const colour = label === null ? palette.craft(craft.colour) : palette.set(label);
      dots.put(moment.positions[k], colour);
      hulls.get(craft.body)?.put(axesOf(scene.zones[craft.body]), moment.positions[k], colour);
      const turned = moment.axes(k);
      if (!turned || !(moment.few || k === chosen)) return;
      shades.put(columns(turned, [this.shade, this.shade, this.shade]), moment.positions[k], palette.shade);
      const { half_angle: half, offset } = moment.search.sensor;
      const apex = moment.positions[k].map((one, i) => one + offset * turned[2][i]);
      const [wide, long] = [this.reach * Math.sin(half), this.reach * Math.cos(half)];
      const group = moment.search.groups[k] === "A" ? palette.cone_a : palette.cone_b;
      cones.put(columns(turned, [wide, wide, long]), apex, group, 0.24);
    });
    const { now, past } = moment.locks;
    const line = ([i, j], look) => locks.line([...moment.positions[i], 0, ...moment.positions[j], 0], palette.lock, look);
    for (const pair of past) line(pair, { width: 1.2, dash: 8, alpha: 0.75 });
    for (const pair of now) line(pair, { width: 3 });
    for (const part of parts) part.finish();
  }
}

/** Rows of a matrix whose columns are axes times sizes. */
function columns(axes, sizes) {
  return [0, 1, 2].flatMap((i) => axes.map((axis, j) => sizes[j] * axis[i]));
}
