// The page: state, drawing when something has changed, and the controls.
const SLOW = 45; // milliseconds between pictures of a movement, above which they are drawn in fewer dots
const HIDDEN = 2000; // nobody looked
const MOVING_DOTS = 2; // in a pixel of the page at most, while the picture moves
const REST = 150; // milliseconds after which what has stopped is drawn in all detail

class Viewer {
  constructor(facts) {
    this.facts = facts;
    this.canvas = byId("scene");
    this.painter = new Painter(this.canvas);
    this.frames = new Frames(facts, (number) => byId(`frame-${number}`).textContent);
    const { low, side } = facts.cube;
    this.camera = new Camera(low.map((x) => x + side / 2), side / 2, facts.view);
    this.number = 0;
    this.pickedId = null;
    this.coarse = 1; // share of the dots that a moving picture has
    this.turning = false;
    this.size = [1, 1];
    this.scalar = facts.scalars.find((item) => item.name === facts.colorBy);
  }

  async start() {
    this.frame = await this.frames.get(0);
    this.camera.radius = ballRadius(this.frame, this.facts.cube, this.camera.centre);
    this.controls();
    this.themed(matchMedia("(prefers-color-scheme: dark)").matches);
    this.painter.setFrame(this.frame);
    this.coloured();
    this.told();
    new ResizeObserver(() => this.redraw()).observe(this.canvas);
    this.redraw();
  }

  // ------------------------------------------------------------------ drawing

  get look() {
    const hex = (text) => [1, 3, 5].map((k) => parseInt(text.slice(k, k + 2), 16) / 255);
    const { dark } = this;
    return {
      cube: this.facts.cube,
      byPoint: this.scalar.name === "surface",
      films: byId("films").checked,
      charged: byId("charged").checked,
      film: hex(this.facts.colours.film),
      // on patches, which are as bright in the dark
      accent: hex("#d4009f"),
      ground: hex(dark ? "#17181c" : "#ffffff"),
      dots: this.dots,
    };
  }

  get dots() {
    const dots = window.devicePixelRatio || 1;
    return this.moves ? Math.min(dots, MOVING_DOTS) * this.coarse : Math.min(dots, 3);
  }

  /** Whether pictures follow each other: these have less detail, and the last is drawn again in all. */
  get moves() {
    return this.turning || Boolean(this.playing);
  }

  redraw() {
    this.pending ??= requestAnimationFrame(() => this.drawn());
  }

  drawn() {
    this.pending = null;
    const { clientWidth, clientHeight } = this.canvas;
    if (clientWidth && clientHeight) this.size = [clientWidth, clientHeight]; // none while it is printed
    this.painter.resize(...this.size, this.dots);
    this.painter.draw(this.camera, this.look, this.moves);
    // the window asks for the next picture once this one is drawn, however often fingers move
    const began = performance.now();
    if (this.moves) requestAnimationFrame(() => this.paced(performance.now() - began));
    this.canvas.dataset.drawn = String(Number(this.canvas.dataset.drawn ?? 0) + 1);
  }

  moving() {
    this.stirred();
    this.redraw();
  }

  /** A picture of a movement took so long: fewer dots if pictures come too slowly, more if they come fast. */
  paced(took) {
    if (took > HIDDEN) return;
    this.pace = 0.7 * (this.pace ?? took) + 0.3 * took;
    if (this.pace > SLOW) this.coarse = Math.max(0.4, 0.8 * this.coarse), this.pace = SLOW;
    else if (this.pace < 0.5 * SLOW) this.coarse = Math.min(1, 1.02 * this.coarse);
  }

  /** Until it has rested for a while. */
  stirred() {
    this.turning = true;
    clearTimeout(this.resting);
    this.resting = setTimeout(() => this.settled(), REST);
  }

  settled() {
    clearTimeout(this.resting);
    if (this.turning) { this.turning = false; this.redraw(); }
  }

  // ------------------------------------------------------------------ state

  async show(number) {
    const wanted = Math.min(Math.max(number, 0), this.facts.frames.length - 1);
    this.wanted = wanted;
    const frame = await this.frames.get(wanted);
    if (this.wanted !== wanted) return; // another one was asked for meanwhile
    this.number = wanted;
    this.frame = frame;
    this.painter.setFrame(frame);
    this.coloured();
    this.told();
    this.redraw();
  }

  colourBy(name) {
    this.scalar = this.facts.scalars.find((item) => item.name === name);
    byId("color-by").value = name;
    this.coloured();
    this.redraw();
  }

  get place() {
    return this.pickedId === null ? -1 : this.frame.placeOf.get(this.pickedId) ?? -1;
  }

  coloured() {
    const { frame, scalar, place } = this, flags = new Uint8Array(frame.count);
    for (let k = 0; k < frame.count; k++) if (frame.values.charge[k] !== 0) flags[k] |= CHARGED;
    if (place >= 0) {
      flags[place] |= PICKED;
      for (const k of frame.neighbours[place]) flags[k] |= NEIGHBOUR;
    }
    this.painter.setRamp(scalar.stops);
    this.painter.setBubbles(frame.rgb[scalar.name], flags);
    const outside = [1, 3, 5].map((k) => parseInt(this.facts.colours.outside.slice(k, k + 2), 16));
    byId("legend").replaceChildren(...legend(scalar, frame, outside));
  }

  told() {
    const { frame, place, facts, number } = this, about = frame.facts;
    byId("frame-facts").textContent =
      `${about.held} bubbles, energy ${written(about.energy)}, gap ${between(...about.gap)}`;
    byId("frame").value = number;
    byId("frame").setAttribute("aria-valuetext", about.label);
    const place_in_all = ` (${number + 1}/${facts.frames.length})`;
    byId("frame-label").replaceChildren(element("span", { title: about.label }, about.label), place_in_all);
    byId("unpick").hidden = this.pickedId === null;
    if (this.pickedId !== null) byId("find-id").value = String(this.pickedId);
    const gone = element("p", { class: "hint" }, `There is no bubble ${this.pickedId} in this frame.`);
    const hint = element("p", { class: "hint" }, "Tap a bubble to read its numbers.");
    const go = (id) => this.goTo(id);
    byId("numbers").replaceChildren(
      ...(place >= 0 ? numbers(frame, place, go) : [this.pickedId === null ? hint : gone]));
  }

  picked(id) {
    this.pickedId = id;
    if (id === null) byId("find-id").value = "";
    this.coloured();
    this.told();
    this.redraw();
  }

  /** Pick a bubble by its id and turn it to the front. */
  goTo(id) {
    const place = this.frame.placeOf.get(id) ?? -1, { centres, facing: normals } = this.frame;
    if (place >= 0) this.camera.faceTo([...centres.slice(3 * place, 3 * place + 3)], [...normals.slice(3 * place, 3 * place + 3)]);
    this.picked(id);
  }

  /** Id of the bubble at a place of the window, in its pixels, or null. */
  at(x, y) {
    const box = this.canvas.getBoundingClientRect();
    const place = this.painter.pick(this.camera, this.look, (x - box.left) / box.width, (y - box.top) / box.height);
    return place < 0 ? null : this.frame.ids[place];
  }

  themed(dark) {
    this.dark = dark;
    document.documentElement.dataset.theme = dark ? "dark" : "light";
    this.redraw();
  }

  // ------------------------------------------------------------------ controls

  controls() {
    const { facts, canvas } = this, select = byId("color-by");
    for (const { name, label } of facts.scalars) select.append(element("option", { value: name }, label));
    select.value = this.scalar.name;
    select.addEventListener("change", () => this.colourBy(select.value));
    for (const id of ["films", "charged"]) byId(id).addEventListener("change", () => this.redraw());
    byId("find").addEventListener("submit", (event) => {
      event.preventDefault();
      const text = byId("find-id").value.trim();
      if (/^\d+$/.test(text)) this.goTo(Number(text));
    });
    byId("unpick").addEventListener("click", () => this.picked(null));
    byId("home").addEventListener("click", () => this.home());
    byId("theme").addEventListener("click", () => this.themed(!this.dark));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", (event) => this.themed(event.matches));
    const full = byId("fullscreen");
    full.hidden = !document.fullscreenEnabled;
    full.addEventListener("click", () => this.fullscreen());
    listen(canvas, this.camera, {
      changed: () => this.moving(),
      ended: () => this.settled(),
      tapped: (x, y) => { this.settled(); this.picked(this.at(x, y)); },
    });
    document.addEventListener("keydown", (event) => this.key(event));
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => {
      this.painter = new Painter(canvas);
      this.painter.setFrame(this.frame);
      this.coloured();
      this.redraw();
    });
    window.addEventListener("beforeprint", () => this.printed());
    if (facts.frames.length > 1) this.player();
  }

  /** A copy of the picture on white, which printers get: what graphics cards draw does not stay. */
  printed() {
    const { canvas } = this, paper = byId("paper"), dots = Math.max(window.devicePixelRatio || 1, 2);
    this.painter.resize(...this.size, dots);
    this.painter.draw(this.camera, { ...this.look, ground: [1, 1, 1], dots });
    Object.assign(paper, { width: canvas.width, height: canvas.height });
    paper.getContext("2d").drawImage(canvas, 0, 0);
    this.redraw();
  }

  home() {
    this.camera.home();
    this.redraw();
  }

  fullscreen() {
    if (document.fullscreenElement) document.exitFullscreen();
    else document.documentElement.requestFullscreen?.().catch(() => {});
  }

  key(event) {
    const busy = event.target.closest("input, select, button, textarea");
    if (event.altKey || event.metaKey || event.ctrlKey) return;
    if (event.key === "Escape" && this.pickedId !== null) this.picked(null);
    else if (busy) return;
    else if (event.key === "Home") this.home();
    else if (event.key === "f" || event.key === "F") this.fullscreen();
    else if (event.key === " " && this.facts.frames.length > 1) this.play(!this.playing);
    else return;
    event.preventDefault();
  }

  player() {
    byId("player").hidden = false;
    const slider = byId("frame");
    slider.max = this.facts.frames.length - 1;
    slider.addEventListener("input", () => {
      this.play(false);
      this.stirred();
      this.show(Number(slider.value));
    });
    byId("play").addEventListener("click", () => this.play(!this.playing));
  }

  play(on) {
    this.playing = on;
    clearTimeout(this.timer);
    byId("play").setAttribute("aria-label", on ? "Pause" : "Play");
    byId("play-shape").setAttribute("d", on ? "M7 5.5h3.5v13H7zM13.5 5.5H17v13h-3.5z" : "M8 5.5v13l11-6.5z");
    if (!on) return this.redraw();
    const last = this.facts.frames.length - 1;
    const step = async (number) => {
      const began = performance.now();
      await this.show(number);
      if (!this.playing) return;
      if (number >= last) return this.play(false);
      const rest = 1000 / Number(byId("speed").value) - (performance.now() - began);
      this.timer = setTimeout(() => step(number + 1), Math.max(rest, 0));
    };
    step(this.number >= last ? 0 : this.number + 1);
  }
}

/** Radius of the ball about a centre that holds a frame's points. */
function ballRadius(frame, cube, centre) {
  const { points } = frame.meshes[0];
  let most = 0;
  for (let k = 0; k < points.length; k += 4) {
    let square = 0;
    for (let c = 0; c < 3; c++) square += (cube.low[c] + (cube.side * points[k + c]) / 65535 - centre[c]) ** 2;
    if (square > most) most = square;
  }
  return Math.sqrt(most);
}

/** Say what went wrong where the picture would be. */
function failed(fault) {
  const message = byId("message");
  message.textContent = fault.message;
  message.hidden = false;
  throw fault;
}

async function begin() {
  if (typeof DecompressionStream === "undefined") throw new Error("This browser is too old: the viewer needs one of 2023 or later.");
  const viewer = new Viewer(JSON.parse(byId("facts").textContent));
  await viewer.start();
  return viewer;
}

/** For scripts of your own: wait for `ready`, then call these. */
const ready = begin().catch(failed);
window.foamViewer = {
  ready: ready.then(() => true),
  show: async (number) => (await ready).show(number),
  pick: async (id) => (await ready).goTo(id),
  colourBy: async (name) => (await ready).colourBy(name),
  /** Where a point of space is in the window, in its pixels. */
  where: async (point) => {
    const { camera, canvas } = await ready, box = canvas.getBoundingClientRect();
    const at = projected(camera, box.width, box.height, point);
    return at && [at[0] + box.left, at[1] + box.top];
  },
  /** What the last picture was drawn of: triangles of bubbles and of films, level 0 in all detail. */
  drawn: async () => {
    const viewer = await ready;
    return { ...viewer.painter.counts, moving: viewer.moves, pictures: Number(viewer.canvas.dataset.drawn) };
  },
  /** Milliseconds each of `count` pictures takes, turning a little between them; at rest or while moving. */
  time: async (count, moving = false) => {
    const viewer = await ready, { camera, canvas, painter } = viewer, out = [];
    viewer.turning = moving;
    painter.resize(...viewer.size, viewer.dots);
    for (let k = 0; k < count; k++) {
      camera.turn(6, 2, canvas.clientWidth, canvas.clientHeight);
      const began = performance.now();
      painter.draw(camera, viewer.look, moving);
      painter.finish();
      out.push(performance.now() - began);
    }
    viewer.stirred();
    return out;
  },
  /** Milliseconds of the page's own work: a picture without its drawing, and going on to another frame. */
  cost: async () => {
    const viewer = await ready, { camera, canvas, painter } = viewer, real = painter.gl;
    const pictures = (count) => {
      for (let k = 0; k < count; k++) {
        camera.turn(6, 2, canvas.clientWidth, canvas.clientHeight);
        painter.draw(camera, viewer.look);
      }
    };
    painter.gl = new Proxy(real, { get: (gl, name) => (typeof gl[name] === "function" ? () => false : gl[name]) });
    pictures(200);
    const began = performance.now();
    pictures(2000);
    const picture = (performance.now() - began) / 2000, number = viewer.number;
    painter.gl = real;
    const times = [];
    for (let k = 0; k < 5; k++) {
      viewer.frames.kept.clear();
      const start = performance.now();
      await viewer.show(number);
      times.push(performance.now() - start);
    }
    return { picture, frame: times.sort((a, b) => a - b)[2] };
  },
};
