// Turning, looking and projecting: pure functions of arrays.
const FIELD = Math.PI / 6; // of view, across the narrower side of the window

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const along = (a, s, b) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];

/** Axes (right, up, towards the viewer) seen from an elevation and an azimuth in degrees. */
function axesFromAngles(elevation, azimuth) {
  const e = (elevation * Math.PI) / 180, a = (azimuth * Math.PI) / 180;
  const towards = [Math.cos(e) * Math.cos(a), Math.cos(e) * Math.sin(a), Math.sin(e)];
  const right = [-Math.sin(a), Math.cos(a), 0];
  return [right, cross(towards, right), towards];
}

/** Vector v turned by an angle about a unit axis. */
function turned(v, axis, angle) {
  const c = Math.cos(angle), s = Math.sin(angle);
  const w = cross(axis, v), d = dot(axis, v) * (1 - c);
  return [0, 1, 2].map((k) => c * v[k] + s * w[k] + d * axis[k]);
}

const unit = (v) => { const n = Math.hypot(...v); return v.map((x) => x / n); };

/** Axes turned about one given in their own terms (right, up, towards), made orthonormal again. */
function turnedAxes(axes, own, angle) {
  const axis = unit([0, 1, 2].map((k) => own[0] * axes[0][k] + own[1] * axes[1][k] + own[2] * axes[2][k]));
  const towards = unit(turned(axes[2], axis, angle));
  const up = turned(axes[1], axis, angle);
  const right = unit(cross(up, towards));
  return [right, cross(towards, right), towards];
}

/** Distance of the eye, from which a ball fills the narrower side of the window; zooming narrows the view. */
const eyeDistance = (radius) => (1.04 * radius) / Math.sin(FIELD / 2);

/** Of a camera in a window: eye, half-widths of the view at distance 1, near and far. */
function lens(camera, width, height) {
  const half = Math.tan(FIELD / 2) / camera.zoom, narrow = Math.min(width, height);
  const eye = along(camera.target, eyeDistance(camera.radius), camera.axes[2]);
  const depth = dot(along(eye, -1, camera.centre), camera.axes[2]), ball = 1.15 * camera.radius;
  return {
    eye,
    across: (half * width) / narrow,
    upright: (half * height) / narrow,
    near: Math.max(depth - ball, 0.01 * camera.radius),
    far: Math.max(depth + ball, 0.02 * camera.radius),
  };
}

/** Matrix (columns first) from the world to clip space. */
function clipMatrix(camera, width, height) {
  const { eye, across, upright, near, far } = lens(camera, width, height);
  const [right, up, towards] = camera.axes, stretch = (far + near) / (far - near);
  const rows = [
    [...right.map((x) => x / across), -dot(right, eye) / across],
    [...up.map((x) => x / upright), -dot(up, eye) / upright],
    [...towards.map((x) => -x * stretch), dot(towards, eye) * stretch - (2 * far * near) / (far - near)],
    [...towards.map((x) => -x), dot(towards, eye)],
  ];
  return Float32Array.from({ length: 16 }, (_, k) => rows[k % 4][k >> 2]);
}

/** Where a point appears in a window, in its pixels from the top left; null behind the eye. */
function projected(camera, width, height, point) {
  const { eye, across, upright } = lens(camera, width, height);
  const arm = along(point, -1, eye), depth = -dot(camera.axes[2], arm);
  if (depth <= 0) return null;
  const x = dot(camera.axes[0], arm) / (across * depth), y = dot(camera.axes[1], arm) / (upright * depth);
  return [(0.5 + 0.5 * x) * width, (0.5 - 0.5 * y) * height];
}

/** Size of a pixel at the target, in units of the world. */
const pixelSize = (camera, width, height) =>
  (2 * Math.tan(FIELD / 2) * eyeDistance(camera.radius)) / (camera.zoom * Math.min(width, height));

/**
 * Runs [first, last) of the parts of a mesh that may be seen in a share of a window: [left, right, bottom, top]
 * from -1 to 1. Parts that face away are left out if the surface is closed.
 */
function partsInSight(camera, width, height, { balls, cones }, closed, [left, right, bottom, top]) {
  const { eye, across, upright } = lens(camera, width, height), [rightward, up, towards] = camera.axes;
  // sides of the view: a ball is beyond one if side . (x or y, depth) exceeds its radius
  const sides = [[0, right * across, 1], [0, left * across, -1], [1, top * upright, 1], [1, bottom * upright, -1]]
    .map(([axis, slope, sign]) => [axis, slope, sign, Math.hypot(1, slope)]);
  const runs = [];
  for (let k = 0; k < balls.length / 4; k++) {
    const arm = [balls[4 * k] - eye[0], balls[4 * k + 1] - eye[1], balls[4 * k + 2] - eye[2]], radius = balls[4 * k + 3];
    const place = [dot(arm, rightward), dot(arm, up)], depth = -dot(arm, towards);
    if (depth < -radius) continue;
    if (sides.some(([axis, slope, sign, size]) => sign * (place[axis] - slope * depth) > radius * size)) continue;
    if (closed) {
      const far = Math.hypot(...arm), spread = Math.acos(Math.max(cones[4 * k + 3], -1)) + Math.asin(Math.min(radius / far, 1));
      const cosine = -(cones[4 * k] * arm[0] + cones[4 * k + 1] * arm[1] + cones[4 * k + 2] * arm[2]) / far;
      if (spread < Math.PI / 2 && cosine < -Math.sin(spread)) continue;
    }
    const last = runs[runs.length - 1];
    if (last && last[1] === k) last[1] = k + 1;
    else runs.push([k, k + 1]);
  }
  return runs;
}

/** Axes turned the shortest way until "towards" points along a unit vector. */
function facing(axes, direction) {
  const axis = cross(axes[2], direction), s = Math.hypot(...axis), c = dot(axes[2], direction);
  if (s < 1e-9) return c > 0 ? axes : turnedAxes(axes, [0, 1, 0], Math.PI);
  const own = axes.map((a) => dot(a, axis) / s);
  return turnedAxes(axes, own, Math.atan2(s, c));
}

/** A number of a colour bar, with four digits. */
const brief = (x) => written(Number(x.toPrecision(4)));

/** A value, or two and what is between them. */
const between = (low, high) => (low === high ? written(low) : `${brief(low)} to ${brief(high)}`);

/** A number for a reader, with six digits. */
function written(x) {
  if (!Number.isFinite(x)) return "–";
  if (Number.isInteger(x) && Math.abs(x) < 1e15) return String(x).replace("-", "−");
  const size = Math.abs(x);
  const text = size >= 1e-3 && size < 1e6 ? String(Number(x.toPrecision(6))) : x.toExponential(4);
  return text.replace("-", "−").replace("e+", "e").replace("e-", "e−");
}
