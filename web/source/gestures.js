// Gestures: turning, moving and zooming a view by mouse, touch and keys, and choosing a craft by a click.

const TURN = 0.006; // radians to a pixel
const ZOOM = 0.0014; // of a wheel's step
const CLICK = 5; // pixels that a click may move

/** Listens on the element over a view; `picked(x, y)` is told of clicks, `changed` of all else. */
export function listen(element, view, changed, picked) {
  const fingers = new Map();
  let moved = 0;
  const middle = () => ["x", "y"].map((key) => [...fingers.values()].reduce((sum, one) => sum + one[key], 0) / fingers.size);
  const spread = () => {
    const [a, b] = [...fingers.values()];
    return Math.hypot(a.x - b.x, a.y - b.y) || 1;
  };
  const from = (event) => [event.offsetX - view.place.width / 2, event.offsetY - view.place.height / 2];
  const touched = () => {
    view.touched = true;
    changed();
  };

  element.addEventListener("pointerdown", (event) => {
    element.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, { x: event.offsetX, y: event.offsetY });
    moved = fingers.size > 1 ? Infinity : 0;
  });
  element.addEventListener("pointermove", (event) => {
    const finger = fingers.get(event.pointerId);
    if (!finger) return;
    const [x, y] = middle();
    const before = fingers.size > 1 ? spread() : 1;
    const [right, down] = [event.offsetX - finger.x, event.offsetY - finger.y];
    Object.assign(finger, { x: event.offsetX, y: event.offsetY });
    moved += Math.hypot(right, down);
    if (moved < CLICK) return;
    if (fingers.size > 1) {
      const [u, v] = middle();
      if (!view.follows) view.pan(u - x, v - y);
      view.zoom(before / spread(), ...(view.follows ? [0, 0] : [u - view.place.width / 2, v - view.place.height / 2]));
    } else if ((event.shiftKey || event.buttons & 6) && !view.follows) view.pan(right, down);
    else view.turn(-TURN * right, TURN * down);
    touched();
  });
  const lift = (event) => {
    if (fingers.delete(event.pointerId) && event.type === "pointerup" && moved < CLICK) picked(event.offsetX, event.offsetY);
  };
  element.addEventListener("pointerup", lift);
  element.addEventListener("pointercancel", lift);
  element.addEventListener("contextmenu", (event) => event.preventDefault());
  element.addEventListener("wheel", (event) => {
    event.preventDefault();
    const steps = event.deltaY * (event.deltaMode ? 30 : 1);
    view.zoom(Math.exp(ZOOM * Math.max(-300, Math.min(300, steps))), ...(view.follows ? [0, 0] : from(event)));
    touched();
  }, { passive: false });
}
