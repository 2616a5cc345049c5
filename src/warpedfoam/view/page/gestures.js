// Mouse, pen, fingers and keys move the camera.
const STILL = { mouse: 4, pen: 8, touch: 12 }; // pixels within which a press is a tap
const ZOOMS = [0.25, 400];

/** Camera operations in pixels of a window; each changes the camera and nothing else. */
class Camera {
  constructor(centre, radius, view) {
    Object.assign(this, { centre, radius, view });
    this.home();
  }

  home() {
    this.axes = axesFromAngles(this.view.elevation, this.view.azimuth);
    this.target = [...this.centre];
    this.zoom = 1;
  }

  /** The near side follows a drag of (dx, dy) pixels, y downwards. */
  turn(dx, dy, width, height) {
    const way = Math.hypot(dx, dy);
    if (way) this.axes = turnedAxes(this.axes, [dy / way, dx / way, 0], (-1.3 * way * pixelSize(this, width, height)) / this.radius);
  }

  roll(angle) {
    this.axes = turnedAxes(this.axes, [0, 0, 1], angle);
  }

  move(dx, dy, width, height) {
    const pixel = pixelSize(this, width, height);
    this.target = along(along(this.target, -dx * pixel, this.axes[0]), dy * pixel, this.axes[1]);
    const arm = along(this.target, -1, this.centre), far = Math.hypot(...arm) / (1.2 * this.radius);
    if (far > 1) this.target = along(this.centre, 1 / far, arm);
  }

  /** Zoom by a factor; the point (x, y), in pixels from the middle of the window, stays where it is. */
  zoomBy(factor, x, y, width, height) {
    const before = this.zoom;
    this.zoom = Math.min(Math.max(before * factor, ZOOMS[0]), ZOOMS[1]);
    const gone = this.zoom / before - 1;
    this.move(-x * gone, -y * gone, width, height);
  }

  /** Turn a point to the front and the middle. */
  faceTo(point, normal) {
    this.axes = facing(this.axes, unit(normal));
    const arm = along(point, -1, this.centre);
    if (this.zoom > 1.2) this.target = along(along(this.centre, dot(arm, this.axes[0]), this.axes[0]), dot(arm, this.axes[1]), this.axes[1]);
    else this.target = [...this.centre];
  }
}

/** Let pointers, wheel and keys on a canvas move a camera; tells of changes and taps. */
function listen(canvas, camera, { changed, tapped, ended }) {
  const held = new Map();
  let path = 0, alone = true;
  const box = () => canvas.getBoundingClientRect();
  const fromMiddle = (x, y) => { const b = box(); return [x - b.left - b.width / 2, y - b.top - b.height / 2]; };
  const pair = () => {
    const [a, b] = [...held.values()];
    return { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2, apart: Math.hypot(b.x - a.x, b.y - a.y) || 1, angle: Math.atan2(b.y - a.y, b.x - a.x) };
  };

  canvas.addEventListener("pointerdown", (event) => {
    if (!held.size) path = 0, alone = true;
    canvas.setPointerCapture(event.pointerId);
    held.set(event.pointerId, { x: event.clientX, y: event.clientY });
    if (held.size > 1) alone = false;
  });
  canvas.addEventListener("pointermove", (event) => {
    const finger = held.get(event.pointerId);
    if (!finger) return;
    const { width, height } = box(), before = held.size === 2 ? pair() : null;
    const dx = event.clientX - finger.x, dy = event.clientY - finger.y;
    path += Math.hypot(dx, dy);
    finger.x = event.clientX;
    finger.y = event.clientY;
    if (before) {
      const after = pair(), middle = fromMiddle(after.x, after.y);
      camera.move(after.x - before.x, after.y - before.y, width, height);
      camera.zoomBy(after.apart / before.apart, ...middle, width, height);
      let angle = after.angle - before.angle;
      if (angle > Math.PI) angle -= 2 * Math.PI;
      if (angle < -Math.PI) angle += 2 * Math.PI;
      camera.roll(angle);
    } else if (held.size === 1 && (path > STILL[event.pointerType] || !alone)) {
      if (event.buttons & 6 || event.shiftKey || event.ctrlKey) camera.move(dx, dy, width, height);
      else camera.turn(dx, dy, width, height);
    } else return;
    changed();
  });
  const release = (event) => {
    if (!held.delete(event.pointerId) || held.size) return;
    const still = alone && path <= (STILL[event.pointerType] ?? 4) && event.button === 0;
    if (event.type === "pointerup" && still) tapped(event.clientX, event.clientY);
    else ended();
  };
  canvas.addEventListener("pointerup", release);
  canvas.addEventListener("pointercancel", release);
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    const { width, height } = box(), lines = [1, 16, height][event.deltaMode] ?? 1;
    const way = Math.min(Math.max(event.deltaY * lines, -240), 240);
    camera.zoomBy(Math.exp(-0.0016 * way * (event.ctrlKey ? 4 : 1)), ...fromMiddle(event.clientX, event.clientY), width, height);
    changed();
  }, { passive: false });

  const STEP = 40, WAYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
  canvas.addEventListener("keydown", (event) => {
    const { width, height } = box(), way = WAYS[event.key];
    if (event.altKey || event.metaKey) return;
    if (way && event.shiftKey) camera.move(STEP * way[0], STEP * way[1], width, height);
    else if (way) camera.turn(STEP * way[0], STEP * way[1], width, height);
    else if (event.key === "+" || event.key === "=") camera.zoomBy(1.2, 0, 0, width, height);
    else if (event.key === "-") camera.zoomBy(1 / 1.2, 0, 0, width, height);
    else return;
    event.preventDefault();
    changed();
  });
}
