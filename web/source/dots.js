// Dots: craft as small balls that face the reader, all in one draw.

import { BufferAttribute, BufferGeometry, Mesh, ShaderMaterial, Vector2 } from "three";
import { rgb } from "./palette.js";

const VERTEX = `
attribute vec2 corner;
attribute vec3 tint;
uniform vec2 halfSize;
uniform float least;
varying vec2 spot; // from the middle [px]
varying vec3 colour;
void main() {
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
  spot = corner * (least + 1.0);
  gl_Position.xy += spot / halfSize;
  colour = tint;
}`;

const FRAGMENT = `
uniform float least;
varying vec2 spot;
varying vec3 colour;
void main() {
  float far = length(spot);
  float alpha = clamp(least + 0.5 - far, 0.0, 1.0);
  if (alpha < 0.02) discard;
  vec2 across = spot / least;
  float light = 0.7 + 0.3 * max(0.0, dot(vec3(across, sqrt(max(0.0, 1.0 - dot(across, across)))), vec3(-0.45, 0.6, 0.66)));
  gl_FragColor = vec4(colour * light, alpha);
}`;

const CORNERS = [-1, -1, 1, -1, -1, 1, 1, 1];

export class Dots {
  constructor(most) {
    this.places = new BufferAttribute(new Float32Array(12 * most), 3);
    this.tint = new BufferAttribute(new Float32Array(12 * most), 3);
    this.geometry = new BufferGeometry();
    this.geometry.setAttribute("position", this.places);
    this.geometry.setAttribute("tint", this.tint);
    const corners = Float32Array.from({ length: 8 * most }, (_, k) => CORNERS[k % 8]);
    this.geometry.setAttribute("corner", new BufferAttribute(corners, 2));
    const index = Array.from({ length: most }, (_, k) => [0, 1, 2, 2, 1, 3].map((one) => 4 * k + one));
    this.geometry.setIndex(index.flat());
    this.uniforms = { halfSize: { value: new Vector2(1, 1) }, least: { value: 4.5 } };
    const look = { uniforms: this.uniforms, vertexShader: VERTEX, fragmentShader: FRAGMENT, transparent: true, depthTest: true };
    this.meshes = [new Mesh(this.geometry, new ShaderMaterial(look))];
    this.meshes[0].frustumCulled = false;
    this.meshes[0].renderOrder = 4;
    this.clear();
  }

  clear() {
    this.count = 0;
  }

  put(place, colour) {
    const parts = rgb(colour);
    for (let k = 4 * this.count; k < 4 * this.count + 4; k++) {
      this.places.array.set(place, 3 * k);
      this.tint.array.set(parts, 3 * k);
    }
    this.count += 1;
  }

  finish() {
    this.places.needsUpdate = this.tint.needsUpdate = true;
    this.geometry.setDrawRange(0, 6 * this.count);
  }
}
