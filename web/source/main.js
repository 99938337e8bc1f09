// The page of a result folder: begins here.

import { App } from "./app.js";
import { readScene } from "./scene.js";
import "./style.css";

const still = document.getElementById("still");
const root = document.getElementById("viewer");

function begin() {
  const scene = readScene(document);
  window.closeform = new App(root, scene);
  still.hidden = true;
}

try {
  begin();
} catch (error) {
  root.replaceChildren();
  root.hidden = true;
  still.hidden = false;
  const graphics = /webgl/i.test(error.message);
  const reason = graphics
    ? "This browser provides no WebGL, which the animation requires; the pictures below show the same scene."
    : `The scene cannot be shown: ${error.message}`;
  document.getElementById("still-reason").textContent = reason;
  if (!graphics) throw error;
}
