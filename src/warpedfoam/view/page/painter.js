// WebGL: patches as triangles, films as quads of constant width, bubbles' numbers for picking.
// Dots across a bubble below which films of two pieces look as bent as they are; and while all of it moves.
const SMALL = 44, SMALL_MOVING = 110;
const SAMPLES = 4; // a dot, at rest
const WHOLE = [-1, 1, -1, 1];

/** Colours of 256 places along a colour bar. */
function rampTexels(stops) {
  const out = new Uint8Array(4 * 256);
  for (let k = 0; k < 256; k++) {
    const at = (k / 255) * (stops.length - 1), low = Math.min(Math.floor(at), stops.length - 2), t = at - low;
    for (let c = 0; c < 3; c++) out[4 * k + c] = Math.round(stops[low][c] * (1 - t) + stops[low + 1][c] * t);
    out[4 * k + 3] = 255;
  }
  return out;
}

class Painter {
  /** Throws if the browser has no WebGL 2. */
  constructor(canvas) {
    this.canvas = canvas;
    const gl = canvas.getContext("webgl2", { alpha: false, antialias: false, stencil: false });
    if (!gl) throw new Error("This browser has no WebGL 2, which the viewer draws with.");
    this.gl = gl;
    this.patch = this.program(PATCH_VERTEX, PATCH_FRAGMENT);
    this.numbers = this.program(PATCH_VERTEX, PICK_FRAGMENT);
    this.line = this.program(LINE_VERTEX, LINE_FRAGMENT);
    this.bubbles = this.texture(gl.NEAREST);
    this.ramp = this.texture(gl.LINEAR);
    this.buffers = [];
    this.meshes = [];
    this.stores = {};
    this.counts = null;
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
  }

  program(vertex, fragment) {
    const gl = this.gl, program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
      const logs = gl.getAttachedShaders(program).map((shader) => gl.getShaderInfoLog(shader));
      throw new Error(`The viewer's shaders do not compile here: ${gl.getProgramInfoLog(program)} ${logs.join(" ")}`);
    }
    const uniforms = {}, count = gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS);
    for (let k = 0; k < count; k++) {
      const { name } = gl.getActiveUniform(program, k);
      uniforms[name.slice(2)] = gl.getUniformLocation(program, name);
    }
    return { program, uniforms };
  }

  texture(filter) {
    const gl = this.gl, texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, filter);
    for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
    return texture;
  }

  buffer(values, target = this.gl.ARRAY_BUFFER) {
    const gl = this.gl, buffer = gl.createBuffer();
    gl.bindBuffer(target, buffer);
    gl.bufferData(target, values, gl.STATIC_DRAW);
    this.buffers.push(buffer);
    return buffer;
  }

  attribute(place, size, type, stride = 0, offset = 0) {
    const gl = this.gl, whole = type === gl.INT || type === gl.UNSIGNED_INT;
    gl.enableVertexAttribArray(place);
    if (whole) gl.vertexAttribIPointer(place, size, type, stride, offset);
    else gl.vertexAttribPointer(place, size, type, true, stride, offset);
  }

  /** Show another frame in place of the last one. */
  setFrame(frame) {
    const gl = this.gl;
    for (const buffer of this.buffers) gl.deleteBuffer(buffer);
    this.buffers = [];
    for (const mesh of this.meshes) if (mesh) [mesh.patches, mesh.lines].forEach((array) => gl.deleteVertexArray(array));
    this.frame = frame;
    this.meshes = frame.meshes.map(() => null); // uploaded when they are first drawn
  }

  uploaded(mesh) {
    const gl = this.gl, patches = gl.createVertexArray(), lines = gl.createVertexArray();
    gl.bindVertexArray(patches);
    this.buffer(mesh.points);
    this.attribute(0, 4, gl.UNSIGNED_SHORT);
    this.buffer(mesh.normals);
    this.attribute(1, 4, gl.BYTE);
    this.buffer(mesh.owner);
    this.attribute(2, 1, gl.UNSIGNED_INT);
    this.buffer(mesh.triangles, gl.ELEMENT_ARRAY_BUFFER);
    gl.bindVertexArray(lines);
    this.buffer(mesh.linePoints);
    this.attribute(0, 4, gl.UNSIGNED_SHORT, 16, 0);
    this.attribute(1, 4, gl.UNSIGNED_SHORT, 16, 8);
    this.buffer(mesh.lineNormals);
    this.attribute(2, 4, gl.BYTE, 8, 0);
    this.attribute(3, 4, gl.BYTE, 8, 4);
    this.buffer(mesh.beside);
    this.attribute(4, 2, gl.INT);
    this.buffer(mesh.quads, gl.ELEMENT_ARRAY_BUFFER);
    gl.bindVertexArray(null);
    return { patches, lines, chunks: mesh.chunks };
  }

  /** Number of the coarsest mesh that looks as the finest does, or nearly so while the picture moves. */
  level(camera, moving) {
    const { width, height } = this.canvas, { size, pieces } = this.frame.facts;
    const dots = size / pixelSize(camera, width, height), small = moving ? SMALL_MOVING : SMALL;
    // films bend away from their pieces by the square of these
    for (let k = pieces.length - 1; k > 0; k--) if (dots < small * (pieces[k] / 2) ** 2) return k;
    return 0;
  }

  /** What of a mesh may be in sight, in a share of the window. */
  sight(camera, moving, share = WHOLE) {
    const { width, height } = this.canvas, level = this.level(camera, moving);
    const mesh = (this.meshes[level] ??= this.uploaded(this.frame.meshes[level]));
    const runs = partsInSight(camera, width, height, mesh.chunks, !this.frame.facts.edged, share);
    return { level, mesh, runs };
  }

  /** Draw the parts of the mesh that is bound, by where each starts; how many triangles these are. */
  parts(runs, starts, triangles) {
    let count = 0;
    for (const [first, last] of runs) {
      const start = triangles * starts[first], end = triangles * starts[last];
      if (end > start) this.gl.drawElements(this.gl.TRIANGLES, 3 * (end - start), this.gl.UNSIGNED_INT, 12 * start);
      count += end - start;
    }
    return count;
  }

  /** Colours (n × 3 bytes) and flags (n bytes) of the bubbles. */
  setBubbles(rgb, flags) {
    const gl = this.gl, rows = Math.ceil(flags.length / ROW), texels = new Uint8Array(4 * ROW * rows);
    for (let k = 0; k < flags.length; k++) {
      for (let c = 0; c < 3; c++) texels[4 * k + c] = rgb[3 * k + c];
      texels[4 * k + 3] = flags[k];
    }
    gl.bindTexture(gl.TEXTURE_2D, this.bubbles);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8UI, ROW, rows, 0, gl.RGBA_INTEGER, gl.UNSIGNED_BYTE, texels);
  }

  setRamp(stops) {
    const gl = this.gl;
    gl.bindTexture(gl.TEXTURE_2D, this.ramp);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, rampTexels(stops));
  }

  /** Fit the drawing to a window of the page, at so many dots a pixel. */
  resize(width, height, dots) {
    const w = Math.max(1, Math.round(width * dots)), h = Math.max(1, Math.round(height * dots));
    if (this.canvas.width !== w) this.canvas.width = w;
    if (this.canvas.height !== h) this.canvas.height = h;
  }

  begin(which, camera, cube) {
    const gl = this.gl, { width, height } = this.canvas, { program, uniforms } = which;
    gl.useProgram(program);
    gl.uniformMatrix4fv(uniforms.clip, false, clipMatrix(camera, width, height));
    gl.uniform3fv(uniforms.low, cube.low);
    gl.uniform1f(uniforms.side, cube.side);
    gl.uniform3fv(uniforms.eye, lens(camera, width, height).eye);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.bubbles);
    gl.uniform1i(uniforms.bubbles, 0);
    return uniforms;
  }

  patches(which, camera, look, { mesh, runs }) {
    const gl = this.gl, u = this.begin(which, camera, look.cube);
    const light = unit([-0.35, 0.55, 0.76]);
    gl.uniform1f(u.sink, this.frame.facts.sink);
    gl.uniform3fv(u.light, [0, 1, 2].map((k) => light.reduce((sum, x, j) => sum + x * camera.axes[j][k], 0)));
    gl.uniform1i(u.by_point, look.byPoint);
    gl.uniform1i(u.charged, look.charged);
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, this.ramp);
    gl.uniform1i(u.ramp, 1);
    gl.bindVertexArray(mesh.patches);
    // of a closed surface no back is seen
    if (!this.frame.facts.edged) gl.enable(gl.CULL_FACE);
    const count = this.parts(runs, mesh.chunks.triangles, 1);
    gl.disable(gl.CULL_FACE);
    return count;
  }

  lines(camera, look, { mesh, runs }, smooth) {
    const gl = this.gl, u = this.begin(this.line, camera, look.cube), { facts } = this.frame;
    const { width, height } = this.canvas, pixel = pixelSize(camera, width, height);
    gl.uniform2f(u.half, 0.5 * width, 0.5 * height);
    gl.uniform1f(u.width, Math.min(Math.max((0.045 * facts.size) / pixel, 0.6 * look.dots), 2.4 * look.dots));
    gl.uniform1f(u.dots, look.dots);
    gl.uniform1f(u.pull, facts.pull + Math.min(1.5 * look.dots * pixel, 2 * facts.pull));
    gl.uniform1i(u.edged, facts.edged);
    gl.uniform1i(u.films, look.films);
    gl.uniform1i(u.charged, look.charged);
    gl.uniform3fv(u.film, look.film);
    gl.uniform3fv(u.accent, look.accent);
    gl.bindVertexArray(mesh.lines);
    gl.enable(smooth ? gl.SAMPLE_ALPHA_TO_COVERAGE : gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    gl.depthMask(smooth); // the blended ends of pieces must not hide each other
    const count = this.parts(runs, mesh.chunks.segments, 2);
    gl.depthMask(true);
    gl.disable(smooth ? gl.SAMPLE_ALPHA_TO_COVERAGE : gl.BLEND);
    return count;
  }

  /** Draw the foam; while it moves in fewer triangles, and with no smoothing of edges but the films'. */
  draw(camera, look, moving = false) {
    const gl = this.gl, { width, height } = this.canvas;
    if (!this.frame || gl.isContextLost()) return;
    const smooth = !moving, store = smooth ? this.store("smooth", SAMPLES) : null;
    gl.bindFramebuffer(gl.FRAMEBUFFER, store);
    gl.viewport(0, 0, width, height);
    gl.clearColor(...look.ground, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const sight = this.sight(camera, moving);
    const triangles = this.patches(this.patch, camera, look, sight);
    const films = this.lines(camera, look, sight, smooth);
    gl.bindVertexArray(null);
    if (smooth) {
      // by way of one with a sample a dot: canvases differ in their formats, which samples must not
      const plain = this.store("plain", 0);
      for (const [from, to] of [[store, plain], [plain, null]]) {
        gl.bindFramebuffer(gl.READ_FRAMEBUFFER, from);
        gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, to);
        gl.blitFramebuffer(0, 0, width, height, 0, 0, width, height, gl.COLOR_BUFFER_BIT, gl.NEAREST);
      }
      gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    }
    this.counts = { level: sight.level, triangles, films, smooth, parts: sight.runs.length, width, height };
  }

  /** Place of the bubble at a share of the window from its top left, or -1. */
  pick(camera, look, x, y) {
    const gl = this.gl, { width, height } = this.canvas;
    if (!this.frame || gl.isContextLost()) return -1;
    const px = Math.min(Math.max(Math.floor(x * width), 0), width - 1);
    const py = Math.min(Math.max(Math.floor((1 - y) * height), 0), height - 1);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.store("plain", 0));
    gl.viewport(0, 0, width, height);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(px, py, 1, 1);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const share = [px / width, (px + 1) / width, py / height, (py + 1) / height].map((at) => 2 * at - 1);
    this.patches(this.numbers, camera, look, this.sight(camera, false, share));
    const texel = new Uint8Array(4);
    gl.readPixels(px, py, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, texel);
    gl.disable(gl.SCISSOR_TEST);
    gl.bindVertexArray(null);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    return texel[0] + 256 * texel[1] + 65536 * texel[2] - 1;
  }

  /** A frame buffer of the canvas's size, by its name. */
  store(name, samples) {
    const gl = this.gl, { width, height } = this.canvas, old = this.stores[name];
    if (old && old.width === width && old.height === height) return old.frame;
    if (old) {
      gl.deleteFramebuffer(old.frame);
      old.parts.forEach((part) => gl.deleteRenderbuffer(part));
    }
    const frame = gl.createFramebuffer(), parts = [];
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    for (const [format, place] of [[gl.RGBA8, gl.COLOR_ATTACHMENT0], [gl.DEPTH_COMPONENT24, gl.DEPTH_ATTACHMENT]]) {
      const part = gl.createRenderbuffer(), most = samples && gl.getParameter(gl.MAX_SAMPLES);
      gl.bindRenderbuffer(gl.RENDERBUFFER, part);
      gl.renderbufferStorageMultisample(gl.RENDERBUFFER, Math.min(samples, most), format, width, height);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, place, gl.RENDERBUFFER, part);
      parts.push(part);
    }
    this.stores[name] = { frame, parts, width, height };
    return frame;
  }

  /** Wait until all that was asked for has been drawn. */
  finish() {
    this.gl.readPixels(0, 0, 1, 1, this.gl.RGBA, this.gl.UNSIGNED_BYTE, new Uint8Array(4));
  }
}
