// Guards: keep-out zones and regions that craft must not leave as glass, and uncertainty ellipsoids.

import { AS_IT_IS, axesOf, shapeOf, SHAPES, Solids } from "./solids.js";
import { root, Tube } from "./tube.js";

export class Guards {
  constructor(scene, moment) {
    Object.assign(this, { scene, moment });
    const room = 2 * scene.craft.length + 8;
    this.shapes = scene.zones.map((zone) => (zone.shape === "faces" ? `faces ${scene.zones.indexOf(zone)}` : zone.shape));
    this.zones = new Map();
    scene.zones.forEach((zone, k) => {
      const key = this.shapes[k];
      if (!this.zones.has(key)) this.zones.set(key, new Solids(shapeOf(zone), room));
    });
    this.regions = scene.regions.map((region) => ({ ...region, solids: new Solids(shapeOf(scene.zones[region.zone]), 1, { side: "both" }) }));
    this.tubes = scene.tubes.map((entry) => {
      const stage = scene.stages.find(({ number }) => number === entry.stage);
      return new Tube(entry, stage, moment.ways[entry.craft], scene);
    });
    this.outlines = this.tubes.filter((tube) => tube.moves).map((tube) => new Solids(tube.outline(), 1, { order: 0.9, side: "both" }));
    this.spreads = new Solids(SHAPES.ball(), Math.max(1, this.tubes.length), { order: 1.1, edge: 1.5 });
  }

  /** Spacecraft with a drawn zone: those that only coast, otherwise the followed one. */
  keepers(chosen) {
    const { craft } = this.scene;
    if (this.moment.search) return [chosen].filter((k) => craft[k].zone >= 0);
    const resting = craft.flatMap((one, k) => (one.moves || one.zone < 0 ? [] : [k]));
    const shown = resting.length && resting.length < craft.length && craft.length <= 40 ? resting : [chosen];
    return shown.filter((k) => craft[k].zone >= 0 && this.moment.ways[k]);
  }

  /** The zone of a pair, -1 for none. */
  pair(first, second) {
    const { craft, pairs } = this.scene;
    if (!pairs) return craft[first].zone;
    const [i, j] = [Math.min(first, second), Math.max(first, second)];
    return pairs.table[pairs.kind[i]]?.[pairs.kind[j]] ?? -1;
  }

  update(palette, chosen, ghosts) {
    const { scene, moment } = this;
    for (const solids of this.zones.values()) solids.clear();
    const put = (zone, middle, colour, alpha) =>
      this.zones.get(this.shapes[zone]).put(axesOf(scene.zones[zone]), middle, colour, alpha);
    const struck = new Map(); // current conflicts; before avoidance, the worst of the followed spacecraft
    const before = moment.conflicts.filter(({ first, second, when }) => when === "before" && (first === chosen || second === chosen));
    const worst = ghosts ? before.sort((a, b) => a.ratio - b.ratio).slice(0, 1) : [];
    for (const { first, second, when } of [...worst, ...moment.conflicts.filter((one) => one.when === "after")]) {
      const resting = scene.craft[first].moves ? second : first;
      const zone = this.pair(first, second);
      if (zone >= 0) struck.set(`${resting} ${zone}`, { resting, zone, when });
    }
    for (const k of this.keepers(chosen)) {
      if (!struck.has(`${k} ${scene.craft[k].zone}`)) put(scene.craft[k].zone, moment.positions[k], palette.zone, 0.42);
    }
    for (const { resting, zone, when } of struck.values()) {
      const ghost = when === "before" && moment.ghosts("before").find((track) => track.craft === resting);
      put(zone, ghost ? ghost.position(moment.time) : moment.positions[resting], palette.conflict, when === "after" ? 0.7 : 0.5);
    }
    for (const solids of this.zones.values()) solids.finish();
    for (const { solids, stage, start, end, zone, middle } of this.regions) {
      solids.clear();
      const holds = start <= moment.time && moment.time <= end;
      if (moment.stage?.number === stage) solids.put(axesOf(scene.zones[zone]), middle, palette.region, holds ? 0.3 : 0.15);
      solids.finish();
    }

    this.spreads.clear();
    for (const outline of this.outlines) {
      outline.clear();
      outline.put(AS_IT_IS, [0, 0, 0], palette.tube, 0.22);
      outline.finish();
    }
    for (const tube of this.tubes) {
      if (tube.start <= moment.time && moment.time <= tube.end) {
        this.spreads.put(root(tube.spread(moment.time)), moment.positions[tube.craft], palette.tube, 0.6);
      }
    }
    this.spreads.finish();
  }
}
