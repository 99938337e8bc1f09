// Ribbons: lines some pixels wide, thousands of segments in one draw, strong where flown and faint beyond now.

import {
  BufferAttribute, DynamicDrawUsage, InstancedBufferAttribute, InstancedBufferGeometry, InstancedInterleavedBuffer,
  InterleavedBufferAttribute, Mesh, ShaderMaterial, StaticDrawUsage, Vector2,
} from "three";
import { rgb } from "./palette.js";

const POINT = 5; // numbers of a point: x, y, z, time, length so far
const CORNERS = new Float32Array([0, -1, 0, 0, 1, 0, 1, -1, 0, 1, 1, 0]);

const VERTEX = `
attribute vec4 a, b;
attribute float lengthA, lengthB;
attribute vec4 tint, look; // look: width [px], craft, dashes [px]
uniform vec2 halfSize;
uniform float chosen;
varying vec4 colour;
varying vec4 along; // time, length, across [px], half width [px]
varying float dash;

void main() {
  vec4 p = projectionMatrix * modelViewMatrix * vec4(a.xyz, 1.0);
  vec4 q = projectionMatrix * modelViewMatrix * vec4(b.xyz, 1.0);
  vec2 way = (q.xy - p.xy) * halfSize;
  float size = length(way);
  way = size > 1e-6 ? way / size : vec2(1.0, 0.0);
  float wide = look.x * (abs(look.y - chosen) < 0.5 ? 1.6 : 1.0);
  float reach = 0.5 * wide + 1.0;
  gl_Position = mix(p, q, position.x);
  gl_Position.xy += position.y * reach * vec2(-way.y, way.x) / halfSize;
  if (wide <= 0.0) gl_Position = vec4(2.0, 2.0, 2.0, 1.0); // between two lines
  colour = tint;
  along = vec4(mix(a.w, b.w, position.x), mix(lengthA, lengthB, position.x), position.y * reach, 0.5 * wide);
  dash = look.z;
}`;

const FRAGMENT = `
uniform float now, trail, units, ahead;
varying vec4 colour;
varying vec4 along;
varying float dash;

void main() {
  float alpha = colour.a * clamp(along.w + 0.5 - abs(along.z), 0.0, 1.0);
  if (dash > 0.0 && mod(along.y, dash * units) > 0.6 * dash * units) discard;
  float age = now - along.x;
  if (ahead < 1.0) alpha *= age < 0.0 ? ahead : max(1.4 * ahead, 1.0 - age / trail);
  if (alpha < 0.01) discard;
  gl_FragColor = vec4(colour.rgb, alpha);
}`;

export class Ribbons {
  /** Room for `most` points. What lies beyond now keeps `ahead` of its strength; with 1 all is alike. */
  constructor(most, { ahead = 1, order = 2, moving = false } = {}) {
    const usage = moving ? DynamicDrawUsage : StaticDrawUsage;
    this.points = new InstancedInterleavedBuffer(new Float32Array(POINT * (most + 1)), POINT, 1).setUsage(usage);
    this.tint = new InstancedBufferAttribute(new Uint8Array(4 * most), 4, true).setUsage(usage);
    this.look = new InstancedBufferAttribute(new Float32Array(4 * most), 4).setUsage(usage);
    const geometry = new InstancedBufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(CORNERS, 3));
    geometry.setIndex([0, 2, 1, 1, 2, 3]);
    geometry.setAttribute("a", new InterleavedBufferAttribute(this.points, 4, 0));
    geometry.setAttribute("b", new InterleavedBufferAttribute(this.points, 4, POINT));
    geometry.setAttribute("lengthA", new InterleavedBufferAttribute(this.points, 1, 4));
    geometry.setAttribute("lengthB", new InterleavedBufferAttribute(this.points, 1, POINT + 4));
    geometry.setAttribute("tint", this.tint);
    geometry.setAttribute("look", this.look);
    this.uniforms = Object.fromEntries(
      Object.entries({ halfSize: new Vector2(1, 1), units: 1, now: 0, trail: 1, ahead, chosen: -1 })
        .map(([name, value]) => [name, { value }]),
    );
    const { uniforms } = this;
    const shaders = { vertexShader: VERTEX, fragmentShader: FRAGMENT };
    this.mesh = new Mesh(geometry, new ShaderMaterial({ uniforms, ...shaders, transparent: true, depthWrite: false }));
    this.mesh.frustumCulled = false;
    this.mesh.renderOrder = order;
    this.lines = [];
    this.clear();
  }

  clear() {
    this.count = 0;
    this.lines.length = 0;
    this.mesh.geometry.instanceCount = 0;
  }

  /** Adds a line through points (x, y, z, t one after another). */
  line(points, colour, { width = 1.5, alpha = 1, dash = 0, craft = -2 } = {}) {
    const first = this.count;
    const many = points.length / 4;
    const rows = this.points.array;
    let length = 0;
    for (let k = 0; k < many; k++) {
      const at = POINT * (first + k);
      for (let i = 0; i < 4; i++) rows[at + i] = points[4 * k + i];
      if (k) length += Math.hypot(rows[at] - rows[at - POINT], rows[at + 1] - rows[at - 4], rows[at + 2] - rows[at - 3]);
      rows[at + 4] = length;
      this.look.array.set([k + 1 < many ? width : 0, craft, dash, 0], 4 * (first + k));
    }
    this.count += many;
    this.lines.push({ first, many, colour, alpha });
  }

  /** Hands what was added to the graphics; `paint` makes a colour "#rrggbb" of each line's own. */
  finish(paint = (colour) => colour) {
    for (const { first, many, colour, alpha } of this.lines) {
      const parts = [...rgb(paint(colour)), alpha].map((part) => Math.round(255 * part));
      for (let k = first; k < first + many; k++) this.tint.array.set(parts, 4 * k);
    }
    for (const buffer of [this.points, this.tint, this.look]) buffer.needsUpdate = true;
    this.mesh.geometry.instanceCount = Math.max(0, this.count - 1);
  }
}
