// Time scale: where a time of the scene stands across a canvas, and the time at a place.

export class TimeScale {
  /** Pixels left and right of it; whoever lays it sets `width`. */
  constructor(scene, left, right) {
    Object.assign(this, { scene, left, right, width: 0 });
  }

  x(time) {
    const { start, end } = this.scene;
    return this.left + ((time - start) / (end - start || 1)) * (this.width - this.left - this.right);
  }

  time(x) {
    const { start, end } = this.scene;
    return start + Math.min(1, Math.max(0, (x - this.left) / (this.width - this.left - this.right))) * (end - start);
  }
}
