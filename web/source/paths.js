// Paths: all paths of the scene as lines, one layer per kind, and their conflicts.

import { Ribbons } from "./ribbons.js";

const FINE = 2500; // chords are as close to a way as the scene's size over this
const MANY = 20; // craft from which on lines are thin

export class Paths {
  constructor(scene, moment, radius) {
    Object.assign(this, { scene, moment, tolerance: radius / FINE });
    const span = scene.end - scene.start || 1;
    this.trail = Math.min(scene.period ?? span, span) || 1;
    const thin = scene.craft.length > MANY;
    const colour = (track) => ({ craft: scene.craft[track.craft].colour });
    this.layers = {
      drifts: this.layer("drift", 1, () => ({ name: "drift" }), { width: 1.2, alpha: 0.55 }),
      before: this.layer("before", 0.55, () => ({ name: "before" }), { width: thin ? 1 : 1.5, dash: 9, alpha: 0.9 }),
      planned: this.layer("planned", 1, colour, { width: 1, dash: 5, alpha: 0.8 }),
      paths: this.layer("executed", thin ? 0.18 : 0.34, colour, { width: thin ? 1.1 : 2.1 }),
      conflicts: this.stretches(thin),
    };
  }

  get groups() {
    return Object.entries(this.layers);
  }

  layer(kind, ahead, colour, look) {
    const tracks = this.moment.tracks.filter((track) => track.kind === kind);
    return this.lines(tracks.map((track) => [track.chords(this.tolerance), colour(track), { ...look, craft: track.craft }]), ahead, 2);
  }

  /** Where craft are within a zone: strong on the ways that lead there. */
  stretches(thin) {
    const lines = [];
    for (const { first, second, stage, when, start, end } of this.scene.conflicts) {
      for (const craft of [first, second]) {
        const own = this.moment.tracks.filter((track) => track.craft === craft && track.stage === stage);
        const track = (when === "before" && own.find(({ kind }) => kind === "before")) || own.find(({ kind }) => kind === "executed");
        if (track && end > track.start && start < track.end) {
          lines.push([track.chords(this.tolerance, start, end), { name: "conflict" }, when === "after" ? { width: thin ? 2 : 4 } : { width: thin ? 1.5 : 3, alpha: 0.6 }]);
        }
      }
    }
    return this.lines(lines, 1, 3);
  }

  lines(lines, ahead, order) {
    const ribbons = new Ribbons(lines.reduce((sum, [points]) => sum + points.length / 4, 0), { ahead, order });
    for (const [points, colour, look] of lines) ribbons.line(points, colour, look);
    ribbons.uniforms.trail.value = this.trail;
    return ribbons;
  }

  paint(palette) {
    for (const [, ribbons] of this.groups) {
      ribbons.finish(({ craft, name }) => (craft ? palette.craft(craft) : palette[name]));
    }
  }

  update(chosen) {
    for (const [, { uniforms }] of this.groups) {
      uniforms.now.value = this.moment.time;
      uniforms.chosen.value = chosen;
    }
  }
}
